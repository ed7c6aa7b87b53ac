"""What is told of a robot that moves, against closed forms, random motions, and what then happens."""

import numpy as np
import pinocchio as pin
import pytest

from cinegen.loops.motions import orthonormal
from cinegen.session import Reporter, RobotReport, agreed_status
from cinegen.session import commands as c
from cinegen.session.report import HORIZON, ForecastReport, SingularityReport
from cinegen.session.state import RobotStatus
from cinegen.singularities.ball_joints import counted

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")


def report(session, name, reporter=None):
    reporter = reporter or Reporter(session.setup.robots[name])
    return reporter.report(session.state().robots[name], session.time)


def put(session, name, values):
    one = session.robots[name]
    one.jump_to(one.mechanism.configuration(dict(zip(one.mechanism.actuated, values, strict=True))))


def test_a_stretched_arm_loses_the_motion_along_itself(session):
    one = session("planar_3r")
    arm = one.setup.robots["planar_3r"]
    put(one, "planar_3r", (0.7, 0.0, 0.0))
    one.obey(c.StartDrag("planar_3r", arm.end, None))
    found = report(one, "planar_3r").type1
    end = one.robots["planar_3r"].placement(arm.end)
    outward = end.translation / np.linalg.norm(end.translation)
    assert found.sigma < 1e-9
    assert found.text.startswith("hardly any motion along")
    assert abs(found.twist[:3] @ outward) == pytest.approx(1.0, abs=1e-6)
    assert found.position == pytest.approx(end.translation)
    put(one, "planar_3r", (0.7, 1.0, 0.5))
    found = report(one, "planar_3r").type1
    assert found.sigma > found.threshold
    assert found.text.startswith("hardest to move")


@pytest.mark.parametrize("name", ["rx90", "delta4"])
def test_the_ellipsoid_is_as_far_as_the_joints_lead_the_node(session, name):
    """Its support in any direction, against finite differences along the free motions, a ball joint as one joint."""
    one = session(name)
    mechanism = one.setup.robots[name]
    ellipsoid = report(one, name).ellipsoid
    centre, axes = ellipsoid.center, ellipsoid.axes
    q, end = mechanism.q_home, mechanism.end
    place = mechanism.placement(q, end).translation
    assert centre == pytest.approx(place)
    jacobians = counted(mechanism, q, end)
    motions = np.eye(mechanism.model.nv)
    if mechanism.is_constrained:
        free = np.linalg.svd(jacobians.loops)[2][mechanism.loop_rank :].T
        motions = jacobians.joints @ orthonormal(free, jacobians.cut_rates)
    step = 1e-6
    moved = [
        mechanism.placement(pin.integrate(mechanism.model, q, sign * step * motion * mechanism.scale), end).translation
        for motion in motions.T
        for sign in (1.0, -1.0)
    ]
    rate = np.array([(moved[2 * i] - moved[2 * i + 1]) / (2 * step) for i in range(motions.shape[1])])
    rng = np.random.default_rng(1)
    for direction in rng.normal(size=(50, 3)):
        direction /= np.linalg.norm(direction)
        assert np.linalg.norm(axes @ direction) == pytest.approx(0.2 * np.linalg.norm(rate @ direction), abs=1e-7)


def test_what_a_moving_hand_will_meet_is_foreseen_where_and_when_it_then_happens(session):
    """An arm is drawn outwards, at a steady pace, towards where it is stretched."""
    one = session("planar_3r")
    arm = one.setup.robots["planar_3r"]
    put(one, "planar_3r", (0.3, 0.9, 0.6))
    one.obey(c.ChangeSettings(gain=1000.0))
    start = one.robots["planar_3r"].placement(arm.end).translation
    outward = start / np.linalg.norm(start)
    length = np.linalg.norm(arm.placement(arm.configuration(dict.fromkeys(arm.joints, 0.0)), arm.end).translation)
    speed = (length - np.linalg.norm(start)) / 1.0  # m/s: there in a second
    one.obey(c.StartDrag("planar_3r", arm.end, (0, 0, 0)))
    reporter, foreseen, met = Reporter(arm), None, None
    for tick in range(1200):
        at = start + outward * speed * (tick + 1) * one.dt
        one.obey(c.MoveDrag(tuple(at)))
        one.tick()
        if tick in (180, 200):
            found = report(one, "planar_3r", reporter)
            events = [event for event in found.forecast.events if event.kind == "TYPE_1"]
            foreseen = one.time + events[0].time if events else None
        if met is None and one.robots["planar_3r"].step.singular_values[-1] < 0.05:
            met = one.time
    assert met is not None
    assert foreseen == pytest.approx(met, abs=0.05)
    assert met - 0.2 < HORIZON


# --- status ----------------------------------------------------------------------------------------------------------


def report_of(type1=None, type2=None):
    found = [
        None if sigma is None else SingularityReport(sigma, 0.05, f"text of {sigma}", "tool", np.zeros(3), np.zeros(6))
        for sigma in (type1, type2)
    ]
    return RobotReport(np.zeros(1), (), (), 0.0, *found, None, ForecastReport(np.zeros((0, 3)), ()))


@pytest.mark.parametrize(
    ("name", "report", "agreed"),
    [
        ("IDLE", None, "IDLE"),
        ("IDLE", report_of(), "IDLE"),
        ("IDLE", report_of(0.2, 0.035), "UNCONTROLLED"),
        ("FOLLOWING", report_of(0.2, 0.035), "UNCONTROLLED"),
        ("FOLLOWING", report_of(0.035, 0.2), "SINGULAR"),
        ("FOLLOWING", report_of(0.06, 0.06), "FOLLOWING"),
        ("HOME", report_of(0.01, 0.01), "UNCONTROLLED"),
        ("REFUSED", report_of(0.01, 0.01), "REFUSED"),
        ("BAD_TARGET", report_of(0.01, 0.01), "BAD_TARGET"),
        ("AT_LIMIT", report_of(0.2, 0.01), "UNCONTROLLED"),
        ("AT_LIMIT", report_of(0.01, 0.2), "AT_LIMIT"),
        ("OUT_OF_REACH", report_of(0.2, 0.2), "OUT_OF_REACH"),
        ("SINGULAR", report_of(0.2, 0.2), "DAMPED"),
        ("SINGULAR", report_of(0.01, 0.2), "SINGULAR"),
    ],
)
def test_the_status_agrees_with_the_meters(name, report, agreed):
    found = agreed_status(RobotStatus(name, "as it is", "a sentence"), report)
    assert found.name == agreed
    near = report is not None and any(one is not None and one.is_near for one in (report.type1, report.type2))
    assert ("near a singularity" in found.label) == (near and agreed not in ("REFUSED", "BAD_TARGET"))
    assert agreed != name or near or found.label == "as it is"


def test_joints_near_a_limit_are_named(session):
    one = session("five_bar")
    bars = one.setup.robots["five_bar"]
    i = bars.q_index("joint1")
    low, high = bars.model.lowerPositionLimit[i], bars.model.upperPositionLimit[i]
    assert "joint1" not in report(one, "five_bar").near_limit
    one.obey(c.MoveJoint("five_bar", "joint1", float(high - 0.05 * (high - low))))
    for _ in range(2000):
        one.tick()
    assert "joint1" in report(one, "five_bar").near_limit
