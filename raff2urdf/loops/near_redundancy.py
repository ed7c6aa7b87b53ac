"""Nearly redundant loops: equations that would be dependent if the numbers of a description were not rounded.

A planar four-bar has five loop equations of rank two, but only if its axes are exactly parallel. With axes that are
parallel to 1e-5 rad, the other three equations are independent, too: their singular values are about 1e-5, not 0, and
they can't all be solved. Some such mechanisms can't be closed at all; others close at home, and then hardly move.

`near_redundancy` finds them. It closes only the equations whose singular values are clearly not zero, at random
configurations along the motions that these allow. If the other equations then are solved too, the mechanism is exact;
if they remain open by no more than `LARGEST_GAP`, it is nearly redundant; if by more, it does not move as supposed, and
the small singular values are its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.bounds import STEP_CAP
from raff2urdf.closure import CLOSED, LoopSystem, close

LARGEST_GAP = 5e-3
"""rad, or characteristic lengths: equations that remain open by more are not meant to be dependent."""

MOST_ROWS = 300
"""Equations of a cluster: larger ones are not examined, since dense singular values would take longer than loading."""

_SMALL = (1e-6, 1e-4, 3e-3)  # singular values below such a part of the largest may be zeros, but for rounding
_CLEAR = 3.0  # and those above so many times that part are not
_CERTAIN = 1e6  # ratio of singular values that are not zero to those that are: above it, no other part is tried
_EXACT = 10.0 * CLOSED  # gap below which equations are dependent
_STEPS = (0.2, 0.8)  # rad or lengths: steps between random configurations
_QUICK, _SAMPLES = 2, 40  # configurations to see that a mechanism is exact; to describe one that is not
_REGULAR = 0.1  # smallest singular value of regular configurations, as a part of the largest such value
_NEARBY = 0.1  # rad or m: a step this short is short enough to solve equations that are not dependent
_HALVED = 8  # Gauss-Newton steps in which what is left is halved; they fail otherwise
_ATTEMPTS = 8  # steps tried for each sample


@dataclass(frozen=True, slots=True)
class NearRedundancy:
    """Loops whose equations are dependent but for small gaps.

    Attributes:
        small: part of the largest singular value below which others count as zeros.
        rank: number of equations that are clearly independent.
        samples: configurations (nq,) that solve these.
        gaps: (rows,) the largest residual of each equation there, in rad or characteristic lengths.
    """

    small: float
    rank: int
    samples: tuple[Array, ...]
    gaps: Array


class _Settled(NamedTuple):
    """A configuration that solves the clearly independent equations; the others are along `left`. `smallest` is the
    smallest singular value that counts, `ratio` its ratio to the largest that does not."""

    q: Array
    c: Array
    rank: int
    smallest: float
    ratio: float
    left: Array


def near_redundancy(system: LoopSystem, *starts: Array) -> NearRedundancy | None:
    """Return how loops are nearly redundant; None if they are not.

    What is small is not known beforehand, so several thresholds are tried, and the one whose singular values are parted
    most clearly is used; of those that find the same number of independent equations, the smallest.

    Clusters of more than `MOST_ROWS` equations are not examined.

    Args:
        system: a cluster of loops, which share joints.
        starts: (nq,) configurations to begin at, closed or nearly; others are tried where the first is singular.
    """
    best: tuple[float, NearRedundancy | None] = (0.0, None)
    if len(system.evaluate(starts[0])[0]) > MOST_ROWS:
        return None
    for small in _SMALL:
        settled = next((s for s in (settle(system, q, small) for q in starts) if s is not None), None)
        if settled is None or settled.rank == len(settled.c):
            continue
        walk = _walk(system, settled, small)
        samples, redundancy = [settled, *islice(walk, _QUICK)], None
        if any(np.abs(sample.c).max() > _EXACT for sample in samples):
            samples = [*samples[1:], *islice(walk, _SAMPLES - _QUICK)]
            rank = max((sample.rank for sample in samples), default=len(settled.c))
            clearest = max((sample.smallest for sample in samples if sample.rank == rank), default=0.0)
            # the others are singular, or nearly
            samples = [s for s in samples if s.rank == rank and s.smallest >= _REGULAR * clearest]
            stalls = [s for s in samples if np.abs(s.c).max() > _EXACT and not _closes(system, s.q)]
            gaps = np.abs([sample.c for sample in stalls]).max(axis=0) if stalls else np.zeros(1)
            if rank == len(settled.c) or gaps.max() > min(LARGEST_GAP, 0.1 * clearest):
                continue  # rounding makes singular values as large as the gaps
            if 2 * len(stalls) > len(samples):
                redundancy = NearRedundancy(small, rank, tuple(sample.q for sample in stalls), gaps)
        ratio = float(np.median([sample.ratio for sample in samples]))
        if ratio > best[0] and not (redundancy and best[1] and redundancy.rank == best[1].rank):
            best = ratio, redundancy
        if redundancy is None and ratio > _CERTAIN:
            break
    return best[1]


def settle(system: LoopSystem, q: Array, small: float) -> _Settled | None:
    """Solve the clearly independent equations by Gauss-Newton steps.

    Args:
        system: the loops.
        q: (nq,) where to begin.
        small: part of the largest singular value below which others count as zeros.

    Returns:
        None if that fails, or leads to where it is not clear which are independent.
    """
    lefts = [np.inf]  # of the clearly independent equations
    for _ in range(40):
        c, jacobian = system.evaluate(q)
        if 0 in jacobian.shape or not jacobian.any():
            return None  # no joint can open the loops
        u, s, vt = np.linalg.svd(jacobian, full_matrices=False)
        rank = int(np.count_nonzero(s > small * s[0]))
        along = u[:, :rank].T @ c
        lefts.append(float(np.abs(along).max(initial=0.0)))
        if lefts[-1] <= 1e-14 or 0.25 * lefts[-2] < lefts[-1] <= 1e-13:  # nothing, or nothing but rounding, is left
            break
        if min(lefts[-_HALVED:]) > 0.5 * min(lefts[:-_HALVED], default=np.inf):
            return None
        step = -vt[:rank].T @ (along / s[:rank])
        q = system.integrate(q, step * min(1.0, STEP_CAP / float(np.abs(step).max())))
    if not lefts[-1] <= 1e-13 or rank == 0 or s[rank - 1] <= _CLEAR * small * s[0]:
        return None
    u = np.linalg.svd(jacobian)[0]
    ratio = s[rank - 1] / max(s[rank], 1e-12 * s[0]) if rank < len(s) else 1.0  # nothing can move
    return _Settled(q, c, rank, float(s[rank - 1]), float(ratio), u[:, rank:])


def _closes(system: LoopSystem, q: Array) -> bool:
    """Return whether there is a closed configuration near q (nq,): its small singular values are its own, for example
    because it is near a singularity."""
    closing = close(system, q, iterations=40)
    return closing.closed and float(np.abs(closing.q - q).max()) <= _NEARBY


def _walk(system: LoopSystem, start: _Settled, small: float) -> Iterator[_Settled]:
    """Yield configurations that solve the clearly independent equations, each a random step from an earlier one of the
    largest rank."""
    rng, regular, failures = np.random.default_rng(0), [start], 0
    while failures < _ATTEMPTS:
        origin = regular[rng.integers(len(regular))]
        free = np.linalg.svd(system.evaluate(origin.q)[1])[2][origin.rank :]
        if not len(free):
            return
        step = np.asarray(rng.standard_normal(len(free))) @ free
        size = rng.uniform(*_STEPS) / float(np.abs(step).max())
        settled = settle(system, system.integrate(origin.q, size * step), small)
        if settled is None or settled.rank < origin.rank:
            failures += 1
            continue
        failures = 0
        regular = [settled] if settled.rank > origin.rank else [*regular, settled]
        yield settled
