"""Torques and reactions against formulas of textbooks, equilibrium body by body, and other cuts of the same loops."""

import math

import numpy as np
import pinocchio as pin
import pytest
from gough_lines import lines_of
from random_masses import massive, random_motion
from small_robots import two_bars

import cinegen
from cinegen.dynamics import InverseDynamics, Payload, forces
from cinegen.dynamics.elasticity import Elasticity
from cinegen.dynamics.errors import MotionError
from cinegen.dynamics.node_wrench import node_wrench
from cinegen.dynamics.trajectory import torques_along
from cinegen.errors import CinegenError, ClosureError, ConfigurationError, UnknownNameError

STILL = (0.0, 0.0, 0.0)

SLIDER_CRANK = """
robot slider_crank {
  base { }
  link 1 { parameters { theta 50 } type 2 pred 0 CRANK }
  link 2 { parameters { theta -67 d 100 } type 2 pred 1 }
  link 3 { parameters { gamma 90 alpha 90 r 420 } type 1 pred 0 PISTON }
  frame 4 { parameters { d 350 } pred 2 }
  frame 5 { parameters { } pred 3 }
  constraint { frame 4 frame 5 type 3 }
}
"""
R, L = 0.1, 0.35


@pytest.fixture
def engine(raff):
    return raff(SLIDER_CRANK.replace("CRANK", "actuated 1").replace("PISTON", ""))


def at(mechanism, name, value):
    """The closed configuration in which a joint has a value."""
    q = mechanism.q_home.copy()
    for x in np.linspace(q[mechanism.q_index(name)], value, 12):
        q[mechanism.q_index(name)] = x
        q = mechanism.close(q, [name])
    return q


# --- formulas ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.4, 1.9, -2.2])
def test_slider_crank(engine, angle):
    """The piston is at x = r cos t + sqrt(l^2 - r^2 sin^2 t); with its mass m at a constant speed w and a force P
    against it, the crank needs the torque T = (m w^2 x'' + P) x'."""
    mass, gas, speed, q = 2.5, 130.0, 40.0, at(engine, "joint1", angle)
    s, c = math.sin(angle), math.cos(angle)
    root = math.sqrt(L**2 - (R * s) ** 2)
    first = -R * s - R**2 * s * c / root
    second = -R * c - R**2 * (c * c - s * s) / root - R**4 * (s * c) ** 2 / root**3
    payload = Payload("link3", mass, wrench=(-gas, 0, 0, 0, 0, 0))
    result = forces(engine, q, {"joint1": speed}, payloads=[payload], gravity=STILL, massless=True)
    assert result.torques == pytest.approx([(mass * speed**2 * second + gas) * first], rel=1e-9)
    assert result.power == pytest.approx(result.torques[0] * speed)
    rod = result.reaction("joint2")  # a massless rod bears a force along itself
    wall = (mass * speed**2 * second + gas) * R * s / root
    assert rod.wrench[:2] == pytest.approx([math.copysign(math.hypot(mass * speed**2 * second + gas, wall),
                                                          mass * speed**2 * second + gas), 0.0], abs=1e-6)  # fmt: skip


# --- reactions --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["delta4", "hybrid", "arm7"])
def test_each_body_is_in_equilibrium(robot, name):
    """Rates of momentum are what the joints of a body, its loops, gravity and a payload's wrench add up to.

    Along their axes actuated joints bear their torques, and passive ones nothing.
    """
    mechanism, rng = massive(robot(name)), np.random.default_rng(1)
    model, data = mechanism.model, mechanism.model.createData()
    wrench = np.array([3.0, -1.0, 4.0, 0.1, 0.5, -0.9])
    for q in mechanism.random_closed(2):
        v, a = random_motion(mechanism, q, rng)
        result = forces(mechanism, q, v, a, [Payload(mechanism.end, wrench=wrench)])
        assert result.undetermined == ()
        torques = dict(zip(mechanism.actuated, result.torques, strict=True))
        for reaction in (reaction for reaction in result.reactions if reaction.name in mechanism.joints):
            along = reaction.force[2] if mechanism.is_prismatic(reaction.name) else reaction.moment[2]
            assert along == pytest.approx(torques.get(reaction.name, 0.0), abs=1e-8)
        pin.forwardKinematics(model, data, q, v, a)
        frame = model.frames[mechanism.frame_id(mechanism.end)]
        total = np.zeros((model.njoints, 6))  # on each body, at the world's origin
        on_end = mechanism.placement(q, mechanism.end).translation
        total[frame.parentJoint] += wrench + np.concatenate([np.zeros(3), np.cross(on_end, wrench[:3])])
        for reaction in result.reactions:
            world = reaction.placement.act(pin.Force(reaction.wrench)).vector
            if reaction.kind == "joint":
                joint = model.getJointId(reaction.name)
                pair = joint, model.parents[joint]
            else:
                loop = next(loop for loop in mechanism.loops if loop.name == reaction.name)
                pair = (model.frames[mechanism.frame_id(node)].parentJoint for node in (loop.second, loop.first))
            for body, sign in zip(pair, (1.0, -1.0), strict=True):
                total[body] += sign * world
        for j in range(1, model.njoints):
            body = model.inertias[j]
            gravity = pin.Motion(data.oMi[j].rotation.T @ np.array([0.0, 0.0, -9.81]), np.zeros(3))
            rate = body * (data.a[j] - gravity) + data.v[j].cross(body * data.v[j])
            assert total[j] == pytest.approx(data.oMi[j].act(rate).vector, abs=1e-8)


