"""What is told of a robot that moves, against closed forms, random motions, and what then happens."""

import numpy as np
import pinocchio as pin
import pytest
from leading import run
from variants import FEWER

import cinegen
from cinegen.dynamics import Payload
from cinegen.loops.motions import orthonormal
from cinegen.session import Reporter, RobotReport, agreed_status
from cinegen.session import commands as c
from cinegen.session.holding import BearingReporter, Holding, why_no_forces
from cinegen.session.report import HORIZON, ForecastReport, SingularityReport
from cinegen.session.state import CarriedMass, RobotStatus
from cinegen.singularities.ball_joints import counted


def report(session, name, reporter=None):
    reporter = reporter or Reporter(session.setup.robots[name])
    return reporter.report(session.state().robots[name], session.time)


def put(session, name, values):
    driven = session.robots[name]
    driven.jump_to(driven.mechanism.configuration(dict(zip(driven.mechanism.actuated, values, strict=True))))


def test_a_stretched_arm_loses_the_motion_along_itself(session):
    live_session = session("planar_3r")
    arm = live_session.setup.robots["planar_3r"]
    put(live_session, "planar_3r", (0.7, 0.0, 0.0))
    live_session.obey(c.StartDrag("planar_3r", arm.end, None))
    singularity = report(live_session, "planar_3r").type1
    end = live_session.robots["planar_3r"].placement(arm.end)
    outward = end.translation / np.linalg.norm(end.translation)
    assert singularity.sigma < 1e-9
    assert singularity.text.startswith("hardly any motion along")
    assert abs(singularity.twist[:3] @ outward) == pytest.approx(1.0, abs=1e-6)
    assert singularity.position == pytest.approx(end.translation)
    put(live_session, "planar_3r", (0.7, 1.0, 0.5))
    singularity = report(live_session, "planar_3r").type1
    assert singularity.sigma > singularity.threshold
    assert singularity.text.startswith("hardest to move")


@pytest.mark.parametrize("name", ["rx90", "delta4"])
def test_the_ellipsoid_is_as_far_as_the_joints_lead_the_node(session, name):
    """Its support in any direction, against finite differences along the free motions, a ball joint as one joint."""
    live_session = session(name)
    mechanism = live_session.setup.robots[name]
    ellipsoid = report(live_session, name).ellipsoid
    centre, axes = ellipsoid.center, ellipsoid.axes
    q, end = mechanism.q_home, mechanism.end
    place = mechanism.placement(q, end).translation
    assert centre == pytest.approx(place)
    jacobians = counted(mechanism, q, end)
    motions = np.eye(mechanism.model.nv)
    if mechanism.is_constrained:
        free = np.linalg.svd(jacobians.loops)[2][mechanism.loop_rank :].T
        motions = jacobians.joints @ orthonormal(free, jacobians.cut_rates)

    def moved(by):
        return mechanism.placement(mechanism.integrate(q, by), end).translation

    rate = np.array([(moved(by) - moved(-by)) / 2e-6 for by in 1e-6 * motions.T * mechanism.scale])
    rng = np.random.default_rng(1)
    for direction in rng.normal(size=(50, 3)):
        direction /= np.linalg.norm(direction)
        assert np.linalg.norm(axes @ direction) == pytest.approx(0.2 * np.linalg.norm(rate @ direction), abs=1e-7)


