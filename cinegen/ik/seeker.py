"""`Seeker`: a solver that jumps. It looks for a configuration from one start, and keeps starts that may be near."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels import seek as kernel
from cinegen.ik._kernels.seek import FOUND, ONWARD, nearest_start, prepare_seek, scratch_size, seek
from cinegen.ik.solver import Solver
from cinegen.ik.task import FrameTask
from cinegen.loops._kernels.memory import address
from cinegen.model import Mechanism

Array = NDArray[np.float64]

MOST = 60
"""Iterations from one start."""


class Seeker(Solver):
    """Looks for configurations in which some nodes are where they should be, all loops closed.

    Args:
        mechanism: which.
        tasks: what should be where; none, to close loops only.
        limits: whether joints keep to their position limits.
    """

    def __init__(self, mechanism: Mechanism, tasks: tuple[FrameTask, ...] = (), limits: bool = True) -> None:
        prepare_seek()
        super().__init__(mechanism, dt=1.0)
        arrays, model = self._memory.arrays, self._model
        arrays["longest"][:] = np.inf
        if not limits:
            arrays["low"][:], arrays["high"][:] = -np.inf, np.inf
        for task in tasks:
            self.add_task(task.node, None, task.translation, task.rotation, task.weight, task.axes, task.offset)
        self._write_tasks()
        rows = 6 * len(tasks) + int(self._table[m.ROWS])
        self._scratch = np.zeros(scratch_size(rows, model.nv))
        self._scratch[kernel.MOST] = MOST
        self._s = address(self._scratch)
        self._numbers = arrays["at"] >= 0.0  # joints that are one number each
        self._at = arrays["at"][self._numbers].astype(int)
        low, high = arrays["low"][self._numbers], arrays["high"][self._numbers]
        scale = mechanism.scale[self._numbers]
        reach = np.where(scale == 1.0, np.pi, mechanism.length)  # of joints without limits
        self._scale = scale
        middle = mechanism.q_home[self._at]
        self._low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, middle) - reach)
        self._high = np.where(np.isfinite(high), high, np.where(np.isfinite(low), low, middle) + reach)

    # --- one start -----------------------------------------------------------------------------------------------

    def seek(self, start: Array, goal: float) -> bool:
        """Looks from a start (nq,); the best found becomes `best`. Whether all residuals came below the goal."""
        scratch, table, s, model, data = self._scratch, self._table, self._s, self._model, self._data
        self._trial[:] = start
        scratch[kernel.GOAL], scratch[kernel.FRESH], scratch[kernel.COUNT] = goal, 1.0, 0.0
        scratch[kernel.MU], scratch[kernel.STALLED] = kernel.SOFT, 0.0
        evaluate, trial = self._evaluate, self._trial
        evaluate(model, data, trial)
        request = seek(table, s)
        while request == ONWARD:
            if self._curved is not None:
                self._integrate(*self._curved)
            evaluate(model, data, trial)
            request = seek(table, s)
        return bool(request == FOUND)

    @property
    def best(self) -> Array:
        """(nq,) the best found from the last start."""
        return self._q.copy()

    @property
    def cost(self) -> float:
        """What is left there: the sum of all squared residuals."""
        return float(self._scratch[kernel.COST])

    @property
    def open_by(self) -> float:
        """What is left there of loops."""
        return float(self._scratch[kernel.LOOPS_LEFT])

    @property
    def iterations(self) -> int:
        """How many there were from the last start."""
        return int(self._scratch[kernel.COUNT])

    # --- starts --------------------------------------------------------------------------------------------------

    def anywhere(self, rng: np.random.Generator) -> Array:
        """(nq,) all joints at random within their limits, loops open."""
        q = self.mechanism.q_home.copy()
        q[self._at] = rng.uniform(self._low, self._high)
        return q

    def spread(self, count: int, rng: np.random.Generator) -> Array:
        """(count, nq) configurations all over what can be reached from home, loops closed and within limits.

        With loops, a tree that grows from home towards random places (S. M. LaValle, "Rapidly-exploring random
        trees", 1998). Without, joints at random.
        """
        if not self.mechanism.loops:
            return np.array([self.anywhere(rng) for _ in range(count)])
        home = self.mechanism.q_home
        found, places = [home], [home[self._at] / self._scale]
        for _ in range(4 * count):
            if len(found) == count:
                break
            there = self.anywhere(rng)
            wish = there[self._at] / self._scale
            known = np.array(places)
            near = nearest_start(known, wish, np.zeros(len(known)))
            way = wish - known[near]
            start = home.copy()
            part = min(1.0, _STRIDE / max(float(np.abs(way).max()), 1e-12))
            start[self._at] = (known[near] + part * way) * self._scale
            if self.seek(start, 1e-10):
                found.append(self.best)
                places.append(self.best[self._at] / self._scale)
        return np.array(found)

    def placements(self, q: Array) -> list[pin.SE3]:
        """Of all pulled nodes."""
        return [self.mechanism.placement(q, task.node) * task.offset for task in self.tasks]


_STRIDE = 0.6  # rad or lengths: from one configuration of the tree to the next
