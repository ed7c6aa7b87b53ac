"""`Closer`: closes a mechanism's loops as `raff2urdf.closure.close` does, compiled."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from cinegen.arrays import Array
from cinegen.jit.starting import start
from cinegen.loops._kernels.closure import close_from_trial
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.setup import set_up
from raff2urdf.closure import Closing


class Closer:
    """Closes loops by the steps of `raff2urdf.closure.close`, compiled. For one thread at a time.

    Args:
        system: the loops.
        ranks: generic rank of each cluster of them.
    """

    def __init__(self, system: ClosedLoops, ranks: Sequence[int]) -> None:
        self._close = start(close_from_trial, LoopMemory, install=partial(setattr, self, "_close"))
        self._memory = set_up(LoopMemory(), system, ranks)
        self._locked: Array | None = None

    def close(self, q: Array, locked: Array) -> Closing:
        """Return the best configuration that Gauss-Newton steps from q (nq,) reach, and its gap.

        Args:
            q: start; the gap is NaN if a number is not finite.
            locked: (nv,) 1 for degrees of freedom that are locked, else 0; must not be modified later.
        """
        memory = self._memory
        if locked is not self._locked:
            memory.locked[:] = locked
            self._locked = locked
        memory.trial[:] = q
        self._close(memory.handle)
        return Closing(memory.trial.copy(), memory.gap)
