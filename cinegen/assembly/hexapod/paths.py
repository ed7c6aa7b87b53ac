"""Where paths of solutions end: each is accounted for, at a regular solution, at infinity or at a multiple point.

A path that ends in a singular point comes there as a power series in a root of what is left of the way. Going round the
end, it closes after as many turns as solutions meet there, and the mean of x on that circle is the end itself (Cauchy's
integral; A. P. Morgan, A. J. Sommese and C. W. Wampler, "Computing singular solutions to nonlinear analytic systems",
Numerische Mathematik 58, 1991).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly.hexapod import _kernels as kernel
from cinegen.assembly.hexapod.equations import Array, Complex

TOLERANCE = 1e-4  # of a path's prediction, |x| = 1
HALF = 0.5**kernel.ORDER  # of a tolerance: steps are half as long

_MOST = 1000  # steps of a path
_INNER = 1e-2  # of a radius: a path whose steps are so short there is given up, and the circle tried
_CORNERS = 16  # of a circle
_CLOSED = 1e-6  # distance of x from where it began, after its turns
_SOLVES = 1e-12  # residual of an end
_INFINITE = 1e-11  # <c, c> of a mean where |x| = 1: that is no rotation
_ROUNDING = 3.0  # times an error
_REGULAR = 1e-9  # the last Newton step, at most
_SAME = 1e-7  # distance of ends that are one: those of two regular paths are further apart, or they'd be multiple
_ATTEMPTS = 4  # to settle doubts
_MOVES = 1e-4  # an end, on another way

_CIRCLES = ((1e-2, 2), (1e-4, 4), (1e-6, 8), (1e-8, 8), (1e-10, 8), (1e-12, 8))
"""About an end, each where nothing comes of the one before: its radius, and after how many turns it is given up."""

Way = Callable[[np.random.Generator | None], Complex]
"""A family from one system to another: straight for None, else by a random detour."""


class Kind(IntEnum):
    """How a path ends."""

    REGULAR, INFINITE, MULTIPLE, FAILED = range(4)


@dataclass(eq=False)
class Ends:
    """Of paths.

    Attributes:
        x: (n, 8) where they came to, of norm 1.
        kind: (n,) a `Kind`.
        error: (n,) what may be wrong with x.
        steps: (n,) that were taken.
    """

    x: Complex
    kind: NDArray[np.int64]
    error: Array
    steps: NDArray[np.int64]

    def count(self, kind: Kind) -> int:
        """How many end so."""
        return int((self.kind == kind).sum())

    def put(self, which: NDArray[np.bool_], other: Ends) -> None:
        """Replaces some by what was found of them in another attempt."""
        self.x[which], self.kind[which], self.error[which] = other.x, other.kind, other.error
        self.steps[which] += other.steps


def follow(family: Complex, x: Complex, tolerance: float) -> Ends:
    """Follows all solutions x (n, 8) at parameter 0 to their ends at 1."""
    n, work = len(x), kernel.work()
    ends = Ends(x.copy(), np.full(n, Kind.FAILED), np.full(n, np.inf), np.zeros(n, dtype=np.int64))
    final = family.sum(axis=0)
    going, before = np.arange(n), 1.0
    for radius, turns in _CIRCLES:
        here = _go(family, ends, going, 1.0 - before, 1.0 - radius, 0.0, tolerance, work)
        going, before = going[here == kernel.ARRIVED], radius
        ring = ends.x[going]
        status = _go(family, ends, going, 1.0 - radius, 1.0, _INNER * radius, tolerance, work)
        _arrive(final, ends, going[status == kernel.ARRIVED], work)
        left = ends.kind[going] == Kind.FAILED
        going = going[left]
        ends.x[going] = ring[left]
        if len(going):
            _go_round(family, final, ends, going, radius, turns, tolerance, work)
            going = going[ends.kind[going] == Kind.FAILED]
        if not len(going):
            break
    return ends


def _go(
    family: Complex,
    ends: Ends,
    rows: NDArray[np.int64],
    begin: complex,
    end: complex,
    brink: float,
    tolerance: float,
    work: kernel.Work,
) -> NDArray[np.int64]:
    """Moves some of the ends; returns their status, as the kernel has it."""
    status, steps, x = np.zeros(len(rows), dtype=np.int64), ends.steps[rows], ends.x[rows]
    kernel.follow(family, complex(begin), complex(end), x, status, steps, tolerance, brink, _MOST, work)
    ends.x[rows], ends.steps[rows] = x, steps
    return status


def _arrive(final: Complex, ends: Ends, rows: NDArray[np.int64], work: kernel.Work) -> None:
    """Newton at the end, of paths that arrived."""
    x, error = ends.x[rows], np.empty(len(rows))
    kernel.polish(final, x, error, work)
    distance = np.linalg.norm(x - ends.x[rows], axis=1)
    regular = (error <= _REGULAR) & (distance <= _CLOSED)
    rows, x, error = rows[regular], x[regular], error[regular]
    ends.x[rows], ends.error[rows] = x, error
    # a solution may be far away: at infinity it is where <c, c> is no more than x's own error makes of it
    far = size(x) <= _ROUNDING * error * np.linalg.norm(x[:, :4], axis=1)
    ends.kind[rows] = np.where(far, Kind.INFINITE, Kind.REGULAR)


def _go_round(
    family: Complex,
    final: Complex,
    ends: Ends,
    rows: NDArray[np.int64],
    radius: float,
    turns: int,
    tolerance: float,
    work: kernel.Work,
) -> None:
    """Cauchy's integral for paths on a circle about their end; those of which nothing comes are left failed."""
    ring, patch = ends.x.copy(), ends.x.conj()
    total, every_other = np.zeros_like(ring), np.zeros_like(ring)
    corners = 1.0 - radius * np.exp(2j * np.pi * np.arange(_CORNERS + 1) / _CORNERS)
    corners[-1] = corners[0]
    for turn in range(1, turns + 1):
        sample = np.empty((len(rows), 8), dtype=complex)
        for i in range(_CORNERS):
            arrived = _go(family, ends, rows, corners[i], corners[i + 1], 0.0, tolerance, work) == kernel.ARRIVED
            rows = rows[arrived]
            sample = ends.x[rows] / (patch[rows] * ends.x[rows]).sum(axis=1)[:, None]
            total[rows] += sample
            if i % 2:
                every_other[rows] += sample
        mean, rough = total[rows] / (turn * _CORNERS), 2.0 * every_other[rows] / (turn * _CORNERS)
        sure = np.abs(rough - mean).max(axis=1, initial=0.0) <= _CLOSED
        mean /= np.linalg.norm(mean, axis=1)[:, None]
        closed = np.abs(sample - ring[rows]).max(axis=1, initial=0.0) <= _CLOSED
        ends_here = closed & sure & (residual(final, mean) <= _SOLVES)
        if turn == 1:  # nothing else comes there: if it isn't at infinity, it is regular
            ends_here &= size(mean) <= _INFINITE
        found = rows[ends_here]
        ring[found], ends.error[found] = mean[ends_here], _CLOSED
        ends.kind[found] = np.where(size(mean[ends_here]) <= _INFINITE, Kind.INFINITE, Kind.MULTIPLE)
        rows = rows[~closed]
        if not len(rows):
            break
    ends.x[:] = ring


