"""The ends of paths that don't end in a regular solution: points where solutions coincide, and infinity.

Near its end a path is a Laurent series in (1 - s)^(1/c): c solutions are permuted cyclically when s goes around 1. The
mean of an analytic function over the c revolutions is its value at the end, if it has one (A. Morgan, A. Sommese, C.
Wampler, "Computing singular solutions to nonlinear analytic systems", Numerische Mathematik 58, 1991: Cauchy's
integral). Means are taken of features, not of joint values: an angle may come back with a whole revolution, a gimbal
does not come back at all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, Bools, Integers
from cinegen.assembly._kernels.tables import ARRIVED, INFINITE, LOST, SINGULAR, Complex
from cinegen.assembly.distinct_solutions import SAME
from cinegen.assembly.linkage import Linkage
from cinegen.assembly.linkage_tables import Tracked

_REGULAR = 1e-6  # smallest pivot over the largest
_FIRST, _SMALLEST, _SHRINK = 1e-2, 1e-9, 0.1  # radii of the circles about s = 1
_NEARER = 1e-3  # of the last circle's radius: solutions are continued to there
_CORNERS = 8  # of a revolution
_REVOLUTIONS = 8  # more solutions than this don't coincide in one point
_BACK = 1e-8  # of the features' size: a path has come back
_AGREE = 1e-7  # means over two circles, if nothing but the end lies within
_GROWS = 1.3  # features on a circle against those on one ten times larger: (10)^(1/8) at a pole


class PathEnds(NamedTuple):
    """The ends of paths to given values of the locked joints.

    Attributes:
        ends: (count,) ARRIVED: regular; SINGULAR: others coincide there, or joints are locked; INFINITE; or LOST.
        solutions: (count, k + 1) the unknowns at the end; of singular ones a little before it.
        features: (count, 3 f) at the end.
    """

    ends: Integers
    solutions: Complex
    features: Complex

    def count(self, end: int) -> int:
        """Return how many end so."""
        return int((self.ends == end).sum())


def path_ends(linkage: Linkage, solutions: Complex, start: Complex, goal: Complex | Array) -> PathEnds:
    """Continue solutions straight from general values of the locked joints to others that may be singular.

    Args:
        linkage: to solve.
        solutions: (count, k + 1) at the start, all different.
        start: (locked,) general.
        goal: (locked,).
    """
    tracked = linkage.track(solutions, linkage.straight(start, goal))
    reached, ends, features = tracked.solutions, tracked.ends.copy(), linkage.features(tracked.solutions, goal)
    ends[(ends == ARRIVED) & (tracked.pivots < _REGULAR)] = SINGULAR
    ends[_duplicates(features, ends == ARRIVED)] = LOST
    left = np.flatnonzero(ends != ARRIVED)
    if len(left):
        ends[left], reached[left], features[left] = _Circles(linkage, start, goal).ends(solutions[left])
    return PathEnds(ends, reached, features)


def _duplicates(features: Complex, among: Bools) -> Bools:
    """Return which ends (count,) coincide with another although both are regular: a path has jumped."""
    rows = np.flatnonzero(among)
    close = np.abs(features[rows, None] - features[rows]).max(axis=2, initial=0.0) < SAME
    duplicates = np.zeros(len(features), dtype=bool)
    duplicates[rows] = close.sum(axis=1) > 1
    return duplicates


class _Circles:
    """Paths on ever smaller circles about the goal."""

    def __init__(self, linkage: Linkage, start: Complex, goal: Complex | Array) -> None:
        self._linkage, self._start, self._goal = linkage, start, goal

    def ends(self, solutions: Complex) -> tuple[Integers, Complex, Complex]:
        """Return ends, solutions and features of paths that don't end in regular solutions."""
        linkage, count = self._linkage, len(solutions)
        tracked = linkage.track(solutions, linkage.straight(self._start, self._at(_FIRST)))
        points, ends = tracked.solutions, np.where(tracked.ends == ARRIVED, SINGULAR, LOST)
        features = linkage.features(points, self._goal)
        ends[_duplicates(linkage.features(points, self._at(_FIRST)), ends == SINGULAR)] = LOST
        before, sizes = np.full(features.shape, np.inf, dtype=complex), np.full(count, np.inf)
        going, radius, grown = ends == SINGULAR, _FIRST, np.zeros(count, dtype=np.int64)
        while going.any() and radius >= _SMALLEST:
            rows = np.flatnonzero(going)
            means, largest, closed = self._means(points[rows], radius)
            grown[rows] = np.where(closed & (largest > _GROWS * sizes[rows]), grown[rows] + 1, 0)
            done = closed & (np.abs(means - before[rows]).max(axis=1) < _AGREE * (1.0 + np.abs(means).max(axis=1)))
            features[rows[done]] = means[done]
            nearer = self._move(points[rows[done]], radius, _NEARER * radius)
            points[rows[done]] = np.where((nearer.ends == ARRIVED)[:, None], nearer.solutions, points[rows[done]])
            ends[rows[~done & (grown[rows] >= 3)]] = INFINITE
            going[rows[done | (grown[rows] >= 3)]] = False
            before[rows], sizes[rows] = np.where(closed[:, None], means, np.inf), largest
            rows = np.flatnonzero(going)
            tracked = self._move(points[rows], radius, _SHRINK * radius)
            points[rows] = tracked.solutions
            ends[rows[tracked.ends != ARRIVED]] = LOST
            going &= ends == SINGULAR
            radius *= _SHRINK
        ends[going] = LOST
        return ends, points, features

    def _at(self, radius: complex) -> Complex:
        """Return the values of the locked joints at s = 1 - radius."""
        return np.asarray(self._goal + radius * (self._start - self._goal), dtype=complex)

    def _move(self, solutions: Complex, start: complex, goal: complex) -> Tracked:
        """Continue solutions from s = 1 - start to s = 1 - goal."""
        return self._linkage.track(solutions, self._linkage.straight(self._at(start), self._at(goal)))

    def _means(self, solutions: Complex, radius: float) -> tuple[Complex, Array, Bools]:
        """Return means of features over a circle, the largest ones on it, and whether it closed, for each solution."""
        linkage, count = self._linkage, len(solutions)
        first = linkage.features(solutions, self._at(radius))
        points, total, corners = solutions.copy(), np.zeros_like(first), np.zeros(count)
        largest, closed, going = np.abs(first).max(axis=1), np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
        for corner in range(_CORNERS * _REVOLUTIONS):
            rows = np.flatnonzero(going)
            if not len(rows):
                break
            begin, end = (radius * np.exp(2j * np.pi * k / _CORNERS) for k in (corner, corner + 1))
            tracked = self._move(points[rows], begin, end)
            points[rows] = tracked.solutions
            going[rows[tracked.ends != ARRIVED]] = False
            features = linkage.features(tracked.solutions, self._at(end))
            total[rows] += features
            corners[rows] += 1
            largest[rows] = np.maximum(largest[rows], np.abs(features).max(axis=1))
            if (corner + 1) % _CORNERS == 0:
                apart = np.abs(features - first[rows]).max(axis=1)
                back = apart < _BACK * (1.0 + np.abs(first[rows]).max(axis=1))
                closed[rows] = back & going[rows]
                going[rows[back]] = False
        return total / np.maximum(corners, 1)[:, None], largest, closed
