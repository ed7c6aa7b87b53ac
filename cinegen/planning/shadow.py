"""`Shadow`: follows the tasks of another solver as if there were no obstacles."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cinegen.ik import FrameTask, Solver
from cinegen.model import Mechanism

Array = NDArray[np.float64]


class Shadow:
    """Of a solver that is pulled.

    Args:
        mechanism: that is pulled.
        dt: s, a tick.
        gain: its own; that of the other unless given.

    Attributes:
        q: (nq,) where it is, for whoever lets it run ahead; None: nowhere.
    """

    def __init__(self, mechanism: Mechanism, dt: float, gain: float | None = None) -> None:
        self._solver = Solver(mechanism, dt if gain is None else 1.0, gain=math.inf if gain is None else gain)
        self._mechanism, self._kinds = mechanism, list[tuple[object, ...]]()
        self.q: Array | None = None

    def ahead(self, q: Array, tasks: Sequence[FrameTask]) -> Array:
        """(nq,) where a tick leads from q (nq,)."""
        solver = self._solver
        self._follow(tasks)
        solver.q = q
        return solver.step().q

    def motion(self, q: Array, tasks: Sequence[FrameTask], gain: float) -> Array:
        """(nv,) how a tick moves the joints from q (nq,), rad and m."""
        self._solver.gain = gain
        return self._mechanism.difference(q, self.ahead(q, tasks))

    def _follow(self, tasks: Sequence[FrameTask]) -> None:
        solver = self._solver
        kinds: list[tuple[object, ...]] = [(p.node, p.axes, p.translation, p.rotation, p.offset) for p in tasks]
        if kinds != self._kinds:
            for own in solver.tasks:
                solver.remove_task(own)
            for task in tasks:
                solver.add_task(
                    task.node, task.target, task.translation, task.rotation, task.weight, task.axes, task.offset
                )
            self._kinds = kinds
        for own, task in zip(solver.tasks, tasks, strict=True):
            own.target, own.weight = task.target, task.weight
