"""`ClearanceBarrier`: keeps a mechanism at a safety distance from obstacles and from itself, whatever drives it."""

from __future__ import annotations

import math
from heapq import heapify, heappop, heappush
from itertools import pairwise

import numpy as np

from cinegen.arrays import Array, Integers
from cinegen.collision.clearance import Clearance
from cinegen.collision.errors import PlanningError
from cinegen.ik.barrier import Bounds
from cinegen.ik.state import State
from cinegen.model import Mechanism

STOP = 1.25
"""Distance at which the velocity damper stops links, as a multiple of the safety distance. The second-order error of a
step is smaller than the rest."""

_LEAST_MARGIN = 1e-3  # characteristic lengths between the stop distance and the safety distance, at least
_APPROACH = 60.0  # 1/s: rate of approach in interactive motion
_RANGE = 0.25  # characteristic lengths beyond the stop distance: pairs further apart have no bound
_MOST_CHECKS = 64  # configurations on the motion of one step
_MOST_HALVINGS = 12  # of a segment of a path
_RETREAT = 0.5  # fraction of a missing distance that a tick restores


def stop_distance(mechanism: Mechanism, safety: float) -> float:
    """Return the distance (m) at which the damper stops links, for a safety distance (m)."""
    return max(STOP * safety, safety + _LEAST_MARGIN * mechanism.length)


class ClearanceBarrier:
    """Barrier of a solver: no step comes nearer than the safety distance, anywhere on its motion.

    A velocity damper slows down links as they approach (B. Faverjon and P. Tournassoud, "A local based approach for
    path planning of manipulators with a high number of degrees of freedom", 1987): in each tick they use up a fraction
    of the remaining distance. That is linear, so each step is checked by conservative advancement before it is made: if
    the distances of two bodies at its ends are a and b, and neither moves by more than w in between, their distance is
    never below (a + b - w) / 2 (B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", 1996); where that
    bound is too small, the step is halved.

    Pairs that are nearer already, because an obstacle was moved, may only separate.

    Args:
        clearance: distances of the mechanism.
        safety: safety distance, m.
        approach: rate at which the remaining distance may be used up, 1/s: a tick of dt may use up the fraction
            1 - exp(-approach dt).

    Attributes:
        pairs: pair of each row of the last bounds.

    Raises:
        PlanningError: the safety distance or the rate is invalid.
    """

    __slots__ = ("__weakref__", "_safety", "_stop_distance", "approach", "clearance", "pairs")

    def __init__(self, clearance: Clearance, safety: float, approach: float = _APPROACH) -> None:
        if not approach > 0.0:
            raise PlanningError(f"the rate of approach is {approach!r}; give one above 0 (1/s)")
        self.clearance, self.safety, self.approach = clearance, safety, approach
        self.pairs: Integers = np.zeros(0, dtype=np.int64)

    @property
    def safety(self) -> float:
        """Safety distance, m."""
        return self._safety

    @safety.setter
    def safety(self, safety: float) -> None:
        if not 0.0 <= safety < np.inf:
            raise PlanningError(f"the safety distance is {safety!r}; give a finite number of m, 0 or more")
        self._safety, self._stop_distance = safety, stop_distance(self.clearance.mechanism, safety)

    @property
    def stop(self) -> float:
        """Distance at which the damper stops links, m."""
        return self._stop_distance

    def bounds(self, state: State) -> Bounds:
        """Return the bounds of the next tick's velocities."""
        near = self.clearance.near(state.q, self.stop + _RANGE * self.clearance.mechanism.length)
        remaining = near.distances - self.stop
        fraction = np.where(remaining < 0.0, _RETREAT, -math.expm1(-self.approach * state.dt))
        self.pairs = near.pairs.copy()
        return Bounds(near.rows, fraction * np.maximum(remaining, -self.stop) / state.dt)

    def clear(self, state: State, q: Array) -> float:
        """Return 1 if the whole motion from the state to q (nq,) is clear, else 0.5."""
        return 1.0 if is_clear(self.clearance, state.q, q, self.safety) else 0.5


def is_clear(clearance: Clearance, begin: Array, end: Array, safety: float) -> bool:
    """Return whether the whole straight motion between two configurations keeps the safety distance.

    A pair that is nearer at the beginning must not be nearer at the end, and nowhere in between nearer than half of its
    distance at the beginning.
    """
    first, change = (bound.copy() for bound in clearance.motion_bounds(begin, end))
    last = clearance.distances(end)
    floor = np.where(first < safety, 0.5 * first, safety)
    if not (last >= np.minimum(first - 1e-12, safety)).all():
        return False
    if not ((first + last - change < 2.0 * floor) & (first > 0.0)).any():
        return True
    return _is_clear(clearance, begin, end, floor, _MOST_CHECKS) is not None


def _is_clear(clearance: Clearance, begin: Array, end: Array, floor: Array, checks: int) -> int | None:
    """Return how many checks are left after the motion was found clear; None if it is not, or they did not suffice."""
    first, change = (bound.copy() for bound in clearance.motion_bounds(begin, end))
    last = clearance.distances(end)
    if not ((first + last - change < 2.0 * floor) & (first > 0.0)).any():
        return checks
    if checks <= 0:
        return None
    half = clearance.mechanism.interpolate(begin, end, 0.5)
    if ((clearance.distances(half) < floor) & (first > 0.0)).any():
        return None
    left = _is_clear(clearance, begin, half, floor, checks - 1)
    return None if left is None else _is_clear(clearance, half, end, floor, left)


def path_clearance(clearance: Clearance, path: Array, relative: float = 0.05, safety: float = 0.0) -> float:
    """Return a lower bound (m) of all distances along a path (n, nq), joints straight between its configurations.

    The bound is found by conservative advancement. It is at most the fraction `relative` too small (or about 1e-4 of
    the longest motion between two configurations, where nearly everything touches). Loops, closed at the
    configurations, open in between to second order of the step. Where bodies overlap, the result is negative: the
    deepest penetration among the configurations checked.

    Args:
        clearance: distances of the mechanism.
        path: (n, nq) configurations.
        relative: largest relative error of the bound.
        safety: required distance, m: a smaller bound is refined as long as no smaller distance is found.
    """

    def bound(begin: Array, end: Array) -> float:
        first, change = clearance.motion_bounds(begin, end)
        return float((0.5 * (first - change + clearance.distances(end))).min(initial=np.inf))

    least = min(clearance.least(q) for q in path)
    segments = [(bound(begin, end), i, 0, begin, end) for i, (begin, end) in enumerate(pairwise(path))]
    heapify(segments)
    count = len(segments)
    while segments and least > 0.0:
        lowest, _, depth, begin, end = heappop(segments)
        if depth == _MOST_HALVINGS or (lowest >= (1.0 - relative) * least and not lowest < safety <= least):
            return min(lowest, least)
        half = clearance.mechanism.interpolate(begin, end, 0.5)
        least = min(least, clearance.least(half))
        for ends in ((begin, half), (half, end)):
            heappush(segments, (bound(*ends), count, depth + 1, *ends))
            count += 1
    return least
