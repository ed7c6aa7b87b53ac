"""Paths of a hexapod's 40 solutions: each is followed to a regular solution, to infinity or to a multiple point.

A path that ends in a singular point arrives there as a power series in a root of the remaining parameter. Around the
end, it closes after as many revolutions as solutions coincide there, and the mean of x on that circle is the end itself
(Cauchy's integral; A. P. Morgan, A. J. Sommese and C. W. Wampler, "Computing singular solutions to nonlinear analytic
systems", Numerische Mathematik 58, 1991).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from cinegen.arrays import Array, Bools, Complex, Integers
from cinegen.hexapod._kernels import taylor
from cinegen.hexapod.study import distances, infinity, residual

TOLERANCE = 1e-4  # of a path's prediction, |x| = 1
HALF_STEPS = 0.5**taylor.ORDER  # of a tolerance: steps are half as long

_MAX_STEPS = 1000  # of a path
_INNER = 1e-2  # of a radius: a path with steps this short is given up, and the circle tried
_CORNERS = 16  # of a circle
_CLOSED = 1e-6  # distance of x from its start, after a number of revolutions
_SOLVES = 1e-12  # residual of an end
_INFINITE = 1e-11  # <c, c> of a mean where |x| = 1: not a rotation
_ROUNDING = 3.0  # times an error
_REGULAR = 1e-9  # the last Newton step, at most
_SAME = 1e-7  # distance of ends that coincide: those of two regular paths are further apart, or they'd be multiple
_ATTEMPTS = 4  # to resolve doubts
_MOVES = 1e-4  # distance of an end from those of another path to the same parameter

_CIRCLES = ((1e-2, 2), (1e-4, 4), (1e-6, 8), (1e-8, 8), (1e-10, 8), (1e-12, 8))
"""About an end, each tried if the one before fails: its radius, and the number of revolutions to give up after."""

Path = Callable[[np.random.Generator | None], Complex]
"""Returns a family (3, 6, 16) from one system to another: straight for None, else along a random detour."""


class PathEnd(IntEnum):
    """Ends of a path."""

    REGULAR, INFINITE, MULTIPLE, FAILED = range(4)


@dataclass(eq=False)
class TrackedPaths:
    """The ends of n paths.

    Attributes:
        x: (n, 8) where they end, of norm 1.
        end: (n,) a `PathEnd`.
        error: (n,) estimated error of x.
        steps: (n,) taken.
    """

    x: Complex
    end: Integers
    error: Array
    steps: Integers

    def count(self, end: PathEnd) -> int:
        """Return how many end so."""
        return int((self.end == end).sum())

    def replace(self, which: Bools, other: TrackedPaths) -> None:
        """Replace some paths by those of another attempt."""
        self.x[which], self.end[which], self.error[which] = other.x, other.end, other.error
        self.steps[which] += other.steps


def follow(family: Complex, x: Complex, tolerance: float) -> TrackedPaths:
    """Follow all solutions x (n, 8) from parameter 0 to their ends at 1."""
    return _Tracker(family, x, tolerance).follow()


class _Tracker:
    """Follows the solutions of one family."""

    def __init__(self, family: Complex, x: Complex, tolerance: float) -> None:
        n = len(x)
        self.paths = TrackedPaths(x.copy(), np.full(n, PathEnd.FAILED), np.full(n, np.inf), np.zeros(n, dtype=np.int64))
        self._family, self._final, self._tolerance = family, family.sum(axis=0), tolerance
        self._quadratic = bool(family[2].any() or family[1, :, 4:].any())
        self._scratch = taylor.tracking_scratch()

    def follow(self) -> TrackedPaths:
        """Follow all paths: to a circle about the end, into its centre, or else round it; on ever smaller circles."""
        paths, going, before = self.paths, np.arange(len(self.paths.x)), 1.0
        for radius, revolutions in _CIRCLES:
            going = going[self._go(going, 1.0 - before, 1.0 - radius) == taylor.ARRIVED]
            before, ring = radius, paths.x[going]
            self._arrive(going[self._go(going, 1.0 - radius, 1.0, _INNER * radius) == taylor.ARRIVED])
            left = paths.end[going] == PathEnd.FAILED
            going = going[left]
            paths.x[going] = ring[left]
            if len(going):
                self._go_round(going, radius, revolutions)
                going = going[paths.end[going] == PathEnd.FAILED]
            if not len(going):
                break
        return paths

    def _go(self, rows: Integers, begin: complex, end: complex, brink: float = 0.0) -> Integers:
        """Track some of the paths between two parameters; return their states (see `taylor.follow`)."""
        paths, states = self.paths, np.zeros(len(rows), dtype=np.int64)
        steps, x = paths.steps[rows], paths.x[rows]
        limits = self._tolerance, brink, _MAX_STEPS
        taylor.follow(
            self._family, self._quadratic, complex(begin), complex(end), x, states, steps, *limits, self._scratch
        )
        paths.x[rows], paths.steps[rows] = x, steps
        return states

    def _arrive(self, rows: Integers) -> None:
        """Refine paths that reached the parameter 1 by Newton's method."""
        paths = self.paths
        x, error = paths.x[rows], np.empty(len(rows))
        taylor.polish(self._final, x, error, self._scratch)
        regular = (error <= _REGULAR) & (np.linalg.norm(x - paths.x[rows], axis=1) <= _CLOSED)
        rows, x, error = rows[regular], x[regular], error[regular]
        paths.x[rows], paths.error[rows] = x, error
        # a solution may be far away: it is at infinity if <c, c> is no larger than x's own error explains
        far = infinity(x) <= _ROUNDING * error * np.linalg.norm(x[:, :4], axis=1)
        paths.end[rows] = np.where(far, PathEnd.INFINITE, PathEnd.REGULAR)

    def _go_round(self, rows: Integers, radius: float, revolutions: int) -> None:
        """Apply Cauchy's integral to paths on a circle about their end; those without result stay failed."""
        paths = self.paths
        ring, patch = paths.x.copy(), paths.x.conj()
        total, every_other = np.zeros_like(ring), np.zeros_like(ring)
        corners = 1.0 - radius * np.exp(2j * np.pi * np.arange(_CORNERS + 1) / _CORNERS)
        corners[-1] = corners[0]
        for revolution in range(1, revolutions + 1):
            sample = np.empty((len(rows), 8), dtype=complex)
            for i in range(_CORNERS):
                rows = rows[self._go(rows, corners[i], corners[i + 1]) == taylor.ARRIVED]
                sample = paths.x[rows] / (patch[rows] * paths.x[rows]).sum(axis=1)[:, None]
                total[rows] += sample
                if i % 2:
                    every_other[rows] += sample
            mean, rough = total[rows] / (revolution * _CORNERS), 2.0 * every_other[rows] / (revolution * _CORNERS)
            sure = np.abs(rough - mean).max(axis=1, initial=0.0) <= _CLOSED
            mean /= np.linalg.norm(mean, axis=1)[:, None]
            closed = np.abs(sample - ring[rows]).max(axis=1, initial=0.0) <= _CLOSED
            is_end, far = closed & sure & (residual(self._final, mean) <= _SOLVES), infinity(mean) <= _INFINITE
            if revolution == 1:  # no other path ends there: unless at infinity, it is regular
                is_end &= far
            ended = rows[is_end]
            ring[ended], paths.error[ended] = mean[is_end], _CLOSED
            paths.end[ended] = np.where(far[is_end], PathEnd.INFINITE, PathEnd.MULTIPLE)
            rows = rows[~closed]
            if not len(rows):
                break
        paths.x[:] = ring


