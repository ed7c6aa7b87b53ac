"""The trace test: whether a set of solutions is all there is on the curves of configurations that they lie on.

Motors are led along a line by t; a plane alpha . F + beta t = gamma cuts the curve of configurations in points. The sum
of t over all of them is an affine function of gamma; over some of them it is not, if the plane is general (A. Sommese,
J. Verschelde, C. Wampler, "Symmetric functions applied to decomposing solution sets of polynomial systems", SIAM J.
Numerical Analysis 40, 2002; A. Leykin, J. Rodriguez, F. Sottile, "Trace test", Arnold Math. J. 4, 2018). So the points
of one plane are gathered, by closed paths of planes, until their trace is affine; led to the plane t = 0 they are all
solutions there, or go to infinity.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cinegen.assembly._kernels import ARRIVED, INFINITE, Complex, Path
from cinegen.assembly.distinct import Distinct
from cinegen.assembly.linkage import ACCURACY, Array, Led, Linkage

_QUIET = 12  # closed paths that found nothing new, until it is given up
_WEIGHTS = 0.3, 1.0, 3.0, 10.0  # of alpha: near poles little goes round where it is small, elsewhere where it is large
_STEPS = (1.3 + 0.7j, 2.6 + 1.4j, -0.9 + 1.1j)  # of gamma; the second is twice the first
_HIDDEN = 1e-3  # part of the smallest bend of a single point: a trace that is bent less hides none
_ROUNDING = 1e-11  # of the sum of all |t|
_SHRUNK = 0.2
_LAST = 1e-9
_TRIES = 3


class Traced(NamedTuple):
    """What the trace test said.

    Attributes:
        complete: whether no point is missing.
        degree: how many points were found.
        solutions: (count, k + 1) all of them that come to t = 0, where motors are at `Trace.motors`.
        deviation: of the trace from an affine function, relative to the sum of all |t|; NaN where it is not affine.
    """

    complete: bool
    degree: int
    solutions: Complex
    deviation: float = math.nan


class Trace:
    """The trace test over a line of motor values that is general and real, so that conjugates of points are points.

    Args:
        linkage: whose.
        home: (motors,) about which values are drawn.
        rng: draws them.
        spent: whether to give up.
        say: is told how far it is.

    Attributes:
        motors: (motors,) where the line is at t = 0.
    """

    def __init__(
        self, linkage: Linkage, home: Array, rng: np.random.Generator, spent: Callable[[], bool],
        say: Callable[[str], None],
    ) -> None:  # fmt: skip
        self._linkage, self._rng, self._spent, self._say = linkage, rng, spent, say
        away = rng.normal(size=len(home))
        self.motors = np.asarray(home + np.where(linkage.turning, away, 0.3 * away) * linkage.leading)
        self._line = np.zeros((len(home), 2), dtype=complex)
        self._line[:, 0] = np.where(linkage.turning, np.tan(0.5 * self.motors), self.motors)
        # where tan is i is a pole; t is about 1 there
        self._line[:, 1] = rng.choice([-1.0, 1.0], size=len(home)) * rng.uniform(0.5, 1.5, size=len(home))
        self._line[~linkage.leading, 1] = 0.0
        self._line[linkage.turning, 1] *= np.abs(self._line[linkage.turning, 0] - 1j)

    def test(self, solutions: Complex) -> Traced:
        """Gathers points from solutions (count, k + 1) at `motors` on."""
        first = self._plane()
        points = Distinct(self._features)
        points.add(self._lead(solutions, self._linkage.fibre, first).arrived)
        quiet = 0
        while len(points) and quiet < _QUIET and not self._spent():
            away, line = self._plane(), self._line * np.exp(0.5j * self._rng.normal(size=self._line.shape))
            there = self._lead(points.array, first, away, (self._line, line))
            there = self._lead(there.arrived, away, first.conj(), (line, self._line))
            quiet = 0 if points.add(there.arrived.conj()) else quiet + 1
            self._say(f"trace test: {len(points)} points of the curve")
            deviation = self._deviation(points.array, first) if quiet else math.nan
            if not math.isnan(deviation):
                found = self._at_zero(points.array, first)
                return Traced(found is not None, len(points), solutions if found is None else found, deviation)
        return Traced(False, len(points), solutions)

    def _plane(self) -> Complex:
        """(3 f + 2,) alpha, beta, gamma: general."""
        count = len(self._linkage.fibre)
        cut = np.asarray(self._rng.normal(size=count) + 1j * self._rng.normal(size=count))
        cut[:-2] *= self._rng.choice(_WEIGHTS) / np.sqrt(max(count - 2, 1))
        return cut

    def _lead(
        self, solutions: Complex, start: Complex, goal: Complex, lines: tuple[Complex, Complex] | None = None
    ) -> Led:
        path = Path(np.array(lines or (self._line, self._line)), np.array([start, goal]), True, ACCURACY)
        return self._linkage.lead(solutions, path)

    def _features(self, solutions: Complex) -> Complex:
        path = Path(np.array([self._line, self._line]), np.array([self._linkage.fibre] * 2), True, ACCURACY)
        return np.asarray(np.c_[self._linkage.features(solutions, path), solutions[:, -1:]])

    def _deviation(self, points: Complex, plane: Complex) -> float:
        """Return how far the sum of t over all points is from an affine function of gamma, relative to the sum of all
        |t|; NaN where a point that is missing could explain it.
        """
        t = [points[:, -1]]
        for step in _STEPS:
            moved = plane.copy()
            moved[-1] += step
            led = self._lead(points, plane, moved)
            if not (led.ends == ARRIVED).all():
                return math.nan
            t.append(led.solutions[:, -1])
        bends = t[1] - t[0] - 0.5 * (t[2] - t[0]), t[1] - t[0] - _STEPS[0] / _STEPS[2] * (t[3] - t[0])
        scale = float(np.abs(t).sum(axis=1).max())
        floor = _ROUNDING * scale
        for bend in bends:
            bent = np.abs(bend)[np.abs(bend) > floor]
            if abs(bend.sum()) > max(_HIDDEN * bent.min(initial=np.inf) if len(bent) else 0.0, floor):
                return math.nan
        return max(abs(complex(bend.sum())) for bend in bends) / scale

    def _at_zero(self, points: Complex, plane: Complex) -> Complex | None:
        """What of all points comes to t = 0; None where some could be led neither there nor to infinity."""
        for _ in range(_TRIES):
            found = self._followed(points, plane)
            if found is not None:
                return found
            other = self._plane()
            around = self._lead(self._lead(points, plane, other).solutions, other, plane)
            if (around.ends == ARRIVED).all():
                points = around.solutions  # in another order: other paths
        return None

    def _followed(self, points: Complex, plane: Complex) -> Complex | None:
        """Once: alpha and gamma shrink by ten and by ten again. So does t on the way to 0; what keeps its t can only do
        that by an F that grows."""
        fibre, found = self._linkage.fibre, []
        part, here, now = 1e-3, points, plane
        there = fibre + part * (plane - fibre)
        led = self._lead(here, now, there)
        while len(led.solutions) and part > _LAST:
            t, here, now = led.solutions[:, -1], led.solutions, there
            known = led.ends == INFINITE
            if not (known | (led.ends == ARRIVED)).all():
                return None
            part *= 0.1
            there = fibre + part * (plane - fibre)
            led = self._lead(here[~known], now, there)
            shrunk = np.abs(led.solutions[:, -1]) / np.maximum(np.abs(t[~known]), 1e-300)
            zero = (led.ends == ARRIVED) & (shrunk < _SHRUNK)
            last = self._lead(led.solutions[zero], there, fibre)
            if not (last.ends == ARRIVED).all():
                return None
            found.append(last.solutions)
            going = ~zero & ((shrunk < 1.0 - _SHRUNK) | (led.ends != ARRIVED))
            led = Led(led.solutions[going], led.ends[going], led.pivots[going])
        return np.vstack(found) if not len(led.solutions) else None
