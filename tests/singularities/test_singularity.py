"""Singularities of whole mechanisms, against closed forms, screw theory and what then moves."""

import math

import linkages
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

import cinegen
from cinegen.singularities import SingularityType, leg_lines, singularity
from cinegen.singularities.line_varieties import GrassmannClass
from cinegen.singularities.pluecker import PlueckerLine
from cinegen.singularities.slice import Coordinates

FEET = ((0.0, 0.0), (1.0, 0.1), (0.4, 0.9))
HEADS = np.array([[0.35, 0.4], [0.75, 0.45], [0.5, 0.75]])


@pytest.mark.parametrize("name", ["hybrid", "delta4", "arm7"])
@given(seed=st.integers(0, 2**32 - 1))
def test_random_poses_are_regular(robot, name, seed):
    mechanism = robot(name)
    q = mechanism.random_closed(1, seed)[0]
    report = singularity(mechanism, q)
    assert not report
    assert report.kind is SingularityType.NONE
    assert report.dependence is None or report.dependence.nearly


@pytest.mark.parametrize("name", ["five_bar", "delta4", "gough"])
def test_the_gained_motion_opens_loops_least_and_moves_the_node_as_its_screw_says(robot, name):
    mechanism = robot(name)
    q = mechanism.random_closed(1, 7)[0]
    report = singularity(mechanism, q)
    step = 1e-6
    size = np.abs(report.motion / mechanism.scale).max()
    assert all(report.motion[mechanism.v_index(motor)] == 0.0 for motor in mechanism.actuated)
    moved = [pin.integrate(mechanism.model, q, s * step * report.motion) for s in (-1, 1)]
    ends = [mechanism.placement(each, mechanism.end) for each in moved]
    w = pin.log3(ends[1].rotation @ ends[0].rotation.T) / (2.0 * step)
    v = (ends[1].translation - ends[0].translation) / (2.0 * step)
    p = mechanism.placement(q, mechanism.end).translation
    twist = np.concatenate([w, v + np.cross(p, w)])  # the origin's velocity
    screw = report.uncontrolled_dof.coordinates
    screw = screw * np.sign(screw @ twist) * np.linalg.norm(twist) / np.linalg.norm(screw)
    assert twist == pytest.approx(screw, abs=1e-6 * size * np.linalg.norm(twist))


def test_type_2_of_a_five_bar_is_where_its_outer_bars_are_in_line(robot):
    """Both outer bars on one line: elbows a distance 2 * 400 or 0 apart; here 0, at (0, -200)."""
    mechanism = robot("five_bar")
    elbow = math.atan2(-200.0, 150.0)
    values = {"joint1": elbow, "joint3": math.pi - elbow, "joint2": 0.3, "joint4": 2.0}
    q = mechanism.close(mechanism.configuration(values), ["joint1", "joint3"])
    tool, elbow_at = mechanism.placement(q, "tool").translation, mechanism.placement(q, "link2").translation
    assert np.allclose(elbow_at, mechanism.placement(q, "link4").translation, atol=1e-9)
    report = singularity(mechanism, q)
    assert report.kind is SingularityType.TYPE_2
    assert report.sigma[1] < 1e-12
    assert report.grassmann_class is GrassmannClass.SPECIAL_COMPLEX
    # the tool turns about the elbows, which are in one place
    assert report.uncontrolled_dof.pitch == pytest.approx(0.0, abs=1e-12)
    assert np.allclose(report.uncontrolled_dof.axis.nearest(np.zeros(3)), elbow_at, atol=1e-9)
    # ... and no force along its circle is borne
    along = np.cross([0.0, 0.0, 1.0], tool - elbow_at)
    force = report.unsupported_wrench.coordinates[:3]
    assert abs(force @ along) > 1e-3 * np.linalg.norm(along)
    assert "with all actuated joints locked tool can make a rotation about the axis" in report.message


