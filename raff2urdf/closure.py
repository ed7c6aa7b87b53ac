"""Closing loops and counting mobility, for any mechanism that can evaluate its loops.

A `LoopSystem` gives the residual of all its loops and its Jacobian, without unit: lengths are divided by the
characteristic length, and a prismatic joint's variable likewise. What is here knows no robot and no file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from raff2urdf.document import LoopKind

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CLOSED = 1e-12
"""Loops count as closed below this residual (rad, or characteristic lengths)."""

ROUNDING = 2e-15  # no residual is expected to get below this: Gauss-Newton stops
STEP_CAP = 0.6  # rad: a longer Gauss-Newton step leaves what its linearisation knows
_RANK = 1e-6  # singular values below this part of the largest are zeros: closing to 1e-14 leaves 1e-7 at a singularity
_NOTHING = 1e-9  # and below this, in any case: loops that no joint can open
_WALK = 0.3  # rad: length of a step between the random closed configurations
_SAMPLES = 5  # random closed configurations on which the generic rank is counted


class LoopSystem(Protocol):
    """The loops of a mechanism as equations c(q) = 0."""

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Residual c (rows,) and its derivative (rows, nv) by the dimensionless step, at q (nq,)."""
        ...

    def integrate(self, q: Array, step: Array) -> Array:
        """The configuration reached from q by a dimensionless step (nv,)."""
        ...


@dataclass(frozen=True, slots=True)
class Closing:
    """What an attempt to close all loops led to: `q` is the best configuration met, `gap` its largest residual."""

    q: Array
    gap: float

    @property
    def closed(self) -> bool:
        """Whether every loop is."""
        return self.gap <= CLOSED


def close(system: LoopSystem, q: Array, free: Mask | None = None, iterations: int = 100) -> Closing:
    """Gauss-Newton on the SVD, from q to the loops: the shortest correction, damped and capped while far away.

    Levenberg-Marquardt with damping c^T c, which keeps the convergence quadratic where the rows are dependent
    (N. Yamashita and M. Fukushima, "On the rate of convergence of the Levenberg-Marquardt method", Computing
    Supplement 15, 2001), as they are in every planar or overconstrained loop.

    Args:
        system: the loops.
        q: (nq,) where to begin.
        free: (nv,) which degrees of freedom may move; all unless said.
        iterations: at most so many evaluations.
    """
    c, jacobian = system.evaluate(q)
    best = _largest(c)
    damping = 1.0
    for _ in range(iterations):
        if best <= ROUNDING:
            break
        rows = jacobian if free is None else jacobian[:, free]
        if rows.shape[1] == 0:
            break
        u, s, vt = np.linalg.svd(rows, full_matrices=False)
        kept = s > 1e-10 * max(s[0], 1e-300)
        along = (u.T @ c)[kept]
        s, vt = s[kept], vt[kept]
        step = np.zeros(jacobian.shape[1])
        short = -vt.T @ (s / (s * s + damping * float(c @ c)) * along)
        short *= min(1.0, STEP_CAP / max(_largest(short), 1e-300))
        step[slice(None) if free is None else free] = short
        there = system.integrate(q, step)
        c_there, jacobian_there = system.evaluate(there)
        if c_there @ c_there < c @ c:
            improved = _largest(c_there)
            enough = improved <= 0.1 * CLOSED and improved > 0.25 * best
            q, c, jacobian, best = there, c_there, jacobian_there, improved
            damping = max(damping * 0.1, 1e-4)
            if enough:
                break
        elif best <= CLOSED or damping > 1e12:
            break
        else:
            damping *= 10.0
    return Closing(q, best)


def close_from_afar(system: LoopSystem, q: Array) -> Closing:
    """`close`, and where that ends in a dead end, again from up to twelve random places ever further from q."""
    best = close(system, q)
    nv = system.evaluate(q)[1].shape[1]
    rng = np.random.default_rng(0)
    for attempt in range(12):
        if best.closed:
            break
        away = np.asarray(rng.standard_normal(nv)) * (0.1 * (1 + attempt))
        best = min(best, close(system, system.integrate(q, away)), key=lambda closing: closing.gap)
    return best


def rank(jacobian: Array) -> int:
    """Number of independent rows, from the singular values."""
    if 0 in jacobian.shape:
        return 0
    s = np.linalg.svd(jacobian, compute_uv=False)
    return int(np.count_nonzero(s > max(_RANK * s[0], _NOTHING)))


