"""`Closer`: closes a mechanism's loops as `raff2urdf.closure.close` does, compiled."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from cinegen.jit.starting import start
from cinegen.loops._kernels.closure import close_from_trial
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.loops.arrays import set_up
from cinegen.loops.closed_loops import ClosedLoops
from raff2urdf.closure import Closing

Array = NDArray[np.float64]


class Closer:
    """Closes loops by the steps of `raff2urdf.closure.close`, compiled. For one thread at a time.

    Args:
        system: the loops.
        rank: generic rank of their Jacobian.
    """

    def __init__(self, system: ClosedLoops, rank: int) -> None:
        self._close = start(close_from_trial, LoopMemory, install=partial(setattr, self, "_close"))
        self._memory = set_up(LoopMemory(), system, rank)
        self._idle = np.asarray(
            ~self._memory.loop_signs.any(axis=0)
        )  # joints in no loop or coupling: they do not change at all
        self._idle[self._memory.term_dof] = False
        self._locked: Array | None = None

    def close(self, q: Array, locked: Array) -> Closing:
        """Return the best configuration that Gauss-Newton steps from q (nq,) reach, and its gap.

        Args:
            q: start; the gap is NaN if a number is not finite.
            locked: (nv,) 1 for degrees of freedom that are locked, else 0; must not be modified later.
        """
        memory = self._memory
        if locked is not self._locked:
            memory.locked[:] = np.where(self._idle, 1.0, locked)
            self._locked = locked
        memory.trial[:] = q
        self._close(memory.handle)
        return Closing(memory.trial.copy(), memory.gap)
