"""Check of a joint trajectory before export: loops, limits, and singularities at its samples and between them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import partial
from itertools import pairwise

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.ik.singular_values import gained
from cinegen.mission.recording import between
from cinegen.mission.trajectory import Trajectory
from cinegen.model import Mechanism
from cinegen.singularities.crossing import Rows, can_vanish, crossings, of_end, of_passive_joints
from cinegen.tolerances import AT_SINGULAR, CLOSURE, NEAR_SINGULAR
from raff2urdf.quantities import ANGLE, ANGULAR_SPEED, LENGTH, SPEED, shown

_AWAY = 1.2  # times a threshold, above which a singular value has left it
_ACTUATED = 1e-9  # rad or lengths: rounding at a limit
_PASSIVE = 1e-3  # rad or lengths that an interpolated passive joint may be beyond a limit
_RATE = 1e-6  # relative to a limit of velocity or acceleration
_SAME = 1e-6  # of a period: distance of two crossings that are one
_AT_ONCE = 1000  # matrices at once


class FindingKind(Enum):
    """Kinds of findings."""

    OPEN = "loops are open"
    LIMIT = "a joint is beyond a limit"
    SPEED = "a joint exceeds its velocity limit"
    ACCELERATION = "a joint exceeds its acceleration limit"
    TYPE_2 = "a type 2 singularity is passed or reached: the actuated joints lose control"
    CROSSED = "a type 2 singularity is crossed at a speed at which torques stay within their limits"
    NEAR_TYPE_2 = "a type 2 singularity is near"
    TYPE_1 = "a type 1 singularity is passed: the end loses a DoF"
    NEAR_TYPE_1 = "a type 1 singularity is near"
    UNCONTROLLED = "joints may move while all actuated joints are locked"

    @property
    def serious(self) -> bool:
        """True for findings with which the trajectory must not be sent to a robot."""
        return self in (
            FindingKind.OPEN, FindingKind.LIMIT, FindingKind.SPEED, FindingKind.ACCELERATION, FindingKind.TYPE_2
        )  # fmt: skip


_TYPE_2 = (FindingKind.TYPE_2, FindingKind.CROSSED)


@dataclass(frozen=True, eq=False)
class Finding:
    """One finding.

    Attributes:
        kind: kind of the finding.
        time: time in the trajectory, s: of its start, or of the smallest distance to a singularity.
        recorded: the same moment in the recording, s.
        message: description for users.
        q: (nq,) configuration.
        sigma: smallest singular value there, dimensionless; None unless it is a singularity.
    """

    kind: FindingKind
    time: float
    recorded: float
    message: str
    q: Array
    sigma: float | None = None

    def __repr__(self) -> str:
        return f"<Finding: {self}>"

    def __str__(self) -> str:
        same = abs(self.time - self.recorded) < 5e-4
        when = f"at {self.time:.3f} s" + ("" if same else f" ({self.recorded:.3f} s of the recording)")
        return f"{when} {self.message}"


@dataclass(frozen=True, eq=False)
class Findings:
    """Findings in the order of time.

    Attributes:
        all: all findings.
        closure: largest loop residual of all samples, rad or characteristic lengths.
        sigma: smallest singular value of the end at a sample, dimensionless (type 1); infinite if nothing moves.
        passive_sigma: smallest singular value of the passive joints (type 2); infinite without loops.
    """

    all: tuple[Finding, ...]
    closure: float
    sigma: float
    passive_sigma: float

    @property
    def serious(self) -> tuple[Finding, ...]:
        """Findings with which the trajectory must not be sent to a robot."""
        return tuple(finding for finding in self.all if finding.kind.serious)

    def __iter__(self) -> Iterator[Finding]:
        return iter(self.all)

    def __len__(self) -> int:
        return len(self.all)


def check(
    trajectory: Trajectory, threshold: float = NEAR_SINGULAR, passive_threshold: float = NEAR_SINGULAR
) -> Findings:
    """Check a trajectory.

    Args:
        trajectory: trajectory to check.
        threshold: singular value of the end, dimensionless, below which a type 1 singularity is near.
        passive_threshold: singular value of the passive joints below which a type 2 singularity is near.

    Returns:
        At the samples: loops open by more than 1e-10 (rad or characteristic lengths), violated limits of position,
        velocity and acceleration (`Trajectory.limits`). At the samples and between them: singularities.
    """
    mechanism, q = trajectory.mechanism, trajectory.q
    gaps = _of_each(q, lambda row: np.array(mechanism.closure(row)))
    findings = [*_uncontrolled(trajectory), *_open(trajectory, gaps), *_limits(trajectory), *_rates(trajectory)]
    end, passive = of_end(mechanism), of_passive_joints(mechanism) if mechanism.structure.passive_rank else None
    kinds = (FindingKind.TYPE_1, FindingKind.NEAR_TYPE_1)
    sigma = _singular(trajectory, end, threshold, kinds, findings) if end.rank else np.full(len(q), np.inf)
    passive_sigma = np.full(len(q), np.inf)
    if passive is not None:
        crosses = trajectory.torques is not None and trajectory.torques.crosses
        kinds = (FindingKind.CROSSED if crosses else FindingKind.TYPE_2, FindingKind.NEAR_TYPE_2)
        passive_sigma = _singular(trajectory, passive, passive_threshold, kinds, findings)
    findings.sort(key=lambda finding: finding.time)
    return Findings(tuple(findings), float(gaps.max()), float(sigma.min()), float(passive_sigma.min()))


def _finding(
    trajectory: Trajectory, kind: FindingKind, time: float, message: str, q: Array, sigma: float | None = None
) -> Finding:
    return Finding(kind, float(time), trajectory.recorded(time), message, q.copy(), sigma)


def _at(trajectory: Trajectory, kind: FindingKind, sample: int, message: str) -> Finding:
    return _finding(trajectory, kind, trajectory.times[sample], message, trajectory.q[sample])


def _intervals(inside: Bools, outside: Bools | None = None) -> Iterator[slice]:
    """Iterate over the intervals of samples in which a condition holds, until it has clearly ended."""
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


def _uncontrolled(trajectory: Trajectory) -> Iterator[Finding]:
    mechanism = trajectory.mechanism
    count = mechanism.structure.uncontrolled_dof
    if count:
        message = f"the actuated joints leave {count} DoF of {trajectory.name} uncontrolled"
        yield _at(trajectory, FindingKind.UNCONTROLLED, 0, message)


def _open(trajectory: Trajectory, gaps: Array) -> Iterator[Finding]:
    for part in _intervals(~(gaps <= CLOSURE)):
        message = f"the loops are open by {gaps[part].max():.2g} (rad or lengths)"
        yield _at(trajectory, FindingKind.OPEN, part.start, message)


def _limits(trajectory: Trajectory) -> Iterator[Finding]:
    mechanism = trajectory.mechanism
    for joint, (lower, upper, *_) in mechanism.limits.items():
        spare = _ACTUATED if joint in mechanism.actuated else _PASSIVE
        spare *= mechanism.scale[mechanism.v_index(joint)]
        positions = trajectory.q[:, mechanism.q_index(joint)]
        for sign, word, bound in ((-1, "lower", lower), (1, "upper", upper)):
            beyond = sign * (positions - bound)
            for part in _intervals(beyond > spare):
                dimension = LENGTH if mechanism.is_prismatic(joint) else ANGLE
                much, limit = shown(float(beyond[part].max()), dimension, 3), shown(bound, dimension, 5)
                message = f"{joint} is {much} beyond its {word} limit of {limit}"
                yield _at(trajectory, FindingKind.LIMIT, part.start, message)


def _rates(trajectory: Trajectory) -> Iterator[Finding]:
    """Yield the joints whose finite differences exceed their limits of velocity or acceleration."""
    mechanism, limits, rate = trajectory.mechanism, trajectory.limits, trajectory.rate
    steps = np.diff(trajectory.q, axis=0)
    changes = np.diff(np.pad(steps, ((1, 1), (0, 0))), axis=0)  # at rest before and after
    for joint in mechanism.joints:
        i, j, prismatic = mechanism.q_index(joint), mechanism.v_index(joint), mechanism.is_prismatic(joint)
        unit = "m" if prismatic else "rad"
        for part in _intervals(~(np.abs(steps[:, i]) * rate <= limits.velocity[j] * (1.0 + _RATE))):
            dimension = SPEED if prismatic else ANGULAR_SPEED
            most, limit = (float(np.abs(steps[part, i]).max()) * rate, float(limits.velocity[j]))
            message = f"{joint} moves at {shown(most, dimension)}, its limit is {shown(limit, dimension)}"
            yield _at(trajectory, FindingKind.SPEED, part.start, message)
        for part in _intervals(~(np.abs(changes[:, i]) * rate * rate <= limits.acceleration[j] * (1.0 + _RATE))):
            most, limit = (float(np.abs(changes[part, i]).max()) * rate * rate, float(limits.acceleration[j]))
            message = f"{joint} accelerates at {most:.4g} {unit}/s^2, its limit is {limit:.4g} {unit}/s^2"
            yield _at(trajectory, FindingKind.ACCELERATION, part.start, message)


# --- singularities ---------------------------------------------------------------------------------------------------


def _singular(
    trajectory: Trajectory, rows: Rows, threshold: float, kinds: tuple[FindingKind, FindingKind], known: list[Finding]
) -> Array:
    """Add the singularities of a type that are passed or near. Return the smallest singular values, (n,)."""
    mechanism, q, times = trajectory.mechanism, trajectory.q, trajectory.times
    passed, near = kinds
    matrices = _of_each(q, rows.of)
    sigma = np.concatenate([rows.sigma(matrices[k : k + _AT_ONCE]) for k in range(0, len(q), _AT_ONCE)])
    changed = np.linalg.norm(np.diff(matrices, axis=0), axis=(1, 2))
    through = np.zeros(len(q), dtype=bool)
    for k in np.flatnonzero(can_vanish(sigma[1:], sigma[:-1], changed) & (changed > 0.0)):
        segment = partial(between, mechanism, q[k], q[k + 1])
        for crossing in crossings(rows, segment):
            time = float(times[k] + crossing.x * (times[k + 1] - times[k]))
            if known and known[-1].kind is passed and time - known[-1].time <= _SAME * (times[k + 1] - times[k]):
                continue  # at a sample, found in the interval before
            message = f"it passes through a {_description(mechanism, passed, rows, crossing.q)}"
            if passed is FindingKind.CROSSED:
                message += ", at a speed at which torques stay within their limits"
            value = float(rows.sigma(rows.of(crossing.q)[None])[0])
            known.append(_finding(trajectory, passed, time, message, crossing.q, value))
            through[k : k + 2] = True
    for part in _intervals(sigma < threshold, sigma > _AWAY * threshold):
        if through[max(0, part.start - 1) : part.stop + 1].any():
            continue
        k = part.start + int(sigma[part].argmin())
        at_it = passed in _TYPE_2 and sigma[k] < AT_SINGULAR
        described = _description(mechanism, passed, rows, q[k])
        message = f"it is at a {described}" if at_it else f"it is near a {described}; singular value {sigma[k]:.2g}"
        known.append(_finding(trajectory, passed if at_it else near, float(times[k]), message, q[k], float(sigma[k])))
    return sigma


def _of_each(q: Array, of: Callable[[Array], Array]) -> Array:
    """Return a value at each sample, (n, ...); it is computed once while the robot is at rest."""
    values = [of(q[0])]
    for before, now in pairwise(q):
        values.append(values[-1] if np.array_equal(before, now) else of(now))
    return np.array(values)


def _description(mechanism: Mechanism, kind: FindingKind, rows: Rows, q: Array) -> str:
    """Return a description of a singularity and its effect."""
    if kind in _TYPE_2:
        motion = gained(mechanism, q)
        moves = np.abs(motion.joints / mechanism.scale) if motion is not None else np.zeros(mechanism.model.nv)
        joint = mechanism.columns[int(moves.argmax())]
        return f"type 2 singularity, where the actuated joints do not control {joint}"
    u = np.linalg.svd(rows.of(q))[0][:, rows.rank - 1]
    axis = int(np.abs(u).argmax())
    direction = f"{'along' if axis < 3 else 'about'} its {'xyz'[axis % 3]}"
    return f"type 1 singularity, where {mechanism.end} can't move {direction}"