def follow_surely(path: Path, x: Complex, real: bool) -> TrackedPaths:
    """Follow all solutions until no doubt is left, or nothing more helps.

    A path that jumped to another shows as a duplicate: such are followed again with half the step, and if doubts stay,
    all are on a detour.

    Args:
        path: the family: None gives the direct path, a generator a random detour. Which start leads to which end
            depends on the detour; the set of the ends does not.
        x: (n, 8) solutions at its beginning, in Study's coordinates.
        real: whether the equations at its end are real, so that the conjugate of an end is one too.

    Returns:
        the ends; FAILED is all that is still in doubt. Of ends that coincide the first stays, as it is a solution.
    """
    paths = follow(path(None), x, TOLERANCE)
    for attempt in range(_ATTEMPTS):
        doubts = _doubts(paths, real)
        if not doubts.any():
            return paths
        if attempt == 0:
            paths.replace(doubts, follow(path(None), x[doubts], TOLERANCE * HALF_STEPS))
            continue
        other = follow(path(np.random.default_rng(attempt)), x, TOLERANCE * HALF_STEPS)
        other.steps += paths.steps
        paths = other if _doubts(other, real).sum() < doubts.sum() else paths
    same = _coincide(paths)
    is_first_of_several = same.any(axis=1) & ~np.triu(same, 1).any(axis=0)
    paths.end[_doubts(paths, real) & ~is_first_of_several] = PathEnd.FAILED
    return paths


def _doubts(paths: TrackedPaths, real: bool) -> Bools:
    """Return which paths may have jumped or have no end (n,); if a conjugate is missing, all that may be it."""
    regular = paths.end == PathEnd.REGULAR
    doubts = (paths.end == PathEnd.FAILED) | _coincide(paths).any(axis=1)
    if not real:
        doubts |= paths.end == PathEnd.MULTIPLE
    if real and regular.any():
        x = paths.x[regular]
        alone = distances(x, x.conj()).min(axis=1) > _SAME
        if alone.any():
            doubts |= ~regular
            doubts[regular] |= alone
    return np.asarray(doubts)


def _coincide(paths: TrackedPaths) -> Bools:
    """Return which regular ends coincide, (n, n)."""
    regular = paths.end == PathEnd.REGULAR
    same = (distances(paths.x, paths.x) <= _SAME) & regular & regular[:, None]
    return np.asarray(same & ~np.eye(len(same), dtype=bool))


def lie_on_curve(path: Path, x: Complex, paths: TrackedPaths) -> bool:
    """Return whether ends at multiple points lie on a curve of solutions: a detour ends at other points of it."""
    multiple = paths.end == PathEnd.MULTIPLE
    if not multiple.any():
        return False
    other = follow(path(np.random.default_rng(_ATTEMPTS)), x, TOLERANCE)
    again = other.x[other.end == PathEnd.MULTIPLE]
    return bool(distances(paths.x[multiple], again).min(axis=1, initial=np.inf).max() > _MOVES)
