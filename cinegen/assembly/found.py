"""What solving a linkage comes to: configurations, an account of all solutions, or else what comes nearest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly.linkage import Array, Linkage
from cinegen.errors import ClosureError
from raff2urdf import closure


@dataclass(frozen=True)
class Paths:
    """What became of all complex solutions: each is real, complex, infinite or lost.

    Attributes:
        real: those that are real configurations; of the platform and of all legs.
        complex: those that are not real.
        infinite: those that are at infinity.
        multiple: how many of the real and the complex ones meet others, or lie where joints are locked.
        lost: those of which that is not known.
    """

    real: int = 0
    complex: int = 0
    infinite: int = 0
    multiple: int = 0
    lost: int = 0


@dataclass(frozen=True, eq=False)
class Approach:
    """How near a mechanism comes to being closed where it can't be.

    Attributes:
        q: (nq,) with the motors where they were asked to be.
        gap: the largest residual of its loops there, rad and characteristic lengths.
        words: what is missing where.
    """

    q: Array
    gap: float
    words: str


@dataclass(frozen=True, eq=False)
class Found:
    """Modes of a linkage.

    Attributes:
        configurations: closed, (nq,) each.
        coincident: of each how many solutions meet in it.
        complete: whether it is proved that these are all.
        words: how they were found, and why they are all, or what is missing or not excluded.
        paths: what became of all solutions.
        closest: where there are none, what comes nearest.
        trace_test: whether nothing is missing on the curves of configurations that were met; None where no trace test
            was needed.
    """

    configurations: tuple[Array, ...]
    coincident: tuple[int, ...]
    complete: bool
    words: str
    paths: Paths
    closest: Approach | None = None
    trace_test: bool | None = None


def closed(linkage: Linkage, q: Array) -> Array | None:
    """(nq,) what closing q comes to with the motors where they are; None if it does not close."""
    try:
        return linkage.mechanism.close(q, linkage.motors)
    except ClosureError:
        return None


def nearest(linkage: Linkage, starts: list[Array], words: str = "") -> Approach:
    """The configuration with the smallest gap that least squares lead to from starts (nq,).

    Args:
        linkage: whose.
        starts: with the motors where they were asked to be.
        words: what is missing, where that is known better than by the loops' gaps.
    """
    mechanism = linkage.mechanism
    free = _free(linkage)
    found = [closure.close(mechanism.system, start, free) for start in starts]
    best = min(found, key=lambda closing: closing.gap)
    gaps = zip(mechanism.loops, mechanism.system.gaps(best.q), strict=True)
    listed = ", ".join(f"'{loop.name}' by {gap:.3g}" for loop, gap in gaps if gap > closure.CLOSED)
    unit = f"(rad, or lengths of {mechanism.length:.4g} m)"
    return Approach(best.q, best.gap, words or f"open stay {listed} {unit}")


def _free(linkage: Linkage) -> NDArray[np.bool_]:
    """(nv,) what may move while the motors are held."""
    mechanism = linkage.mechanism
    free = np.ones(mechanism.model.nv, dtype=bool)
    for name in linkage.motors:
        free[mechanism.v_index(name)] = False
    return free
