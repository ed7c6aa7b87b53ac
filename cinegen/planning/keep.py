"""`Keep`: holds a mechanism clear of what is around it, whatever leads it."""

from __future__ import annotations

import math
from heapq import heapify, heappop, heappush
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.clearance import Clearance
from cinegen.collision.errors import AvoidError
from cinegen.ik.barrier import Bounds
from cinegen.ik.objectives import State
from cinegen.model import Mechanism

Array = NDArray[np.float64]

STOP = 1.25
"""Of the safety distance: where the damper lets nothing come nearer. What a step bends is less than the rest."""

_LEAST = 1e-3  # lengths: what is between where links are stopped and the safety distance, at least
_CLOSER = 60.0  # 1/s
_FAR = 0.25  # lengths
_LOOKS = 64  # at configurations on the way of one step, at most
_HALVED = 12  # times that a part of a path is halved, at most
_PUSH = 0.5  # of what a link lacks to where it stops is made good in a tick


def part_in(dt: float) -> float:
    """The part of what is left in front of a link that it may use up in a tick of dt (s), where ticks follow a hand."""
    return -math.expm1(-_CLOSER * dt)


def stop(mechanism: Mechanism, safety: float) -> float:
    """m: where the damper stops links that are to keep a safety distance (m)."""
    return max(STOP * safety, safety + _LEAST * mechanism.length)


class Keep:
    """A barrier: no step leads nearer than the safety distance, nowhere on its way.

    Links slow down as they come near (B. Faverjon and P. Tournassoud, "A local based approach for path planning of
    manipulators with a high number of degrees of freedom", 1987): of what is left in front of them they use a part in
    each tick. That is linear, so each step is looked at before it is made, by conservative advancement: where two
    bodies are a and b apart at its ends, and can't move by more than w on its way, they are never nearer than
    (a + b - w) / 2 (B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996); where that says too
    little, the way is halved.

    What is nearer than that already, because an obstacle was put there, may only go away.

    Args:
        clearance: of the mechanism.
        safety: distance that is kept, m.
        part: of what is left that may be used in a tick, 0 to 1.

    Attributes:
        held: the pairs that the last bounds were about, row by row.

    Raises:
        AvoidError: the safety distance or the part makes no sense.
    """

    def __init__(self, clearance: Clearance, safety: float, part: float = 0.5) -> None:
        if not 0.0 <= safety < np.inf:
            raise AvoidError(f"the safety distance is {safety!r}; give a finite number of m, 0 or more")
        if not 0.0 < part <= 1.0:
            raise AvoidError(f"the part of what is left that a tick may use is {part!r}; give one above 0, 1 at most")
        self.clearance, self.safety, self.part = clearance, safety, part
        self.stop = stop(clearance.mechanism, safety)
        self.held: NDArray[np.int64] = np.zeros(0, dtype=np.int64)

    def bounds(self, state: State) -> Bounds:
        """What holds in the next tick."""
        near = self.clearance.near(state.q, self._range)
        left = near.distances - self.stop
        part = np.where(left < 0.0, _PUSH, self.part)
        self.held = near.pairs.copy()
        return Bounds(near.rows, part * np.maximum(left, -self.stop) / state.dt)

    @property
    def _range(self) -> float:
        """m: from there nothing comes too near in one tick, or the look at the step will say so."""
        return self.stop + _FAR * self.clearance.mechanism.length

    def clear(self, state: State, q: Array) -> float:
        """1 where all of the way from the state to q (nq,) is clear, 0.5 where it is not."""
        return 1.0 if is_clear(self.clearance, state.q, q, self.safety) else 0.5


def is_clear(clearance: Clearance, begin: Array, end: Array, safety: float) -> bool:
    """Return whether all of the straight path between two configurations keeps the safety distance.

    What is nearer than that at the beginning must not be nearer at the end, and nowhere on the path nearer than half of
    its distance at the beginning.
    """
    first, ways = clearance.bounds(begin, end)
    first, ways = first.copy(), ways.copy()
    last = clearance.distances(end)
    floor = np.where(first < safety, 0.5 * first, safety)
    if not (last >= np.minimum(first - 1e-12, safety)).all():
        return False
    unsure = (first + last - ways < 2.0 * floor) & (first > 0.0)
    if not unsure.any():
        return True
    return _is_clear_between(clearance, begin, end, floor, _LOOKS) is not None


def _is_clear_between(clearance: Clearance, begin: Array, end: Array, floor: Array, looks: int) -> int | None:
    """How many looks are left after the way was found to be clear; None if it is not, or they did not suffice."""
    first, ways = clearance.bounds(begin, end)
    first, ways = first.copy(), ways.copy()
    last = clearance.distances(end)
    if not ((first + last - ways < 2.0 * floor) & (first > 0.0)).any():
        return looks
    if looks <= 0:
        return None
    half = clearance.mechanism.interpolate(begin, end, 0.5)
    if ((clearance.distances(half) < floor) & (first > 0.0)).any():
        return None
    left = _is_clear_between(clearance, begin, half, floor, looks - 1)
    return None if left is None else _is_clear_between(clearance, half, end, floor, left)


def least_along(clearance: Clearance, path: Array, sharp: float = 0.05, asked: float = 0.0) -> float:
    """m: a distance that nothing falls below anywhere on a path (n, nq), joints going straight between its points.

    A bound from below, by conservative advancement, no more than `sharp` of it too small (or than about 1e-4 of the
    longest way between two points, where nearly everything touches). Loops, closed at the points, open between them to
    second order of the step. Where it says less than what is asked for, m, though nothing that near is seen, it is
    looked at more closely.

    Where two bodies overlap, the deepest overlap at the points that were looked at, below 0.
    """
    least = min(clearance.least(q) for q in path)
    parts = [(_bound_between(clearance, begin, end), i, 0, begin, end) for i, (begin, end) in enumerate(pairwise(path))]
    heapify(parts)
    count = len(parts)
    while parts and least > 0.0:
        bound, _, depth, begin, end = heappop(parts)  # the least of all
        if depth == _HALVED or (bound >= (1.0 - sharp) * least and not bound < asked <= least):
            return min(bound, least)
        half = clearance.mechanism.interpolate(begin, end, 0.5)
        least = min(least, clearance.least(half))
        for ends in ((begin, half), (half, end)):
            heappush(parts, (_bound_between(clearance, *ends), count, depth + 1, *ends))
            count += 1
    return least


def _bound_between(clearance: Clearance, begin: Array, end: Array) -> float:
    """m: nothing comes nearer than that on the way from one configuration to another."""
    first, ways = clearance.bounds(begin, end)
    return float((0.5 * (first - ways + clearance.distances(end))).min(initial=np.inf))
