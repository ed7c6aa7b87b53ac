"""Where paths end that don't end in a regular solution: points where solutions meet, and infinity.

Near its end a path is a Laurent series in (1 - s)^(1/c): c solutions go round in a cycle when s goes round 1. The mean
of what is analytic over the c rounds is its value at the end, if it has one (A. Morgan, A. Sommese, C. Wampler,
"Computing singular solutions to nonlinear analytic systems", Numerische Mathematik 58, 1991: Cauchy's integral). Joint
values are not what goes round here (an angle may come back with a whole turn, a gimbal does not come back at all):
features are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly._kernels import ARRIVED, INFINITE, LOST, SINGULAR, Complex
from cinegen.assembly.distinct import SAME
from cinegen.assembly.linkage import Array, Linkage

_REGULAR = 1e-6  # smallest pivot over the largest
_FIRST, _SMALLEST, _SHRINK = 1e-2, 1e-9, 0.1  # radii of the circles about s = 1
_NEARER = 1e-3  # of the last circle's radius: where what was found is led to
_CORNERS = 8  # of a round
_ROUNDS = 8  # more solutions than this don't meet in one point
_BACK = 1e-8  # of the features' size: a path has come back
_AGREE = 1e-7  # means over two circles, where nothing but the end lies within
_GROWS = 1.3  # features on a circle against those on the one ten times larger: (10)^(1/8) at a pole


class Ends(NamedTuple):
    """How solutions end that were led to values of the motors.

    Attributes:
        kinds: (count,) ARRIVED: regular; SINGULAR: others meet there, or joints are locked; INFINITE; or LOST.
        solutions: (count, k + 1) the unknowns at the end; of singular ones a little before it.
        features: (count, 3 f) at the end.
    """

    kinds: NDArray[np.int64]
    solutions: Complex
    features: Complex

    def count(self, kind: int) -> int:
        """How many end so."""
        return int((self.kinds == kind).sum())


def ends(linkage: Linkage, solutions: Complex, start: Complex, goal: Complex | Array) -> Ends:
    """Leads solutions straight from general values of the motors to others that may be singular.

    Args:
        linkage: whose.
        solutions: (count, k + 1) at the start, all different.
        start: (motors,) general.
        goal: (motors,).
    """
    led = linkage.lead(solutions, linkage.way(start, goal))
    there, kinds, features = led.solutions, led.ends.copy(), linkage.features(led.solutions, goal)
    kinds[(kinds == ARRIVED) & (led.pivots < _REGULAR)] = SINGULAR
    kinds[_met(features, kinds == ARRIVED)] = LOST
    rest = np.flatnonzero(kinds != ARRIVED)
    if len(rest):
        circles = _Circles(linkage, start, goal)
        kinds[rest], there[rest], features[rest] = circles.ends(solutions[rest])
    return Ends(kinds, there, features)


def _met(features: Complex, among: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(count,) which regular ends are the same as another: a path has jumped."""
    met = np.zeros(len(features), dtype=bool)
    rows = np.flatnonzero(among)
    for i, k in enumerate(rows):
        same = rows[:i][np.abs(features[rows[:i]] - features[k]).max(axis=1, initial=0.0) < SAME]
        met[same] = True
        met[k] |= len(same) > 0
    return met


class _Circles:
    """Paths on ever smaller circles about the goal."""

    def __init__(self, linkage: Linkage, start: Complex, goal: Complex | Array) -> None:
        self._linkage, self._start, self._goal = linkage, start, goal

    def ends(self, solutions: Complex) -> tuple[NDArray[np.int64], Complex, Complex]:
        """Kinds, solutions and features of paths whose ends are not regular."""
        linkage, count = self._linkage, len(solutions)
        led = linkage.lead(solutions, linkage.way(self._start, self._at(_FIRST)))
        here = led.solutions
        kinds = np.where(led.ends == ARRIVED, SINGULAR, LOST)
        features = linkage.features(here, self._goal)
        kinds[_met(linkage.features(here, self._at(_FIRST)), kinds == SINGULAR)] = LOST
        before = np.full(features.shape, np.inf, dtype=complex)
        sizes = np.full(count, np.inf)
        going, radius, grown = kinds == SINGULAR, _FIRST, np.zeros(count, dtype=np.int64)
        while going.any() and radius >= _SMALLEST:
            rows = np.flatnonzero(going)
            means, largest, closed = self._round(here[rows], radius)
            grown[rows] = np.where(closed & (largest > _GROWS * sizes[rows]), grown[rows] + 1, 0)
            done = closed & (np.abs(means - before[rows]).max(axis=1) < _AGREE * (1.0 + np.abs(means).max(axis=1)))
            features[rows[done]] = means[done]
            here[rows[done]] = self._nearer(here[rows[done]], radius)
            kinds[rows[~done & (grown[rows] >= 3)]] = INFINITE
            going[rows[done | (grown[rows] >= 3)]] = False
            before[rows], sizes[rows] = np.where(closed[:, None], means, np.inf), largest
            rows = np.flatnonzero(going)
            led = linkage.lead(here[rows], linkage.way(self._at(radius), self._at(_SHRINK * radius)))
            here[rows] = led.solutions
            kinds[rows[led.ends != ARRIVED]] = LOST
            going &= kinds == SINGULAR
            radius *= _SHRINK
        kinds[going] = LOST
        return kinds, here, features

    def _nearer(self, solutions: Complex, radius: float) -> Complex:
        """Solutions on a circle, led towards its centre."""
        led = self._linkage.lead(solutions, self._linkage.way(self._at(radius), self._at(_NEARER * radius)))
        return np.asarray(np.where((led.ends == ARRIVED)[:, None], led.solutions, solutions))

    def _at(self, radius: complex) -> Complex:
        """Motors there: s = 1 - radius."""
        return np.asarray(self._goal + radius * (self._start - self._goal), dtype=complex)

    def _round(self, solutions: Complex, radius: float) -> tuple[Complex, Array, NDArray[np.bool_]]:
        """Means of features over a circle, the largest ones on it, and whether it closed, for each solution."""
        linkage, count = self._linkage, len(solutions)
        first = linkage.features(solutions, self._at(radius))
        apart = _BACK * (1.0 + np.abs(first).max(axis=1))
        here, total, corners = solutions.copy(), np.zeros_like(first), np.zeros(count)
        largest, closed, going = np.abs(first).max(axis=1), np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
        for corner in range(_CORNERS * _ROUNDS):
            rows = np.flatnonzero(going)
            if not len(rows):
                break
            turns = [np.exp(2j * np.pi * k / _CORNERS) for k in (corner, corner + 1)]
            led = linkage.lead(here[rows], linkage.way(self._at(radius * turns[0]), self._at(radius * turns[1])))
            here[rows] = led.solutions
            going[rows[led.ends != ARRIVED]] = False
            features = linkage.features(led.solutions, self._at(radius * turns[1]))
            total[rows] += features
            corners[rows] += 1
            largest[rows] = np.maximum(largest[rows], np.abs(features).max(axis=1))
            if (corner + 1) % _CORNERS == 0:
                back = np.abs(features - first[rows]).max(axis=1) < apart[rows]
                closed[rows] = back & going[rows]
                going[rows[back]] = False
        return total / np.maximum(corners, 1)[:, None], largest, closed
