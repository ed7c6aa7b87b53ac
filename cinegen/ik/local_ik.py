"""Local inverse kinematics: a configuration from one start, by Levenberg-Marquardt iterations; and samples as
starts."""

from __future__ import annotations

from functools import partial

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.ik._kernels.local_ik import solve
from cinegen.ik._kernels.memory import LocalIKMemory
from cinegen.ik.setup import set_up, set_up_tasks
from cinegen.ik.task import FrameTask
from cinegen.jit.one_thread import OneThread, in_one_thread
from cinegen.jit.starting import start
from cinegen.model import Mechanism

_ITERATIONS = 60  # from one start
_STRIDE = 0.6  # rad or lengths: from one configuration of the tree to the next


class LocalIK(OneThread):
    """Local solver of the inverse kinematics of some nodes, all loops closed. For one thread at a time.

    Set the targets of its `tasks`, then call `solve`.

    Args:
        mechanism: mechanism.
        tasks: frames with targets, of which copies are made; none, to close loops only.
        limits: whether joints keep their position limits.
        holds_base: whether a floating base stays where a start has it.

    Attributes:
        mechanism: mechanism.
        tasks: the copies.
    """

    def __init__(
        self, mechanism: Mechanism, tasks: tuple[FrameTask, ...] = (), limits: bool = True, holds_base: bool = False
    ) -> None:
        self._solve = start(solve, LocalIKMemory, install=partial(setattr, self, "_solve"))
        self.mechanism = mechanism
        self.tasks = tuple(task.copy(mechanism.frame_id(task.node)) for task in tasks)
        self._memory = memory = LocalIKMemory()
        set_up(memory, mechanism, 6 if mechanism.floating and holds_base else 0)
        set_up_tasks(memory, mechanism, self.tasks)
        memory.resize(equations=memory.task_rows + memory.rows)
        memory.most_iterations = _ITERATIONS
        if not limits:
            memory.lower[:], memory.upper[:] = -np.inf, np.inf
        scalar = memory.q_index >= 0
        scalar[[column - memory.fixed for column in mechanism.structure.held_columns]] = False
        self._at = memory.q_index[scalar]
        low, high, scale = memory.lower[scalar], memory.upper[scalar], memory.scale[scalar]
        reach = np.where(scale == 1.0, np.pi, mechanism.length)  # of joints without limits
        middle = mechanism.structure.held_at[self._at]
        self._scale = scale
        self._low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, middle) - reach)
        self._high = np.where(np.isfinite(high), high, np.where(np.isfinite(low), low, middle) + reach)

    # --- one start -----------------------------------------------------------------------------------------------

    @in_one_thread
    def solve(self, start: Array, goal: float) -> bool:
        """Iterate from a start; the best configuration found becomes `best`.

        Args:
            start: (nq,) loops closed or not.
            goal: residual to reach, rad or characteristic lengths.

        Returns:
            Whether all residuals are below the goal.
        """
        memory = self._memory
        memory.trial[:], memory.goal_residual = start, goal
        return bool(self._solve(memory.handle))

    @property
    def best(self) -> Array:
        """(nq,) best configuration from the last start."""
        return self._memory.q.copy()

    @property
    def cost(self) -> float:
        """Sum of all squared residuals there."""
        return float(self._memory.cost)

    @property
    def closure(self) -> float:
        """Largest loop residual there, rad or characteristic lengths."""
        return float(self._memory.loops_left)

    @property
    def iterations(self) -> int:
        """Number of iterations from the last start."""
        return int(self._memory.iterations)

    # --- starts --------------------------------------------------------------------------------------------------

    def random_start(self, rng: np.random.Generator) -> Array:
        """Return a configuration (nq,) with all joints at random within their limits, loops open."""
        q = self.mechanism.structure.held_at.copy()
        q[self._at] = rng.uniform(self._low, self._high)
        return q

    def samples(self, count: int, rng: np.random.Generator) -> Array:
        """Return up to `count` configurations (count, nq) that can be reached from home, loops closed and within
        limits.

        With loops, they are a tree that grows from home towards random configurations (S. M. LaValle,
        "Rapidly-exploring random trees", 1998); without, random configurations.
        """
        if not self.mechanism.is_constrained:
            return np.array([self.random_start(rng) for _ in range(count)])
        home = self.mechanism.structure.held_at
        configurations, points = [home], [home[self._at] / self._scale]
        for _ in range(4 * count if len(self._at) else 0):
            if len(configurations) == count:
                break
            wanted = self.random_start(rng)[self._at] / self._scale
            known = np.array(points)
            nearest = ((known - wanted) ** 2).sum(axis=1).argmin()
            direction = wanted - known[nearest]
            start = home.copy()
            part = min(1.0, _STRIDE / max(float(np.abs(direction).max()), 1e-12))
            start[self._at] = (known[nearest] + part * direction) * self._scale
            if self.solve(start, 1e-10):
                configurations.append(self.best)
                points.append(self.best[self._at] / self._scale)
        return np.array(configurations)

    def placements(self, q: Array) -> list[pin.SE3]:
        """Return the poses at q (nq,) of all frames that have targets."""
        return [self.mechanism.placement(q, task.node) * task.offset for task in self.tasks]
