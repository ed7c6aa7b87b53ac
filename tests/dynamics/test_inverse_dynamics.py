"""Torques of actuated joints against Pinocchio's dynamics, the plain form, and each other."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg
from coupled_robots import random_text
from pinocchio_constraints import constraint_dynamics
from random_masses import free_motions, massive, random_motion

import cinegen
from cinegen.dynamics import InverseDynamics, Payload, forces
from cinegen.dynamics._kernels.torques import HELD
from cinegen.dynamics.errors import MassError, MotionError, PayloadError
from cinegen.errors import ClosureError, ConfigurationError, UnknownNameError

FEW = ("ankle", "arm7", "delta4", "differential_wrist", "five_bar", "planetary_gear", "tssm")
LOAD = (3.0, -1.0, 4.0, 0.1, 0.5, -0.9)


@pytest.fixture(scope="module")
def heavy(robot):
    """`heavy("gough")`: a shipped robot with random masses."""
    return cache(lambda name: massive(robot(name)))


def load_cases(mechanism):
    load = Payload(mechanism.end, 2.0, (0.1, -0.05, 0.02), np.diag([0.02, 0.03, 0.04]), LOAD)
    return load, Payload(mechanism.nodes[1], 0.3, wrench=LOAD[::-1], axes="node")


def loaded_model(mechanism, payloads):
    """The model with the payloads' masses."""
    model = pin.Model(mechanism.model)
    for payload in payloads:
        frame = model.frames[mechanism.frame_id(payload.node)]
        inertia = np.zeros((3, 3)) if payload.inertia is None else payload.inertia
        body = pin.Inertia(payload.mass, np.array(payload.centre), np.array(inertia))
        model.inertias[frame.parentJoint] = model.inertias[frame.parentJoint] + frame.placement.act(body)
    return model


def work_of_wrenches(mechanism, q, payloads):
    """Generalised forces (nv,) of the payloads' wrenches."""
    total = np.zeros(mechanism.model.nv)
    for payload in payloads:
        jacobian = mechanism.jacobian(q, payload.node)
        rotation = np.eye(3) if payload.axes == "node" else mechanism.placement(q, payload.node).rotation
        force, moment = np.array(payload.wrench[:3]), np.array(payload.wrench[3:])
        total += jacobian.T @ np.concatenate([rotation.T @ force, rotation.T @ moment])
    return total


@pytest.mark.parametrize("name", FEW)
def test_virtual_work(heavy, name, monkeypatch):
    """On each motion that keeps loops closed, the actuated joints do the work of the tree's inertias and loads.

    The plain form agrees with the kernel.
    """
    mechanism = heavy(name)
    payloads, rng = load_cases(mechanism), np.random.default_rng(2)
    dynamics, model = InverseDynamics(mechanism, payloads, (1.0, 2.0, -9.0)), loaded_model(mechanism, payloads)
    model.gravity = pin.Motion(np.array([1.0, 2.0, -9.0]), np.zeros(3))
    data, columns = model.createData(), [mechanism.v_index(joint) for joint in mechanism.actuated]
    for q in mechanism.random_closed(3):
        v, a = random_motion(mechanism, q, rng)
        for rates in ((np.zeros(model.nv),) * 2, (v, a)):
            needed = np.array(pin.rnea(model, data, q, *rates)) - work_of_wrenches(mechanism, q, payloads)
            applied = np.zeros(model.nv)
            torques = dynamics.torques(q, *rates)
            assert dynamics._single["statuses"][0] == HELD  # by the kernel
            applied[columns] = torques
            free = free_motions(mechanism, q)
            assert free.T @ applied == pytest.approx(free.T @ needed, abs=1e-9 * max(1.0, np.abs(needed).max()))
            with monkeypatch.context() as context:
                context.setattr(dynamics, "_is_compiled", False)
                assert torques == pytest.approx(dynamics.torques(q, *rates), rel=1e-9, abs=1e-8)


@pytest.mark.parametrize("name", ["delta4", "gough", "five_bar"])
def test_pinocchios_constraint_dynamics(heavy, name):
    mechanism, rng = heavy(name), np.random.default_rng(4)
    dynamics, accelerate = InverseDynamics(mechanism), constraint_dynamics(mechanism)
    for q in mechanism.random_closed(2, seed=6):
        wanted = {joint: float(rng.normal()) for joint in mechanism.actuated}
        v, a = dynamics.motion(q, wanted, wanted)
        got = accelerate(q, v, dynamics.torques(q, v, a))
        assert got == pytest.approx(a, abs=1e-8 * max(1.0, np.abs(a).max()))


