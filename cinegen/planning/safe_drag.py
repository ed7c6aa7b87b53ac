"""Safe dragging: `AvoidingSolver` keeps a mechanism clear of obstacles while a user drags it, and guides it around
them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.collision.clearance import Clearance
from cinegen.errors import CinegenError
from cinegen.ik import FrameTask, LookAhead, Solver, Status, Step
from cinegen.ik.barrier import Range
from cinegen.ik.state import State
from cinegen.ik.thresholds import SECONDARY_TRIES, TRIES
from cinegen.loops.setup import null_space
from cinegen.model.motion_limits import motion_limits
from cinegen.planning.braking import BrakingBarrier
from cinegen.planning.clearance_barrier import ClearanceBarrier
from cinegen.planning.evasion import Evasion, Threat
from cinegen.planning.goal_configurations import clear_configurations
from cinegen.planning.manoeuvres import driven_motions
from cinegen.planning.vortices import DetourDirection, Vortices

_PREDICTION_GAIN = -math.log1p(-0.2)  # 1/tick: a prediction arrives within a few ticks
_PREDICTION_PERIOD = 4e-3  # s between two ticks of the prediction, at least
_ARRIVED = 1e-4  # rad or m in a predicted step
_TASKS_PATIENCE = 0.25  # s without progress until the tasks are suspended
_STRATEGY_PATIENCE = 0.6  # s without progress until the next strategy is tried
_STILL = 0.1  # s at rest that are enough for either
_REST = 2e-3  # rad/s or characteristic lengths/s
_PROGRESS = 0.02  # fraction of the remaining distance
_QUIET = 0.02  # s without an active vortex until the tasks are resumed
_MOVED = 0.02  # characteristic lengths or rad: a target or an obstacle that moved further is a new situation
_REFUSALS = 3  # of a step, before it is replaced by braking
_CONFIGURATIONS = 3  # that are tried
_STRIDE = 0.02  # rad or characteristic lengths: largest step towards a configuration
_AT_CONFIGURATION = 0.02  # rad or characteristic lengths from a configuration, where the tasks are resumed

_FIRST = (DetourDirection.SHORTER, DetourDirection.FOLDING)
_OTHERS = (DetourDirection.LONGER, DetourDirection.UP, DetourDirection.DOWN, DetourDirection.ASIDE)


class _Strategy(NamedTuple):
    """A way to reach the targets: by the tasks, or by a configuration (nq,); with a direction around obstacles."""

    configuration: Array | None
    direction: DetourDirection


class AvoidingSolver(Solver):
    """A `Solver` that never comes nearer to an obstacle than the safety distance, and gets around obstacles.

    Links that come near slow down and slide along (`ClearanceBarrier`), always. Where following the tasks would come
    too near, vortices deflect the motion: first in the null space of the tasks, so that the dragged node stays with the
    pointer; if that does not help, the tasks are suspended and the whole mechanism moves around the obstacle, as a plan
    would. Without progress, other directions are tried one after the other, also via other configurations that reach
    the targets; when none is left, the mechanism waits at the safety distance until the targets move. The status is
    DETOUR while tasks are suspended, and BARRED where an obstacle restricts the motion.

    What the tasks would come too near to is found by a prediction, a little in each tick.

    Limits of acceleration are obeyed. Obstacles that move are expected to go on at the velocity between their last two
    poses, and evaded (`Evasion`); the status is DETOUR while tasks wait for that. Where no motion within the limits is
    found that avoids a collision, the status is UNAVOIDABLE, and IN_COLLISION in contact: the mechanism brakes to a
    stop, and goes on when the obstacle has stopped or gone.

    Args:
        clearance: distances of the mechanism among its obstacles.
        dt: period of a tick, s.
        safety: safety distance, m.
        reach: distance at which vortices start to act, m; half a characteristic length unless given.
        q: (nq,) initial configuration; home unless given.
        acceleration: limits of the joint accelerations, rad/s^2 and m/s^2: one number for all actuated joints, or by
            joint name, with the defaults of `motion_limits` for joints that are left out, by default all; `math.inf`
            for unlimited accelerations: obstacles then push the mechanism at any rate, and nothing is predicted.

    Attributes:
        clearance: as given.
        barrier: barrier that keeps the safety distance.
        threat: collision at the last tick, or the one that no motion was found to avoid; None without one, and without
            limits of acceleration.
        evaded: index of the obstacle that the last tick evaded; None without one.
        destination: (nq,) configuration, with closed loops, to which it moves instead of following its tasks, straight
            in joint space, as far as obstacles allow; None: it follows them. Needs limits of acceleration.
        vortices: vortices around obstacles.

    Raises:
        ConfigurationError: q is not a configuration.
        UnknownNameError: `acceleration` names a joint that does not exist.
        CinegenError: q leaves loops open, or dt or an acceleration is invalid.
    """

    __slots__ = (
        "_braking", "_evasion", "_known", "_nearest", "_obstructing", "_predicted", "_prediction", "_quiet", "_search",
        "_since", "_still", "_strategies", "_targets", "_unobstructed", "_unpredicted", "barrier", "clearance",
        "destination", "evaded", "threat", "vortices",
    )  # fmt: skip

    def __init__(
        self,
        clearance: Clearance,
        dt: float,
        safety: float,
        reach: float | None = None,
        q: ArrayLike | None = None,
        acceleration: float | Mapping[str, float] | None = None,
    ) -> None:
        mechanism = clearance.mechanism
        self._still, self._unpredicted = 0, math.inf  # ticks at rest, and s since the last tick of the prediction
        is_limited = isinstance(acceleration, Mapping) or acceleration is None or not math.isinf(acceleration)
        limits = motion_limits(mechanism, acceleration if is_limited else None).acceleration
        columns = {joint: mechanism.v_index(joint) for joint in mechanism.joints}
        limited = {joint: float(limits[j]) for joint, j in columns.items() if math.isfinite(limits[j])}
        super().__init__(mechanism, dt, q=q, acceleration=limited if is_limited else None)
        self.clearance = clearance
        self._evasion: Evasion | None = None
        self._braking: BrakingBarrier | None = None
        if is_limited:
            known = np.full(mechanism.model.nv, np.inf)
            known[[columns[joint] for joint in limited]] = list(limited.values())
            self._evasion = Evasion(clearance, safety, known)
            self._braking = BrakingBarrier(clearance, safety, known, self._evasion)
        self.barrier = self._braking or ClearanceBarrier(clearance, safety)
        self.threat: Threat | None = None
        self.evaded: int | None = None
        self.destination: Array | None = None
        self.barriers = (self.barrier,)
        self.vortices = Vortices(clearance, 0.5 * mechanism.length if reach is None else reach, safety)
        self._known: dict[int, pin.SE3] = {}  # poses of obstacles
        self._unobstructed = LookAhead(mechanism, dt)  # regardless of obstacles
        self._prediction = LookAhead(mechanism, 1.0, _PREDICTION_GAIN)
        self._restart()

    def move(self, obstacle: int, placement: pin.SE3, jumps: bool = False) -> None:
        """Move an obstacle. After some distance, strategies that failed are tried again.

        Args:
            obstacle: its index in the clearance.
            placement: its pose in the mechanism's world.
            jumps: whether it was put there, as in an undo, instead of moved since the tick before: the difference is no
                velocity, and is not predicted to go on.
        """
        self.clearance.move(obstacle, placement)
        if self._evasion is not None:
            self._evasion.move(obstacle, placement, self.dt, jumps)
        moved = self._known.setdefault(obstacle, placement.copy()).actInv(placement)
        angle = float(np.linalg.norm(pin.log3(moved.rotation)))
        if max(float(np.linalg.norm(moved.translation)) / self.mechanism.length, angle) > _MOVED:
            self._known[obstacle] = placement.copy()
            if not self._strategies:
                self._restart()

    def _add_given(self, task: Any) -> Any:
        if isinstance(task, Range):
            raise CinegenError(
                "an AvoidingSolver keeps no ranges, as it may have to brake beyond one: add the range's task itself"
            )
        return super()._add_given(task)

    def _mark_changed(self, binds: bool) -> None:
        super()._mark_changed(binds)
        if binds:
            self._targets = tuple[Array, ...]()  # a new situation

    def _step(self) -> Step:
        suspended, motion = bool(self._memory.tasks_are_suspended), None
        try:
            motion = self._react()
            if motion is None and self.destination is not None:
                motion = self._towards(self.destination)
            if motion is None:
                self._guide()
        except Exception as error:  # the loop must go on; the barrier keeps the mechanism clear
            self._restart()
            self._catch(f"the search for a path around obstacles of {self.mechanism.name}", error)
        if motion is not None:
            self._suspend_tasks(True)
            self._detour = (_Motion(motion),)
            self._memory.secondary[:], self._memory.secondary_scale = 0.0, 1.0  # it may reverse
        step = super()._step()
        self._detour = None
        if motion is not None:
            self._suspend_tasks(suspended)
        if self._evasion is not None:
            self._evasion.tick += 1
        if self.threat is not None:
            step = step.with_status(Status.IN_COLLISION if self.threat.happens else Status.UNAVOIDABLE)
        slow = float(np.abs(step.v / self.mechanism.scale).max(initial=0.0)) < _REST
        self._still = self._still + 1 if slow else 0
        return step

    def _react(self) -> Array | None:
        """Return the motion (nv,) of a tick by which to evade an obstacle that moves, or to stop; None if neither is
        needed."""
        barrier, evasion, memory = self._braking, self._evasion, self._memory
        if barrier is None or evasion is None:
            return None
        barrier.v, q = self.v, self._q
        if self.mechanism.is_constrained and memory.mobility:
            barrier.basis = null_space(memory)[:, : memory.n] * self.mechanism.scale
        velocity = evasion.react(q, barrier.v, self.dt)
        self.threat = evasion.contact(q) or evasion.threat
        barrier.is_released = velocity is not None or (self.threat is not None and self.threat.moves)
        self.evaded = evasion.obstacle if velocity is not None and self.threat is None else None
        if not barrier.is_released:
            return None
        motion = np.zeros(self._model.nv)
        if velocity is not None and self.threat is None:
            if self.mechanism.is_constrained:
                return driven_motions(self.mechanism, q, evasion.joints.columns) @ (velocity * self.dt)
            motion[evasion.joints.columns] = velocity * self.dt
        return motion

    def _towards(self, destination: Array) -> Array | None:
        """Return the motion (nv,) of a tick straight to a configuration (nq,), as fast as the barrier allows without
        deflecting it; None without limits of acceleration."""
        if self._evasion is None:
            return None
        self._evasion.joints.dt = self.dt
        motion = self._evasion.joints.towards(self._q, destination)
        bounds = self.barrier.bounds(self.state)
        rates = bounds.rows @ motion / self.dt
        violated = rates > bounds.most
        return motion * max(0.0, float((bounds.most[violated] / rates[violated]).min(initial=1.0)))

    def _clear(self) -> float:
        """Return the fraction of the step to the trial configuration that barriers allow; where accelerations are
        limited, a step that is refused a few times is replaced by braking, which is always allowed; at once, where an
        obstacle that moves would hit: predictions take time."""
        clear, memory = super()._clear(), self._memory
        if self._braking is None:
            return clear
        last = TRIES + (SECONDARY_TRIES if memory.has_secondary else 0) - 1
        if memory.tries >= last:
            return 1.0
        if clear < 1.0 and (self._braking.is_met or memory.tries >= _REFUSALS):
            memory.tries = last - 1
        return clear

    # --- around obstacles ----------------------------------------------------------------------------------------

    def _restart(self) -> None:
        """Begin with the first strategy, for new targets."""
        self._strategies = [_Strategy(None, direction) for direction in _FIRST]
        self._search: Iterator[list[Array] | None] | None = None
        self._targets = tuple[Array, ...]()
        self._quiet = 0
        self._begin_strategy()
        self._suspend_tasks(False)

    def _begin_strategy(self) -> None:
        """Begin the first of the strategies that are left."""
        self._nearest, self._since, self._still = math.inf, 0, 0
        self._obstructing: frozenset[int] = frozenset()
        self._predicted: Array | None = None
        self.vortices.deactivate()
        if self._strategies:
            self.vortices.direction = self._strategies[0].direction

    def _guide(self) -> None:
        """Find out before a tick what obstructs the tasks, and set the objectives that get around it."""
        tasks = [task for task in self.frame_tasks if task.is_valid()]
        if not tasks or any(task.twist is not None for task in tasks):
            if self._targets:
                self._restart()
            return
        targets = tuple(task.target.homogeneous for task in tasks)
        if self._have_moved(targets):
            self._restart()
            self._targets = tuple(target.copy() for target in targets)
        if not self._strategies:
            self._search_configurations(tasks)
            return
        q = self.q
        configuration = self._strategies[0].configuration
        for look_ahead in (self._unobstructed, self._prediction):
            look_ahead.solver._copy_joints(self, accelerations=False)
        self._predict(q, tasks, configuration)
        if configuration is None:
            self._unobstructed.solver.dt, self._unobstructed.solver.gain = self.dt, self.gain
            motion = self.mechanism.difference(q, self._unobstructed.step(q, tasks))
        else:
            motion = self._step_towards(q, configuration)
        deflected = self.vortices.deflect(q, motion, lambda: self._obstructing)
        is_deflected = len(self.vortices.active) > 0
        self._quiet = 0 if is_deflected else self._quiet + 1
        if self._memory.tasks_are_suspended:
            self._detour = (_Motion(deflected),)
        elif is_deflected:
            self._detour = (*self._objectives, _Motion(deflected - motion))
        if is_deflected or configuration is not None:
            self._check_progress(tasks, configuration)
        elif self._memory.tasks_are_suspended and self._quiet * self.dt >= _QUIET:
            self._suspend_tasks(False)

    def _have_moved(self, targets: tuple[Array, ...]) -> bool:
        """Return whether targets moved away from where the present strategies began."""
        if len(targets) != len(self._targets):
            return True
        length = self.mechanism.length
        return any(
            math.dist(now[:3, 3], then[:3, 3]) > _MOVED * length  # of any size: squares may overflow
            or float(np.abs(now[:3, :3] - then[:3, :3]).max()) > _MOVED
            for now, then in zip(targets, self._targets, strict=True)
        )

    def _predict(self, q: Array, tasks: Sequence[FrameTask], configuration: Array | None) -> None:
        """Advance the prediction; it restarts where it comes too near to something, or arrives."""
        self._unpredicted += self.dt
        if self._unpredicted < 0.999 * _PREDICTION_PERIOD:
            return
        self._unpredicted = 0.0
        before = q if self._predicted is None else self._predicted
        if configuration is None:
            predicted = self._prediction.step(before, tasks)
        else:
            predicted = self.mechanism.integrate(before, 3.0 * self._step_towards(before, configuration))
        violated = self.vortices.violated(predicted)
        if violated or float(np.abs(predicted - before).max(initial=0.0)) < _ARRIVED:
            self._obstructing, self._predicted = violated, None
        else:
            self._predicted = predicted

    def _step_towards(self, q: Array, configuration: Array) -> Array:
        """Return a tick's motion (nv,) towards a configuration, regardless of loops."""
        largest = self.mechanism.distance(q, configuration)
        return self.mechanism.difference(q, configuration) * min(self.tick_gain, _STRIDE / max(largest, 1e-300))

    def _check_progress(self, tasks: Sequence[FrameTask], configuration: Array | None) -> None:
        """Suspend the tasks, or try the next strategy, where there is no progress: for some time, no tick has made the
        remaining distance (of the tasks, or from a configuration (nq,)) clearly smaller than it was before."""
        if configuration is None:
            remaining = self._remaining(tasks)
        else:
            remaining = self.mechanism.distance(self._q, configuration)
            if remaining < _AT_CONFIGURATION:
                self._strategies = [_Strategy(None, DetourDirection.SHORTER)]
                self._begin_strategy()
                self._suspend_tasks(False)
                return
        self._since += 1
        if remaining < (1.0 - _PROGRESS) * self._nearest:
            self._nearest, self._since = remaining, 0
        still = self._still * self.dt >= _STILL
        if not self._memory.tasks_are_suspended and (still or self._since * self.dt >= _TASKS_PATIENCE):
            self._suspend_tasks(True)
            self._since, self._still = 0, 0
        elif self._memory.tasks_are_suspended and (still or self._since * self.dt >= _STRATEGY_PATIENCE):
            self._strategies.pop(0)
            self._begin_strategy()
            self._suspend_tasks(bool(self._strategies))

    def _remaining(self, tasks: Sequence[FrameTask]) -> float:
        """Return the sum of all errors of tasks, characteristic lengths and rad."""
        total = 0.0
        for task in tasks:
            distance, angle = task.distances(self.mechanism, self._q)
            total += distance / self.mechanism.length + angle
        return total

    # --- other configurations ------------------------------------------------------------------------------------

    def _search_configurations(self, tasks: Sequence[FrameTask]) -> None:
        """Search from one more start, once for each situation; at the end the configurations found are tried."""
        if self._search is None:
            self._search = clear_configurations(self._joints.limited, self.clearance, tasks, self.barrier.safety)
        configurations = next(self._search, None)
        if configurations is not None:
            nearest = sorted(configurations, key=lambda q: self.mechanism.distance(self._q, q))[:_CONFIGURATIONS]
            others = _OTHERS if self.vortices.plane is None else _OTHERS[:1]
            self._strategies = [_Strategy(q, direction) for q in nearest for direction in _FIRST]
            self._strategies += [_Strategy(None, direction) for direction in others]
            self._begin_strategy()
            self._suspend_tasks(bool(self._strategies))


class _Motion:
    """Objective: a motion in one tick."""

    def __init__(self, motion: Array) -> None:
        self._motion = motion

    def velocity(self, state: State) -> Array:
        """Return the joint velocity (nv,), rad/s and m/s."""
        return self._motion / state.dt
