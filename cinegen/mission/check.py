"""Checks a joint motion before it is handed on: loops, limits, and singularities at its samples and between them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.singular import NEAR_PASSIVE, gained
from cinegen.ik.thresholds import NEAR, NEAR_TYPE_2
from cinegen.loops.thresholds import CLOSURE
from cinegen.mission.recording import between
from cinegen.mission.trajectory import Trajectory
from cinegen.model import Mechanism
from cinegen.singularities.crossing import Rows, crossings, of_end, of_passive_joints

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_AWAY = 1.2  # times a threshold: a singular value above has left it
_MOTOR = 1e-9  # rad or lengths: rounding at a limit
_PASSIVE = 1e-3  # rad or lengths that a joint may be beyond: between recorded samples it follows the motors
_SPEED = 1e-6  # part of a velocity limit
_SAME = 1e-6  # part of a period: two crossings so near are one
_AT_ONCE = 1000  # matrices


class FindingKind(Enum):
    """What may be found."""

    OPEN = "loops are open"
    LIMIT = "a joint is beyond a limit"
    SPEED = "a joint is faster than it may"
    TYPE_2 = "a type 2 singularity is passed or reached: motors lose their hold"
    NEAR_TYPE_2 = "a type 2 singularity is near"
    TYPE_1 = "a type 1 singularity is passed: the end loses a direction"
    NEAR_TYPE_1 = "a type 1 singularity is near"
    NO_SPEED_LIMIT = "nothing says how fast a motor may be"
    UNDRIVEN = "joints may move though all motors are held"

    @property
    def serious(self) -> bool:
        """Whether a robot must not be sent there."""
        return self in (FindingKind.OPEN, FindingKind.LIMIT, FindingKind.SPEED, FindingKind.TYPE_2)


@dataclass(frozen=True, eq=False)
class Finding:
    """Something that was found.

    Attributes:
        kind: what.
        time: s in the trajectory: where it begins; where it is nearest, for what is near.
        recorded: the same moment in the recording, s.
        words: for people.
        q: (nq,) there.
        sigma: the smallest singular value there, without unit; None for what is no singularity.
    """

    kind: FindingKind
    time: float
    recorded: float
    words: str
    q: Array
    sigma: float | None = None

    def __str__(self) -> str:
        same = abs(self.time - self.recorded) < 5e-4
        when = f"at {self.time:.3f} s" + ("" if same else f" ({self.recorded:.3f} s of the recording)")
        return f"{when} {self.words}"


@dataclass(frozen=True, eq=False)
class Findings:
    """All that was found, in the order of time.

    Attributes:
        all: of them.
        closure: the largest loop residual of all samples, rad or characteristic lengths.
        sigma: the smallest singular value of the end at a sample, without unit (type 1); infinite where nothing moves.
        passive_sigma: that of the passive joints (type 2); infinite without loops.
    """

    all: tuple[Finding, ...]
    closure: float
    sigma: float
    passive_sigma: float

    @property
    def serious(self) -> tuple[Finding, ...]:
        """Those because of which a robot must not be sent there."""
        return tuple(finding for finding in self.all if finding.kind.serious)

    def __iter__(self) -> Iterator[Finding]:
        return iter(self.all)

    def __len__(self) -> int:
        return len(self.all)


def check(trajectory: Trajectory, threshold: float = NEAR, passive_threshold: float = NEAR_PASSIVE) -> Findings:
    """Checks a motion.

    Args:
        trajectory: which.
        threshold: below which singular value the end is near a singularity of type 1, without unit.
        passive_threshold: below which one the passive joints are near one of type 2.

    Returns:
        loops open by more than 1e-10 (rad or characteristic lengths), limits of position and velocity that are not
        kept, both at the samples; singularities at the samples and between them.
    """
    mechanism, q = trajectory.mechanism, trajectory.q
    gaps = _of_each(q, lambda one: np.array(mechanism.closure(one)))
    found = [*_undriven(trajectory), *_open(trajectory, gaps), *_limits(trajectory), *_speeds(trajectory)]
    end, passive = of_end(mechanism), of_passive_joints(mechanism) if mechanism.passive_rank else None
    kinds = (FindingKind.TYPE_1, FindingKind.NEAR_TYPE_1)
    sigma = _singular(trajectory, end, threshold, kinds, found) if end.rank else np.full(len(q), np.inf)
    passive_sigma = np.full(len(q), np.inf)
    if passive is not None:
        kinds = (FindingKind.TYPE_2, FindingKind.NEAR_TYPE_2)
        passive_sigma = _singular(trajectory, passive, passive_threshold, kinds, found)
    found.sort(key=lambda finding: finding.time)
    return Findings(tuple(found), float(gaps.max()), float(sigma.min()), float(passive_sigma.min()))


def _finding(
    trajectory: Trajectory, kind: FindingKind, time: float, words: str, q: Array, sigma: float | None = None
) -> Finding:
    return Finding(kind, float(time), trajectory.recorded(time), words, q.copy(), sigma)


def _stretches(inside: Mask, outside: Mask | None = None) -> Iterator[slice]:
    """Where something is so: from the first sample of each stretch to the one before it has clearly ended."""
    ended = ~inside if outside is None else outside
    begin: int | None = None
    for k in np.flatnonzero(inside | ended):
        if inside[k] and begin is None:
            begin = int(k)
        elif ended[k] and begin is not None:
            yield slice(begin, int(k))
            begin = None
    if begin is not None:
        yield slice(begin, len(inside))


# --- loops and limits ------------------------------------------------------------------------------------------------


def _undriven(trajectory: Trajectory) -> Iterator[Finding]:
    mechanism = trajectory.mechanism
    count = len(mechanism.passive_columns) - mechanism.passive_rank
    if count:
        words = f"what the motors do leaves {count} freedom{'s' * (count != 1)} of {trajectory.name} to itself"
        yield _finding(trajectory, FindingKind.UNDRIVEN, 0.0, words, trajectory.q[0])


def _open(trajectory: Trajectory, gaps: Array) -> Iterator[Finding]:
    for part in _stretches(~(gaps <= CLOSURE)):
        words = f"the loops are open by {gaps[part].max():.2g} (rad or lengths)"
        yield _finding(trajectory, FindingKind.OPEN, trajectory.times[part.start], words, trajectory.q[part.start])


def _unit(mechanism: Mechanism, joint: str) -> str:
    return "m" if mechanism.slides(joint) else "rad"


def _limits(trajectory: Trajectory) -> Iterator[Finding]:
    mechanism = trajectory.mechanism
    for joint, (lower, upper, *_) in mechanism.limits.items():
        spare = _MOTOR if joint in mechanism.actuated else _PASSIVE
        spare *= mechanism.scale[mechanism.v_index(joint)]
        course = trajectory.q[:, mechanism.q_index(joint)]
        for sign, word, bound in ((-1, "lower", lower), (1, "upper", upper)):
            beyond = sign * (course - bound)
            for part in _stretches(beyond > spare):
                unit = _unit(mechanism, joint)
                words = f"{joint} goes {beyond[part].max():.3g} {unit} beyond its {word} limit of {bound:.5g} {unit}"
                yield _finding(
                    trajectory, FindingKind.LIMIT, trajectory.times[part.start], words, trajectory.q[part.start]
                )


def _speeds(trajectory: Trajectory) -> Iterator[Finding]:
    mechanism, times = trajectory.mechanism, trajectory.times
    if len(times) < 2:
        return
    steps = np.abs(np.diff(trajectory.q, axis=0)) / np.diff(times)[:, None]
    unlimited: list[tuple[float, str]] = []
    for joint, (_, _, limit, _) in mechanism.limits.items():
        speed, unit = steps[:, mechanism.q_index(joint)], f"{_unit(mechanism, joint)}/s"
        for part in _stretches(~(speed <= limit * (1.0 + _SPEED))):
            words = f"{joint} moves at {speed[part].max():.4g} {unit}, its limit is {limit:.4g} {unit}"
            yield _finding(trajectory, FindingKind.SPEED, times[part.start], words, trajectory.q[part.start])
        if joint in mechanism.actuated and not np.isfinite(limit):
            unlimited.append((float(speed.max() / mechanism.scale[mechanism.v_index(joint)]), joint))
    if unlimited:
        _, joint = max(unlimited)
        speed = steps[:, mechanism.q_index(joint)]
        k = int(speed.argmax())
        words = f"{joint}, which has no velocity limit, moves at {speed[k]:.3g} {_unit(mechanism, joint)}/s"
        yield _finding(trajectory, FindingKind.NO_SPEED_LIMIT, times[k], words, trajectory.q[k])


# --- singularities ---------------------------------------------------------------------------------------------------


def _singular(
    trajectory: Trajectory, rows: Rows, threshold: float, kinds: tuple[FindingKind, FindingKind], found: list[Finding]
) -> Array:
    """Adds the singularities of a kind that are passed and those that are near; (n,) the smallest singular values."""
    mechanism, q, times = trajectory.mechanism, trajectory.q, trajectory.times
    passed, near = kinds
    matrices = _of_each(q, rows.of)
    sigma = np.concatenate([rows.sigma(matrices[k : k + _AT_ONCE]) for k in range(0, len(q), _AT_ONCE)])
    changed = np.linalg.norm(np.diff(matrices, axis=0), axis=(1, 2))
    through = np.zeros(len(q), dtype=bool)
    for k in np.flatnonzero((sigma[1:] + sigma[:-1] <= changed) & (changed > 0.0)):
        way = partial(between, mechanism, q[k], q[k + 1])
        for crossing in crossings(rows, way):
            time = float(times[k] + crossing.x * (times[k + 1] - times[k]))
            if found and found[-1].kind is passed and time - found[-1].time <= _SAME * (times[k + 1] - times[k]):
                continue  # it is at a sample, and was found before it
            words = f"it passes through a {_said(mechanism, passed, rows, crossing.q)}"
            value = float(rows.sigma(rows.of(crossing.q)[None])[0])
            found.append(_finding(trajectory, passed, time, words, crossing.q, value))
            through[k : k + 2] = True
    for part in _stretches(sigma < threshold, sigma > _AWAY * threshold):
        if through[max(0, part.start - 1) : part.stop + 1].any():
            continue
        k = part.start + int(sigma[part].argmin())
        at_it = passed is FindingKind.TYPE_2 and sigma[k] < NEAR_TYPE_2
        said = _said(mechanism, passed, rows, q[k])
        words = f"it is at a {said}" if at_it else f"it is near a {said}; singular value {sigma[k]:.2g}"
        found.append(_finding(trajectory, passed if at_it else near, float(times[k]), words, q[k], float(sigma[k])))
    return sigma


def _of_each(q: Array, of: Callable[[Array], Array]) -> Array:
    """(n, ...) a value at each sample; where the robot stands still, computed once."""
    found = [of(q[0])]
    for before, now in pairwise(q):
        found.append(found[-1] if np.array_equal(before, now) else of(now))
    return np.array(found)


def _said(mechanism: Mechanism, kind: FindingKind, rows: Rows, q: Array) -> str:
    """Which singularity, and what it does."""
    if kind is FindingKind.TYPE_2:
        motion = gained(mechanism, q)
        moves = np.abs(motion.joints / mechanism.scale) if motion is not None else np.zeros(mechanism.model.nv)
        joint = mechanism.columns[int(moves.argmax())]
        return f"type 2 singularity, where the motors do not hold {joint}"
    u = np.linalg.svd(rows.of(q))[0][:, rows.rank - 1]
    axis = int(np.abs(u).argmax())
    way = f"{'along' if axis < 3 else 'about'} its {'xyz'[axis % 3]}"
    return f"type 1 singularity, where {mechanism.end} can't move {way}"
