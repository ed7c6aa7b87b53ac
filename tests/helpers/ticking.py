"""Many ticks of a solver in one line, and targets for it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

import cinegen
from cinegen.ik import FrameTask, Step


def ticked(solver: cinegen.Solver, count: int) -> Step:
    """Return the last of some steps."""
    for _ in range(count):
        step = solver.step()
    return step


def beside(pose: pin.SE3, way: ArrayLike, turn: Sequence[float] = (0.0, 0.0, 0.0)) -> pin.SE3:
    """Return a pose that is moved along the world's axes, and turned about its own."""
    return pin.SE3(pose.rotation @ pin.exp3(np.array(turn)), pose.translation + np.asarray(way))


def pull(solver: cinegen.Solver, node: str, way: ArrayLike, **options: Any) -> FrameTask:
    """Return a new task, whose target is some way along the world's axes from where the node is."""
    task = solver.add_task(node, **options)
    task.target = beside(task.target, way)
    return task


def of_pinocchio(mechanism: cinegen.Mechanism, q: np.ndarray, node: str) -> pin.SE3:
    """Return the pose of a node by Pinocchio's own kinematics."""
    data = mechanism.model.createData()
    pin.framesForwardKinematics(mechanism.model, data, np.asarray(q))
    return data.oMf[mechanism.model.getFrameId(node, pin.FrameType.BODY)]


def away(mechanism: cinegen.Mechanism, node: str, rng: np.random.Generator, lengths: float) -> pin.SE3:
    """Return a target in a random direction from home."""
    way = rng.normal(size=3)
    home = mechanism.placement(mechanism.q_home, node)
    return beside(home, lengths * mechanism.length * way / np.linalg.norm(way))
