"""All inverse solutions: against published closed forms, and against Newton's method from thousands of starts."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pinocchio as pin
import pytest
from mpmath import mp
from numpy.random import default_rng as rng

import cinegen
from cinegen.assembly.homotopy import Homotopy
from cinegen.cli.motion.ik import claim_text
from cinegen.ik import FrameTask, IKError, IKSolutions
from cinegen.model.build import build

RIGHT = math.pi / 2.0


def chain(*joints, name="arm"):
    """A serial robot of joints (type, xyz, rpy), each about or along its z axis; the last is the tool's frame."""
    text = f'<robot name="{name}"><link name="l0"/>'
    axis = '<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="1" velocity="1"/>'
    for k, (kind, xyz, rpy) in enumerate(joints, 1):
        child = f"l{k}" if k < len(joints) else "tool"
        origin = f'<origin xyz="{" ".join(map(repr, map(float, xyz)))}" rpy="{" ".join(map(repr, map(float, rpy)))}"/>'
        text += f'<link name="{child}"/><joint name="j{k}" type="{kind}"><parent link="l{k - 1}"/>'
        text += f'<child link="{child}"/>{origin}{axis}</joint>'
    return build(text + "</robot>", None)


def denavit_hartenberg(a, d, alpha):
    """A chain of revolute joints: rotation by theta and translation by d along z, then by a and alpha along x."""
    origins = [((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))]
    origins += [((ai, 0.0, di), (turn, 0.0, 0.0)) for ai, di, turn in zip(a, d, alpha, strict=True)]
    kinds = ["revolute"] * len(a) + ["fixed"]
    return chain(*((kind, *origin) for kind, origin in zip(kinds, origins, strict=True)))


OF_PUMA = np.array((0.0, 0.4318, 0.0203, 0.0, 0.0, 0.0)), np.array((0.0, 0.0, 0.15005, 0.4318, 0.0, 0.0))
TWISTS_OF_PUMA = (RIGHT, 0.0, -RIGHT, RIGHT, -RIGHT, 0.0)
PUMA = denavit_hartenberg(*OF_PUMA, TWISTS_OF_PUMA)


def solved(mechanism, pose, node="tool", **task) -> IKSolutions:
    """All solutions, each checked by Pinocchio: the pose is reached, loops are closed, and no two are the same."""
    asked = FrameTask(node, pose, **task)
    solutions = cinegen.inverse_kinematics(mechanism, [asked], all=True)
    for q in solutions:
        assert max(asked.distances(mechanism, q)) < 1e-12
        assert mechanism.closure(q) < 1e-12
    for k, q in enumerate(solutions):
        assert all(apart(mechanism, q, other) > 1e-6 for other in solutions[:k])
    assert len(solutions.outside) == len(solutions.coincident) == len(solutions)
    return solutions


def apart(mechanism, q, other):
    """How far two configurations are apart, angles modulo 2 pi."""
    gap = q - other
    for joint in mechanism.joints:
        if not mechanism.is_prismatic(joint):
            k = mechanism.q_index(joint)
            gap[k] = (gap[k] + math.pi) % (2.0 * math.pi) - math.pi
    return float(np.abs(gap[[mechanism.q_index(joint) for joint in mechanism.actuated]]).max())


def alike(mechanism, solutions, expected):
    """Assert that two lists hold the same configurations."""
    assert len(solutions) == len(expected)
    for q in expected:
        assert min(apart(mechanism, q, np.asarray(other)) for other in solutions) < 1e-8


def random_pose(mechanism, seed, node="tool"):
    rng = np.random.default_rng(seed)
    return mechanism.placement(rng.uniform(-math.pi, math.pi, mechanism.model.nq), node)


def guessed(mechanism, pose, node, starts, seed=0):
    """What Newton's method finds from random starts of all joints: an algorithm that shares nothing with the other."""
    rng, asked, solutions = np.random.default_rng(seed), FrameTask(node, pose), []
    model, scale = mechanism.model, mechanism.scale
    for _ in range(starts):
        q = mechanism.integrate(mechanism.q_home, scale * rng.uniform(-math.pi, math.pi, model.nv))
        for _ in range(40):
            error, rows = asked.equations(mechanism.placement(q, node), mechanism.jacobian(q, node))
            if mechanism.loops:
                error = np.concatenate([error, -mechanism.loop_residual(q)])
                rows = np.vstack([rows, mechanism.loop_jacobian(q)])
            size = np.abs(error).max()
            if size < 1e-11:
                break
            step = np.linalg.lstsq(rows * scale, error, rcond=1e-8)[0]
            q = mechanism.integrate(q, scale * step * min(1.0, 0.8 / max(np.abs(step).max(), 1e-9)))
        if size < 1e-11 and all(apart(mechanism, q, other) > 1e-5 for other in solutions):
            solutions.append(q)
    return solutions


