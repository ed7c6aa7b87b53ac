"""Frames, screws and steps of joints as Pinocchio computes them: every robot, and trees of all kinds of joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import cinegen
import raff2urdf
from cinegen.jit.foreign import frame_of
from cinegen.loops._kernels import kinematics
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.loops.arrays import set_up
from cinegen.loops.closed_loops import ClosedLoops

ROBOTS = Path(__file__).resolve().parents[2] / "robots"
EVERY = [
    pytest.param(path.stem, robot.name, id=f"{path.stem}-{robot.name}")
    for path in sorted(ROBOTS.glob("*.raff"))
    for robot in raff2urdf.load(path).robots
]
KINDS = ("RX", "PY", "RZ", "PX", "RY", "PZ", "Spherical", "FreeFlyer", "RevoluteUnaligned", "PrismaticUnaligned")


def tree(kinds, rng) -> pin.Model:
    model = pin.Model()
    for kind in kinds:
        axis = rng.normal(size=3)
        make = getattr(pin, f"JointModel{kind}")
        joint = make(axis / np.linalg.norm(axis)) if kind.endswith("Unaligned") else make()
        placement = pin.SE3(pin.exp3(rng.normal(size=3)), 0.3 * rng.normal(size=3))
        model.addJoint(
            int(rng.integers(max(0, model.njoints - 2), model.njoints)), joint, placement, f"j{model.njoints}"
        )
    return model


def memory_of(model: pin.Model, fixed: int = 0) -> LoopMemory:
    return set_up(LoopMemory(), ClosedLoops(model, [], 1.0), 0, fixed)


def check(model: pin.Model, q: np.ndarray, step: np.ndarray) -> None:
    memory, data = memory_of(model), model.createData()
    pin.computeJointJacobians(model, data, q)
    kinematics.evaluate(memory, q)
    assert memory.screws == pytest.approx(np.reshape(data.J, (6, -1)).T, abs=1e-12)
    assert memory.frames == pytest.approx(np.array([frame_of(placement) for placement in data.oMi]), abs=1e-12)
    there, back = np.zeros(model.nq), np.zeros(model.nv)
    kinematics.integrate(memory, q, step, there)
    assert there == pytest.approx(pin.integrate(model, q, step), abs=1e-12)
    kinematics.difference(memory, q, there, back)
    assert back == pytest.approx(pin.difference(model, q, there), abs=1e-11)


@pytest.mark.parametrize(("name", "which"), EVERY)
def test_every_robot(name, which):
    model, rng = cinegen.load(ROBOTS / f"{name}.raff", which).model, np.random.default_rng(0)
    for _ in range(5):
        check(model, pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)), rng.normal(size=model.nv))


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-5, 1e-2, 1.0, 3.0])
def test_trees_of_all_kinds_of_joints(size):
    rng = np.random.default_rng(1)
    for _ in range(20):
        model = tree(rng.permutation(KINDS), rng)
        check(
            model, pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)), size * rng.normal(size=model.nv)
        )


def test_rounding_does_not_grow_along_a_chain():
    rng = np.random.default_rng(2)
    check(tree(["RZ"] * 200, rng), rng.uniform(-3.0, 3.0, 200), rng.normal(size=200))


def test_what_does_not_move_stays_bit_by_bit():
    rng = np.random.default_rng(3)
    model = tree(KINDS, rng)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    there = np.zeros(model.nq)
    kinematics.integrate(memory_of(model), q, np.zeros(model.nv), there)
    assert there.tobytes() == q.tobytes()


def test_a_base_that_stays_has_no_columns():
    rng = np.random.default_rng(4)
    model = tree(["FreeFlyer", "RZ", "PX", "RY"], rng)
    memory, data = memory_of(model, fixed=6), model.createData()
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    pin.computeJointJacobians(model, data, q)
    kinematics.evaluate(memory, q)
    assert memory.screws == pytest.approx(data.J.T[6:], abs=1e-12)
    there = np.zeros(model.nq)
    kinematics.integrate(memory, q, np.ones(3), there)
    assert there == pytest.approx(q + np.repeat([0.0, 1.0], [7, 3]))


def test_other_joints_are_refused():
    with pytest.raises(NotImplementedError, match=r"joint 'j1' is a JointModelPlanar: only revolute, prismatic"):
        memory_of(tree(["Planar"], np.random.default_rng(5)))
