"""`Closer`: closes a mechanism's loops as `raff2urdf.closure.close` does, compiled."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.joints import other_joints
from cinegen.loops._kernels import memory as m
from cinegen.loops._kernels.newton import FOUND, ONWARD, newton, prepare_newton
from cinegen.loops.arrays import memory_of
from cinegen.loops.closed_loops import ClosedLoops
from raff2urdf import closure

Array = NDArray[np.float64]


class Closer:
    """Takes the steps of `raff2urdf.closure.close` in a tenth of the time where a few suffice and the rank is clear,
    and else calls it. For one thread at a time: it keeps scratch data.

    Args:
        system: the loops, for nobody else.
        rank: of their Jacobian, generic.
    """

    def __init__(self, system: ClosedLoops, rank: int) -> None:
        self._system, self._model, self._data = system, system.model, system.data
        if self._model.nv == 0:
            return
        prepare_newton()
        memory = memory_of(system, rank)
        self._memory, self._table = memory, memory.table
        self._q, self._trial = memory.arrays["q"], memory.arrays["trial"]
        self._before, self._delta = memory.arrays["before"], memory.arrays["delta"]
        self._idle = (memory.arrays["signs"] == 0.0).all(axis=0)  # joints in no loop
        self._others = other_joints(self._model, ~self._idle)
        self._locked: Array | None = None

    def close(self, q: Array, locked: Array) -> closure.Closing:
        """Return the best configuration that Gauss-Newton steps reach from q (nq,), and its gap.

        Args:
            q: where to begin; the gap is NaN where a number is not finite.
            locked: (nv,) 1 for degrees of freedom that stay, else 0; not to be changed.
        """
        if self._model.nv and self._newton(q, locked):
            return closure.Closing(self._q.copy(), 0.0)
        if not np.isfinite(q).all():
            return closure.Closing(q, np.nan)
        return closure.close(self._system, q.copy(), locked == 0.0)

    def _newton(self, q: Array, locked: Array) -> bool:
        """Return whether the kernel closes the loops; then `_q` is closed to `closure.CLOSED`."""
        if locked is not self._locked:
            self._memory.arrays["held"][:] = np.where(self._idle, 1.0, locked)
            self._locked = locked
        table, trial, model, data = self._table, self._trial, self._model, self._data
        trial[:] = q
        table[m.CORRECTIONS] = 0
        pin.computeJointJacobians(model, data, trial)
        request = newton(table)
        while request == ONWARD:
            if self._others is not None:
                at_q, _ = self._others
                trial[at_q] = pin.integrate(model, self._before, self._delta)[at_q]
            pin.computeJointJacobians(model, data, trial)
            request = newton(table)
        return bool(request == FOUND)
