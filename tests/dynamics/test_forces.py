"""Torques and reactions against formulas of textbooks, equilibrium body by body, and other cuts of the same loops."""

import math

import numpy as np
import pinocchio as pin
import pytest
from random_masses import massive, random_motion

from cinegen.dynamics import Payload, forces
from cinegen.errors import ClosureError, UnknownNameError

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
    found = forces(engine, q, {"joint1": speed}, payloads=[payload], gravity=STILL, massless=True)
    assert found.torques == pytest.approx([(mass * speed**2 * second + gas) * first], rel=1e-9)
    assert found.power == pytest.approx(found.torques[0] * speed)
    rod = found.reaction("joint2")  # a massless rod bears a force along itself
    wall = (mass * speed**2 * second + gas) * R * s / root
    assert rod.wrench[:2] == pytest.approx([math.copysign(math.hypot(mass * speed**2 * second + gas, wall),
                                                          mass * speed**2 * second + gas), 0.0], abs=1e-6)  # fmt: skip


# --- reactions --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["delta4", "hybrid"])
def test_each_body_is_in_equilibrium(robot, name):
    """Rates of momentum are what the joints of a body, its loops, gravity and a payload's wrench add up to."""
    mechanism, rng = massive(robot(name)), np.random.default_rng(1)
    model, data = mechanism.model, mechanism.model.createData()
    wrench = np.array([3.0, -1.0, 4.0, 0.1, 0.5, -0.9])
    for q in mechanism.random_closed(2):
        v, a = random_motion(mechanism, q, rng)
        found = forces(mechanism, q, v, a, [Payload(mechanism.end, wrench=wrench)])
        assert found.undetermined == ()
        pin.forwardKinematics(model, data, q, v, a)
        frame = model.frames[mechanism.frame_id(mechanism.end)]
        total = np.zeros((model.njoints, 6))  # on each body, at the world's origin
        on_end = mechanism.placement(q, mechanism.end).translation
        total[frame.parentJoint] += wrench + np.concatenate([np.zeros(3), np.cross(on_end, wrench[:3])])
        for one in found.reactions:
            world = one.placement.act(pin.Force(one.wrench)).vector
            if one.kind == "joint":
                joint = model.getJointId(one.name)
                pair = joint, model.parents[joint]
            else:
                loop = next(loop for loop in mechanism.loops if loop.name == one.name)
                pair = (model.frames[mechanism.frame_id(node)].parentJoint for node in (loop.second, loop.first))
            for body, sign in zip(pair, (1.0, -1.0), strict=True):
                total[body] += sign * world
        for j in range(1, model.njoints):
            body = model.inertias[j]
            gravity = pin.Motion(data.oMi[j].rotation.T @ np.array([0.0, 0.0, -9.81]), np.zeros(3))
            rate = body * (data.a[j] - gravity) + data.v[j].cross(body * data.v[j])
            assert total[j] == pytest.approx(data.oMi[j].act(rate).vector, abs=1e-8)


def test_actuated_joints_bear_their_torques_and_passive_ones_none(robot):
    for name in ("sr400", "five_bar", "arm7"):
        mechanism = massive(robot(name))
        found = forces(mechanism, mechanism.random_closed(1)[0])
        given = dict(zip(mechanism.actuated, found.torques, strict=True))
        for one in found.reactions[: len(mechanism.joints)]:
            along = one.force[2] if mechanism.is_prismatic(one.name) else one.moment[2]
            assert along == pytest.approx(given.get(one.name, 0.0), abs=1e-9)


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


def test_a_truss_of_three_bars_is_undetermined_and_one_of_two_is_not(raff):
    force, load = np.array([70.0, -200.0]), Payload("frame3", wrench=(70, -200, 0, 0, 0, 0))
    two, three = (raff(star(POINTS[:n], TIP, False), f"bars{n}") for n in (2, 3))
    bars = np.linalg.solve(np.transpose([np.subtract(TIP, p) / math.dist(TIP, p) for p in POINTS[:2]]), force)
    found = forces(two, two.q_home, payloads=[load], gravity=STILL)
    for name, bar in zip(("joint1", "joint11"), bars, strict=True):
        assert found.reaction(name).force[:2] == pytest.approx([-bar, 0.0], abs=1e-9)  # the ground pulls the bar back
    found = forces(three, three.q_home, payloads=[load], gravity=STILL)
    for one in map(found.reaction, ("joint1", "joint11", "joint21")):
        assert np.isnan(one.force[0])
        assert one.stresses[0].any()
        assert one.force[1] == pytest.approx(0.0, abs=1e-9)


def test_a_truss_with_redundant_actuation_against_its_stiffness(raff):
    """Bars of one stiffness k: the tip moves by u = (sum k d d^T)^-1 F, and bar i bears k d_i . u. That is the shortest
    solution of the equilibrium."""
    mechanism = raff(star(POINTS, TIP, True))
    assert (mechanism.mobility, len(mechanism.actuated)) == (2, 4)
    force = np.array([70.0, -200.0])
    found = forces(
        mechanism, mechanism.q_home, payloads=[Payload("frame3", wrench=(*force, 0, 0, 0, 0))], gravity=STILL
    )
    d = np.array([np.subtract(TIP, p) / math.dist(TIP, p) for p in POINTS])
    displacement = np.linalg.solve(d.T @ d, force)
    assert found.torques == pytest.approx(-d @ displacement, rel=1e-9)  # a positive force lengthens the bar
    assert found.prestress.shape == (2, 4)
    assert "2 independent combinations of torques do no work" in found.message
    assert found.prestress @ d == pytest.approx(np.zeros((2, 2)), abs=1e-9)


# --- singularities ----------------------------------------------------------------------------------------------------


def test_at_a_dead_centre_the_direction_is_named_that_no_actuator_holds(raff):
    """A slider-crank driven by its piston holds no torque of the crank where crank and rod are in line."""
    mechanism = raff(SLIDER_CRANK.replace("CRANK", "").replace("PISTON", "actuated 1"))
    q = mechanism.configuration({"joint1": 0.0, "joint2": 0.0, "joint3": R + L})
    assert mechanism.closure(q) < 1e-12
    turning = Payload("link1", wrench=(0, 0, 0, 0, 0, 3.0))
    found = forces(mechanism, q, payloads=[turning], gravity=STILL, node="link1")
    assert not found.is_held
    assert np.isnan(found.torques).all()
    assert all(np.isnan(one.wrench).all() for one in found.reactions)
    assert "no torques of the actuated joints hold the load" in found.message
    assert "link1 can make a rotation about the axis through (0, 0, 0) m along (0, 0, 1)" in found.message
    assert found.as_dict()["torques"][0]["value"] is None
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
