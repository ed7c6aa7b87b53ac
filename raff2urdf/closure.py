"""Closing loops, their rank, and which joints they determine, for any mechanism that can evaluate its loops.

A `LoopSystem` gives the residual c(q) of all its loops and the Jacobian J = dc/dq, dimensionless: lengths are divided
by the characteristic length, and so is the variable of a prismatic joint. The algorithms know no robot and no file.

`close` is the reference for closing loops: `cinegen.loops` compiles it and is tested against it on every robot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from raff2urdf.arrays import Array, Bools
from raff2urdf.bounds import STEP_CAP, JointBounds
from raff2urdf.raff.document import LoopKind
from raff2urdf.residual import ROWS

CLOSED = 1e-12
"""rad, or characteristic lengths: `close` succeeds where no residual is above this."""

ROUNDING = 2e-15  # no residual is expected to get below this: iterations stop
RANK = 1e-6  # singular values below this part of the largest are zeros: closing to 1e-14 leaves 1e-7 at a singularity
NOTHING = 1e-9  # and below this, in any case: loops that no joint can open
_WALK = 0.3  # rad or lengths: step between the random closed configurations
_SAMPLES = 5  # random closed configurations on which the generic rank is counted
_WALKS = 8  # to as many, if the rank is not clear there


class LoopSystem(Protocol):
    """The loops of a mechanism as equations c(q) = 0."""

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return the residual c (rows,) and its derivative (rows, nv) by the dimensionless step, at q (nq,)."""
        ...

    def integrate(self, q: Array, step: Array) -> Array:
        """Return the configuration reached from q (nq,) by a dimensionless step (nv,)."""
        ...


class KindedLoops(LoopSystem, Protocol):
    """The loops of a mechanism and their kinds, in the order of their residuals; after these, one of each coupling."""

    length: float
    """Characteristic length, m."""

    @property
    def kinds(self) -> Sequence[LoopKind]:
        """Kinds of all loops."""
        ...

    @property
    def ends(self) -> Sequence[tuple[str, str]]:
        """Names of the nodes at both ends of each loop."""
        ...

    def placements(self, q: Array) -> list[Array]:
        """Return the placement (4, 4) of each loop's second end in its first, at q (nq,); m."""
        ...

    def with_moved(self, steps: Mapping[int, tuple[Array, Array]]) -> KindedLoops:
        """Return the same loops, some loops' ends moved by placements (4, 4) in their own axes."""
        ...

    def with_kinds(self, kinds: Sequence[LoopKind]) -> KindedLoops:
        """Return the same loops, closed by other kinds of joints."""
        ...


class Closing(NamedTuple):
    """The result of closing loops.

    Attributes:
        q: (nq,) the best configuration met.
        gap: its largest residual, in rad or characteristic lengths.
    """

    q: Array
    gap: float

    @property
    def closed(self) -> bool:
        """True if all loops are closed."""
        return self.gap <= CLOSED


def close(
    system: LoopSystem, q: Array, free: Bools | None = None, iterations: int = 100, bounds: JointBounds | None = None
) -> Closing:
    """Close loops from a configuration, by damped Gauss-Newton steps.

    With J = U S V^T, residual c and damping mu, a step is

        d = -V S / (S^2 + mu c^T c) U^T c ,

    the least of |J d + c|^2 + mu (c^T c) |d|^2: of all steps that close the loops to first order the shortest, but for
    the damping. Since that vanishes with the square of the residual, convergence stays quadratic where rows depend on
    each other, as they do in every planar or overconstrained loop (N. Yamashita and M. Fukushima, "On the rate of
    convergence of the Levenberg-Marquardt method", Computing Supplement 15, 2001). Singular values that are zero but
    for rounding are left out, and a step is cut to `STEP_CAP`. A step that does not lower c^T c is tried again with
    tenfold damping; after one that does, the damping falls to a tenth.

    Args:
        system: the loops.
        q: (nq,) where to begin.
        free: (nv,) the degrees of freedom that may move; all if None.
        iterations: greatest number of steps tried.
        bounds: limits that are kept: each step is then the least within them, and q must not be beyond them.
    """
    c, jacobian = system.evaluate(q)
    gap, damping = _largest(c), 1.0
    free = np.ones(jacobian.shape[1], dtype=bool) if free is None else free
    for _ in range(iterations):
        if gap <= ROUNDING or not free.any():
            break
        step = np.zeros(len(free))
        if bounds is None:
            step[free] = _step(jacobian[:, free], c, damping * float(c @ c))
        else:
            step = bounds.step(jacobian, c, damping * float(c @ c), q)
        trial = system.integrate(q, step) if bounds is None else bounds.clipped(system.integrate(q, step))
        c_trial, jacobian_trial = system.evaluate(trial)
        if c_trial @ c_trial < c @ c:
            before, gap = gap, _largest(c_trial)
            q, c, jacobian = trial, c_trial, jacobian_trial
            damping = max(damping * 0.1, 1e-4)
            if gap <= 0.1 * CLOSED and gap > 0.25 * before:  # nothing but rounding is left
                break
        elif gap <= CLOSED or damping > 1e12 or _is_least(c, c + jacobian @ step):
            break
        else:
            damping *= 10.0
    return Closing(q, gap)


