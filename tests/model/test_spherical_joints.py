"""Ball joints of RAFF as spherical joints: no gimbal lock, and everything else as with three revolute joints."""

import dataclasses
import json
import pickle
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree
from small_robots import rssr as text_of_rssr

import cinegen
import raff2urdf
from cinegen.errors import ConfigurationError
from cinegen.ik import Solver, Status
from cinegen.ik.singular_values import passive_singular_values
from cinegen.model import ForwardKinematics
from cinegen.model.build import build
from cinegen.singularities import SingularityType, leg_lines, singularity
from raff2urdf.raff.document import CompoundKind, JointType, RaffLink, RaffParameters, RaffVariable
from raff2urdf.raff.kleinfinger import parameters, transform
from raff2urdf.tree import kleinfinger

CHAIN = """
RAFF Chain
robot chain {
  link 1 { parameters { d 100 alpha 20 theta 15 } joint ball pred 0 variable y { home 40 } }
  link 2 { parameters { d 200 alpha 10 } type 2 pred 1 limits { -60 60 } effort 7 }
  link 3 { parameters { d 100 r 30 gamma 70 } joint ball pred 2 }
}
"""


@pytest.fixture(scope="module")
def chain():
    return cinegen.load(CHAIN)


@pytest.fixture(scope="module")
def rssr():
    return cinegen.load(text_of_rssr())


@pytest.fixture(scope="module")
def gough():
    """Gough's platform with a ball joint for the links 4, 5 and 6, without limits of passive joints. The middle angle
    of the ball joint is 90 degrees at home."""
    document = raff2urdf.load("gough")
    robot = document.robot()
    links = {part.number: part for part in robot.parts}
    placed = np.eye(4)
    for number in (4, 5, 6):
        placed = placed @ transform(kleinfinger(document, links[number].parameters))
    placed[:3, :3] = placed[:3, :3] @ turned([0.0, -np.pi / 2, 0.0])
    at_lock = (RaffVariable("y", home=90.0),)
    gamma, epsilon, alpha, d, theta, r = parameters(placed)
    gamma, alpha, theta = map(float, np.degrees([gamma, alpha, theta]))
    geom = RaffParameters(theta, 1e3 * r, 1e3 * d, alpha, gamma, 1e3 * epsilon)
    links[6] = RaffLink(6, geom, JointType.FIXED, 3, compound=CompoundKind.BALL, variables=at_lock, name=links[6].name)
    parts = []
    for part in (link for number, link in links.items() if number not in (4, 5)):
        if isinstance(part, RaffLink):
            wide = {JointType.REVOLUTE: None, JointType.PRISMATIC: (100.0, 3000.0)}.get(part.type)
            part = dataclasses.replace(part, limits=wide, velocity=None)
        parts.append(part)
    changed = dataclasses.replace(document, robots=(dataclasses.replace(robot, parts=tuple(parts)),))
    return cinegen.load(raff2urdf.dumps(changed))


def turned(angle):
    return pin.exp3(np.array(angle))


# --- the model -------------------------------------------------------------------------------------------------------


def test_no_mass_is_lost_not_even_that_of_the_base():
    rod = cinegen.load(
        '<mujoco model="rod"><worldbody><body name="base"><geom type="box" size="0.1 0.1 0.1" mass="3"/>'
        '<body name="rod" pos="0 0 0.2"><joint type="ball" name="ball"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 1" size="0.01" mass="2"/></body></body></worldbody>'
        '<equality><connect body1="rod" body2="base" anchor="0 0 1"/></equality></mujoco>'
    )
    assert rod.balls
    assert [inertia.mass for inertia in rod.model.inertias] == pytest.approx([3.0, 2.0])


