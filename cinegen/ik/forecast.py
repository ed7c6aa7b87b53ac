"""Forecast: the singularities, joint limits and ends of reach on a motion that a second solver predicts: it runs
ahead of the first.

After L. Flückiger, L. Piguet and C. Baur, "Generic robotic kinematic generator for virtual environment interfaces",
section 4: "display in advance the singular configuration in which the robot will go".
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, Bools
from cinegen.errors import CinegenError
from cinegen.html import table
from cinegen.ik.solver import Solver
from cinegen.ik.step import Status
from cinegen.ik.task import FrameTask
from cinegen.ik.thresholds import REST
from cinegen.model import Mechanism
from cinegen.tolerances import NEAR_SINGULAR
from raff2urdf.closure import close

_TICKS = 100  # of a forecast, at most, unless its dt is given
_AT_LIMIT = 1e-9  # rad or lengths: distance at which a joint has met its limit
_OFF_LIMIT = 0.02  # rad or lengths: distance from which a joint may meet its limit again
_CLEAR = 1.2  # multiple of a threshold above which a singular value may fall below it again
_MOVING = 1e-4  # rad or lengths in a tick: motion after which the robot may come to rest again
_SAME = 0.5  # least product of the cosines between singular vectors that belong together


class EventKind(Enum):
    """Kind of a predicted event."""

    TYPE_1 = "near a type 1 singularity, the tasks lose a direction"
    TYPE_2 = "near a type 2 singularity, a motion becomes uncontrolled"
    LIMIT = "a joint meets its limit"
    STOPPED = "the motion stops and a target is not reached"


@dataclass(frozen=True, eq=False)
class Event:
    """A predicted event.

    Attributes:
        kind: kind of event.
        time: seconds from now; 0 for a condition that holds already.
        q: (nq,) configuration, loops closed.
        sigma: smallest singular value there (dimensionless): of the passive joints for type 2, else of the tasks.
        joint: joint that meets its limit; None for other kinds.
    """

    kind: EventKind
    time: float
    q: Array
    sigma: float
    joint: str | None = None

    @property
    def text(self) -> str:
        """Description, without the time."""
        return self.kind.value if self.joint is None else f"{self.joint} meets its limit"

    def __str__(self) -> str:
        return f"in {self.time:.2f} s: {self.text}" if self.time else f"now: {self.text}"

    def __repr__(self) -> str:
        return f"<Event {self.kind.name}: {self}>"


@dataclass(frozen=True, eq=False)
class Forecast:
    """Predicted motion.

    Attributes:
        times: (ticks + 1,) seconds from now, 0 first.
        q: (ticks + 1, nq) configurations.
        sigma_min: (ticks + 1,) smallest singular value of the tasks (type 1), among as many as their generic rank;
            infinite without a task that can move.
        passive_sigma_min: (ticks + 1,) that of the passive joints (type 2); infinite without loops.
        events: predicted events, in the order of time.
    """

    times: Array
    q: Array
    sigma_min: Array
    passive_sigma_min: Array
    events: tuple[Event, ...]

    def __repr__(self) -> str:
        return f"<Forecast of {self.times[-1]:.3g} s: {'; '.join(map(str, self.events)) or 'no events'}>"

    def _repr_html_(self) -> str:
        """Show the events as a table in a notebook."""
        rows = [(f"{event.time:.2f}", event.text, f"{event.sigma:.3g}") for event in self.events]
        caption = f"Forecast of {self.times[-1]:.3g} s: {len(self.events)} events"
        return table(caption, ("time (s)", "event", "singular value"), rows)


@dataclass(frozen=True, eq=False)
class Rollout:
    """Motion of a solver over some ticks; joint space is scaled to be dimensionless where no unit is given.

    Attributes:
        mechanism: mechanism that was moved.
        dt: period of a tick, s.
        q: (ticks + 1, nq) configurations.
        v: (ticks + 2, nv) joint velocities, rad/s and m/s: of the tick before the first q, then of the tick after each.
        stopped: (ticks + 1, nv) nonzero where a joint's limit restricts the tick after q.
        statuses: (ticks + 1,) of the tick after each q.
        tasks: (ticks + 1, rows, n) Jacobian of the tasks at each q in the null space of the loops.
        task_rank: its generic rank.
        passive: (ticks + 1, rows, .) columns of the passive joints, and of those that were cut, in the screw matrix of
            the loops.
    """

    mechanism: Mechanism
    dt: float
    q: Array
    v: Array
    stopped: Array
    statuses: tuple[Status, ...]
    tasks: Array
    task_rank: int
    passive: Array

    @property
    def motions(self) -> Array:
        """(ticks + 2, nv) dimensionless motion of each tick."""
        return self.v * self.dt / self.mechanism.scale


def forecast_motion(
    solver: Solver,
    seconds: float,
    dt: float | None = None,
    threshold: float = NEAR_SINGULAR,
    passive_threshold: float = NEAR_SINGULAR,
    moving: bool = True,
) -> Forecast:
    """Predict the motion of a solver: singularities, joint limits and the end of reach. The solver does not change.

    Invalid tasks are left out. Targets that moved between the last two ticks continue at that velocity. For forecasts
    in a loop, keep a `LookAhead`.

    Args:
        solver: solver whose motion is predicted.
        seconds: horizon.
        dt: period of the prediction's ticks, s. With the solver's own period the prediction is exactly what its ticks
            will do. By default at most 100 ticks are computed. No joint moves by more than 0.1 rad in one.
        threshold: singular value of the tasks below which a type 1 singularity is reported.
        passive_threshold: singular value of the passive joints below which a type 2 singularity is reported.
        moving: whether moving targets continue.

    Raises:
        CinegenError: seconds or dt is not a positive, finite time.
    """
    dt = max(solver.dt, seconds / _TICKS) if dt is None else dt
    if not (0.0 < seconds < np.inf and 0.0 < dt < np.inf):
        raise CinegenError(f"a forecast's seconds and dt must be positive and finite, not {seconds} and {dt}")
    look_ahead = LookAhead(solver.mechanism, dt)
    look_ahead.copy(solver, moving)
    return look_ahead.forecast(seconds, threshold, passive_threshold)


class LookAhead:
    """A solver that runs ahead of another one. Making one takes as long as hundreds of ticks: keep it.

    Args:
        mechanism: mechanism of the other solver.
        dt: period of a tick of the prediction, s.
        gain: rate at which pose errors decay, 1/s; see `Solver.gain`.

    Attributes:
        solver: the solver that runs ahead. Its configuration and tasks may also be set directly.
        velocities: velocity with which the target of each of its tasks continues, in the world: its origin's, m/s, and
            rad/s. Targets without one stay.
    """

    def __init__(self, mechanism: Mechanism, dt: float, gain: float = math.inf) -> None:
        self.solver = Solver(mechanism, dt, gain=gain)
        self.velocities: tuple[pin.Motion, ...] = ()

    def copy(self, solver: Solver, moving: bool = True) -> None:
        """Take over the state of a solver: see `Solver.copy_state`.

        Args:
            solver: solver of the same mechanism; it does not change.
            moving: whether its moving targets continue.
        """
        self.solver.copy_state(solver)
        self.velocities = ()
        if moving:
            tasks = zip(solver.tasks, solver.target_velocities, strict=True)
            self.velocities = tuple(
                velocity for task, velocity in tasks if isinstance(task, FrameTask) and task.is_valid()
            )

    def step(self, q: Array, tasks: Sequence[FrameTask]) -> Array:
        """Return the configuration (nq,) one tick after a configuration at rest.

        Args:
            q: (nq,) with closed loops.
            tasks: valid tasks of another solver.
        """
        self.solver.copy_tasks(tasks)
        self.solver.q = q
        return self.solver.step().q

    def forecast(
        self, seconds: float, threshold: float = NEAR_SINGULAR, passive_threshold: float = NEAR_SINGULAR
    ) -> Forecast:
        """Predict the motion from the present state on; the state is then that at the end.

        Args:
            seconds: horizon.
            threshold: singular value of the tasks below which a type 1 singularity is reported.
            passive_threshold: singular value of the passive joints below which a type 2 singularity is reported.
        """
        rollout = self._roll_out(math.ceil(seconds / self.solver.dt - 1e-9))
        return forecast_of(rollout, threshold, passive_threshold)

    def _roll_out(self, ticks: int) -> Rollout:
        """Step the solver `ticks` times, and once more for the Jacobians at the end; return the motion.

        A target that moves with the twist (w, v), rad/s and m/s in the world's axes, is at time t rotated to
        exp(t [w]) R and translated to p + t v. The Jacobian J (rows, n) of the tasks becomes J N_n^T N, with the
        orthonormal rows N (k, n + .) of the motions that all loops allow, and N_n, their first n columns: this does not
        depend on the choice of the basis.
        """
        solver, mechanism = self.solver, self.solver.mechanism
        solver.keeps_linearisation = True
        moving = [
            (task, task.target.copy(), velocity)
            for task, velocity in zip(solver.frame_tasks, self.velocities, strict=False)
            if velocity.np.any()
        ]
        q, v = [solver.q], [solver.v]
        steps, jacobians = [], []
        for tick in range(1, ticks + 2):
            for task, start, velocity in moving:
                time = tick * solver.dt
                rotation = pin.exp3(velocity.angular * time) @ start.rotation
                task.target = pin.SE3(rotation, start.translation + velocity.linear * time)
            steps.append(solver.step())
            jacobians.append(solver.linearisation)
        tasks, motions, passive = (
            np.array([getattr(each, name) for each in jacobians]) for name in ("tasks", "motions", "passive")
        )
        if mechanism.loop_rank:
            tasks = tasks @ motions[:, :, : tasks.shape[2]].transpose(0, 2, 1) @ motions
        return Rollout(
            mechanism,
            solver.dt,
            np.vstack([*q, *(step.q for step in steps[:-1])]),
            np.vstack([*v, *(step.v for step in steps)]),
            np.array([step.stopped for step in steps]),
            tuple(step.status for step in steps),
            tasks,
            jacobians[-1].task_rank,
            passive,
        )


# --- events ----------------------------------------------------------------------------------------------------------


def forecast_of(rollout: Rollout, threshold: float, passive_threshold: float) -> Forecast:
    """Find the events on a motion.

    Args:
        rollout: motion of a solver.
        threshold: singular value of the tasks (dimensionless) below which a type 1 singularity is reported.
        passive_threshold: singular value of the passive joints below which a type 2 singularity is reported.
    """
    events: list[Event] = []
    sigmas = []
    for kind, jacobians, rank, limit in (
        (EventKind.TYPE_1, rollout.tasks, rollout.task_rank, threshold),
        (EventKind.TYPE_2, rollout.passive, _passive_rank(rollout.mechanism), passive_threshold),
    ):
        signed = _signed(jacobians, rank)
        sigmas.append(np.abs(signed))
        for x in _crossings(signed, limit):
            sigma = limit if x else float(sigmas[-1][0])
            events.append(Event(kind, x * rollout.dt, _configuration(rollout, x), sigma))
    for x, column, bound in _limits(rollout):
        q, joint = _configuration(rollout, x, column, bound), rollout.mechanism.columns[column]
        events.append(Event(EventKind.LIMIT, x * rollout.dt, q, _interpolated(sigmas[0], x), joint))
    for k in _stops(rollout):
        events.append(Event(EventKind.STOPPED, k * rollout.dt, rollout.q[k].copy(), float(sigmas[0][k])))
    events.sort(key=lambda event: event.time)
    times = rollout.dt * np.arange(len(rollout.q), dtype=np.float64)
    return Forecast(times, rollout.q, sigmas[0], sigmas[1], tuple(events))


def _passive_rank(mechanism: Mechanism) -> int:
    return mechanism.structure.passive_rank + mechanism.structure.screws.cut if mechanism.structure.passive_rank else 0


def _signed(matrices: Array, rank: int) -> Array:
    """Return the smallest of the first `rank` singular values of each matrix (t, rows, columns), with a sign, (t,).

    The sign changes where the value passes through 0 between two matrices. By Weyl's inequality the matrix then changes
    by at least the sum of both values; and since singular vectors are continuous, one of them seems to reverse. The
    values are infinite for rank 0, and where a matrix is not finite (for a target whose rotation overflows).
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