# --- published closed forms -------------------------------------------------------------------------------------------


def test_a_manipulator_with_sixteen_real_solutions():
    """R. Manseur and K. Doty, "A robot manipulator with 16 real inverse kinematic solution sets", Int. J. Robotics
    Research 8, 1989."""
    degree = math.radians(1.0)
    arm = denavit_hartenberg(
        (0.3, 1.0, 0.0, 1.5, 0.0, 0.0), (0.0, 0.0, 0.2, 0.0, 0.0, 0.0), (RIGHT, degree, RIGHT, degree, RIGHT, 0.0)
    )
    written = [[-0.760117, -0.641689, 0.102262], [0.133333, 0.0, 0.991071], [-0.635959, 0.766965, 0.085558]]
    left, _, right = np.linalg.svd(written)
    solutions = solved(arm, pin.SE3(left @ right, np.array([-1.140175, 0.0, 0.0])))
    assert (len(solutions), solutions.complete, solutions.counts.complex) == (16, True, 0)
    assert "polynomial of degree 16, in ball arithmetic: 16 real, 0 complex" in solutions.method
    assert solutions.certified == 16
    assert solutions.as_dict()["certified"] == 16
    assert solutions.as_dict()["solutions"][0]["certificate"]["equations"] == 6


UR = (
    (0.0, -0.6127, -0.57155, 0.0, 0.0, 0.0), (0.1807, 0.0, 0.0, 0.17415, 0.11985, 0.11655),
    (RIGHT, 0.0, 0.0, RIGHT, -RIGHT, 0.0),
)  # fmt: skip


def calibrated(rng, off, written=UR):
    """An arm whose parameters are off by about so many metres and radians."""
    return denavit_hartenberg(*(np.array(numbers) + off * rng.normal(size=6) for numbers in written))


def test_all_solutions_of_a_calibrated_arm_are_proved_to_be_all():
    arm = calibrated(np.random.default_rng(0), 1e-2)
    pose = random_pose(arm, 0)
    solutions = solved(arm, pose)
    assert solutions.proved
    assert solutions.certified == len(solutions) == solutions.counts.real
    assert solutions.counts.total == 16
    others = guessed(arm, pose, "tool", 60)
    assert len(others) >= len(solutions) / 2
    for other in others:
        assert min(apart(arm, other, solution) for solution in solutions) < 1e-5


@pytest.mark.parametrize("off", [1e-7, 1e-11])
def test_a_wrist_that_is_almost_one_point_has_the_solutions_of_an_exact_one(off):
    shift = np.array([0.0, 0.0, 0.0, *off * np.random.default_rng(0).normal(size=2), 0.0])
    arm = denavit_hartenberg(OF_PUMA[0] + shift, OF_PUMA[1] + np.roll(shift, 1), TWISTS_OF_PUMA)
    pose = random_pose(PUMA, 1)
    exact, almost = solved(PUMA, pose), solved(arm, pose)
    assert almost.proved
    assert (exact.counts.total, almost.counts.total) == (8, 16)
    assert len(exact) == len(almost) == almost.certified > 0
    for q in exact:
        assert min(apart(arm, q, other) for other in almost) < 100.0 * off


def test_a_tool_on_the_axis_of_the_base_leaves_a_calibrated_arm_a_curve():
    """The first joint then turns what the last one turns back."""
    rng = np.random.default_rng(0)
    arm = calibrated(rng, 1e-4)
    q = rng.uniform(-3.0, 3.0, 6)
    inner = arm.placement(q, "l1").inverse() * arm.placement(q, "l6")
    ends = [("revolute", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ("fixed", (0.0, 0.0, 0.2), (0.0, 0.0, 0.0))]
    first = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5])) * inner.inverse()
    places = [first * arm.model.jointPlacements[2], *list(arm.model.jointPlacements)[3:7]]
    origins = [("revolute", place.translation, pin.rpy.matrixToRpy(place.rotation)) for place in places]
    aligned = chain(ends[0], *origins, ends[1])
    q[0] = q[5] = 0.4
    pose = aligned.placement(q, "tool")
    assert np.abs(pose.translation[:2]).max() < 1e-12
    solutions = cinegen.inverse_kinematics(aligned, {"tool": pose}, all=True, effort=0.01)
    assert not solutions.complete
    assert solutions.self_motions or "a curve of configurations" in solutions.method


