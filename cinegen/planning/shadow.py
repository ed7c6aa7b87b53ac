"""`Shadow`: follows the pulls of another solver as if there were no obstacles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik import Pull, Solver
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
        self._solver = Solver(mechanism, dt if gain is None else 1.0, gain=gain or 1.0)
        self._mechanism, self._kinds = mechanism, list[tuple[object, ...]]()
        self.q: Array | None = None

    def ahead(self, q: Array, pulls: Sequence[Pull]) -> Array:
        """(nq,) where a tick leads from q (nq,)."""
        solver = self._solver
        self._follow(pulls)
        solver.q = q
        return solver.step().q

    def motion(self, q: Array, pulls: Sequence[Pull], gain: float) -> Array:
        """(nv,) how a tick moves the joints from q (nq,), rad and m."""
        self._solver.gain = gain
        return np.asarray(pin.difference(self._mechanism.model, q, self.ahead(q, pulls)))

    def _follow(self, pulls: Sequence[Pull]) -> None:
        solver = self._solver
        kinds: list[tuple[object, ...]] = [(p.node, p.axes, p.translation, p.rotation, p.at) for p in pulls]
        if kinds != self._kinds:
            for own in solver.pulls:
                solver.release(own)
            for pull in pulls:
                solver.pull(pull.node, pull.target, pull.translation, pull.rotation, pull.weight, pull.axes, pull.at)
            self._kinds = kinds
        for own, pull in zip(solver.pulls, pulls, strict=True):
            own.target, own.weight = pull.target, pull.weight