def _onsets(inside: Bools, outside: Bools) -> Iterator[int]:
    """Yield the ticks at which a condition begins to hold; again only after it clearly did not (hysteresis).

    Args:
        inside: (t,) whether it holds.
        outside: (t,) whether it clearly does not hold.
    """
    ended = True
    for k in np.flatnonzero(inside | outside):
        if inside[k] and ended:
            yield int(k)
        ended = not inside[k]


def _crossings(signed: Array, threshold: float) -> Iterator[float]:
    """Yield the times, in ticks, at which a singular value falls below a threshold; 0 if it begins below."""
    size = np.abs(signed)
    through = np.concatenate([[False], signed[1:] * signed[:-1] < 0.0])
    for k in _onsets((size < threshold) | through, size > _CLEAR * threshold):
        if k == 0:
            yield 0.0
        else:
            end = -size[k] if through[k] else size[k]
            yield float(k - 1 + (size[k - 1] - threshold) / (size[k - 1] - end))


def _limits(rollout: Rollout) -> Iterator[tuple[float, int, float]]:
    """Yield the times, in ticks, at which a joint meets a limit, its column and the limit; 0 for one that restricts the
    first tick."""
    mechanism, motions = rollout.mechanism, rollout.motions
    for index, column in zip(*mechanism.structure.scalar_joints, strict=True):
        for bound, side in ((mechanism.limits.lower[index], -1.0), (mechanism.limits.upper[index], 1.0)):
            left = side * (bound - rollout.q[:, index]) / mechanism.scale[column]
            for k in _onsets(left <= _AT_LIMIT, left > _OFF_LIMIT):
                if k > 0:
                    speed = side * motions[k - 1, column]  # in the tick before, which the limit did not cut short
                    part = min(1.0, left[k - 1] / speed) if speed > 0.0 else 1.0
                    yield float(k - 1 + part), column, bound
                elif rollout.stopped[0, column]:
                    yield 0.0, column, bound