def star(points, tip, actuated):
    """RAFF of bars from points of the ground to a tip (mm), hinged at both ends: legs of variable length, or rigid."""
    lines = ["robot star {", "  base { }"]
    for i, (x, y) in enumerate(points):
        angle, length = math.degrees(math.atan2(tip[1] - y, tip[0] - x)), math.dist(tip, (x, y))
        around, far = math.degrees(math.atan2(y, x)), math.hypot(x, y)
        a, b, c = 10 * i + 1, 10 * i + 2, 10 * i + 3
        lines.append(f"  link {a} {{ parameters {{ gamma {around} d {far} theta {angle - around} }} type 2 pred 0 }}")
        if actuated:
            lines.append(f"  link {b} {{ parameters {{ gamma 90 alpha 90 r {length} }} type 1 pred {a} actuated 1 }}")
            lines.append(f"  frame {c} {{ parameters {{ }} pred {b} }}")
        else:
            lines.append(f"  frame {c} {{ parameters {{ d {length} }} pred {a} }}")
        if i:
            lines.append(f"  constraint {{ frame 3 frame {c} type 3 }}")
    return "\n".join([*lines, "}"])


POINTS, TIP = [(0.0, 0.0), (900.0, 100.0), (300.0, -200.0), (1000.0, 900.0)], (420.0, 510.0)


def test_a_truss_of_three_bars_is_undetermined(raff):
    load, three = Payload("frame3", wrench=(70, -200, 0, 0, 0, 0)), raff(star(POINTS[:3], TIP, False))
    result = forces(three, three.q_home, payloads=[load], gravity=STILL)
    for reaction in map(result.reaction, ("joint1", "joint11", "joint21")):
        assert np.isnan(reaction.force[0])
        assert reaction.stresses[0].any()
        assert reaction.force[1] == pytest.approx(0.0, abs=1e-9)


def test_a_truss_with_redundant_actuation_against_its_stiffness(raff):
    """Bars of one stiffness k: the tip moves by u = (sum k d d^T)^-1 F, and bar i bears k d_i . u. That is the shortest
    solution of the equilibrium."""
    mechanism = raff(star(POINTS, TIP, True))
    assert (mechanism.mobility, len(mechanism.actuated)) == (2, 4)
    force = np.array([70.0, -200.0])
    load = Payload("frame3", wrench=(*force, 0, 0, 0, 0))
    result = forces(mechanism, mechanism.q_home, payloads=[load], gravity=STILL)
    d = np.array([np.subtract(TIP, p) / math.dist(TIP, p) for p in POINTS])
    displacement = np.linalg.solve(d.T @ d, force)
    assert result.torques == pytest.approx(-d @ displacement, rel=1e-9)  # a positive force lengthens the bar
    assert result.prestress.shape == (2, 4)
    assert "2 independent combinations of torques do no work" in result.message
    assert result.prestress @ d == pytest.approx(np.zeros((2, 2)), abs=1e-9)


# --- singularities ----------------------------------------------------------------------------------------------------


