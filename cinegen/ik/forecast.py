"""What lies ahead: where the present tasks lead to a singularity, a joint's limit or the end of reach.

After L. Flückiger, L. Piguet and C. Baur, "Generic robotic kinematic generator for virtual environment interfaces",
section 4: "display in advance the singular configuration in which the robot will go".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.ahead import Path
from cinegen.ik.step import Status
from cinegen.ik.thresholds import REST
from raff2urdf.closure import close

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TICKS = 100
"""A forecast has so many ticks at most, unless its dt is given."""

_TOUCH = 1e-9  # rad or lengths: a joint this near to its limit has met it
_FAR = 0.02  # rad or lengths: a joint this far from its limit may meet it again
_AWAY = 1.2  # times a threshold: a singular value above may fall below it again
_AGAIN = 1e-4  # rad or lengths in a tick: what moves so fast may come to rest again
_SAME = 0.5  # product of the cosines between singular vectors that belong together


class EventKind(Enum):
    """What may lie ahead."""

    TYPE_1 = "a direction is about to be lost: type 1 singularity"
    TYPE_2 = "a motion is about to be gained: type 2 singularity"
    LIMIT = "a joint meets its limit"
    STOPPED = "nothing moves any more and a target is not reached"


@dataclass(frozen=True, eq=False)
class Event:
    """Something that lies ahead.

    Attributes:
        kind: what.
        time: seconds from now; 0 where it is so already.
        q: (nq,) where, loops closed.
        sigma: the smallest singular value there, without unit: of the passive joints for type 2, else of the tasks.
        joint: the one that meets its limit; None for other kinds.
    """

    kind: EventKind
    time: float
    q: Array
    sigma: float
    joint: str | None = None

    def __str__(self) -> str:
        what = self.kind.value if self.joint is None else f"{self.joint} meets its limit"
        return f"in {self.time:.2f} s {what}" if self.time else f"now {what}"

    def __repr__(self) -> str:
        return f"<Event {self.kind.name}: {self}>"


@dataclass(frozen=True, eq=False)
class Forecast:
    """Where the present tasks lead.

    Attributes:
        times: (ticks + 1,) seconds from now, 0 first.
        q: (ticks + 1, nq) the path.
        sigma_min: (ticks + 1,) the smallest singular value of the tasks along it (type 1), as many as their generic
            rank; infinite where nothing is pulled that can move.
        passive_sigma_min: (ticks + 1,) that of the passive joints (type 2); infinite without loops.
        events: what lies ahead, in the order of time.
    """

    times: Array
    q: Array
    sigma_min: Array
    passive_sigma_min: Array
    events: tuple[Event, ...]

    def __repr__(self) -> str:
        return f"<Forecast of {self.times[-1]:.3g} s: {'; '.join(map(str, self.events)) or 'nothing ahead'}>"


def foresee(path: Path, threshold: float, passive_threshold: float) -> Forecast:
    """What a path meets.

    Args:
        path: of a solver that ran ahead.
        threshold: of the tasks' smallest singular value, without unit.
        passive_threshold: of the passive joints' smallest singular value, without unit.
    """
    tasks = _signed(path.tasks, path.task_rank)
    passive = _signed(path.passive, path.mechanism.passive_rank)
    sigma, passive_sigma = np.abs(tasks), np.abs(passive)
    events = []
    for x in _crossings(tasks, threshold):
        found = threshold if x else float(sigma[0])
        events.append(Event(EventKind.TYPE_1, x * path.dt, _at(path, x), found))
    for x in _crossings(passive, passive_threshold):
        found = passive_threshold if x else float(passive_sigma[0])
        events.append(Event(EventKind.TYPE_2, x * path.dt, _at(path, x), found))
    for x, column, bound in _limits(path):
        q, joint = _at(path, x, column, bound), path.mechanism.columns[column]
        events.append(Event(EventKind.LIMIT, x * path.dt, q, _between(sigma, x), joint))
    for k in _rests(path):
        events.append(Event(EventKind.STOPPED, k * path.dt, path.q[k].copy(), float(sigma[k])))
    events.sort(key=lambda event: event.time)
    times = path.dt * np.arange(len(path.q), dtype=np.float64)
    return Forecast(times, path.q, sigma, passive_sigma, tuple(events))


def _signed(matrices: Array, rank: int) -> Array:
    """(t,) the smallest of the first `rank` singular values of each matrix (t, rows, columns); infinite for rank 0
    (or for a target whose rotation is none, and overflows).

    Its sign changes wherever it passes through 0 between two of them. By Weyl's inequality the matrix changes there by
    at least as much as both values together; and as singular vectors go on smoothly, one of them seems to turn round.
    """
    if rank == 0 or not np.isfinite(matrices).all():
        return np.full(len(matrices), np.inf)
    signed = np.linalg.svd(matrices, compute_uv=False)[:, rank - 1]
    changed = np.linalg.norm(np.diff(matrices, axis=0), axis=(1, 2))
    for k in np.flatnonzero(signed[1:] + signed[:-1] <= changed):
        u, _, vt = np.linalg.svd(matrices[k : k + 2], full_matrices=False)
        if (u[0, :, rank - 1] @ u[1, :, rank - 1]) * (vt[0, rank - 1] @ vt[1, rank - 1]) < -_SAME:
            signed[k + 1 :] *= -1.0
    return np.asarray(signed)


def _begins(inside: Mask, outside: Mask) -> Iterator[int]:
    """At which ticks something begins; again only after it has clearly ended, so that nothing flickers.

    Args:
        inside: (t,) whether it is so.
        outside: (t,) whether it is clearly not so.
    """
    ended = True
    for k in np.flatnonzero(inside | outside):
        if inside[k] and ended:
            yield int(k)
        ended = not inside[k]


def _crossings(signed: Array, threshold: float) -> Iterator[float]:
    """Where, in ticks, a singular value gets below a threshold; 0 if it is there from the beginning."""
    size = np.abs(signed)
    through = np.concatenate([[False], signed[1:] * signed[:-1] < 0.0])
    for k in _begins((size < threshold) | through, size > _AWAY * threshold):
        if k == 0:
            yield 0.0
        else:
            end = -size[k] if through[k] else size[k]
            yield float(k - 1 + (size[k - 1] - threshold) / (size[k - 1] - end))


def _limits(path: Path) -> Iterator[tuple[float, int, float]]:
    """Where, in ticks, a joint meets a limit, its column and the limit; 0 if one holds the motion back already."""
    mechanism = path.mechanism
    for at, column in zip(*mechanism.scalar_joints, strict=True):
        for bound, side in ((mechanism.limits.lower[at], -1.0), (mechanism.limits.upper[at], 1.0)):
            left = side * (bound - path.q[:, at]) / mechanism.scale[column]
            for k in _begins(left <= _TOUCH, left > _FAR):
                if k > 0:
                    speed = side * path.steps[k - 1, column]  # in the tick before: that one was not cut short
                    part = min(1.0, left[k - 1] / speed) if speed > 0.0 else 1.0
                    yield float(k - 1 + part), column, bound
                elif path.stopped[0, column]:
                    yield 0.0, column, bound


def _rests(path: Path) -> Iterator[int]:
    """After which ticks nothing moves any more and a target is not reached."""
    short = np.array([status in (Status.AT_LIMIT, Status.OUT_OF_REACH, Status.REFUSED) for status in path.statuses])
    fastest = np.abs(path.steps[1:]).max(axis=1, initial=0.0)
    return _begins(short & (fastest < REST), fastest > _AGAIN)


def _at(path: Path, x: float, column: int | None = None, bound: float = 0.0) -> Array:
    """(nq,) the configuration between two ticks, loops closed; with a joint on its bound where one is given."""
    mechanism, k = path.mechanism, min(int(x), len(path.q) - 2)
    q = mechanism.interpolate(path.q[k], path.q[k + 1], x - k)
    free = np.ones(mechanism.model.nv, dtype=bool)
    if column is not None:
        q[mechanism.q_index(mechanism.columns[column])] = bound
        free[column] = False
    if not mechanism.loops:
        return q
    closing = close(mechanism.system, q, free)
    return closing.q if closing.closed else path.q[k + 1].copy()


def _between(values: Array, x: float) -> float:
    """Of a value at each tick, what it is in between."""
    k = min(int(x), len(values) - 2)
    if not np.isfinite(values[k : k + 2]).all():
        return float(values[k])
    return float(values[k] + (x - k) * (values[k + 1] - values[k]))