@pytest.mark.parametrize("seed", [5, 13])
def test_couplings_bear_torques(seed):
    """Random trees with gears, belts, racks, screws and curves, in motion."""
    text, _ = random_text(np.random.default_rng(seed))
    mechanism, rng = massive(cinegen.load(text)), np.random.default_rng(seed)
    dynamics, data = InverseDynamics(mechanism), mechanism.model.createData()
    for q in mechanism.random_closed(2):
        v, a = random_motion(mechanism, q, rng)
        applied = np.zeros(mechanism.model.nv)
        applied[[mechanism.v_index(joint) for joint in mechanism.actuated]] = dynamics.torques(q, v, a)
        assert dynamics._single["statuses"][0] == HELD
        free, needed = free_motions(mechanism, q), np.array(pin.rnea(mechanism.model, data, q, v, a))
        assert free.T @ applied == pytest.approx(free.T @ needed, abs=1e-9 * np.abs(needed).max())
        result = forces(mechanism, q, v, a)
        if not any(np.isnan(list(torques.values())).any() for torques in result.couplings.values()):
            for torques in result.couplings.values():  # joint by joint: actuator and couplings bear what the tree needs
                for joint, torque in torques.items():
                    applied[mechanism.v_index(joint)] += torque
            assert applied == pytest.approx(needed, abs=1e-9 * np.abs(needed).max())


def test_many_configurations(heavy):
    mechanism = heavy("gough")
    dynamics, rng = InverseDynamics(mechanism, load_cases(mechanism)), np.random.default_rng(7)
    q = np.array(mechanism.random_closed(6))
    rates = rng.normal(size=(2, len(q), 6))
    by_name = [[dict(zip(mechanism.actuated, row, strict=True)) for row in rows] for rows in rates]
    torques = dynamics.torques_of(q, *rates, actuated=True)
    assert torques == pytest.approx(np.array([dynamics.torques(*state) for state in zip(q, *by_name, strict=True)]))
    motions = [dynamics.motion(*state) for state in zip(q, *by_name, strict=True)]
    v, a = (np.array([motion[i] for motion in motions]) for i in (0, 1))
    assert dynamics.torques_of(q, v, a) == pytest.approx(torques)
    opened = q.copy()
    opened[2, 0] += 0.1
    still = dynamics.torques_of(opened)
    assert np.isnan(still).all(axis=1).tolist() == [False, False, True, False, False, False]
    assert dynamics.torques_of(q[:0]).shape == (0, 6)


RSUR = """
robot rsur {
  base { parameters { d 40 alpha 15 } }
  link 1 { parameters { theta 40 } type 2 pred 0 actuated 1 }
  frame 10 { parameters { d 100 alpha 70 theta 10 } pred 1 }
  link 2 { joint ball pred 10 }
  link 3 { parameters { gamma 20 d 300 alpha 80 theta 85 epsilon 30 } type 2 pred 0 }
  link 6 { parameters { d 200 alpha 90 theta 20 } type 2 pred 3 }
  frame 4 { parameters { d 320 } pred 2 }
  frame 5 { parameters { alpha 90 } pred 6 }
  constraint { frame 4 frame 5 type 2 }
  FLOATS
}
sensor 1 { port "/dev/null" }
"""
"""A loop with a spherical joint whose mobility is 1."""


@pytest.mark.parametrize("floats", [False, True])
def test_spherical_joints_and_a_base_that_floats(raff, floats):
    """A floating base is held: on all other motions, the actuated joint does the work of the moving tree."""
    mechanism = massive(raff(RSUR.replace("FLOATS", "constraint { base sensor ( 0 1 ) }" if floats else "")))
    assert (mechanism.balls, mechanism.floating) == (("joint2",), floats)
    dynamics, rng, data = InverseDynamics(mechanism), np.random.default_rng(8), mechanism.model.createData()
    many, torques = [], []
    for q in mechanism.random_closed(3):
        v, a = random_motion(mechanism, q, rng)
        free = free_motions(mechanism, q)
        if floats:
            free = free @ scipy.linalg.null_space(free[:6])
        applied = np.zeros(mechanism.model.nv)
        applied[mechanism.v_index("joint1")] = dynamics.torques(q, v, a)[0]
        assert dynamics._single["statuses"][0] == HELD
        assert free.T @ applied == pytest.approx(free.T @ np.array(pin.rnea(mechanism.model, data, q, v, a)))
        many.append((q, v, a))
        torques.append(dynamics.torques(q, v, a))
    assert dynamics.torques_of(*map(np.array, zip(*many, strict=True))) == pytest.approx(np.array(torques))