@pytest.mark.parametrize("parallel", [False, True])
def test_a_3rrr_gains_a_motion_where_its_outer_bars_meet_in_a_point_or_are_parallel(raff, parallel):
    centre, way = np.array([0.3, 0.6]), np.array([0.3, 1.0])
    directions = np.array([way] * 3) if parallel else HEADS - centre
    elbows = HEADS + directions * np.array([[0.5], [0.6], [0.4]]) * (1.0 if parallel else 1.5)
    hinges = [[linkages.hinge(point) for point in leg] for leg in np.stack([elbows, HEADS], axis=1)]
    joints = [[linkages.hinge(foot, motor=True), *leg] for foot, leg in zip(FEET, hinges, strict=True)]
    mechanism = raff(linkages.legged(joints, "joint").text(joint_digits=None))
    report = singularity(mechanism, mechanism.q_home, tolerance=1e-7)
    assert report.kind is SingularityType.TYPE_2
    assert report.dependence.grassmann_class is GrassmannClass.FLAT_PENCIL
    assert report.dependence.lines == (0, 1, 2)
    if parallel:
        assert report.uncontrolled_dof.pitch == math.inf
        assert abs(report.uncontrolled_dof.axis.coordinates[3:5] @ way) < 1e-7  # across the bars
        assert "parallel" in report.message
    else:
        assert report.uncontrolled_dof.pitch == pytest.approx(0.0, abs=1e-7)
        assert np.allclose(report.uncontrolled_dof.axis.nearest(np.zeros(3))[:2], centre, atol=1e-7)
        assert "meet in one point" in report.message


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_all_motions_of_a_constraint_singularity_count_for_type_1(raff, turn):
    """A 3-UPU whose first axes meet has five degrees of freedom where its platform is level (D. Zlatanov, I. Bonev and
    C. Gosselin, 2002): all translations, those across its axis of symmetry alike."""
    legs = []
    for angle in turn + 2.0 * math.pi * np.arange(3) / 3.0:
        radial, across = np.array([[math.cos(angle), math.sin(angle), 0.0], [-math.sin(angle), math.cos(angle), 0.0]])
        foot, head = 0.4 * radial, 0.25 * radial + [0.0, 0.0, 0.8]
        leg = [*linkages.universal(foot, radial, across), linkages.slide(foot, head - foot, motor=True)]
        legs.append([*leg, *linkages.universal(head, across, radial)])
    level = linkages.legged(legs, "joint", lambda: linkages.axis((0.0, 0.0, 0.8), linkages.Z))
    mechanism = raff(level.text(joint_digits=None))
    report = singularity(mechanism, mechanism.q_home)
    assert (mechanism.mobility, report.uncontrolled.order) == (3, 2)
    values = np.sort(report.first)
    assert min(abs(values[1] - values[0]), abs(values[2] - values[1])) < 1e-9


def test_a_level_3rps_keeps_its_rotations_where_its_position_is_singular(raff):
    """Its platform shifts by the square of its tilt: level, it moves up and tilts about two axes, three DoF (K. Hunt,
    1983)."""
    rng, legs = np.random.default_rng(0), []
    for angle in 2.0 * math.pi * np.arange(3) / 3.0:
        radial, across = np.array([[math.cos(angle), math.sin(angle), 0.0], [-math.sin(angle), math.cos(angle), 0.0]])
        foot, head = 0.5 * radial, 0.3 * radial + [0.0, 0.0, 0.8]
        leg = [linkages.hinge(foot, across), linkages.slide(foot, head - foot, motor=True)]
        legs.append([*leg, *linkages.ball(head, rng)])
    level = linkages.legged(legs, "ball", lambda: linkages.axis((0.0, 0.0, 0.8), linkages.Z))
    mechanism = raff(level.text(joint_digits=None))
    report = singularity(mechanism, mechanism.q_home)
    assert (report.kind, report.lost.order, report.keeps_rotations) == (SingularityType.TYPE_1, 2, True)
    assert "its rotations, which follow from its position elsewhere, are left out: they remain" in report.message
    loops = mechanism.loop_jacobian(mechanism.q_home)
    motions = np.linalg.svd(loops)[2][np.linalg.matrix_rank(loops) :].T
    assert np.linalg.matrix_rank(mechanism.jacobian(mechanism.q_home, mechanism.end) @ motions, tol=1e-9) == 3


# --- legs that are lines -----------------------------------------------------------------------------------------


def at(mechanism: cinegen.Mechanism, **pose: float) -> np.ndarray:
    """The configuration with the platform at a pose (mm, degrees)."""
    coordinates = {name: value * (1e-3 if len(name) == 1 else math.pi / 180.0) for name, value in pose.items()}
    q = Coordinates(mechanism, tuple(coordinates)).from_home(coordinates)
    assert q is not None
    return q


