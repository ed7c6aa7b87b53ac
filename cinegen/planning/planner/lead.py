"""`Lead`: leads a mechanism to its goal, around what is in the way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.objectives import State
from cinegen.planning.planner.attraction import Attraction
from cinegen.planning.vortices import Vortices

Array = NDArray[np.float64]

_AHEAD = 60  # steps that are looked ahead to see what is in the way
_AT_ONCE = 10  # of them
_EVERY = 4  # steps: so often it is looked again
_ARRIVED = 1e-6  # rad or lengths


class Lead:
    """An objective: the attraction, turned by vortices around what going on straight would hit.

    Args:
        attraction: that leads to the goal.
        vortices: that turn.
    """

    def __init__(self, attraction: Attraction, vortices: Vortices) -> None:
        self.attraction, self.vortices = attraction, vortices
        self._ticks, self._looked = 0, -_EVERY
        self._hit: frozenset[int] = frozenset()

    def velocity(self, state: State) -> Array:
        """(nv,) rad/s and m/s."""
        q = state.q
        motion = state.mechanism.difference(q, self.attraction.ahead(q)[0])
        self._ticks += 1
        return self.vortices.turn(q, motion, lambda: self._in_the_way(q)) / state.dt

    def _in_the_way(self, q: Array) -> frozenset[int]:
        """What would be hit first if nothing turned."""
        if self._ticks - self._looked < _EVERY:
            return self._hit
        self._looked, self._hit = self._ticks, frozenset()
        for _ in range(_AHEAD // _AT_ONCE):
            way = self.attraction.ahead(q, _AT_ONCE)
            self._hit = next((hit for hit in map(self.vortices.hits, way) if hit), frozenset())
            if self._hit or np.abs(way[-1] - q).max(initial=0.0) < _ARRIVED:
                break
            q = way[-1]
        return self._hit