def test_puma_has_the_eight_solutions_of_its_closed_form():
    """R. Paul and H. Zhang, "Computationally efficient kinematics for manipulators with spherical wrists", Int. J.
    Robotics Research 5, 1986: shoulder, elbow and wrist have two configurations each."""
    pose = random_pose(PUMA, 1)
    a2, a3, d3, d4 = 0.4318, 0.0203, 0.15005, 0.4318
    x, y, z = pose.translation
    expected = []
    for shoulder in (1.0, -1.0):
        far = shoulder * math.sqrt(x * x + y * y - d3 * d3) if x * x + y * y > d3 * d3 else math.nan
        waist = math.atan2(y, x) - math.atan2(-d3, far)
        for elbow in (1.0, -1.0):
            k = (far * far + z * z - a2 * a2 - a3 * a3 - d4 * d4) / (2.0 * a2)
            if not abs(k) <= math.hypot(a3, d4):
                continue
            # a3 cos(t3) - d4 sin(t3) = k
            three = -math.atan2(d4, a3) + elbow * math.acos(k / math.hypot(a3, d4))
            u, v = a2 + a3 * math.cos(three) - d4 * math.sin(three), a3 * math.sin(three) + d4 * math.cos(three)
            two = math.atan2(z, far) - math.atan2(v, u)
            arm = np.array([waist, two, three, 0.0, 0.0, 0.0])
            turn = PUMA.placement(arm, "l4").rotation.T @ pose.rotation  # Rz(t4) Rx(90) Rz(t5) Rx(-90) Rz(t6)
            for flip in (1.0, -1.0):
                five = math.atan2(flip * math.hypot(turn[0, 2], turn[1, 2]), turn[2, 2])
                four = math.atan2(-flip * turn[1, 2], -flip * turn[0, 2])
                six = math.atan2(-flip * turn[2, 1], flip * turn[2, 0])
                expected.append(np.array([waist, two, three, four, five, six]))
    for q in expected:
        assert np.abs(PUMA.placement(q, "tool").homogeneous - pose.homogeneous).max() < 1e-9
    solutions = solved(PUMA, pose)
    assert solutions.complete
    alike(PUMA, solutions, expected)


def test_a_planar_arm_has_two_elbows_and_none_out_of_its_reach(robot):
    arm = robot("planar_3r")
    pose = arm.placement(arm.q_home, "tool")
    solutions = solved(arm, pose)
    assert (len(solutions), solutions.complete, solutions.certified) == (2, True, 2)
    assert apart(arm, solutions[0], arm.q_home) < 1e-12
    assert np.isclose(solutions[1][1], -solutions[0][1])
    far = pose * pin.SE3(np.eye(3), np.array([3.0, 0.0, 0.0]))
    none = solved(arm, far)
    assert (len(none), none.complete) == (0, True)
    assert none.closest is not None
    off = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.01])) * pose
    none = solved(arm, off)
    assert (len(none), none.complete) == (0, True)
    assert "moves in a plane: the pose is 10 mm" in none.method


# --- closed mechanisms ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "count", "task"),
    [("delta4", 8, {}), ("gough", 64, {}), ("five_bar", 4, {"rotation": 0}), ("sr400", 16, {})],
)
def test_legs_and_parallelograms_have_two_solutions_each(robot, name, count, task):
    mechanism = robot(name)
    for q in (mechanism.random_closed(2, seed=1)[-1], mechanism.q_home):
        pose = mechanism.placement(q, mechanism.end)
        solutions = solved(mechanism, pose, mechanism.end, **task)
        assert solutions.complete
        assert solutions.counts.real + solutions.counts.complex == max(count, solutions.counts.total)
        assert len(solutions) == solutions.counts.real
        assert min(apart(mechanism, q, other) for other in solutions) < 1e-9
    assert len(solutions) == count
    assert not solutions.outside[0]
    assert mechanism.distance(mechanism.q_home, solutions[0]) < 1e-9


