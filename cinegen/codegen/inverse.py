"""Starts of the inverse kinematics of generated code, and the same search in Python."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.codegen.inverse_kernels import InverseMemory
from cinegen.ik.global_ik import placement_weights
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.task import FrameTask
from cinegen.jit.foreign import frame_of
from cinegen.model import Mechanism
from cinegen.tolerances import CLOSURE

STARTS = 8
"""Configurations that the code keeps: 8 nq bytes each."""

ITERATIONS = 60
"""Largest number of iterations from one start."""

TOLERANCE = 1e-6
"""Largest error of a target in recorded cases, m and rad."""

_SAMPLES = 200  # of which starts are chosen


class InverseKinematics:
    """The search of generated code in Python: from a configuration, then from a few starts, the nearest first.

    Args:
        mechanism: mechanism.
        tasks: frames with targets.

    Attributes:
        starts: (STARTS, nq) closed configurations, far from each other.
        frames: (STARTS, tasks, 4, 3) of the tasks there.
        weights: (tasks, 4) of a task's three axes and its origin in the distance of two frames, squared.
    """

    def __init__(self, mechanism: Mechanism, tasks: Sequence[FrameTask]) -> None:
        self._local = LocalIK(mechanism, tuple(tasks))
        closing = LocalIK(mechanism) if mechanism.is_constrained else self._local
        samples = closing.samples(_SAMPLES, np.random.default_rng(0))
        frames = np.array([self._frames(self._local.placements(q)) for q in samples])
        self.weights = np.array(
            [
                np.append(np.broadcast_to(angular, 3), linear) ** 2
                for linear, angular in (placement_weights(task, mechanism.length) for task in tasks)
            ]
        )
        chosen = [0]
        nearest = self._distances(frames, frames[0])
        while len(chosen) < min(STARTS, len(samples)):  # each is the farthest from those before
            chosen.append(int(nearest.argmax()))
            nearest = np.minimum(nearest, self._distances(frames, frames[chosen[-1]]))
        self.starts, self.frames = samples[chosen], frames[chosen]
        self.length = mechanism.length

    @staticmethod
    def _frames(placements: Sequence[pin.SE3]) -> Array:
        return np.array([frame_of(placement) for placement in placements])

    def _distances(self, frames: Array, target: Array) -> Array:
        """Return the squared distances (n,) of frames (n, tasks, 4, 3)."""
        return np.asarray((self.weights * ((frames - target) ** 2).sum(axis=-1)).sum(axis=(1, 2)))

    def set_up(self, memory: InverseMemory) -> None:
        """Write the starts into a memory with its tasks."""
        memory.resize(starts=len(self.starts), equations=memory.task_rows + memory.rows)
        memory.start_q[:], memory.start_weights[:] = self.starts, self.weights
        memory.most_iterations = ITERATIONS

    def find(self, targets: Sequence[pin.SE3], q: Array, tolerance: float) -> tuple[Array | None, int]:
        """Return the configuration (nq,) that is found, or None, and the number of iterations.

        Args:
            targets: pose of each task.
            q: (nq,) first start.
            tolerance: largest error, m and rad.
        """
        local, iterations = self._local, 0
        for task, target in zip(local.tasks, targets, strict=True):
            task.target = target
        order = np.argsort(self._distances(self.frames, self._frames(targets)), kind="stable")
        for start in (q, *self.starts[order]):
            solved = local.solve(start, 0.5 * min(tolerance, tolerance / self.length))
            iterations += local.iterations
            if solved and local.closure <= CLOSURE:
                return local.best, iterations
        return None, iterations


def most_iterations(memory: InverseMemory) -> int:
    """Return the largest number of iterations of a search."""
    return (memory.starts + 1) * (memory.most_iterations + 1)