def test_the_legs_are_the_lines_between_their_joints(robot):
    """Of Merlet's TSSM, whose base points are those of table 1's geometry."""
    mechanism = robot("tssm")
    feet = 1e-3 * np.array([[-9.7, 9.1], [9.7, 9.1], [12.76, 3.9], [3.0, -13.0], [-3.0, -13.0], [-12.76, 3.9]])
    corners = 1e-3 * np.array([[0.0, 7.3, 0.0], [4.822, -5.480722, 0.0], [-4.822, -5.480722, 0.0]])
    q = at(mechanism, x=1.0, y=-2.0, z=18.0, rx=5.0, ry=3.0, rz=10.0)
    platform = mechanism.placement(q, "platform")
    report = singularity(mechanism, q)
    for line, foot, corner in zip(report.legs, feet, np.repeat(corners, 2, axis=0), strict=True):
        expected = PlueckerLine.through([*foot, 0.0], platform.act(corner)).coordinates
        assert np.allclose(line.coordinates, expected, atol=1e-8) or np.allclose(line.coordinates, -expected, atol=1e-8)


@pytest.mark.parametrize(("place", "side"), [((0.0, 0.0, 20.0), 90.0), ((2.0, -3.0, 14.0), -90.0)])
def test_fichters_singularity(robot, place, side):
    """The platform turned by 90 degrees over the base: all six legs belong to one complex, wherever it is."""
    mechanism = robot("tssm")
    q = at(mechanism, x=place[0], y=place[1], z=place[2], rx=0.0, ry=0.0, rz=side)
    report = singularity(mechanism, q)
    assert report.kind is SingularityType.TYPE_2
    assert report.dependence.grassmann_class is GrassmannClass.GENERAL_COMPLEX
    assert report.dependence.lines == (0, 1, 2, 3, 4, 5)
    # what is gained does no work with forces along the legs (Merlet, section 3)
    for line in leg_lines(mechanism, q):
        w, v = np.split(report.uncontrolled_dof.coordinates, 2)
        assert abs(line.direction @ v + line.moment @ w) < 1e-9
    assert "all six legs belong to one linear complex" in report.message


def test_hunts_singularity(robot):
    """The platform's plane goes through feet 1 and 2: all six legs meet its side B3 B5, about which it turns."""
    mechanism = robot("tssm")
    q = at(mechanism, x=0.5, y=0.0, z=15.0, rx=-math.degrees(math.atan2(15.0, 9.1)), ry=0.0, rz=0.0)
    platform = mechanism.placement(q, "platform")
    side = [platform.act(1e-3 * np.array([x, -5.480722, 0.0])) for x in (4.822, -4.822)]
    report = singularity(mechanism, q)
    assert report.kind is SingularityType.TYPE_2
    assert report.dependence.grassmann_class is GrassmannClass.SPECIAL_COMPLEX
    assert report.uncontrolled_dof.pitch == pytest.approx(0.0, abs=1e-9)
    for corner in side:
        assert np.linalg.norm(report.uncontrolled_dof.axis.nearest(corner) - corner) < 1e-8
    assert "special complex (5b): all six legs meet the line through" in report.message


# --- several motions at once -------------------------------------------------------------------------------------


def concurrent(rng, point):
    """Feet and heads of six legs whose lines meet in a point."""
    feet = linkages.points(rng)[0] - [0.0, 0.0, 0.5]
    return feet, point + rng.uniform(0.35, 0.6, (6, 1)) * (feet - point)


def assert_motions_keep_leg_lengths(mechanism, q, report, feet, heads):
    """Moved by a screw's twist, legs change their length by the square of the motion only."""
    for screw in report.uncontrolled.screws:
        w, v = np.split(screw.coordinates, 2)
        step = 1e-4 / (np.linalg.norm(w) + np.linalg.norm(v))
        changes = []
        for size in (step, 2.0 * step):
            motion = pin.exp6(pin.Motion(size * v, size * w))
            ends = [motion.act(head) for head in heads]
            changes.append(np.linalg.norm(ends - feet, axis=1) - np.linalg.norm(heads - feet, axis=1))
        assert np.abs(changes[0]).max() < 1e-7
        assert changes[1] == pytest.approx(4.0 * changes[0], abs=1e-10)
    # ... and the joints close the loops to second order
    for motion in report.motions:
        step = 1e-5 / np.abs(motion).max()
        gaps = [mechanism.closure(pin.integrate(mechanism.model, q, s * step * motion)) for s in (1.0, 2.0)]
        assert gaps[0] < 1e-9
        assert gaps[1] < 5.0 * gaps[0] + 1e-12


