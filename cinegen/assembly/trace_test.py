"""The trace test: whether a set of solutions is complete on the curves of configurations that it lies on.

Locked joints move along a line by t; a plane alpha . F + beta t = gamma cuts the curve of configurations in points. The
sum of t over all of them is an affine function of gamma; over some of them it is not, if the plane is general (A.
Sommese, J. Verschelde, C. Wampler, "Symmetric functions applied to decomposing solution sets of polynomial systems",
SIAM J. Numerical Analysis 40, 2002; A. Leykin, J. Rodriguez, F. Sottile, "Trace test", Arnold Math. J. 4, 2018). So the
points of one plane are gathered, by closed paths of planes, until their trace is affine; continued to the plane t = 0
they are all solutions there, or go to infinity.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.assembly._kernels.tables import ARRIVED, INFINITE, Complex, ParameterPath
from cinegen.assembly.distinct_solutions import DistinctSolutions
from cinegen.assembly.linkage import ACCURACY, Linkage
from cinegen.assembly.linkage_tables import Tracked

_QUIET = 12  # closed paths without new points, after which it is given up
_WEIGHTS = 0.3, 1.0, 3.0, 10.0  # of alpha: near poles little is permuted if it is small, elsewhere if it is large
_STEPS = (1.3 + 0.7j, 2.6 + 1.4j, -0.9 + 1.1j)  # of gamma; the second is twice the first
_HIDDEN = 1e-3  # part of the smallest curvature of a single point: a trace with less hides none
_ROUNDING = 1e-11  # of the sum of all |t|
_SHRUNK = 0.2
_LAST = 1e-9
_ATTEMPTS = 3


class TraceResult(NamedTuple):
    """The result of the trace test.

    Attributes:
        complete: whether no point is missing.
        degree: number of points.
        solutions: (count, k + 1) all of them that arrive at t = 0, where locked joints are at `TraceTest.locked`.
        deviation: of the trace from an affine function, relative to the sum of all |t|; NaN if it is not affine.
    """

    complete: bool
    degree: int
    solutions: Complex
    deviation: float = math.nan


class TraceTest:
    """The trace test over a line of joint values that is general and real, so that conjugates of points are points.

    Args:
        linkage: to test.
        home: (locked,) about which values are drawn.
        rng: draws them.
        spent: returns whether to give up.
        report: called with a sentence on the progress.

    Attributes:
        locked: (locked,) values at t = 0.
    """

    def __init__(
        self, linkage: Linkage, home: Array, rng: np.random.Generator, spent: Callable[[], bool],
        report: Callable[[str], None],
    ) -> None:  # fmt: skip
        self._linkage, self._rng, self._spent, self._report = linkage, rng, spent, report
        away, revolute = rng.normal(size=len(home)), linkage.revolute
        self.locked = np.asarray(home + np.where(revolute, away, 0.3 * away) * linkage.driving)
        self._line = np.zeros((len(home), 2), dtype=complex)
        self._line[:, 0] = np.where(revolute, np.tan(0.5 * self.locked), self.locked)
        # where tan is i is a pole; t is about 1 there
        self._line[:, 1] = rng.choice([-1.0, 1.0], size=len(home)) * rng.uniform(0.5, 1.5, size=len(home))
        self._line[~linkage.driving, 1] = 0.0
        self._line[revolute, 1] *= np.abs(self._line[revolute, 0] - 1j)

    def run(self, solutions: Complex) -> TraceResult:
        """Gather points, beginning with solutions (count, k + 1) at `locked`."""
        first = self._plane()
        points = DistinctSolutions(self._features)
        points.add(self._track(solutions, self._linkage.zero_slice, first).arrived)
        quiet = 0
        while len(points) and quiet < _QUIET and not self._spent():
            away, line = self._plane(), self._line * np.exp(0.5j * self._rng.normal(size=self._line.shape))
            tracked = self._track(points.array, first, away, (self._line, line))
            tracked = self._track(tracked.arrived, away, first.conj(), (line, self._line))
            quiet = 0 if points.add(tracked.arrived.conj()) else quiet + 1
            self._report(f"trace test: {len(points)} points of the curve")
            deviation = self._deviation(points.array, first) if quiet else math.nan
            if not math.isnan(deviation):
                zeros = self._at_zero(points.array, first)
                return TraceResult(zeros is not None, len(points), solutions if zeros is None else zeros, deviation)
        return TraceResult(False, len(points), solutions)

    def _plane(self) -> Complex:
        """Return general alpha, beta, gamma (3 f + 2,)."""
        count = len(self._linkage.zero_slice)
        cut = np.asarray(self._rng.normal(size=count) + 1j * self._rng.normal(size=count))
        cut[:-2] *= self._rng.choice(_WEIGHTS) / np.sqrt(max(count - 2, 1))
        return cut

    def _track(
        self, solutions: Complex, start: Complex, goal: Complex, lines: tuple[Complex, Complex] | None = None
    ) -> Tracked:
        path = ParameterPath(np.array(lines or (self._line, self._line)), np.array([start, goal]), True, ACCURACY)
        return self._linkage.track(solutions, path)

    def _features(self, solutions: Complex) -> Complex:
        lines, slices = np.array([self._line] * 2), np.array([self._linkage.zero_slice] * 2)
        path = ParameterPath(lines, slices, True, ACCURACY)
        return np.asarray(np.c_[self._linkage.features(solutions, path), solutions[:, -1:]])

    def _deviation(self, points: Complex, plane: Complex) -> float:
        """Return how far the sum of t over all points is from an affine function of gamma, relative to the sum of all
        |t|; NaN if a point that is missing could explain it."""
        t = [points[:, -1]]
        for step in _STEPS:
            moved = plane.copy()
            moved[-1] += step
            tracked = self._track(points, plane, moved)
            if not (tracked.ends == ARRIVED).all():
                return math.nan
            t.append(tracked.solutions[:, -1])
        curvatures = t[1] - t[0] - 0.5 * (t[2] - t[0]), t[1] - t[0] - _STEPS[0] / _STEPS[2] * (t[3] - t[0])
        scale = float(np.abs(t).sum(axis=1).max())
        floor = _ROUNDING * scale
        for curvature in curvatures:
            curved = np.abs(curvature)[np.abs(curvature) > floor]
            if abs(curvature.sum()) > max(_HIDDEN * curved.min(initial=np.inf) if len(curved) else 0.0, floor):
                return math.nan
        return max(abs(complex(curvature.sum())) for curvature in curvatures) / scale

    def _at_zero(self, points: Complex, plane: Complex) -> Complex | None:
        """Return what of all points arrives at t = 0; None if some go neither there nor to infinity."""
        for _ in range(_ATTEMPTS):
            at_zero = self._follow(points, plane)
            if at_zero is not None:
                return at_zero
            other = self._plane()
            around = self._track(self._track(points, plane, other).solutions, other, plane)
            if (around.ends == ARRIVED).all():
                points = around.solutions  # in another order: other paths
        return None

    def _follow(self, points: Complex, plane: Complex) -> Complex | None:
        """Follow points once: alpha and gamma shrink by ten and by ten again. So does a t that tends to 0; a point that
        keeps its t can only do that by an F that grows."""
        zero, arrivals, part = self._linkage.zero_slice, [], 1e-3
        now, nearer = plane, zero + part * (plane - zero)
        tracked = self._track(points, now, nearer)
        while len(tracked.solutions) and part > _LAST:
            t, points, now = tracked.solutions[:, -1], tracked.solutions, nearer
            infinite = tracked.ends == INFINITE
            if not (infinite | (tracked.ends == ARRIVED)).all():
                return None
            part *= 0.1
            nearer = zero + part * (plane - zero)
            tracked = self._track(points[~infinite], now, nearer)
            shrunk = np.abs(tracked.solutions[:, -1]) / np.maximum(np.abs(t[~infinite]), 1e-300)
            at_zero = (tracked.ends == ARRIVED) & (shrunk < _SHRUNK)
            last = self._track(tracked.solutions[at_zero], nearer, zero)
            if not (last.ends == ARRIVED).all():
                return None
            arrivals.append(last.solutions)
            going = ~at_zero & ((shrunk < 1.0 - _SHRUNK) | (tracked.ends != ARRIVED))
            tracked = Tracked(*(part_of[going] for part_of in tracked))
        return np.vstack(arrivals) if not len(tracked.solutions) else None