def test_what_a_moving_hand_will_meet_is_foreseen_where_and_when_it_then_happens(session):
    """An arm is drawn outwards, at a steady pace, towards where it is stretched."""
    live_session = session("planar_3r")
    arm = live_session.setup.robots["planar_3r"]
    put(live_session, "planar_3r", (0.3, 0.9, 0.6))
    live_session.obey(c.ChangeSettings(gain=1000.0))
    start = live_session.robots["planar_3r"].placement(arm.end).translation
    outward = start / np.linalg.norm(start)
    length = np.linalg.norm(arm.placement(arm.configuration(dict.fromkeys(arm.joints, 0.0)), arm.end).translation)
    speed = (length - np.linalg.norm(start)) / 1.0  # m/s: there in a second
    live_session.obey(c.StartDrag("planar_3r", arm.end, (0, 0, 0)))
    reporter, foreseen, met = Reporter(arm), None, None
    for tick in range(1200):
        at = start + outward * speed * (tick + 1) * live_session.dt
        live_session.obey(c.MoveDrag(tuple(at)))
        live_session.tick()
        if tick in (180, 200):
            robot_report = report(live_session, "planar_3r", reporter)
            events = [event for event in robot_report.forecast.events if event.kind == "TYPE_1"]
            foreseen = live_session.time + events[0].time if events else None
        if met is None and live_session.robots["planar_3r"].step.singular_values[-1] < 0.05:
            met = live_session.time
    assert met is not None
    assert foreseen == pytest.approx(met, abs=0.05)
    assert met - 0.2 < HORIZON


# --- status ----------------------------------------------------------------------------------------------------------


def report_of(type1=None, type2=None):
    singularities = [
        None if sigma is None else SingularityReport(sigma, 0.05, f"text of {sigma}", "tool", np.zeros(3), np.zeros(6))
        for sigma in (type1, type2)
    ]
    return RobotReport(np.zeros(1), (), (), 0.0, *singularities, None, ForecastReport(np.zeros((0, 3)), ()))


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
    status = agreed_status(RobotStatus(name, "as it is", "a sentence"), report)
    assert status.name == agreed
    near = report is not None and any(meter is not None and meter.is_near for meter in (report.type1, report.type2))
    assert ("near a singularity" in status.label) == (near and agreed not in ("REFUSED", "BAD_TARGET"))
    assert agreed != name or near or status.label == "as it is"


def test_joints_near_a_limit_are_named(session):
    live_session = session("five_bar")
    bars = live_session.setup.robots["five_bar"]
    i = bars.q_index("joint1")
    low, high = bars.model.lowerPositionLimit[i], bars.model.upperPositionLimit[i]
    assert "joint1" not in report(live_session, "five_bar").near_limit
    run(live_session, 2.0, c.MoveJoint("five_bar", "joint1", float(high - 0.05 * (high - low))))
    assert "joint1" in report(live_session, "five_bar").near_limit


# --- holding ----------------------------------------------------------------------------------------------------------
# What holds a driven robot at rest: payloads, bases that tilt, singularities, robots without masses.


STANDING = pin.SE3(pin.rpy.rpyToMatrix(np.pi / 2, 0.0, 0.0), np.zeros(3))  # what lay flat stands


def test_the_torques_are_those_of_the_configuration_and_the_payload(session, robot):
    """A drag moves the robot; its torques balance the change of its potential energy, by finite differences."""
    live_session, delta = session("delta4"), robot("delta4")
    begin = delta.placement(delta.q_home, "platform").translation
    drag = c.StartDrag("delta4", "platform"), c.MoveDrag(tuple(begin + np.array([0.2, -0.1, 0.1])))
    state = run(live_session, 0.5, *drag, c.SetPayload("delta4", "link3", 7.5)).robots["delta4"]
    assert state.carried == CarriedMass("link3", 7.5)

    def energy(q):
        data = delta.model.createData()
        weight = pin.computePotentialEnergy(delta.model, data, q)
        return weight + 9.81 * 7.5 * delta.placement(q, "link3").translation[2]

    step, indices = 1e-5, [delta.q_index(name) for name in delta.actuated]
    for column, index in enumerate(indices):
        sides = []
        for sign in (1.0, -1.0):
            q = state.q.copy()
            q[index] += sign * step
            sides.append(energy(delta.close(q, locked=delta.actuated)))
        assert state.torques[column] == pytest.approx((sides[0] - sides[1]) / (2 * step), rel=1e-6)