def _is_least(c: Array, foreseen: Array) -> bool:
    """Return whether a step that lowered no residual c (rows,) could not do so but by rounding: c is a local least."""
    size = float(np.linalg.norm(c))
    return size - float(np.linalg.norm(foreseen)) < ROUNDING


def _step(jacobian: Array, c: Array, damping: float) -> Array:
    u, s, vt = np.linalg.svd(jacobian, full_matrices=False)
    kept = s > 1e-10 * max(s[0], 1e-300)
    along, s, vt = (u.T @ c)[kept], s[kept], vt[kept]
    step = -vt.T @ (s / (s * s + damping) * along)
    return np.asarray(step * min(1.0, STEP_CAP / max(_largest(step), 1e-300)))


def close_from_afar(system: LoopSystem, q: Array) -> Closing:
    """Close loops as `close` does; where that fails, again from up to twelve random configurations ever further from
    q. The best result is returned."""
    best = close(system, q)
    nv = system.evaluate(q)[1].shape[1]
    rng = np.random.default_rng(0)
    for attempt in range(12):
        if best.closed:
            break
        away = np.asarray(rng.standard_normal(nv)) * (0.1 * (1 + attempt))
        best = min(best, close(system, system.integrate(q, away)), key=lambda closing: closing.gap)
    return best


def rank(jacobian: Array, threshold: float = RANK) -> int:
    """Return the number of independent rows of a Jacobian: of singular values above this part of the largest."""
    if 0 in jacobian.shape:
        return 0
    s = np.linalg.svd(jacobian, compute_uv=False)
    return int(np.count_nonzero(s > max(threshold * s[0], NOTHING)))


def closed_walk(system: LoopSystem, q: Array, samples: int, seed: int = 0) -> Iterator[Array]:
    """Yield random closed configurations: a walk from the closed q along the directions that the loops leave free.

    A step that can't be closed, or falls back to where it began (as many do from a singular q), is tried again in
    another direction, eight times for each sample at most.
    """
    rng = np.random.default_rng(seed)
    for _ in range(samples):
        _, jacobian = system.evaluate(q)
        for attempt in range(8):
            direction = rng.standard_normal(jacobian.shape[1])
            step: Array = direction - np.linalg.lstsq(jacobian, jacobian @ direction, rcond=RANK)[0].astype(float)
            size = _largest(step)
            if size <= 1e-6:  # nothing can move
                return
            step = step * (_WALK * (1.0 + 0.5 * attempt) / size)
            ahead = system.integrate(q, step)
            closing = close(system, ahead)
            if closing.closed and _largest(closing.q - q) >= 0.2 * _largest(ahead - q):
                q = closing.q
                yield q
                break


def generic_rank(system: LoopSystem, q: Array) -> tuple[int, Array]:
    """Return the generic rank of the loops, and a closed configuration (nq,) where it is reached.

    It is the largest rank on random closed configurations around the closed q, which may be singular itself. Where
    branches of closed configurations meet at q, many walks end near q and near a singularity; further ones are made
    then. The mobility is the number of degrees of freedom less this rank.
    """
    best, where = rank(system.evaluate(q)[1]), q
    for walk in range(_WALKS):
        is_clear = True
        for closed in closed_walk(system, q, _SAMPLES, walk):
            jacobian = system.evaluate(closed)[1]
            count = rank(jacobian)
            if count > best:
                best, where = count, closed
            is_clear = is_clear and rank(jacobian, 1e-2 * RANK) == rank(jacobian, 1e2 * RANK)
        if is_clear:
            break
    return best, where


def passive(jacobian: Array, order: Sequence[int]) -> list[int]:
    """Return the first columns in `order` that are independent: passive joints, which the others determine.

    If the joints furthest from the base come first, the remaining ones are those nearest the base that suffice to
    determine the mechanism (a basis of a matroid, and its complement in the dual). What remains of a column beside
    those before it is nothing if `rank` takes as much for a zero of the whole matrix, whatever the column's own size.
    """
    total = rank(jacobian)
    if total == 0:
        return []
    nothing = max(RANK * float(np.linalg.norm(jacobian, 2)), NOTHING) / math.sqrt(jacobian.shape[1])
    basis = np.zeros((jacobian.shape[0], 0))
    chosen: list[int] = []
    for column in order:
        if len(chosen) == total:  # with remainders below `nothing`, no singular value more can be above RANK
            break
        v = jacobian[:, column]
        for _ in range(2):  # twice is enough (Kahan, Parlett)
            v = v - basis @ (basis.T @ v)
        remainder = float(np.linalg.norm(v))
        if remainder > nothing:
            basis = np.column_stack([basis, v / remainder])
            chosen.append(column)
    return chosen


def gaps(loops: KindedLoops, q: Array) -> list[float]:
    """Return the largest residual of each loop and coupling at q (nq,), in rad or characteristic lengths."""
    return [_largest(part) for part in residuals(loops, q)]


def residuals(loops: KindedLoops, q: Array) -> list[Array]:
    """Return the residual of each loop and coupling at q (nq,), in rad or characteristic lengths."""
    c = loops.evaluate(q)[0]
    ends = np.cumsum([ROWS[kind] for kind in loops.kinds], dtype=int)
    couplings = ends[-1] if ends.size else 0
    return [*np.split(c[:couplings], ends)[:-1], *c[couplings:, None]]


def _largest(values: Array) -> float:
    return float(np.abs(values).max()) if values.size else 0.0
