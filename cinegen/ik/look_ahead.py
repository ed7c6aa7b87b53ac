"""Look-ahead: a second solver that runs ahead of the first, to predict its motion."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik.forecast import Forecast, Rollout, forecast_of
from cinegen.ik.solver import Solver
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism
from cinegen.tolerances import NEAR_SINGULAR

_TICKS = 100  # of a forecast, at most, unless its dt is given


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
        solver, mechanism = self.solver, self.solver.mechanism
        solver.keeps_linearisation = True
        moving = [
            (task, task.target.copy(), velocity)
            for task, velocity in zip(solver.frame_tasks, self.velocities, strict=False)
            if velocity.np.any()
        ]
        q, v = [solver.q], [solver.v]
        steps, jacobians = [], []
        for tick in range(1, ticks + 2):  # one more, for the Jacobians at the end
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
