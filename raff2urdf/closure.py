"""Closing loops, their rank, and which joints they determine, for any mechanism that can evaluate its loops.

A `LoopSystem` gives the residual c(q) of all its loops and the Jacobian J = dc/dq, dimensionless: lengths are divided
by the characteristic length, and so is the variable of a prismatic joint. The algorithms know no robot and no file.

`close` is the reference for closing loops: `cinegen.loops` compiles it and is tested against it on every robot.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from raff2urdf.escape import shell_word
from raff2urdf.raff import texts
from raff2urdf.raff.document import LoopKind
from raff2urdf.residual import ROWS, skew, swing

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CLOSED = 1e-12
"""rad, or characteristic lengths: `close` succeeds where no residual is above this."""

ROUNDING = 2e-15  # no residual is expected to get below this: iterations stop
STEP_CAP = 0.6  # rad or lengths: a longer step leaves the range of its linearisation
RANK = 1e-6  # singular values below this part of the largest are zeros: closing to 1e-14 leaves 1e-7 at a singularity
NOTHING = 1e-9  # and below this, in any case: loops that no joint can open
_PARALLEL = 0.5  # degrees: z axes of hinges that are farther apart are not parallel
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

    def with_turned(self, turns: Mapping[int, tuple[Array, Array]]) -> KindedLoops:
        """Return the same loops, the axes of some loops' ends turned by rotations (3, 3) in their own axes."""
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