def test_legs_that_meet_in_one_point_leave_all_rotations_about_it(raff):
    rng, point = np.random.default_rng(0), np.array([0.1, 0.0, 0.3])
    feet, heads = concurrent(rng, point)
    mechanism = raff(linkages.hexapod(rng, feet=feet, heads=heads).text(joint_digits=None))
    report = singularity(mechanism, mechanism.q_home)
    assert report.kind is SingularityType.TYPE_2
    assert (report.second <= 1e-6).sum() == 3
    assert report.dependence.rank == 3
    assert report.dependence.grassmann_class is report.dependence.class_of_all is GrassmannClass.BUNDLE
    assert report.uncontrolled.order == report.unsupported.order == len(report.motions) == 3
    assert report.uncontrolled.type == "IIA"
    assert "tool can make any rotation about the point (0.1, 0, 0.3) m (3 uncontrolled DoF)" in repr(report)
    assert "can't support any couple: they support any force through the point (0.1, 0, 0.3) m" in repr(report)
    assert_motions_keep_leg_lengths(mechanism, mechanism.q_home, report, feet, heads)
    # no combination of unsupported wrenches is one of forces along the legs
    legs = np.array([line.coordinates for line in report.legs])
    together = np.vstack([legs, report.unsupported.coordinates])
    assert np.linalg.matrix_rank(together, tol=1e-6) == 6
    shown = report.as_dict()
    assert shown["class"] == "bundle (3c)"
    assert [len(shown[name]["screws"]) for name in ("uncontrolled", "unsupported")] == [3, 3]
    assert shown["uncontrolled"]["text"] == "any rotation about the point (0.1, 0, 0.3) m"
    assert shown["dependence"]["rank"] == 3


@pytest.mark.parametrize(("straight", "lost"), [((), 0), (("joint5",), 1), (("joint3", "joint5"), 2)])
def test_an_arm_loses_what_numpy_finds(robot, straight, lost):
    """rx90: its wrist straight, and its elbow too."""
    mechanism = robot("rx90")
    q = mechanism.configuration({"joint2": 0.3, "joint4": 0.4, "joint3": 1.2, "joint5": 0.8, "joint6": 0.2})
    units = np.repeat([1.0 / mechanism.length, 1.0], 3)[:, None] * mechanism.scale
    if "joint3" in straight:

        def smallest(angle):
            return np.linalg.svd(mechanism.jacobian(mechanism.configuration({"joint3": angle}, q), "link4")[:3])[1][2]

        grid = np.linspace(0.5, 2.6, 400)
        best = min(grid, key=smallest)
        best = minimize_scalar(smallest, bounds=(best - 0.01, best + 0.01), options={"xatol": 1e-13}).x
        q = mechanism.configuration({"joint3": best}, q)
    if "joint5" in straight:
        q = mechanism.configuration({"joint5": 0.0}, q)
    report = singularity(mechanism, q)
    placement = mechanism.placement(q, mechanism.end)
    turn = np.kron(np.eye(2), placement.rotation)
    jacobian = turn @ (units * mechanism.jacobian(q, mechanism.end))
    assert int((np.linalg.svd(jacobian)[1] <= 1e-6).sum()) == lost
    assert bool(report) == bool(lost)
    assert report.lost.order == report.supported.order == max(lost, 1)
    if lost:  # wrenches do no work on what the joints can do
        units = np.repeat([1.0, 1.0 / mechanism.length], 3)
        wrenches = report.supported.coordinates * units
        p = placement.translation
        twists = np.hstack([jacobian[3:].T, jacobian[:3].T + np.cross(p / mechanism.length, jacobian[3:].T)])
        assert twists @ np.roll(wrenches, 3, axis=1).T == pytest.approx(np.zeros((6, lost)), abs=1e-6)
        assert np.linalg.matrix_rank(wrenches, tol=1e-6) == lost
        assert ("2 DoF" in report.message) == (lost == 2)


def test_a_ball_joint_in_gimbal_lock_is_no_singularity(robot):
    mechanism = robot("gough")
    q = mechanism.close(mechanism.configuration({"joint5": 0.0}), ["joint5"])
    passive = mechanism.structure.system.evaluate(q)[1][:, mechanism.structure.passive_columns]
    assert np.linalg.svd(passive, compute_uv=False)[-1] < 1e-12
    report = singularity(mechanism, q)
    assert report.kind is SingularityType.NONE
    assert report.sigma[1] > 0.02


def test_open_loops_are_told(robot):
    mechanism = robot("five_bar")
    q = mechanism.q_home.copy()
    q[0] += 0.1
    with pytest.raises(cinegen.ClosureError, match=r"are open by 0\.\d+ .*close\(q\) first"):
        singularity(mechanism, q)