@pytest.mark.parametrize("name", ["delta4", "arm7"])
def test_mass_matrices_are_what_accelerates_from_rest_and_those_of_the_composite_rigid_body_algorithm(heavy, name):
    mechanism = heavy(name)
    dynamics = InverseDynamics(mechanism, [Payload(mechanism.end, 3.0)], (0, 0, 0))
    samples = mechanism.random_closed(10)
    opened = samples[0].copy()
    opened[0] += 0.3
    matrices = dynamics.mass_matrices_of([*samples, opened])
    for matrix, q in zip(matrices, samples, strict=False):
        expected = dynamics.mass_matrix(q)
        for joint, column in zip(mechanism.actuated, expected.T, strict=True):
            assert dynamics.torques(q, {}, {joint: 1.0}) == pytest.approx(column)
        assert matrix == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())
    assert np.isnan(matrices[-1]).all() == mechanism.is_constrained


# --- wrong input ------------------------------------------------------------------------------------------------------


def test_links_without_mass_are_named(robot):
    delta = robot("delta4_linear")
    with pytest.raises(MassError, match=r"r1: .*no mass: .*massless=True"):
        InverseDynamics(delta)
    weightless = InverseDynamics(delta, [Payload(delta.end, wrench=LOAD)], gravity=(0, 0, 0))
    assert np.isfinite(weightless.torques(delta.q_home)).all()
    with pytest.raises(MassError, match="no mass"):
        weightless.torques(delta.q_home, a={delta.actuated[0]: 1.0})
    with pytest.raises(MassError, match="no mass"):
        weightless.mass_matrix(delta.q_home)
    counted = InverseDynamics(delta, [Payload(delta.end, 2.0)], massless=True)
    force = InverseDynamics(delta, [Payload(delta.end, wrench=(0, 0, -2 * 9.81, 0, 0, 0))], gravity=(0, 0, 0))
    assert counted.torques(delta.q_home) == pytest.approx(force.torques(delta.q_home))


def test_wrong_input(heavy):
    mechanism = heavy("delta4")
    dynamics, q, v = InverseDynamics(mechanism), mechanism.q_home, np.zeros(mechanism.model.nv)
    first = np.eye(len(v))[0]
    for error, message, call in (
        (ClosureError, r"open by 0\.\d+", lambda: dynamics.torques(q + 0.3 * first)),
        (ConfigurationError, "15 numbers", lambda: dynamics.torques(q, v[1:], v)),
        (ConfigurationError, "not finite", lambda: dynamics.torques(q, v + np.nan)),
        (ConfigurationError, "both by name", lambda: dynamics.torques(q, {}, v)),
        (UnknownNameError, "no actuated joint 'elbow'", lambda: dynamics.torques(q, {"elbow": 1.0})),
        (MotionError, r"velocities open loops, at 0?\.?\d+", lambda: dynamics.torques(q, v + first)),
        (MotionError, "accelerations open loops", lambda: dynamics.torques_of([q], [v], [v + first])),
        (ConfigurationError, r"\(count, 15\)", lambda: dynamics.torques_of(q)),
        (ConfigurationError, "1 rows, q has 2", lambda: dynamics.torques_of([q, q], [v])),
        (UnknownNameError, "no node 'hand'", lambda: InverseDynamics(mechanism, [Payload("hand", 1.0)])),
        (PayloadError, "gravity", lambda: InverseDynamics(mechanism, gravity=(0, 1))),
    ):
        with pytest.raises(error, match=message):
            call()


@pytest.mark.parametrize(("options", "message"), [
    ({"mass": -1.0}, "negative mass"),
    ({"mass": np.nan}, "the mass .* a finite number"),
    ({"centre": (1, 2)}, "the centre .* 3 finite numbers"),
    ({"wrench": (1, 2, 3)}, "the wrench .* 6 finite numbers"),
    ({"mass": 1.0, "inertia": np.diag([1.0, 1.0, 3.0])}, r"principal moments 1, 1, 3"),
    ({"mass": 1.0, "inertia": np.diag([-1.0, 1.0, 1.0])}, "no body"),
    ({"inertia": np.eye(3)}, "none is there without mass"),
    ({"mass": 1.0, "inertia": [[1, 0.2, 0], [0, 1, 0], [0, 0, 1]]}, "not symmetric"),
    ({"axes": "body"}, "'world' or 'node'"),
])  # fmt: skip
def test_payloads_that_no_body_can_be(options, message):
    with pytest.raises(PayloadError, match=message):
        Payload("tool", **options)