def test_gravity_is_the_worlds_also_on_a_base_that_tilts(session, robot):
    lying, standing = session("five_bar"), session("five_bar", bases=["five_bar=0,0,0,90,0,0"])
    assert np.abs(lying.state().robots["five_bar"].torques).max() < 1e-9
    torques = standing.state().robots["five_bar"].torques
    five_bar = robot("five_bar")
    expected = cinegen.forces(five_bar, five_bar.q_home, gravity=STANDING.rotation.T @ [0, 0, -9.81]).torques
    assert np.abs(expected).min() > 0.1
    np.testing.assert_allclose(torques, expected, rtol=1e-9)


def test_a_robot_without_masses_has_no_torques_and_carries_nothing(session, robot):
    live_session = session("tssm", "delta4")
    live_session.obey(c.SetPayload("tssm", "platform", 1.0))
    state = live_session.state()
    assert state.robots["tssm"].torques is None
    assert state.robots["tssm"].carried is None
    assert state.robots["delta4"].torques is not None
    assert state.notices[-1].warning
    assert "tssm carries no payload: no mass is given for " in state.notices[-1].text
    for link in robot("tssm").massless:
        assert link in why_no_forces(robot("tssm"))


def stretched(turn=0.0):
    """The five-bar's values with both outer bars in one line; the left motor is turned back."""
    return np.radians([180.0, -180.0, 0.0, 180.0, -180.0]) - turn * np.array([1.0, -1.0, 0.0, 0.0, 0.0])


def test_no_torques_hold_a_load_in_a_singularity_and_next_to_it(robot):
    five_bar = robot("five_bar")
    holding = Holding(five_bar)
    holding.load(CarriedMass("tool", 2.0), STANDING)
    assert five_bar.closure(stretched()) < 1e-12
    assert np.isnan(holding.torques(stretched())).all()
    near, far = (five_bar.close(stretched(turn), locked=five_bar.actuated) for turn in (1e-7, 0.1))
    down = STANDING.rotation.T @ [0.0, 0.0, -9.81]
    largest = np.abs(cinegen.forces(five_bar, near, payloads=[Payload("tool", 2.0)], gravity=down).torques).max()
    assert not largest < 1e3  # N m, or NaN: of 3 kg, at 0.4 m
    assert np.isnan(holding.torques(near)).all()
    assert np.isfinite(holding.torques(far)).all()


def test_reactions_balance_each_other_and_undetermined_ones_are_named(session, robot):
    """The forces on a platform, of all joints and loops that it has, carry its weight and its payload."""
    live_session, delta = session("delta4", bases=["delta4=1,1,1,20,10,5"]), robot("delta4")
    live_session.obey(c.SetPayload("delta4", delta.end, 4.0))
    state = live_session.state().robots["delta4"]
    bearings = BearingReporter(delta).report(state)
    assert [report.undetermined for report in bearings] == [()] * 17
    joints, loops = bearings[:15], bearings[15:]
    assert [report.kind for report in loops] == ["loop", "loop"]

    def parent(node):
        return delta.model.frames[delta.frame_id(node)].parentJoint

    assert len({parent(report.node) for report in bearings}) == 15
    carrier = parent(delta.end)
    acting = sum(np.array(report.force) for report in bearings if parent(report.node) == carrier)
    ends = zip(loops, delta.loops, strict=True)
    against = sum(np.array(report.force) for report, loop in ends if parent(loop.first) == carrier)
    weight = 9.81 * (delta.model.inertias[carrier].mass + 4.0)
    np.testing.assert_allclose(acting - against, [0.0, 0.0, weight], atol=1e-8 * weight)
    for report in joints:
        joint = delta.model.getJointId(report.name)
        data = delta.model.createData()
        pin.forwardKinematics(delta.model, data, state.q)
        at = delta.placement(state.q, report.node).act(np.array(report.point))
        np.testing.assert_allclose(at, data.oMi[joint].translation, atol=1e-12)


def test_a_description_lists_actuated_joints_in_the_order_of_the_torques(robot):
    for name in FEWER:
        mechanism = robot(name)
        assert tuple(joint for joint in mechanism.joints if joint in mechanism.actuated) == mechanism.actuated