def test_a_cylinder_between_ball_joints_has_two_lengths(raff):
    """It may rotate about itself, which is no solution of its own."""
    crane = raff("""robot crane { base { }
      link 1 { type 2 pred 0 parameters { theta 60 } actuated 0 }
      frame 2 { pred 1 name "arm" parameters { d 500 r 300 } }
      frame 3 { pred 0 parameters { d 300 } }
      link 4 { joint ball pred 3 }
      link 5 { type 1 pred 4 parameters { r 400 } actuated 1 }
      constraint { frame 2 link 5 type 3 }
    }""")
    modes = solved(crane, crane.placement(crane.q_home, "arm"), "arm")
    assert (len(modes), modes.complete) == (2, True)
    assert "a telescopic rod" in modes.method


def test_newton_from_random_starts_finds_no_other_solution(robot):
    mechanism = robot("delta4")
    node, q = mechanism.end, mechanism.random_closed(3, seed=2)[-1]
    pose = mechanism.placement(q, node)
    solutions = solved(mechanism, pose, node)
    others = guessed(mechanism, pose, node, 100)
    assert len(others) >= len(solutions) / 2
    for other in others:
        assert min(apart(mechanism, other, solution) for solution in solutions) < 1e-5


# --- what is not isolated, and tasks ----------------------------------------------------------------------------------


def test_a_redundant_arm_is_refused_until_a_joint_is_locked(robot):
    arm = robot("arm7")
    pose = arm.placement(arm.q_home, "tool")
    with pytest.raises(IKError, match=r"still have 1 DoF: .* lock 1 of its joints"):
        solved(arm, pose)
    value = float(arm.q_home[arm.q_index("joint3")])
    solutions = cinegen.inverse_kinematics(arm, {"tool": pose}, all=True, locked={"joint3": value})
    assert solutions.complete
    assert arm.distance(arm.q_home, solutions[0]) < 1e-9
    assert all(q[arm.q_index("joint3")] == value for q in solutions)
    with pytest.raises(cinegen.CinegenError, match="no joint 'joint33'"):
        cinegen.inverse_kinematics(arm, {"tool": pose}, all=True, locked={"joint33": value})
    assert len(cinegen.inverse_kinematics(arm, {"tool": pose}, all=True, locked=["joint3"])) == len(solutions)
    result = cinegen.inverse_kinematics(arm, {"tool": pose}, locked={"joint3": value})
    assert result.q[arm.q_index("joint3")] == value


def test_a_wrist_whose_axes_are_in_line_leaves_a_curve(robot):
    arm = robot("rx90")
    q = arm.configuration({"joint5": 0.0})
    solutions = solved(arm, arm.placement(q, "tool"))
    assert not solutions.complete
    assert "a curve of configurations" in solutions.method
    assert len(solutions.self_motions) == 2  # shoulder to the front and to the back
    for motion in solutions.self_motions:
        assert (motion.dimension, motion.moving) == (1, ("joint4", "joint6"))
        assert max(solutions.task.distances(arm, motion.configuration)) < 1e-9
        assert abs(motion.configuration[arm.q_index("joint5")]) < 1e-6
    assert solutions.as_dict()["self_motions"][0]["moving"] == ["joint4", "joint6"]


def test_a_curve_is_not_excluded_where_shoulder_and_wrist_are_singular_at_once():
    q = np.array([math.pi, math.pi, RIGHT, RIGHT, math.pi, 0.0])
    solutions = solved(PUMA, PUMA.placement(q, "tool"))
    assert not solutions.complete
    assert "a curve of configurations is not excluded" in solutions.method


def test_a_stretched_elbow_is_one_solution_in_which_two_coincide(robot):
    arm = robot("planar_3r")
    solutions = solved(arm, arm.placement(arm.configuration({"joint2": 0.0}), "tool"))
    assert (len(solutions), solutions.coincident, solutions.complete, solutions.certified) == (1, (2,), True, 0)


def test_a_free_rotation_and_a_free_orientation():
    """Five joints and a free axis; three joints and a ball."""
    rng = np.random.default_rng(4)
    joints = [("revolute", rng.uniform(-1, 1, 3), rng.uniform(-3, 3, 3)) for _ in range(5)]
    tool = ("fixed", (0.1, 0.2, 0.3), (0.4, 0.5, 0.6))
    three = chain(*joints[:3], tool)
    solutions = solved(three, random_pose(three, 0), rotation=0)
    assert solutions.complete
    assert "three joints and a ball joint" in solutions.method
    five = chain(*joints, tool)
    pose = random_pose(five, 0)
    solutions = solved(five, pose, rotation=2)
    assert solutions.complete
    turned = pose * pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.7])), np.zeros(3))
    again = solved(five, turned, rotation=2)
    assert again.complete
    alike(five, again, list(solutions))