def test_a_ball_joint_is_a_quaternion_in_q(chain):
    assert (chain.balls, chain.joints) == (("joint1", "joint3"), ("joint2",))
    assert (chain.model.nq, chain.model.nv) == (9, 7)
    assert (chain.actuated, chain.mobility) == (("joint2",), 7)
    first, last = ([f"{joint}.r{axis}" for axis in "xyz"] for joint in chain.balls)
    assert chain.columns == (*first, "joint2", *last)
    assert chain.nodes == ("base", "link1", "link2", "link3")
    assert "1 joint (1 actuated), 2 ball joints, " in repr(chain)
    at = chain.q_index("joint1")
    assert chain.q_home[at : at + 4] == pytest.approx([0.0, np.sin(np.radians(20.0)), 0.0, np.cos(np.radians(20.0))])
    assert chain.limits.lower[chain.q_index("joint2")] == pytest.approx(np.radians(-60.0))
    assert chain.model.upperEffortLimit.tolist() == [np.inf] * 3 + [7.0] + [np.inf] * 3
    assert pickle.loads(pickle.dumps(chain)).q_home.tolist() == chain.q_home.tolist()


def test_successive_joints_move_alike_and_are_found_again(chain):
    successive = chain.successive
    assert successive.joints == ("joint1_X", "joint1_Y", "joint1_Z", "joint2", "joint3_X", "joint3_Y", "joint3_Z")
    assert successive.mobility == chain.mobility
    rng = np.random.default_rng(0)
    for k in range(40):
        angles = 3.0 * rng.normal(size=7)
        if k % 4 == 0:
            angles[[1, 5]] = np.pi / 2, -np.pi / 2  # gimbal lock
        q = chain.spherical.from_successive(angles)
        back = chain.spherical.to_successive(q)
        for node in chain.nodes:
            expected = successive.placement(angles, node).homogeneous
            assert np.abs(chain.placement(q, node).homogeneous - expected).max() < 1e-12
            assert np.abs(successive.placement(back, node).homogeneous - expected).max() < 1e-7 * (k % 4 == 0) + 1e-12


def test_values_by_name(chain):
    quaternion = np.array([0.1, -0.2, 0.3, 0.4])
    q = chain.configuration({"joint1": 3.0 * quaternion, "joint2": 0.3})
    assert chain.values(q)["joint1"] == pytest.approx(quaternion / np.linalg.norm(quaternion))
    assert chain.values(q)["joint2"] == 0.3
    assert chain.configuration(chain.values(q)) == pytest.approx(q)
    for wrong in (0.3, [1.0, 2.0], [0.0] * 4):
        with pytest.raises(ConfigurationError, match="joint 'joint1' of chain takes 4 numbers"):
            chain.configuration({"joint1": wrong})


def with_limit(urdf, name, attributes):
    """Return a URDF in which a revolute joint has only these limits."""
    root = etree.fromstring(urdf.encode())
    (joint,) = (joint for joint in root.findall("joint") if joint.get("name") == name)
    joint.remove(joint.find("limit"))
    joint.set("type", "revolute" if "lower" in attributes else "continuous")
    etree.SubElement(joint, "limit", attributes)
    return etree.tostring(root, encoding="unicode")


@pytest.mark.parametrize("change", ["limits", "velocity", "actuated", "coupling"])
def test_what_is_no_free_ball_joint_stays_three_joints(chain, change):
    urdf, constraints, *_ = chain.source
    entries = [dict(joint) for joint in constraints["joints"]]
    changed = {**constraints, "joints": entries}
    first = next(joint for joint in entries if joint["name"] == "joint1_X")
    if change == "coupling":
        terms = [{"joint": name, "coefficients": [1.0]} for name in ("joint1_X", "joint2")]
        changed["couplings"] = [{"name": "gear", "terms": terms, "constant": 0.0}]
    elif change == "actuated":
        first["actuated"] = True
    else:
        bounds = {"lower": "-1", "upper": "1"} if change == "limits" else {"velocity": "2"}
        urdf = with_limit(urdf, "joint1_X", {"effort": "1"} | bounds)
    for key in ("mobility", "loop_rows", "loop_rank"):
        changed.pop(key, None)
    mechanism = build(urdf, changed)
    assert mechanism.balls == ("joint3",)
    assert "joint1_X" in mechanism.joints