def _stops(rollout: Rollout) -> Iterator[int]:
    """Yield the ticks after which nothing moves and a target is not reached."""
    short = np.array([status in (Status.AT_LIMIT, Status.OUT_OF_REACH, Status.REFUSED) for status in rollout.statuses])
    fastest = np.abs(rollout.motions[1:]).max(axis=1, initial=0.0)
    return _onsets(short & (fastest < REST), fastest > _MOVING)


def _configuration(rollout: Rollout, x: float, column: int | None = None, bound: float = 0.0) -> Array:
    """Return the configuration (nq,) at a time in ticks, loops closed; with a joint on its bound where one is given."""
    mechanism, k = rollout.mechanism, min(int(x), len(rollout.q) - 2)
    q = mechanism.interpolate(rollout.q[k], rollout.q[k + 1], x - k)
    free = np.ones(mechanism.model.nv, dtype=bool)
    if column is not None:
        q[mechanism.q_index(mechanism.columns[column])] = bound
        free[column] = False
    if not mechanism.is_constrained:
        return q
    closing = close(mechanism.structure.system, q, free)
    return closing.q if closing.closed else rollout.q[k + 1].copy()


def _interpolated(values: Array, x: float) -> float:
    """Return a quantity given at each tick, at a time in ticks."""
    k = min(int(x), len(values) - 2)
    if not np.isfinite(values[k : k + 2]).all():
        return float(values[k])
    return float(values[k] + (x - k) * (values[k + 1] - values[k]))