@pytest.mark.parametrize(
    ("word", "bound"), [("RPRRRR", 16), ("RPRPRP", 2), ("RRR==R", 8), ("PRRR..", 8), ("PRPR..", 4)]
)
def test_serial_arms_have_as_many_solutions_as_theory_allows(word, bound):
    """R: revolute, P: prismatic, =: parallel to the one before, .: through one point with it."""
    rng = np.random.default_rng(5)
    joints = []
    for letter in word:
        place = (0.0, 0.0, 0.0) if letter == "." else rng.uniform(-1, 1, 3)
        turn = (0.0, 0.0, rng.uniform(-3, 3)) if letter == "=" else rng.uniform(-3, 3, 3)
        joints.append(("prismatic" if letter == "P" else "revolute", place, turn))
    arm = chain(*joints, ("fixed", (0.1, 0.2, 0.3), (0.4, 0.5, 0.6)))
    solutions = solved(arm, random_pose(arm, 1))
    assert solutions.complete
    assert solutions.counts.total == bound


def test_joints_are_brought_within_their_limits_by_whole_revolutions():
    first = ("revolute", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    arm = chain(first, ("fixed", (0.5, 0.0, 0.0), (0.0, 0.0, 0.0)))
    pose = arm.placement(np.array([0.5]), "tool")
    near = cinegen.inverse_kinematics(arm, {"tool": pose}, np.array([6.0]), all=True)
    assert np.allclose(near[0], 0.5 + 2.0 * math.pi)  # limits are -9 and 9
    beyond = cinegen.inverse_kinematics(arm, {"tool": pose}, np.array([14.0]), all=True)
    assert np.allclose(beyond[0], 0.5)  # nearest the middle between the limits, as 0.5 + 4 pi is beyond
    assert not beyond.outside[0]


def test_what_is_not_computed_is_an_error(robot):
    arm, two = robot("rx90"), robot("gough")
    pose = arm.placement(arm.q_home, "tool")
    with pytest.raises(IKError, match="one node at a time"):
        cinegen.inverse_kinematics(arm, {"tool": pose, "link3": pose}, all=True)
    with pytest.raises(IKError, match=r"fixed to the base|no joint moves"):
        cinegen.inverse_kinematics(two, {two.nodes[0]: pose}, all=True)
    with pytest.raises(IKError, match="3 translations and 0, 2 or 3 rotations"):
        solved(arm, pose, rotation=1)
    with pytest.raises(IKError, match="with a position"):
        solved(arm, pose, translation=0)


def test_a_free_base_stays_where_it_is(robot):
    free = '<joint name="free" type="floating"><parent link="earth"/><child link="base"/></joint>'
    urdf = robot("rx90").source.urdf
    arm = build(urdf.replace('<link name="base"', f'<link name="earth"/>{free}<link name="base"', 1), None)
    assert arm.floating
    q = np.r_[pin.SE3ToXYZQUAT(pin.SE3(pin.exp3(np.array([0.3, 0.2, 0.1])), np.ones(3))), robot("rx90").q_home]
    solutions = cinegen.inverse_kinematics(arm, {"tool": arm.placement(q, "tool")}, q, all=True)
    assert (len(solutions), solutions.complete, solutions.certified) == (8, True, 8)
    assert all(np.array_equal(solution[:7], q[:7]) for solution in solutions)
    assert max(map(max, solutions.errors)) < 1e-12
    assert "the base stays where it is" in solutions.method


@pytest.mark.parametrize("locked", [{}, {"joint6": RIGHT}])
def test_of_joints_that_couplings_tie_to_those_that_move_the_tool_one_motor_stays(locked):
    """A hand on the elbow's bar, on a belt that keeps its angle to the base at half that of a motor."""
    text = """RAFF Scara
    robot scara {
      link 1 { parameters { theta 20 } type 2 pred 0 actuated 1 }
      link 2 { parameters { theta 40 d 300 } type 2 pred 1 actuated 1 }
      link 3 { parameters { d 250 } type 2 pred 2 }
      link 6 { parameters { r 100 } type 2 pred 0 actuated 1 }
      coupling { link 3 link 6 ratio 0.5 link 2 ratio -1 link 1 ratio -1 }
      frame 7 { parameters { r 60 } pred 3 name "tool" }
    }
    """
    scara = cinegen.load(text)
    target = FrameTask("tool", pin.SE3(np.eye(3), np.array([0.3, 0.2, 0.06])), rotation=0)
    q = scara.close(scara.configuration(locked), locked)
    solutions = cinegen.inverse_kinematics(scara, [target], q, all=True, locked=tuple(locked))
    assert (len(solutions), solutions.proved, solutions.certified) == (2, True, 2)
    assert ("joints that do not move it stay where they are: joint6" in solutions.method) == (not locked)
    bend = math.acos((0.3**2 + 0.2**2 - 0.3**2 - 0.25**2) / (2.0 * 0.3 * 0.25))
    motor = q[scara.q_index("joint6")]
    expected = []
    for elbow in (bend, -bend):
        first = math.atan2(0.2, 0.3) - math.atan2(0.25 * math.sin(elbow), 0.3 + 0.25 * math.cos(elbow))
        expected.append([first, elbow, motor / 2.0 - first - elbow, motor])
    assert np.allclose(sorted(map(list, solutions)), sorted(expected), rtol=0.0, atol=1e-9)


CAM = """RAFF Cam
robot cam {
  link 1 { parameters { theta 10 } type 2 pred 0 }
  link 2 { parameters { d 100 r 6 } type 1 pred 0 actuated 1 }
  coupling { link 2 link 1 polynomial ( 0.5 0.01 ) }
}
"""


@pytest.mark.parametrize("height", [0.01, 0.001, -0.006, -0.1])
def test_the_cam_of_a_slider_has_all_angles_that_its_polynomial_allows(height):
    """0.5 theta + 0.01 theta^2 = r in degrees and mm, which has two solutions above -6.25 mm and none below."""
    cam = cinegen.load(CAM)
    target = FrameTask("link2", pin.SE3(np.eye(3), np.array([0.1, 0.0, height])), rotation=0)
    solutions = cinegen.inverse_kinematics(cam, [target], all=True)
    square = 0.5**2 + 0.04 * 1e3 * height
    angles = [(-0.5 + sign * math.sqrt(square)) / 0.02 for sign in (-1.0, 1.0)] if square > 0.0 else []
    assert (solutions.proved, solutions.certified) == (True, len(angles))
    turned = sorted(math.degrees(q[cam.q_index("joint1")]) for q in solutions)
    assert np.allclose(turned, angles, rtol=0.0, atol=1e-8)
    assert np.allclose([q[cam.q_index("joint2")] for q in solutions], height, rtol=0.0, atol=1e-12)


def test_a_cam_that_dwells_at_home_has_the_two_angles_of_its_square():
    """r = 6 + 0.01 theta^2 in mm and degrees: at home, theta = 0, the angle does not move the slider."""
    text = CAM.replace(" actuated 1", "").replace("pred 0 }", "pred 0 actuated 1 }", 1)
    dwelling = cinegen.load(text.replace("theta 10", "theta 0").replace("( 0.5 0.01 )", "( 0 0.01 ) offset 6"))
    target = FrameTask("link2", pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.01])), rotation=0)
    solutions = cinegen.inverse_kinematics(dwelling, [target], all=True)
    assert (solutions.proved, solutions.certified) == (True, 2)
    angles = sorted(math.degrees(q[dwelling.q_index("joint1")]) for q in solutions)
    assert np.allclose(angles, [-20.0, 20.0], rtol=0.0, atol=1e-8)