def test_a_floating_base_limits_and_loops_together():
    limited = "pred 0 limits { 100 170 } }\n  frame 4"
    text = text_of_rssr().replace("pred 0 }\n  frame 4", limited)
    text = text.replace("  constraint {", "  constraint { base sensor ( 0 1 ) }\n  constraint {")
    with pytest.warns(raff2urdf.RaffWarning, match="home 85 of link 3 is outside"):
        mechanism = cinegen.load(text + 'sensor 1 { port "/dev/ttyS0" }')
    assert mechanism.floating
    assert mechanism.closure(mechanism.q_home) < 1e-10
    assert mechanism.limits.exceeded(mechanism.q_home, 1e-9) == {}


# --- no gimbal lock --------------------------------------------------------------------------------------------------


def test_singular_values_do_not_depend_on_the_axes_of_the_ball_joint(rssr):
    expected = None
    for gamma, alpha, theta in ((0, 0, 0), (40, 35, 25), (0, 90, 0), (-70, 110, 10)):
        turn = f"gamma {gamma} alpha {alpha} theta {theta}"
        mechanism = cinegen.load(text_of_rssr(turn, f"gamma {-theta} alpha {-alpha} theta {-gamma}"))
        mechanism = replace(mechanism, length=rssr.length)  # their homes differ by the gap as written
        values = []
        motion = ForwardKinematics(mechanism)
        for angle in np.linspace(-1.0, 1.0, 7):
            q = motion.move({"joint1": np.radians(40.0) + angle})
            values.append(np.linalg.svd(mechanism.structure.system.evaluate(q)[1], compute_uv=False))
        expected = values if expected is None else expected
        assert np.abs(np.array(values) - np.array(expected)).max() < 1e-8


def test_a_platform_is_dragged_from_gimbal_lock_on(gough):
    """Its ball joint is written such that three revolute joints are singular at home."""
    successive = gough.successive
    assert passive_singular_values(successive, successive.q_home)[-1] < 1e-6
    assert passive_singular_values(gough, gough.q_home)[-1] > 0.1
    assert singularity(gough, gough.q_home).near is SingularityType.NONE
    solver, rng = Solver(gough, 0.01), np.random.default_rng(0)
    task, start = solver.add_task(gough.end), gough.placement(gough.q_home, gough.end)
    for _ in range(20):
        shift, turn = 0.03 * rng.normal(size=3), 0.1 * rng.normal(size=3)
        task.target = pin.SE3(turned(turn) @ start.rotation, start.translation + shift)
        for _ in range(40):
            step = solver.step()
            assert step.closure <= 1e-10
            assert step.status is Status.FOLLOWING
        assert max(step.errors[0]) < 1e-6


# --- everything else -------------------------------------------------------------------------------------------------


def test_assembly_modes_and_lines_are_those_of_the_successive_joints(gough, robot):
    modes = cinegen.assembly_modes(gough)
    assert modes.mechanism is gough
    assert modes.complete
    middle = gough.successive.q_index("joint6_Y")  # a ball joint is not singular at gimbal lock
    assert any(abs(gough.spherical.to_successive(q)[middle] - np.pi / 2) < 1e-6 for q in modes)
    assert modes.certified == len(modes) == 8
    home = {gough.end: gough.placement(gough.q_home, gough.end)}
    solutions = cinegen.inverse_kinematics(gough, home, all=True)
    assert solutions.certified == len(solutions) > 0
    expected = cinegen.assembly_modes(robot("gough"))
    assert len(modes) == len(expected)
    for q, q_expected in zip(modes, expected, strict=True):
        assert gough.closure(q) < 1e-11
        placed = robot("gough").placement(q_expected, "platform")
        assert np.abs(gough.placement(q, "platform").homogeneous - placed.homogeneous).max() < 1e-8
    json.dumps(modes.as_dict())
    lines = [line.coordinates for line in leg_lines(gough, gough.q_home)]
    same = [line.coordinates for line in leg_lines(robot("gough"), robot("gough").q_home)]
    assert np.abs(np.array(lines) - np.array(same)).max() < 1e-8
    of_ball, of_three = singularity(gough, gough.q_home), singularity(gough.successive, gough.successive.q_home)
    assert of_ball.second == pytest.approx(of_three.second, abs=1e-7)