def size(x: Complex) -> Array:
    """(n,) of <c, c>, which is 0 at infinity, for x (n, 8) of norm 1."""
    return np.asarray(np.abs((x[:, :4] ** 2).sum(axis=1)))


def residual(coefficients: Complex, x: Complex) -> Array:
    """(n,) the largest left side of the seven equations."""
    return np.asarray(np.abs(_left(coefficients, x)).max(axis=1))


def _left(coefficients: Complex, x: Complex) -> Complex:
    """(n, 7) left sides of the equations at x (n, 8)."""
    c, d = x[:, :4], x[:, 4:]
    first, second = np.triu_indices(4, 1)
    products = np.hstack(
        [c * c, 2.0 * c[:, first] * c[:, second], 2.0 * (d[:, first] * c[:, second] - d[:, second] * c[:, first])]
    )
    left = np.hstack([products @ coefficients.T, (c * d).sum(axis=1)[:, None]])
    left[:, 0] += (d * d).sum(axis=1)
    return left


def apart(x: Complex, y: Complex) -> Array:
    """(n, m) distances of x (n, 8) and y (m, 8), of norm 1, up to factors of norm 1."""
    turn = x.conj() @ y.T
    turn /= np.maximum(np.abs(turn), 1e-300)
    return np.asarray(np.linalg.norm(x[:, None, :] * turn[:, :, None] - y[None, :, :], axis=2))


def settle(way: Way, x: Complex, real: bool) -> Ends:
    """Follows all solutions until nothing is left in doubt, or nothing more helps.

    A path that jumped to another shows as a duplicate: such are followed again with half the step, and if doubts stay,
    all are on a way round.

    Args:
        way: the family; on a detour other paths have other ends.
        x: (n, 8) solutions at its beginning.
        real: whether the equations at its end are real, so that the conjugate of an end is one too.

    Returns:
        the ends; FAILED is all that is still in doubt, but for one of each that are the same.
    """
    ends = follow(way(None), x, TOLERANCE)
    for attempt in range(_ATTEMPTS):
        doubts = _doubts(ends, real)
        if not doubts.any():
            return ends
        if attempt == 0:
            ends.put(doubts, follow(way(None), x[doubts], TOLERANCE * HALF))
            continue
        other = follow(way(np.random.default_rng(attempt)), x, TOLERANCE * HALF)
        other.steps += ends.steps
        ends = other if _doubts(other, real).sum() < doubts.sum() else ends
    same = _same(ends)
    ends.kind[_doubts(ends, real) & ~(same.any(axis=1) & ~np.triu(same, 1).any(axis=0))] = Kind.FAILED
    return ends


def _doubts(ends: Ends, real: bool) -> NDArray[np.bool_]:
    """(n,) which paths may have jumped or have no end; and all that may be a conjugate that is missing."""
    regular = ends.kind == Kind.REGULAR
    doubts = (ends.kind == Kind.FAILED) | _same(ends).any(axis=1)
    if not real:
        doubts |= ends.kind == Kind.MULTIPLE
    if real and regular.any():
        x = ends.x[regular]
        alone = apart(x, x.conj()).min(axis=1) > _SAME
        if alone.any():
            doubts |= ~regular
            doubts[regular] |= alone
    return np.asarray(doubts)


def _same(ends: Ends) -> NDArray[np.bool_]:
    """(n, n) which regular ends are one."""
    regular = ends.kind == Kind.REGULAR
    same = (apart(ends.x, ends.x) <= _SAME) & regular & regular[:, None]
    return np.asarray(same & ~np.eye(len(same), dtype=bool))


def lie_on_curve(way: Way, x: Complex, ends: Ends) -> bool:
    """Whether ends at multiple points lie on a curve of solutions: on another way, paths come to other points of it."""
    multiple = ends.kind == Kind.MULTIPLE
    if not multiple.any():
        return False
    other = follow(way(np.random.default_rng(_ATTEMPTS)), x, TOLERANCE)
    again = other.x[other.kind == Kind.MULTIPLE]
    return bool(apart(ends.x[multiple], again).min(axis=1, initial=np.inf).max() > _MOVES)