def test_at_a_dead_centre_the_direction_is_named_that_no_actuator_holds(raff):
    """A slider-crank driven by its piston holds no torque of the crank where crank and rod are in line."""
    mechanism = raff(SLIDER_CRANK.replace("CRANK", "").replace("PISTON", "actuated 1"))
    q = mechanism.configuration({"joint1": 0.0, "joint2": 0.0, "joint3": R + L})
    assert mechanism.closure(q) < 1e-12
    turning = Payload("link1", wrench=(0, 0, 0, 0, 0, 3.0))
    result = forces(mechanism, q, payloads=[turning], gravity=STILL, node="link1")
    assert not result.is_held
    assert np.isnan(result.torques).all()
    assert all(np.isnan(reaction.wrench).all() for reaction in result.reactions)
    assert "no torques of the actuated joints hold the load" in result.message
    assert "link1 can make a rotation about the axis through (0, 0, 0) m along (0, 0, 1)" in result.message
    assert result.as_dict()["torques"][0]["value"] is None
    pushing = Payload("link3", wrench=(-50, 0, 0, 0, 0, 0))
    pushed = forces(mechanism, q, payloads=[pushing], gravity=STILL, node="link1")
    assert pushed.torques == pytest.approx([0.0])  # crank and rod bear it, or the actuator does
    assert len(pushed.prestress) == 1
    assert "hold the load, but at a type 2 singularity" in pushed.message
    near = at(mechanism, "joint3", R + L - 1e-6)
    grown = forces(mechanism, near, payloads=[turning], gravity=STILL, node="link1")
    assert "near a type 2 singularity" in grown.message
    assert abs(grown.torques[0]) > 1e3


def test_wrong_names_and_open_loops(engine):
    with pytest.raises(UnknownNameError, match="no node 'piston'"):
        forces(engine, engine.q_home, node="piston", gravity=STILL)
    with pytest.raises(UnknownNameError, match="no joint or loop 'pin'"):
        forces(engine, engine.q_home, gravity=STILL).reaction("pin")
    q = engine.q_home.copy()
    q[0] += 0.2
    with pytest.raises(ClosureError, match="open by"):
        forces(engine, q, gravity=STILL)


# --- node wrench ------------------------------------------------------------------------------------------------------
# Wrenches that torques produce, compliance and natural frequencies, against closed forms.


@pytest.fixture(scope="module")
def gough(robot):
    return robot("gough")


@pytest.fixture(scope="module")
def arm(robot):
    return robot("planar_3r")


def test_a_platform_exerts_the_sum_of_its_legs_forces(gough):
    dynamics, rng = InverseDynamics(gough, gravity=STILL), np.random.default_rng(1)
    for q in gough.random_closed(3):
        forces = rng.normal(scale=100.0, size=6)
        exerted = node_wrench(dynamics, q, forces)
        assert exerted.wrench == pytest.approx(forces @ lines_of(gough, q), rel=1e-9, abs=1e-9)
        assert len(exerted.supported) == 0
        assert exerted.imbalance < 1e-12


def test_what_the_structure_supports_may_be_added(arm):
    dynamics, q = InverseDynamics(arm, gravity=STILL), np.array([0.3, 0.5, -0.7])
    exerted = node_wrench(dynamics, q, [1.0, 2.0, 3.0])
    jacobian = arm.jacobian(q, arm.end)
    rotation = arm.placement(q, arm.end).rotation
    local = np.concatenate([rotation.T @ exerted.wrench[:3], rotation.T @ exerted.wrench[3:]])
    assert jacobian.T @ local == pytest.approx([1.0, 2.0, 3.0])
    assert exerted.supported.shape == (3, 6)
    assert np.abs(exerted.supported[:, [0, 1, 5]]).max() < 1e-12  # forces along z, moments about x and y
    behind = node_wrench(dynamics, q, [1.0, 2.0, 3.0], "link2")
    assert behind.imbalance == pytest.approx(1.0)  # joint3 is free to rotate


def test_compliance_of_a_platform_in_closed_form(gough):
    """Legs of stiffness k along lines L: the stiffness is L^T k L."""
    springs = dict(zip(gough.actuated, np.linspace(1e6, 2e6, 6), strict=True))
    dynamics = InverseDynamics(gough, gravity=STILL)
    for q in gough.random_closed(3):
        lines = lines_of(gough, q)
        expected = np.linalg.inv(lines.T @ np.diag(list(springs.values())) @ lines)
        compliance = Elasticity(dynamics, q, springs).compliance()
        assert compliance == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_frequencies(arm, robot):
    """A point mass on a lever with a spring: w^2 = k / (m l^2)."""
    dynamics = InverseDynamics(arm, [Payload(arm.end, 2.0)], massless=True)
    frequencies = Elasticity(dynamics, np.zeros(3), {"joint1": 300.0}).frequencies()
    assert frequencies == pytest.approx([np.sqrt(300.0 / (2.0 * 0.9**2)) / (2.0 * np.pi)])
    heavy = massive(robot("delta4"))
    body, q = InverseDynamics(heavy), heavy.q_home
    springs = dict.fromkeys(heavy.actuated, 1e4)
    mass = body.mass_matrix(q)
    expected = np.sqrt(np.sort(1e4 / np.linalg.eigvalsh(mass))) / (2.0 * np.pi)
    assert Elasticity(body, q, springs).frequencies() == pytest.approx(expected)