GEARS = """RAFF Gears
robot gears {
  link 1 { parameters { theta 20 } type 2 pred 0 actuated 1 }
  link 2 { parameters { theta 60 d 400 } type 2 pred 1 }
  link 3 { parameters { theta -60 d 300 } type 2 pred 2 }
  frame 20 { name "tool" parameters { d 100 } pred 3 }
  link 6 { parameters { d 500 } type 2 pred 0 } link 7 { parameters { d 600 } type 2 pred 0 }
  link 8 { parameters { d 700 } type 2 pred 0 }
  coupling { link 3 link 2 ratio -1 }
  coupling { link 6 link 1 ratio 2 } coupling { link 7 link 6 ratio 2 } coupling { link 8 link 7 ratio 2 }
}
"""


def test_a_joint_that_follows_another_one_keeps_the_tool_upright():
    """With q3 = -q2 the bars 1 and 3 are parallel: two bars, of lengths 0.4 + 0.1 and 0.3. Other wheels only turn:
    theta8 = 8 theta1."""
    gears = cinegen.load(GEARS)
    pose = gears.placement(gears.q_home, "tool")
    solutions = solved(gears, pose, rotation=0)
    assert (len(solutions), solutions.certified) == (2, 2)
    x, y, _ = pose.translation
    two = math.acos((x * x + y * y - 0.5**2 - 0.3**2) / (2.0 * 0.5 * 0.3))
    for q, bend in zip(solutions, (two, -two), strict=True):
        first = math.atan2(y, x) - math.atan2(0.3 * math.sin(bend), 0.5 + 0.3 * math.cos(bend))
        assert np.allclose([q[gears.q_index(f"joint{k}")] for k in (1, 2, 3, 8)], [first, bend, -bend, 8.0 * first])
    assert len(solved(gears, pose)) == 1
    with pytest.raises(IKError, match="ratio of 1 or -1, not for 'joint3-joint2'"):
        solved(cinegen.load(GEARS.replace("ratio -1", "ratio -0.7 offset -18")), pose, rotation=0)


