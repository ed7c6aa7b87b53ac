"""Wrenches that torques produce, compliance and natural frequencies, against closed forms."""

import numpy as np
import pinocchio as pin
import pytest
from random_masses import massive

from cinegen.dynamics import InverseDynamics, Payload
from cinegen.dynamics.elasticity import Elasticity
from cinegen.dynamics.errors import MotionError
from cinegen.dynamics.node_wrench import node_wrench
from cinegen.errors import CinegenError, ConfigurationError, UnknownNameError

STILL = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def gough(robot):
    return robot("gough")


@pytest.fixture(scope="module")
def arm(robot):
    return robot("planar_3r")


def lines_of(gough, q):
    """(6, 6) the legs' unit forces as force and moment about the platform's origin."""
    data = gough.model.createData()
    pin.forwardKinematics(gough.model, data, q)
    starts = [data.oMi[gough.model.getJointId(f"joint{k}")].translation for k in (1, 7, 10, 13, 16, 19)]
    ends = [data.oMi[gough.model.getJointId("joint4")].translation]
    ends += [(data.oMi[anchor[0]] * anchor[1]).translation for anchor in gough.structure.system.anchors]
    centre = gough.placement(q, gough.end).translation
    units = [(b - a) / np.linalg.norm(b - a) for a, b in zip(starts, ends, strict=True)]
    return np.array([np.concatenate([u, np.cross(a - centre, u)]) for a, u in zip(starts, units, strict=True)])


def test_a_platform_exerts_the_sum_of_its_legs_forces(gough):
    dynamics, rng = InverseDynamics(gough, gravity=STILL), np.random.default_rng(1)
    for q in gough.random_closed(3):
        forces = rng.normal(scale=100.0, size=6)
        found = node_wrench(dynamics, q, forces)
        assert found.wrench == pytest.approx(forces @ lines_of(gough, q), rel=1e-9, abs=1e-9)
        assert len(found.supported) == 0
        assert found.imbalance < 1e-12


def test_torques_and_wrenches_are_inverse(gough):
    """With masses, in motion: the wrench that a payload exerts is given back by the torques that it needs."""
    mechanism, rng = massive(gough), np.random.default_rng(2)
    wrench = rng.normal(scale=50.0, size=6)
    loaded, free = InverseDynamics(mechanism, [Payload(mechanism.end, wrench=wrench)]), InverseDynamics(mechanism)
    q = mechanism.random_closed(1)[0]
    v, a = ({name: float(rng.normal()) for name in mechanism.actuated} for _ in range(2))
    found = node_wrench(free, q, loaded.torques(q, v, a), v=v, a=a)
    assert found.wrench == pytest.approx(-wrench, rel=1e-8, abs=1e-8)


def test_what_the_structure_supports_may_be_added(arm):
    dynamics, q = InverseDynamics(arm, gravity=STILL), np.array([0.3, 0.5, -0.7])
    found = node_wrench(dynamics, q, [1.0, 2.0, 3.0])
    jacobian = arm.jacobian(q, arm.end)
    rotation = arm.placement(q, arm.end).rotation
    local = np.concatenate([rotation.T @ found.wrench[:3], rotation.T @ found.wrench[3:]])
    assert jacobian.T @ local == pytest.approx([1.0, 2.0, 3.0])
    assert found.supported.shape == (3, 6)
    assert np.abs(found.supported[:, [0, 1, 5]]).max() < 1e-12  # forces along z, moments about x and y
    behind = node_wrench(dynamics, q, [1.0, 2.0, 3.0], "link2")
    assert behind.imbalance == pytest.approx(1.0)  # joint3 is free to rotate


def test_compliance_of_a_platform_in_closed_form(gough):
    """Legs of stiffness k along lines L: the stiffness is L^T k L."""
    springs = dict(zip(gough.actuated, np.linspace(1e6, 2e6, 6), strict=True))
    dynamics = InverseDynamics(gough, gravity=STILL)
    for q in gough.random_closed(3):
        lines = lines_of(gough, q)
        expected = np.linalg.inv(lines.T @ np.diag(list(springs.values())) @ lines)
        found = Elasticity(dynamics, q, springs).compliance()
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_frequencies(arm, robot):
    """A point mass on a lever with a spring: w^2 = k / (m l^2)."""
    dynamics = InverseDynamics(arm, [Payload(arm.end, 2.0)], massless=True)
    one = Elasticity(dynamics, np.zeros(3), {"joint1": 300.0}).frequencies()
    assert one == pytest.approx([np.sqrt(300.0 / (2.0 * 0.9**2)) / (2.0 * np.pi)])
    heavy = massive(robot("delta4"))
    body, q = InverseDynamics(heavy), heavy.q_home
    springs = dict.fromkeys(heavy.actuated, 1e4)
    mass = body.mass_matrix(q)
    expected = np.sqrt(np.sort(1e4 / np.linalg.eigvalsh(mass))) / (2.0 * np.pi)
    assert Elasticity(body, q, springs).frequencies() == pytest.approx(expected)


def test_wrong_input(arm, raff):
    dynamics = InverseDynamics(arm, gravity=STILL)
    for error, message, call in (
        (ConfigurationError, "torques of arm are 3 finite", lambda: node_wrench(dynamics, np.zeros(3), [1.0, 2.0])),
        (UnknownNameError, "no node 'hand'", lambda: node_wrench(dynamics, np.zeros(3), np.zeros(3), "hand")),
        (UnknownNameError, "no joint 'elbow'", lambda: Elasticity(dynamics, np.zeros(3), {"elbow": 1.0})),
        (CinegenError, "must be positive", lambda: Elasticity(dynamics, np.zeros(3), {"joint1": 0.0})),
    ):
        with pytest.raises(error, match=message):
            call()
    swing = raff(
        "robot swing { link 1 { type 2 pred 0 actuated 1 } link 2 { parameters { d 300 } type 2 pred 1 actuated 0 } "
        "frame 3 { parameters { d 200 } pred 2 } }"
    )
    with pytest.raises(MotionError, match="moves without deforming a spring"):
        Elasticity(InverseDynamics(swing, gravity=STILL), swing.q_home, {"joint1": 5.0})
    assert Elasticity(dynamics, np.zeros(3), {}).compliance() == pytest.approx(np.zeros((6, 6)))