def test_wrong_input(arm):
    dynamics = InverseDynamics(arm, gravity=STILL)
    for error, message, call in (
        (ConfigurationError, "torques of arm are 3 finite", lambda: node_wrench(dynamics, np.zeros(3), [1.0, 2.0])),
        (UnknownNameError, "no node 'hand'", lambda: node_wrench(dynamics, np.zeros(3), np.zeros(3), "hand")),
        (UnknownNameError, "no joint 'elbow'", lambda: Elasticity(dynamics, np.zeros(3), {"elbow": 1.0})),
        (CinegenError, "must be positive", lambda: Elasticity(dynamics, np.zeros(3), {"joint1": 0.0})),
    ):
        with pytest.raises(error, match=message):
            call()
    swing = cinegen.load(two_bars(words=("actuated 1", "actuated 0")))
    with pytest.raises(MotionError, match="moves without deforming a spring"):
        Elasticity(InverseDynamics(swing, gravity=STILL), swing.q_home, {"joint1": 5.0})
    assert Elasticity(dynamics, np.zeros(3), {}).compliance() == pytest.approx(np.zeros((6, 6)))


# --- trajectory torques -----------------------------------------------------------------------------------------------
# Torques along a trajectory: peaks, means and powers in closed form, and trajectories that are none.


@pytest.fixture(scope="module")
def swing(robot):
    """An arm that rotates stretched, by 1 - cos(t) rad: 2 kg at 0.9 m; times and configurations."""
    arm = robot("planar_3r")
    times = np.linspace(0.0, 2.0 * np.pi, 2001)
    q = np.zeros((len(times), 3))
    q[:, arm.q_index("joint1")] = 1.0 - np.cos(times)
    dynamics = InverseDynamics(arm, [Payload(arm.end, 2.0)], gravity=(0, 0, 0), massless=True)
    return dynamics, times, q


def test_a_swing_in_closed_form(swing):
    dynamics, times, q = swing
    trace, inertia = torques_along(dynamics, times, q), 2.0 * 0.9**2
    assert trace.torques[:, 0] == pytest.approx(inertia * np.cos(times), abs=1e-5)
    assert trace.speeds[:, 0] == pytest.approx(np.sin(times), abs=1e-5)
    assert trace.peak[0] == pytest.approx(inertia, rel=1e-5)
    assert trace.rms[0] == pytest.approx(inertia / np.sqrt(2.0), rel=1e-3)
    assert trace.peak_power[0] == pytest.approx(inertia / 2.0, rel=1e-5)
    assert trace.peak_time[0] == pytest.approx(0.0, abs=1e-9) or trace.peak_time[0] == pytest.approx(np.pi, abs=1e-2)
    assert len(trace.not_held) == 0


def test_trajectories_that_are_none(swing, robot):
    dynamics, times, q = swing
    with pytest.raises(ConfigurationError, match="evenly spaced"):
        torques_along(dynamics, times**2, q)
    with pytest.raises(ConfigurationError, match="three times at least"):
        torques_along(dynamics, times[:2], q[:2])
    five_bar = robot("five_bar")
    still = np.tile(five_bar.q_home, (4, 1))
    held = InverseDynamics(five_bar, massless=True)
    assert torques_along(held, np.arange(4.0), still).peak == pytest.approx([0.0, 0.0])
    still[2, 0] += 0.1
    with pytest.raises(ClosureError, match=r"at 2 s loops are open by 0\.\d+"):
        torques_along(held, np.arange(4.0), still)


def test_what_holds_a_floating_base_is_reported(raff):
    """Its weight, 3 kg + 2 kg, and the moment of 2 kg at 0.3 m."""
    mechanism = raff("""
robot hand {
  base { inertial { mass 3 } }
  link 1 { parameters { alpha 90 } type 2 pred 0 inertial { mass 2 centre { 300 0 0 } } }
  constraint { base sensor ( 0 1 ) }
}
sensor 1 { port "/dev/null" }
""")
    message = forces(mechanism, mechanism.q_home).message
    assert f"a force of {5 * 9.81:.4g} N and a moment of {0.6 * 9.81:.4g} N m hold it" in message