def close(system: LoopSystem, q: Array, free: Mask | None = None, iterations: int = 100) -> Closing:
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
    """
    c, jacobian = system.evaluate(q)
    gap, damping = _largest(c), 1.0
    free = np.ones(jacobian.shape[1], dtype=bool) if free is None else free
    for _ in range(iterations):
        if gap <= ROUNDING or not free.any():
            break
        step = np.zeros(len(free))
        step[free] = _step(jacobian[:, free], c, damping * float(c @ c))
        there = system.integrate(q, step)
        c_there, jacobian_there = system.evaluate(there)
        if c_there @ c_there < c @ c:
            before, gap = gap, _largest(c_there)
            q, c, jacobian = there, c_there, jacobian_there
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


def close_within(
    system: LoopSystem, closed: Array, lower: Array, upper: Array, columns: Mapping[int, int] | None = None
) -> Array:
    """Return a closed configuration within the limits, or `closed` itself where none is found.

    Joints beyond a limit are put on it and kept there while the others close the loops. That may lead others beyond
    theirs, so it is done up to three times.

    Args:
        system: the loops.
        closed: (nq,) a closed configuration.
        lower: (nq,) least values; -inf where there is none.
        upper: (nq,) greatest values; inf where there is none.
        columns: of each index in q that has limits the index in v; the same unless given.
    """
    q, free = closed, np.ones(system.evaluate(closed)[1].shape[1], dtype=bool)
    for _ in range(3):
        outside = (q < lower) | (q > upper)
        if not outside.any():
            return q
        free[[i if columns is None else columns[i] for i in np.flatnonzero(outside).tolist()]] = False
        closing = close(system, np.clip(q, lower, upper), free)
        if not closing.closed:
            break
        q = closing.q
    return closed


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
            there = close(system, ahead)
            if there.closed and _largest(there.q - q) >= 0.2 * _largest(ahead - q):
                q = there.q
                yield q
                break


def generic_rank(system: LoopSystem, q: Array) -> tuple[int, Array]:
    """Return the generic rank of the loops, and a closed configuration (nq,) where it is reached.

    It is the largest rank on random closed configurations around the closed q, which may be singular itself. Where
    branches of closed configurations meet at q, many walks end near q and near a singularity; further ones are made
    then. The mobility is the number of degrees of freedom less this rank.
    """
    found, where = rank(system.evaluate(q)[1]), q
    for walk in range(_WALKS):
        is_clear = True
        for there in closed_walk(system, q, _SAMPLES, walk):
            jacobian = system.evaluate(there)[1]
            count = rank(jacobian)
            if count > found:
                found, where = count, there
            is_clear = is_clear and rank(jacobian, 1e-2 * RANK) == rank(jacobian, 1e2 * RANK)
        if is_clear:
            break
    return found, where


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
    return [_largest(part) for part in _residuals(loops, q)]


def shown_gaps(loops: KindedLoops, q: Array) -> list[str]:
    """Return the residual of each loop and coupling at q (nq,) as text: mm and degrees, in the axes of the loop's first
    end."""
    found = _residuals(loops, q)
    texts = [_shown_gap(kind, part, loops.length) for kind, part in zip(loops.kinds, found, strict=False)]
    return texts + [f"{_largest(part):.3g} rad or characteristic lengths" for part in found[len(texts) :]]


def _residuals(loops: KindedLoops, q: Array) -> list[Array]:
    c = loops.evaluate(q)[0]
    ends = np.cumsum([ROWS[kind] for kind in loops.kinds], dtype=int)
    couplings = ends[-1] if ends.size else 0
    return [*np.split(c[:couplings], ends)[:-1], *c[couplings:, None]]


def _shown_gap(kind: LoopKind, c: Array, length: float) -> str:
    """Return the residual of a loop as text: what is a thousandth of the rest is left out."""
    count = 2 if kind is LoopKind.PRISMATIC else 3
    found = []
    sizes = (c[:count], 1e3 * length, "mm", "along"), (c[count:], math.degrees(1.0), "degrees", "about")
    for part, scale, unit, word in sizes:
        if _largest(part) > 1e-3 * _largest(c):
            size = float(np.linalg.norm(part))
            axis = f" {word} {'xyz'[int(np.argmax(np.abs(part)))]}" if _largest(part) > 0.95 * size else ""
            found.append(f"{scale * size:.3g} {unit}{axis}")
    return " and ".join(found) or "0 mm"


def why_open(loops: KindedLoops, names: Sequence[str], start: Array, best: Closing, raff: bool) -> str:
    """Return the text of an error: which loops and couplings can't be closed, and what would close them: other axes of
    their ends, or weaker kinds.

    Args:
        loops: that can't be closed.
        names: of all loops and couplings.
        start: (nq,) the configuration as written.
        best: the best attempt.
        raff: whether the file is RAFF, in which the remedy is written then.
    """
    from raff2urdf.near_redundancy import LARGEST_GAP, MOST_ROWS, near_redundancy  # which imports this module

    kinds, remaining = loops.kinds, gaps(loops, best.q)
    open_loops = [i for i, gap in enumerate(remaining) if gap > CLOSED]
    jacobian = loops.evaluate(best.q)[1]
    what = texts.LOOPS_AND_COUPLINGS if len(names) > len(kinds) else texts.LOOPS
    words = [kind.name.lower() for kind in kinds] + ["coupling"] * (len(names) - len(kinds))
    shown = shown_gaps(loops, best.q)
    listed = ", ".join(f"'{names[i]}' ({words[i]}, {shown[i]})" for i in open_loops[:8])
    more = texts.MORE_OPEN.format(count=len(open_loops) - 8) if len(open_loops) > 8 else ""
    lines = [
        texts.STAY_OPEN.format(what=what, listed=listed, more=more),
        f"these are the least gaps found, in the axes of each loop's first end; {jacobian.shape[0]} loop rows of "
        f"rank {rank(jacobian)} on {jacobian.shape[1]} joints",
    ]
    if max(remaining) <= LARGEST_GAP and len(jacobian) <= MOST_ROWS and near_redundancy(loops, best.q, start):
        lines.append("these loops are nearly redundant, since numbers are rounded: `cinegen heal` writes exact ones")
    turns = _turns(loops, open_loops, start)
    apart = [f"{' and '.join(loops.ends[i])} are {angle:.4g} degrees apart" for i, (angle, *_) in turns.items()]
    turned = loops.with_turned({i: (np.eye(3), turn) for i, (_, _, turn) in turns.items()})
    if turns and close_from_afar(turned, start).closed:
        edits = [_edit(loops.ends[i][1], angle, about, raff) for i, (angle, about, _) in turns.items()]
        lines.append(f"the z axes of {', of '.join(apart)} as written. It closes with {'; and '.join(edits)}")
        return "\n  ".join(lines)
    for weaker in (LoopKind.REVOLUTE, LoopKind.BALL):
        changed = [i for i in open_loops if i < len(kinds) and ROWS[kinds[i]] > ROWS[weaker]]
        trial = [weaker if i in changed else kind for i, kind in enumerate(kinds)]
        if changed and close_from_afar(loops.with_kinds(trial), start).closed:
            kind = weaker.name.lower()
            typed = " ".join(f"--loop {shell_word(names[i])}={kind}" for i in changed)
            python = ", ".join(f'{json.dumps(names[i], ensure_ascii=False)}: "{kind}"' for i in changed)
            lines.append(
                f"it closes with {kind} joints there: loops={{{python}}} in Python, {typed} as a command's option"
            )
            if apart and weaker is LoopKind.BALL:
                lines.append(f"but hinges need parallel axes: the z axes of {', of '.join(apart)} as written")
            break
    else:
        if any(i < len(kinds) for i in open_loops):
            lines.append("neither revolute nor ball joints there would close it")
    return "\n  ".join(lines)


def _turns(loops: KindedLoops, open_loops: Sequence[int], start: Array) -> dict[int, tuple[float, float, Array]]:
    """Return for open hinges whose z axes are not parallel as written: the angle between them, and about which axis of
    the second end's x and y it is turned to make them parallel, by its angle from x, degrees; and that rotation."""
    found, placed = {}, loops.placements(start)
    for i in open_loops:
        if i < len(loops.kinds) and loops.kinds[i] is LoopKind.REVOLUTE:
            swung, _ = swing(placed[i][2, :3])  # the first end's z axis, seen from the second
            angle = math.degrees(float(np.linalg.norm(swung)))
            if angle > _PARALLEL:
                about = math.degrees(math.atan2(swung[1], swung[0]))
                found[i] = angle, about, _rotation(np.append(swung, 0.0))
    return found


def _rotation(vector: Array) -> Array:
    """Return the rotation (3, 3) of a rotation vector (3,) that is not 0."""
    angle = float(np.linalg.norm(vector))
    k = skew(vector / angle)
    return np.asarray(np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * k @ k)


def _edit(end: str, angle: float, about: float, raff: bool) -> str:
    """Return how the axes of an end are turned."""
    if raff:
        around = f"gamma {about:.8g} " if abs(about) > _PARALLEL else ""
        back = f" theta {-about:.8g}" if around else ""
        return f"a frame on {end}, 'parameters {{ {around}alpha {angle:.8g}{back} }}', as that end of the loop"
    axes = {0: "its x", 90: "its y", 180: "its -x", -180: "its -x", -90: "its -y"}
    near = min(axes, key=lambda at: abs(about - at))
    axis = axes[near] if abs(about - near) < _PARALLEL else f"an axis {about:.4g} degrees from its x to its y"
    return f"the frame of {end} turned by {angle:.4g} degrees about {axis}"


def _largest(values: Array) -> float:
    return float(np.abs(values).max()) if values.size else 0.0