def test_couplings_one_after_another_are_followed_to_their_end():
    """By a last pair of wheels, on joint 2, the tool has 1 DoF, for two coordinates."""
    train = cinegen.load(GEARS.replace("\n}", " coupling { link 2 link 8 ratio 0.375 }\n}"))
    with pytest.raises(IKError, match=r"\('joint3-joint2', .*'joint8-joint7', 'joint2-joint8'\) relate joints"):
        solved(train, train.placement(train.q_home, "tool"), rotation=0)


TURN = """RAFF Turn
robot turn {
  link 1 { parameters { theta 20 } type 2 pred 0 actuated 1 LIMITS }
  link 2 { parameters { theta 40 d 300 } type 2 pred 1 actuated 1 }
  frame 3 { parameters { d 250 } pred 2 name "tool" }
  link 6 { parameters { d 500 } type KIND pred 0 }
  COUPLING
}
"""


@pytest.mark.parametrize(("kind", "limits", "coupling", "named"), [
    (1, "", "link 6 link 1 lead 20", True),
    (1, "limits { -180 180 }", "link 6 link 1 lead 20", False),
    (1, "limits { -181 180 }", "link 6 link 1 lead 20", True),
    (2, "", "link 6 link 1 ratio 2 link 2 ratio -3", False),
    (2, "", "link 6 link 1 ratio 0.5 link 2 ratio -3", True),
    (2, "", "link 6 link 1 polynomial ( 2 0.01 )", True),
])  # fmt: skip
def test_whole_revolutions_that_place_driven_joints_elsewhere_are_named(kind, limits, coupling, named):
    """And with the first joint a revolution further, the tool is where it was, and link 6 is not, by Pinocchio."""
    text = TURN.replace("KIND", str(kind)).replace("LIMITS", limits).replace("COUPLING", f"coupling {{ {coupling} }}")
    robot = cinegen.load(text)
    solutions = solved(robot, pin.SE3(np.eye(3), np.array([0.3, 0.2, 0.0])), rotation=0)
    assert (len(solutions), solutions.proved) == (2, True)
    remark = "; revolutions of joint1, after which driven joints are elsewhere, are not counted"
    assert (remark in solutions.method) == named
    driving = {name: solutions[0][robot.q_index(name)] for name in ("joint1", "joint2")}
    turned = robot.close(robot.configuration({**driving, "joint1": driving["joint1"] + 2.0 * math.pi}), driving)
    assert max(solutions.task.distances(robot, turned)) < 1e-12
    moved = np.abs(robot.placement(turned, "link6").homogeneous - robot.placement(solutions[0], "link6").homogeneous)
    assert (moved.max() > 1e-3) == (named or bool(limits))


def test_what_couplings_may_allow_besides_is_not_excluded():
    """A double root of a polynomial; and a rocker, whose four-bar closes in two ways at each of its angles."""
    cam = cinegen.load(CAM)
    at = pin.SE3(np.eye(3), np.array([0.1, 0.0, -0.00625]))
    solutions = cinegen.inverse_kinematics(cam, [FrameTask("link2", at, rotation=0)], all=True)
    assert not solutions.complete
    assert "; other solutions of couplings are not excluded: joint2-joint1" in solutions.method
    text = """RAFF Geared
    robot geared {
      link 11 { parameters { theta 50 } type 2 pred 0 actuated 1 }
      link 12 { parameters { theta -26 d 120 } type 2 pred 11 }
      link 13 { parameters { theta 89 d 400 } type 2 pred 0 }
      link 16 { parameters { theta 89 d 900 } type 2 pred 0 }
      frame 14 { parameters { d 360 } pred 12 }
      frame 15 { parameters { d 240 } pred 13 }
      frame 17 { parameters { d 100 } pred 16 name "tool" }
      constraint { frame 14 frame 15 type 2 }
      coupling { link 16 link 13 ratio 1 }
    }
    """
    geared = cinegen.load(text)
    solutions = solved(geared, geared.placement(geared.q_home, "tool"), rotation=0)
    assert (len(solutions), solutions.complete) == (1, False)
    assert solutions.method.endswith("; other solutions of couplings are not excluded: joint16-joint13")


