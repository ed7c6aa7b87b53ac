"""`Newton`: closes a mechanism's loops from nearby, compiled."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from cinegen.joints import other_joints
from cinegen.loops._kernels import memory as m
from cinegen.loops._kernels.newton import FOUND, ONWARD, newton, prepare_newton
from cinegen.loops.arrays import memory_of
from cinegen.loops.closed_loops import ClosedLoops

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MOST_EXPECTED = 64  # ways of locking joints that are remembered


class Newton:
    """Takes the steps of `raff2urdf.closure.close`, in a tenth of the time, where that is a matter of a few.

    Not for two threads at once: it keeps scratch data.

    Args:
        system: the loops, for this thread alone.
        rank: of their Jacobian, generic.
    """

    def __init__(self, system: ClosedLoops, rank: int) -> None:
        prepare_newton()
        memory = memory_of(system, rank)
        self._model, self._data = system.model, system.data
        self._memory, self._table = memory, memory.table
        self._q, self._trial = memory.arrays["q"], memory.arrays["trial"]
        self._before, self._delta = memory.arrays["before"], memory.arrays["delta"]
        self._idle: Mask = (memory.arrays["signs"] == 0.0).all(axis=0)  # joints that no loop sees
        self._curved = other_joints(self._model, ~self._idle)
        self._shape = (self._model.nq,)
        self._expected: dict[tuple[str, ...], Array] = {}
        self._holds: Array | None = None

    def expect(self, locked: tuple[str, ...], held: Mask) -> None:
        """Says which degrees of freedom (nv,) stay where joints of these names are locked."""
        if len(self._expected) >= _MOST_EXPECTED:
            self._expected.clear()
        self._expected[locked] = np.where(held | self._idle, 1.0, 0.0)

    def close(self, q: ArrayLike, locked: tuple[str, ...]) -> Array | None:
        """The closed configuration (nq,) that `closure.close` finds from q (nq,); None where that is for it to say, or
        where such joints are not expected to be locked."""
        held = self._expected.get(locked)
        given = np.asarray(q, dtype=float)
        if held is None or given.shape != self._shape:
            return None
        if held is not self._holds:
            self._memory.arrays["held"][:] = self._holds = held
        table, trial, model, data = self._table, self._trial, self._model, self._data
        trial[:] = given
        table[m.CORRECTIONS] = 0
        pin.computeJointJacobians(model, data, trial)
        request = newton(table)
        while request == ONWARD:
            if self._curved is not None:
                at_q, _ = self._curved
                trial[at_q] = pin.integrate(model, self._before, self._delta)[at_q]
            pin.computeJointJacobians(model, data, trial)
            request = newton(table)
        return self._q.copy() if request == FOUND else None
