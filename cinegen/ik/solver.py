"""The resolved-rate solver: moves any mechanism after any pulls, one tick at a time, loops closed at every tick."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import CinegenError
from cinegen.exception_log import ExceptionLog
from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.tick import prepare_tick, tick
from cinegen.ik.ahead import Ahead
from cinegen.ik.barrier import Barrier, Bounds
from cinegen.ik.blend import Blend
from cinegen.ik.forecast import TICKS, Forecast, foresee
from cinegen.ik.objectives import Objective, State
from cinegen.ik.plain import pull_rank
from cinegen.ik.pull import Pull
from cinegen.ik.setup import make_room_for_barriers, memory_of
from cinegen.ik.singular import NEAR_PASSIVE
from cinegen.ik.step import Layout, Step
from cinegen.ik.thresholds import (
    ACCEPTED,
    ASTRAY,
    CLEAR_PLEASE,
    DONE,
    EVALUATE,
    EVALUATE_HERE,
    NEAR,
    STEP_CAP,
)
from cinegen.loops.arrays import curved, moves
from cinegen.loops.thresholds import CLOSURE
from cinegen.model import Mechanism

Array = NDArray[np.float64]

_FASTEST = 1e100  # rad/s or m/s: no objective means more


class Solver:
    """Moves a mechanism; owns q. One thread at a time; the mechanism may serve others meanwhile.

    Args:
        mechanism: what to move.
        dt: seconds between two ticks.
        q: (nq,) where to begin, loops closed; home unless given.
        gain: part of a pull's error that a tick makes good, 0 to 1.
        acceleration: largest acceleration of the joints, rad/s^2 and m/s^2: one number for all, or by joint; none
            unless given.

    Attributes:
        exception_log: what objectives and barriers raised so far. Each exception is logged once; see `ExceptionLog`.

    Raises:
        ConfigurationError: q is no configuration.
        UnknownNameError: no such joint.
        CinegenError: q leaves loops open, or dt, gain or an acceleration make no sense.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        dt: float,
        q: ArrayLike | None = None,
        gain: float = 1.0,
        acceleration: float | Mapping[str, float] | None = None,
    ) -> None:
        if not (np.isfinite(dt) and dt > 0.0):
            raise CinegenError(f"dt must be a positive time in seconds, not {dt}")
        prepare_tick()
        self.mechanism, self.dt = mechanism, dt
        self._system = mechanism.own_system()  # scratch of its own: no other thread or solver disturbs it
        self._model, self._data = self._system.model, self._system.data
        self._evaluate = pin.computeJointJacobians if self._model.nv else pin.forwardKinematics
        self._pulls: list[Pull] = []
        self._blends: list[Blend] = []
        self._objectives: tuple[Objective, ...] = ()
        self._barriers: tuple[Barrier, ...] = ()
        self._blocked = False  # a barrier failed in this tick
        self.exception_log = ExceptionLog()
        self._caught: tuple[Exception, ...] = ()  # in this tick
        self._ranks: dict[tuple[object, ...], int] = {}
        self._memory = memory_of(mechanism, self._system, dt)
        self._table = self._memory.table
        self.gain = gain
        self._q, self._trial = np.zeros(self._model.nq), np.zeros(self._model.nq)
        if self._model.nq:
            self._q, self._trial = self._memory.arrays["q"], self._memory.arrays["trial"]
        self._curved = curved(self._model)
        self._limit_accelerations(acceleration)
        self._changed = True
        self._earlier: Array | None = None  # records of the last two ticks: they tell how fast targets move
        self._latest: Array | None = None
        self._ahead: Ahead | None = None
        self.q = mechanism.q_home if q is None else q

    @property
    def gain(self) -> float:
        """The part of a pull's error that a tick makes good, above 0 to 1. May be set at any time.

        Raises:
            CinegenError: set to something else.
        """
        return float(self._memory.arrays["settings"][m.GAIN])

    @gain.setter
    def gain(self, gain: float) -> None:
        if not 0.0 < gain <= 1.0:
            raise CinegenError(f"gain must be in (0, 1], not {gain}")
        self._memory.arrays["settings"][m.GAIN] = gain

    @property
    def near(self) -> float:
        """The singular value (without unit) of the pulls below which motion is damped, 0.05 unless set. More makes a
        robot calmer near singularities, and slower; less, livelier. May be set at any time.

        Raises:
            CinegenError: set to what is not above 0 and 1 at most.
        """
        return float(self._memory.arrays["settings"][m.NEAR])

    @near.setter
    def near(self, near: float) -> None:
        if not 0.0 < near <= 1.0:
            raise CinegenError(f"damping sets in below a singular value above 0, 1 at most, not {near}")
        self._memory.arrays["settings"][m.NEAR] = near

    @property
    def q(self) -> Array:
        """(nq,) where the mechanism is. May be set: then it is there at once, and at rest.

        Raises:
            ConfigurationError: set to what is no configuration.
            CinegenError: set to where loops are open.
        """
        return self._q.copy()

    @q.setter
    def q(self, q: ArrayLike) -> None:
        full = self.mechanism.checked(q)
        closure = self.mechanism.closure(full)
        if closure > CLOSURE:
            raise CinegenError(f"q leaves loops of {self.mechanism.name} open by {closure:.2g}: close it")
        self._q[:] = full
        self._memory.arrays["settings"][m.CLOSED] = closure
        for name in ("last", "drift", "secondary"):
            self._memory.arrays[name][:] = 0.0
        self._memory.arrays["settings"][m.TRUST] = 1.0
        self._table[m.PHASE] = ASTRAY
        if not self._changed:  # pulls forget what they followed
            self._memory.arrays["pull_state"][:] = 0.0
            self._table[m.WARM] = 0
            self._earlier, self._latest = None, None

    def _limit_accelerations(self, acceleration: float | Mapping[str, float] | None) -> None:
        if acceleration is None:
            return
        mechanism = self.mechanism
        if not isinstance(acceleration, Mapping):
            acceleration = dict.fromkeys(mechanism.joints, acceleration)
        limits = self._memory.arrays["acceleration"]
        for joint, limit in acceleration.items():
            if not limit > 0.0:
                raise CinegenError(f"the acceleration of '{joint}' must be positive, not {limit}")
            column = mechanism.v_index(joint)
            limits[column] = limit * self.dt * self.dt / mechanism.scale[column]
        self._table[m.ACCELERATED] = 1

    # --- pulls ---------------------------------------------------------------------------------------------------

    @property
    def pulls(self) -> tuple[Pull, ...]:
        """The pulls that hold, in the order they were made."""
        return tuple(self._pulls)

    def pull(
        self,
        node: str,
        target: pin.SE3 | None = None,
        translation: int = 3,
        rotation: int = 3,
        weight: float = 1.0,
        axes: str = "target",
        at: pin.SE3 | ArrayLike | None = None,
    ) -> Pull:
        """Makes a node follow a pose. Set `pull.target` to move it on, or `pull.twist` to give it a speed.

        Args:
            node: base, link or frame.
            target: where it should be, in the world; where it is unless given.
            translation: how many translations it holds, 0 to 3 (see `Pull`).
            rotation: how many rotations it holds, 0 to 3.
            weight: of its equations where several pulls can't all be met.
            axes: whose axes these are: "target", "world" or the name of a node.
            at: what of the node follows: a point (3,) or a frame that is fixed on it, as seen from it (m); its own
                frame unless given. A part may be taken anywhere.

        Raises:
            UnknownNameError: no such node.
            CinegenError: translation or rotation not 0 to 3, a weight not above 0, the target no SE3, or `at` neither
                that nor three finite numbers.
        """
        frame = self.mechanism.frame_id(node)
        if translation not in range(4) or rotation not in range(4):
            raise CinegenError(f"a pull holds 0 to 3 translations and rotations, not {translation} and {rotation}")
        if not 0.0 < weight < np.inf:
            raise CinegenError(f"a pull's weight must be above 0, not {weight}")
        if axes not in ("target", "world"):
            self.mechanism.frame_id(axes)
        grip = _grip(at)
        if target is None:
            target = self.mechanism.placement(self._q, node) * grip
        if not isinstance(target, pin.SE3):
            raise CinegenError(f"a pull's target is a pinocchio.SE3, not {type(target).__name__}")
        pull = Pull(node, target, translation, rotation, weight, axes, frame, grip)
        pull.changed = self._notice
        self._pulls.append(pull)
        self._changed = True
        return pull

    def blend(
        self, pull: Pull, target: pin.SE3 | None = None, seconds: float = 0.5, weight: float | None = None
    ) -> None:
        """Leads a pull over to another target or weight, without a jerk: the following ticks do that. Where its target
        or weight is set meanwhile, that holds; and another blend of the same pull takes over.

        Args:
            pull: that follows a pose.
            target: where it should be at the end, in the world; as it is unless given.
            seconds: how long that takes.
            weight: at the end; as it is unless given. With 0 the pull is let go then.

        Raises:
            CinegenError: the pull is not one of this solver's or follows no pose, or the others make no sense.
        """
        if pull not in self._pulls:
            raise CinegenError(f"the pull of '{pull.node}' is not one of this solver's")
        blend = Blend(pull, seconds, target, weight)
        self._blends = [other for other in self._blends if other.pull is not pull] + [blend]

    def release(self, pull: Pull, seconds: float = 0.0) -> None:
        """Lets go; a pull that holds no longer is let go already.

        Args:
            pull: which.
            seconds: in which its weight fades first, so that others take over without a jerk.

        Raises:
            CinegenError: seconds make no sense.
        """
        if seconds != 0.0 and pull in self._pulls:
            self.blend(pull, seconds=seconds, weight=0.0)
            return
        self._blends = [blend for blend in self._blends if blend.pull is not pull]
        if pull in self._pulls:
            pull.lies_in(np.zeros(m.PULL_WIDTH))
            pull.changed = _nothing
            self._pulls.remove(pull)
            self._changed = True

    def _go_on_blending(self) -> None:
        for blend in self._blends[:]:
            if not blend.advance(self.dt):
                self._blends.remove(blend)
                if blend.lets_go:
                    self.release(blend.pull)

    def _suspend_pulls(self, waits: bool) -> None:
        """For solvers that lead elsewhere: pulls wait, and objectives alone lead."""
        self._table[m.DETOUR] = waits
        if not waits:
            self._table[m.WISHING] = 0

    def _notice(self) -> None:
        self._changed = True

    def _arrange(self) -> None:
        """Makes room for the pulls as they are."""
        mechanism, memory, pulls = self.mechanism, self._memory, self._pulls
        table = np.zeros((max(len(pulls), 1), m.PULL_WIDTH))
        moved_by = np.zeros((max(len(pulls), 1), self._model.nv))
        for i, pull in enumerate(pulls):
            pull.lies_in(table[i])
            frame = self._model.frames[pull.frame]
            table[i, m.JOINT] = frame.parentJoint
            table[i, m.LOCAL : m.LOCAL + 12] = m.columns_of(frame.placement * pull.at)
            table[i, m.AXES_OF] = {"target": m.OF_TARGET, "world": m.OF_WORLD}.get(pull.axes, m.OF_NODE)
            if pull.axes not in ("target", "world"):
                axes = self._model.frames[mechanism.frame_id(pull.axes)]
                table[i, m.AXES_JOINT] = axes.parentJoint
                table[i, m.AXES_LOCAL : m.AXES_LOCAL + 9] = axes.placement.rotation.ravel()
            moved_by[i] = moves(self._model, frame.parentJoint)
        offset = 6 if self._rests() else 0
        if offset != self._table[m.OFFSET]:
            memory.arrays["last"][:] = memory.arrays["drift"][:] = 0.0
        self._table[m.OFFSET], self._table[m.N] = offset, self._model.nv - offset
        self._table[m.PULLS], self._table[m.SIGNATURE], self._table[m.WARM] = len(pulls), -1, 0
        memory.put("pull_table", table)
        for i, pull in enumerate(pulls):
            pull.lies_in(memory.arrays["pull_table"][i])
        memory.put("pull_state", np.zeros((max(len(pulls), 1), m.STATE_WIDTH)))
        memory.put("moves", moved_by)
        self._make_room(6 * len(pulls))
        self._layout = Layout(mechanism, tuple((pull.node, pull.axes, pull.at) for pull in pulls), offset)
        self._record = memory.put("record", np.zeros(self._layout.starts[-1]))
        self._earlier, self._latest = None, None
        self._changed = False

    def _make_room(self, p: int) -> None:
        nv = self._model.nv
        for name in ("e", "e_whole", "e_trial"):
            self._memory.put(name, np.zeros(p + 6))
        self._memory.put("jp", np.zeros((p + 6, nv)))
        for name in ("a", "b"):
            self._memory.put(name, np.zeros(max(p, 1) * max(p, nv, 1)))
        self._memory.put("u", np.zeros(max(p, 1) ** 2))
        self._memory.put("square", np.zeros(max(p, 1)))
        self._memory.put("triangle", np.zeros((2, max(p, 1), max(p, 1))))

    def _rank(self) -> None:
        """The generic rank of the pulls that make sense."""
        pulls = [pull for pull in self._pulls if pull.makes_sense()]
        offset = int(self._table[m.OFFSET])
        grips = [(pull.frame, pull.axes, *pull.at.homogeneous.ravel().tolist()) for pull in pulls]
        key = (offset, *((grip, pull.translation, pull.rotation) for grip, pull in zip(grips, pulls, strict=True)))
        if key not in self._ranks:
            self._ranks[key] = pull_rank(self.mechanism, self.mechanism.system, pulls, slice(offset, None))
        self._table[m.PULL_RANK] = self._ranks[key]
        self._table[m.WARM] = 0

    # --- what lies ahead -----------------------------------------------------------------------------------------

    def forecast(
        self,
        seconds: float,
        dt: float | None = None,
        threshold: float = NEAR,
        passive_threshold: float = NEAR_PASSIVE,
        moving: bool = True,
    ) -> Forecast:
        """What the present pulls lead to: singularities, limits of joints, the end of reach. Changes nothing.

        Pulls that make no sense are left out. Targets that moved between the last two ticks go on moving as fast.

        Args:
            seconds: how far ahead.
            dt: seconds between two of its ticks. The solver's own tells exactly what its ticks will do; unless given,
                as much more as makes them 100 at most. No joint moves on by more than 0.1 rad in any.
            threshold: below which singular value the pulls are near a singularity of type 1.
            passive_threshold: below which one the passive joints are near one of type 2.
            moving: whether targets go on moving.

        Raises:
            CinegenError: seconds or dt are no positive times.
        """
        dt = max(self.dt, seconds / TICKS) if dt is None else dt
        if not (0.0 < seconds < np.inf and 0.0 < dt < np.inf):
            raise CinegenError(f"a forecast's seconds and dt must be positive times, not {seconds} and {dt}")
        if self._ahead is None or self._ahead.dt != dt:
            self._ahead = Ahead(Solver(self.mechanism, dt))
        path = self._ahead.run(self, math.ceil(seconds / dt - 1e-9), moving)
        return foresee(path, threshold, passive_threshold)

    # --- redundancy ----------------------------------------------------------------------------------------------

    @property
    def objectives(self) -> tuple[Objective, ...]:
        """What the mechanism does with the motions that loops and pulls leave free: what these wish for, added up.

        May be set at any time, to any number of them. None of them moves a pull. One that fails in a tick, or returns
        what is no velocity, is left out in that tick; the step's `left_out` and `exceptions` report it, and the logger
        "cinegen" gets the traceback once.

        Raises:
            CinegenError: set to something without a method `velocity`, or to what does not fit this mechanism. Other
                exceptions of a first call are only logged: the objective may work in a later tick.
        """
        return self._objectives

    @objectives.setter
    def objectives(self, objectives: Iterable[Objective]) -> None:
        given, state = tuple(objectives), self.state
        for i, objective in enumerate(given):
            if not callable(getattr(objective, "velocity", None)):
                raise CinegenError(f"an objective has a method `velocity`; {objective!r} has none")
            try:
                objective.velocity(state)
            except CinegenError:
                raise
            except Exception as error:
                self.exception_log.report(self._source("objective", i, objective), error)
        self._objectives = given

    @property
    def state(self) -> State:
        """What objectives are told."""
        resting = 6 if self._rests() else 0
        return State(self.mechanism, self.q, self.dt, self.pulls, resting)

    # --- barriers ------------------------------------------------------------------------------------------------

    @property
    def barriers(self) -> tuple[Barrier, ...]:
        """What the mechanism must not run into: neither pulls nor objectives lead beyond. May be set at any time.

        A barrier that raises, or returns what makes no sense, allows no motion in that tick. The step's `exceptions`
        report it, and the logger "cinegen" gets the traceback once.

        Raises:
            CinegenError: set to something without the methods `bounds` and `clear`.
        """
        return self._barriers

    @barriers.setter
    def barriers(self, barriers: Iterable[Barrier]) -> None:
        given = tuple(barriers)
        for barrier in given:
            if not (callable(getattr(barrier, "bounds", None)) and callable(getattr(barrier, "clear", None))):
                raise CinegenError(f"a barrier has the methods `bounds` and `clear`; {barrier!r} lacks one")
        self._barriers = given
        self._table[m.GUARDED], self._table[m.BARRIERS] = bool(given), 0

    def _look_around(self) -> None:
        """Asks the barriers what holds in this tick."""
        state, offset, mechanism = self.state, int(self._table[m.OFFSET]), self.mechanism
        rows: list[Array] = []
        most: list[Array] = []
        self._blocked = False
        for i, barrier in enumerate(self._barriers):
            try:
                bounds = _checked(barrier.bounds(state), self._model.nv)
                rows.append(bounds.rows * (mechanism.scale / mechanism.length))
                most.append(bounds.most * (self.dt / mechanism.length))
            except Exception as error:  # the loop must go on
                self._blocked = True
                self._catch(self._source("barrier", i, barrier), error)
        count = 0 if self._blocked else sum(map(len, most))
        if count > len(self._memory.arrays["stopped"]) - self._model.nv:
            make_room_for_barriers(self._memory, self._model.nv, count)
        self._table[m.BARRIERS] = count
        if count:
            free = np.vstack(rows)[:, offset:].ravel()
            self._memory.arrays["barrier_rows"].ravel()[: len(free)] = free
            self._memory.arrays["barrier_room"][:count] = np.concatenate(most)

    def _clear(self) -> float:
        """The part of the way to the trial that barriers allow."""
        if self._blocked:
            return 0.0
        state, least = self.state, np.inf
        for i, barrier in enumerate(self._barriers):
            try:
                part = float(barrier.clear(state, self._trial.copy()))
                if not part >= 0.0:
                    raise ValueError(f"clear(state, q) returned {part}: return a number from 0 to 1")
                least = min(least, part)
            except Exception as error:  # the loop must go on
                self._blocked = True
                self._catch(self._source("barrier", i, barrier), error)
        return 0.0 if self._blocked else least

    def _rests(self) -> bool:
        """Whether the mechanism has a base that could move, and does not: it moves when it is pulled itself."""
        base = self.mechanism.nodes[0]
        return self.mechanism.floating and all(pull.node != base for pull in self._pulls)

    def _wish(self) -> None:
        """Asks the objectives what they wish for in this tick."""
        state, total, left_out = self.state, np.zeros(self._model.nv), 0
        for i, objective in enumerate(self._objectives):
            try:
                velocity = np.asarray(objective.velocity(state), dtype=float)
                if velocity.shape != total.shape:
                    raise ValueError(f"velocity(state) returned shape {velocity.shape}: return {total.shape}")
                if not np.abs(velocity).max(initial=0.0) < _FASTEST:
                    i_bad = int(np.argmin(np.abs(velocity) < _FASTEST))
                    raise ValueError(f"velocity(state)[{i_bad}] is {velocity[i_bad]}: return finite rad/s and m/s")
            except Exception as error:  # the loop must go on
                self._catch(self._source("objective", i, objective), error)
                left_out |= 1 << min(i, m.MOST_LEFT_OUT)
            else:
                total += velocity
        total *= self.dt / self.mechanism.scale
        total *= STEP_CAP / max(STEP_CAP, np.abs(total).max(initial=0.0))
        self._memory.arrays["wish"][: len(total)] = total
        self._table[m.WISHING], self._table[m.LEFT_OUT] = 1, left_out

    def _source(self, kind: str, i: int, what: object) -> str:
        """Return which objective or barrier an exception comes from."""
        return f"{kind} {i} ({type(what).__name__}) of {self.mechanism.name}"

    def _catch(self, source: str, error: Exception) -> None:
        """Keep an exception for the step of this tick, and log it."""
        self._caught += (error,)
        self.exception_log.report(source, error)

    # --- one tick ------------------------------------------------------------------------------------------------

    def step(self) -> Step:
        """One tick of dt. Never raises: the status says what happened."""
        if self._blends:
            self._go_on_blending()
        if self._changed:
            self._arrange()
        if self._objectives:
            self._wish()
        if self._barriers:
            self._look_around()
        table = self._table
        request = tick(table)
        while request != ACCEPTED and request != DONE:
            if request == EVALUATE:
                if self._curved is not None:
                    self._integrate(*self._curved)
                self._evaluate(self._model, self._data, self._trial)
            elif request == EVALUATE_HERE:
                self._evaluate(self._model, self._data, self._q)
            elif request == CLEAR_PLEASE:
                self._memory.arrays["settings"][m.CLEAR] = self._clear()
            else:
                self._rank()
            request = tick(table)
        if request == ACCEPTED:
            self._evaluate(self._model, self._data, self._q)
        record = self._record.copy()
        self._earlier, self._latest = self._latest, record
        if self._caught:
            caught, self._caught = self._caught, ()
            return Step(record, self._layout, caught)
        return Step(record, self._layout)

    def _integrate(self, at_q: NDArray[np.intp], at_v: NDArray[np.intp]) -> None:
        """Joints whose configuration is no number (a free base, a ball) go on as Pinocchio says."""
        arrays, offset = self._memory.arrays, int(self._table[m.OFFSET])
        self._trial[at_q] = pin.integrate(self._model, arrays["before"], arrays["delta"])[at_q]
        moved = pin.difference(self._model, self._q, self._trial) / self.mechanism.scale
        moving = at_v[at_v >= offset]
        arrays["moved"][moving - offset] = moved[moving]


def _checked(bounds: Bounds, nv: int) -> Bounds:
    """Bounds as they should be.

    Raises:
        ValueError: they are not.
    """
    rows, most = np.asarray(bounds.rows, dtype=float), np.asarray(bounds.most, dtype=float)
    if most.ndim != 1 or rows.shape != (len(most), nv) or not np.isfinite(rows).all() or np.isnan(most).any():
        raise ValueError(
            f"bounds(state) returned rows {rows.shape} and most {most.shape}: return finite rows (m, {nv}), "
            "and most (m,) without NaN"
        )
    return Bounds(rows, most)


def _nothing() -> None:
    """Nobody is to be told."""


def _grip(at: pin.SE3 | ArrayLike | None) -> pin.SE3:
    """What of a node is pulled, as a frame on it."""
    if at is None:
        return pin.SE3.Identity()
    if isinstance(at, pin.SE3):
        grip = at
    else:
        try:
            grip = pin.SE3(np.eye(3), np.asarray(at, dtype=float).reshape(3))
        except (TypeError, ValueError):
            grip = None
    if grip is None or not np.isfinite(grip.homogeneous).all():
        raise CinegenError("what of a node is pulled is a point of three finite numbers, or a pinocchio.SE3")
    return grip
