"""Constraints of a node along a path, as equations of its pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.scene import Scene
from cinegen.errors import CinegenError
from cinegen.ik.barrier import TOLERANCE as RANGE_TOLERANCE
from cinegen.ik.barrier import Range
from cinegen.ik.by_ticks import solver_for
from cinegen.ik.equations import task_rank
from cinegen.ik.given_task import GivenTask, Task, errors_of
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.state import State
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism
from cinegen.tolerances import CLOSURE

Projection = Callable[[Array], Array | None]
"""Returns a configuration (nq,) near a given one, on which all equations are satisfied; None without one."""

Kept: TypeAlias = Sequence[Task | Range]
"""Tasks and ranges that are kept along a path."""

_RESIDUAL = 1e-9  # rad or characteristic lengths
_TICKS = 40  # of a projection onto tasks
_MET = 1e-6  # m or rad: a task with less error is satisfied


def path_tasks(scene: Scene) -> tuple[FrameTask, ...]:
    """Return tasks whose rows are 0 where a scene's `path_constraints` are satisfied."""
    pose, constraints, tasks = scene.mechanism.placement(scene.start, scene.node), scene.path_constraints, []
    if constraints.upright:  # z of a frame that is parallel to the world's at the start remains vertical
        upright = pin.SE3(pose.rotation.T, np.zeros(3))
        tasks.append(FrameTask(scene.node, pin.SE3(np.eye(3), pose.translation), 0, 2, offset=upright))
    for direction, weights in ((constraints.line, [1, 1, 0]), (constraints.plane, [0, 0, 1])):
        if direction is not None:
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction).toRotationMatrix()
            target = pin.SE3(turn, pose.translation)
            tasks.append(FrameTask(scene.node, target, axes="target", weights=[*weights, 0, 0, 0]))
    return tuple(tasks)


class TaskProjection:
    """A projection onto configurations that satisfy tasks of any kind, and ranges, loops closed and within limits: by
    ticks of a solver from each configuration.

    Args:
        mechanism: mechanism that moves.
        frames: tasks of frames; their targets may be changed.
        tasks: other tasks, and ranges.

    Raises:
        CinegenError: a task can't be evaluated.
    """

    def __init__(self, mechanism: Mechanism, frames: Sequence[FrameTask], tasks: Kept) -> None:
        self._solver, self._tasks = solver_for(mechanism, (*frames, *tasks)), tasks
        self.frames = self._solver.frame_tasks

    def __call__(self, q: Array) -> Array | None:
        """Return the projection (nq,) of q (nq,); None if there is none near it."""
        solver, mechanism = self._solver, self._solver.mechanism
        try:
            solver.q = mechanism.close(q)
        except CinegenError:
            return None
        for _ in range(_TICKS):
            step = solver.step()
            if not step.v.any() or float(np.abs(step.v / mechanism.scale).max()) < _RESIDUAL:
                break
        return step.q if mechanism.limits.within(step.q) and self._is_satisfied(step.q) else None

    def _is_satisfied(self, q: Array) -> bool:
        state = State(self._solver.mechanism, q, 1.0)
        values = [float(np.abs(task.error(state)).max()) for task in self._tasks if isinstance(task, Range)]
        rest = [max(errors_of(task, state)) for task in self._solver.tasks]
        return max(values, default=0.0) <= RANGE_TOLERANCE and max(rest, default=0.0) <= _MET


def equations_of(scene: Scene, tasks: Kept) -> int:
    """Return the number of independent equations along a path: of loops, of a scene's path constraints, and of tasks
    (generic rank)."""
    mechanism, state = scene.mechanism, State(scene.mechanism, scene.start, 1.0)
    kept = [GivenTask(task, state) for task in tasks if not isinstance(task, Range)]
    return mechanism.loop_rank + task_rank(mechanism, mechanism.structure.system, [*path_tasks(scene), *kept])


def projection(scene: Scene, tasks: Kept = ()) -> Projection | None:
    """Return the projection onto the configurations on which a scene's path constraints and tasks are satisfied and
    loops are closed, within limits; None without any."""
    if tasks:
        return TaskProjection(scene.mechanism, path_tasks(scene), tasks)
    if not scene.path_constraints:
        return None
    local = LocalIK(scene.mechanism, path_tasks(scene))

    def project(q: Array) -> Array | None:
        return local.best if local.solve(q, _RESIDUAL) and local.closure <= CLOSURE else None

    return project