def test_solutions_of_which_a_part_is_complete_with_probability_one_are_not_called_proved(robot, monkeypatch):
    arm = robot("rx90")
    pose = arm.placement(arm.q_home, "tool")
    solutions = solved(arm, pose)
    assert (solutions.complete, solutions.proved) == (True, True)
    assert claim_text(solutions).startswith("These are all. ")
    exact = Homotopy.modes
    monkeypatch.setattr(Homotopy, "modes", lambda *args: replace(exact(*args), almost_surely=True))
    solutions = solved(arm, pose)
    assert (len(solutions), solutions.complete, solutions.proved) == (8, True, False)
    assert repr(solutions).endswith("all with probability one>")
    assert claim_text(solutions).startswith("These are all, with probability one. ")
    assert (solutions.as_dict()["complete"], solutions.as_dict()["proved"]) == (True, False)


# --- ik certified -----------------------------------------------------------------------------------------------------
# Certificates of inverse solutions: what is certified is reached, and what is not a solution is not certified.


def exact(placement):
    """(4, 4) of a placement, with a rotation that is exactly one."""
    x, _, z = (mp.matrix(column.tolist()) for column in placement.rotation.T)
    z = z / mp.norm(z)
    x = x - (x.T * z)[0] * z
    x = x / mp.norm(x)
    y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]]
    rows = [[x[i], y[i], z[i], mp.mpf(float(placement.translation[i]))] for i in range(3)]
    return mp.matrix([*rows, [0, 0, 0, 1]])


def reached(arm, values):
    """(4, 4) of the tool of a serial arm whose joints rotate about z."""
    model, pose = arm.model, mp.eye(4)
    for j, value in enumerate(values, 1):
        c, s = mp.cos(value), mp.sin(value)
        turn = mp.matrix([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        pose = pose * exact(model.jointPlacements[j]) * turn
    return pose * exact(model.frames[arm.frame_id("tool")].placement)


def refined(arm, pose, q):
    """Joint values near q that reach a pose, to 50 digits."""
    target = exact(pose)

    def missing(*values):
        gap = target**-1 * reached(arm, values) - mp.eye(4)
        return [gap[i, j] for i in range(3) for j in range(4)]

    values = mp.findroot(missing, [mp.mpf(float(x)) for x in q], solver="mdnewton", tol=1e-90)
    return values, max(map(abs, missing(*values)))


def test_solutions_of_arms_are_in_their_boxes():
    pose = random_pose(PUMA, 1)
    solutions = solved(PUMA, pose)
    assert solutions.certified == len(solutions) > 0
    with mpmath.workdps(50):
        for q, certificate in zip(solutions, solutions.certificates, strict=True):
            values, left = refined(PUMA, pose, q)
            assert left < 1e-40
            off = max(abs(mp.mpf(float(x)) - value) for x, value in zip(q, values, strict=True))
            assert off <= certificate.error < certificate.radius
            assert (certificate.equations, certificate.others) == (6, 0)


def test_what_is_no_solution_is_not_certified(robot):
    for name in ("rx90", "scara", "five_bar", "delta4"):
        m = robot(name)
        solutions = cinegen.inverse_kinematics(m, {m.end: m.placement(m.random_closed(2, 1)[-1], m.end)}, all=True)
        assert solutions.certified == sum(count == 1 for count in solutions.coincident) > 0
        for seed in range(3):
            off = 1e-3 * rng(seed).normal(size=m.model.nq)
            assert replace(solutions, configurations=tuple(q + off for q in solutions)).certified == 0
        half_turns = [pin.SE3(pin.exp3(math.pi * axis), np.zeros(3)) for axis in np.eye(3)]
        moved = solutions.task.copy()
        for move in (pin.SE3(np.eye(3), np.array([1e-3, 0.0, 0.0])), *half_turns):
            moved.target = solutions.task.target * move
            assert replace(solutions, task=moved).certified == 0
        if name == "rx90":
            task = FrameTask(m.end, solutions.task.target * half_turns[0], rotation=2)
            assert replace(solutions, task=task, unknowns=solutions.unknowns._replace(rank=5)).certified == 0