def closed_walk(system: LoopSystem, q: Array, samples: int, seed: int = 0) -> Iterator[Array]:
    """Random closed configurations: a walk from the closed q along the directions the loops leave free.

    A step that does not close, or falls back to where it came from (as many do from a singular q), is tried again
    elsewhere, eight times for each sample at most.
    """
    rng = np.random.default_rng(seed)
    for _ in range(samples):
        _, jacobian = system.evaluate(q)
        for attempt in range(8):
            anyhow = rng.standard_normal(jacobian.shape[1])
            step: Array = anyhow - np.linalg.lstsq(jacobian, jacobian @ anyhow, rcond=_RANK)[0].astype(float)
            size = _largest(step)
            if size <= 1e-6:  # nothing can move
                return
            step = step * (_WALK * (1.0 + 0.5 * attempt) / size)
            ahead = system.integrate(q, step)
            there = close(system, ahead)
            if there.closed and _largest(there.q - q) >= 0.2 * _largest(ahead - q):
                q = there.q
                yield q
                break


def generic_rank(system: LoopSystem, q: Array) -> tuple[int, Array]:
    """The loops' rank on random closed configurations around the closed q, and one where it is reached.

    q itself may be singular, so the largest rank counts: degrees of freedom less this rank is the mobility.
    """
    found, where = rank(system.evaluate(q)[1]), q
    for there in closed_walk(system, q, _SAMPLES):
        count = rank(system.evaluate(there)[1])
        if count > found:
            found, where = count, there
    return found, where


def passive(jacobian: Array, order: Sequence[int]) -> list[int]:
    """The first columns in `order` that are independent: joints that the others determine.

    Taking the joints furthest from the base first leaves, as the rest, the joints nearest the base that suffice
    to determine the mechanism (a basis of a matroid and the complement in its dual).
    """
    total = rank(jacobian)
    basis = np.zeros((jacobian.shape[0], 0))
    chosen: list[int] = []
    for column in order:
        if len(chosen) == total:
            break
        v = jacobian[:, column]
        size = float(np.linalg.norm(v))
        for _ in range(2):  # twice is enough (Kahan, Parlett)
            v = v - basis @ (basis.T @ v)
        rest = float(np.linalg.norm(v))
        if rest > 1e-6 * size and size > 0.0:
            basis = np.column_stack([basis, v / rest])
            chosen.append(column)
    return chosen


def why_open(
    names: Sequence[str],
    kinds: Sequence[LoopKind],
    gaps: Callable[[Array], Sequence[float]],
    relaxed: Callable[[Sequence[LoopKind]], LoopSystem],
    start: Array,
    best: Closing,
) -> str:
    """Why a mechanism can't be closed, and which weaker closures would close it.

    Args:
        names: of all loops.
        kinds: of all loops.
        gaps: the residual of each loop at a configuration.
        relaxed: the same mechanism with other kinds of loops.
        start: (nq,) the written configuration.
        best: the best attempt.
    """
    left = gaps(best.q)
    open_loops = [i for i, gap in enumerate(left) if gap > CLOSED]
    jacobian = relaxed(kinds).evaluate(best.q)[1]
    listed = ", ".join(f"'{names[i]}' ({kinds[i].name.lower()}, {left[i]:.3g})" for i in open_loops[:8])
    more = f" and {len(open_loops) - 8} more" if len(open_loops) > 8 else ""
    lines = [
        f"the mechanism can't be closed: {listed}{more} stay open",
        f"the numbers are the least gaps found, in rad or characteristic lengths; {jacobian.shape[0]} loop rows of "
        f"rank {rank(jacobian)} on {jacobian.shape[1]} joints",
    ]
    for weaker in (LoopKind.REVOLUTE, LoopKind.BALL):
        changed = [i for i in open_loops if _freedom(kinds[i]) < _freedom(weaker) and kinds[i] is not LoopKind.BALL]
        trial = [weaker if i in changed else kind for i, kind in enumerate(kinds)]
        if changed and close_from_afar(relaxed(trial), start).closed:
            kind = weaker.name.lower()
            typed = " ".join(f"--loop {names[i]}={kind}" for i in changed)
            python = ", ".join(f'"{names[i]}": "{kind}"' for i in changed)
            lines.append(
                f"it closes with {kind} joints there: loops={{{python}}} in Python, {typed} as a command's option"
            )
            break
    else:
        lines.append("neither revolute nor ball joints there would close it")
    return "\n  ".join(lines)


def _freedom(kind: LoopKind) -> int:
    return {LoopKind.RIGID: 0, LoopKind.PRISMATIC: 1, LoopKind.REVOLUTE: 1, LoopKind.BALL: 3}[kind]


def _largest(values: Array) -> float:
    return float(np.abs(values).max()) if values.size else 0.0
