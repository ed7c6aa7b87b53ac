"""`AvoidingSolver`: keeps a mechanism clear of obstacles while it is pulled, and leads it round them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from cinegen.collision.clearance import Clearance
from cinegen.ik import FrameTask, Solver, Step
from cinegen.ik.objectives import Objective, State
from cinegen.ik.seeker import Seeker
from cinegen.model import Mechanism
from cinegen.planning.keep import Keep, part_in
from cinegen.planning.shadow import Shadow
from cinegen.planning.vortices import Turning, Vortices
from cinegen.tolerances import CLOSURE

Array = NDArray[np.float64]

_SCOUTS = -math.log1p(-0.2)  # 1/tick, gain of the look-ahead: it arrives within a few ticks
_THERE = 1e-4  # rad or m in a step of it: it has arrived
_TRUSTED = 0.25  # s without coming nearer, then the tasks wait and all of the mechanism goes round
_TRIED = 0.6  # s without coming nearer, then another way round is tried
_STILL = 0.1  # s at rest are long enough for either
_REST = 2e-3  # rad/s or lengths/s: slower than that is at rest
_NEARER = 0.02  # part of what is left at the time, that counts as nearer
_CALM = 0.02  # s without a vortex, then the tasks take over again
_MOVED = 0.02  # lengths or rad: targets further away than that from where they were are others
_STARTS = 40  # from which postures are looked for, one in a tick
_POSTURES = 3  # that are tried
_STRIDE = 0.02  # rad or lengths in a tick towards a posture, at most; limits of speed count too
_AT_POSTURE = 0.02  # rad or lengths from it the tasks take over

_FIRST = (Turning.SHORTER, Turning.FOLDING)
_OTHERS = (Turning.LONGER, Turning.UP, Turning.DOWN, Turning.ASIDE)


class _Way(NamedTuple):
    """One way to the targets: after the tasks, or by a posture (nq,); and which way round."""

    posture: Array | None
    turning: Turning


class AvoidingSolver(Solver):
    """A `Solver` that never leads nearer to an obstacle than the safety distance, and goes round what is in the way.

    Links that come near slow down and slide along (`Keep`); that is never given up. Where following the tasks would
    hit, vortices turn: first in the motions that the tasks leave free, so that what is pulled stays with the hand;
    where that does not help, the tasks wait and the whole mechanism goes round, as a plan would. If it comes no nearer
    so, other ways round are tried one after the other, by postures that reach the targets, too; when none is left it
    waits at the safety distance until the targets move. The status is DETOUR while tasks wait, and BARRED where an
    obstacle holds the motion back.

    What would be hit is found out by a shadow that runs ahead, a little in each tick.

    Args:
        mechanism: what to move.
        dt: seconds between two ticks.
        clearance: of the mechanism among its obstacles.
        around: for each pair of the clearance the number of what it goes round.
        safety: m: the distance that is kept.
        reach: m: from where on vortices act; half a characteristic length unless given.
        q: (nq,) where to begin; home unless given.

    Raises:
        ConfigurationError: q is no configuration.
        CinegenError: q leaves loops open, or dt makes no sense.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        dt: float,
        clearance: Clearance,
        around: NDArray[np.int64],
        safety: float,
        reach: float | None = None,
        q: ArrayLike | None = None,
    ) -> None:
        self._own: tuple[Objective, ...] = ()
        self._still = 0  # ticks at rest
        super().__init__(mechanism, dt, q=q)
        self.clearance = clearance
        self.keep = Keep(clearance, safety, part_in(dt))
        self.barriers = (self.keep,)
        self.vortices = Vortices(clearance, around, 0.5 * mechanism.length if reach is None else reach, safety)
        self._seen: dict[int, pin.SE3] = {}  # where obstacles were
        self._follower, self._scout = Shadow(mechanism, dt), Shadow(mechanism, dt, _SCOUTS)
        self._begin_anew()

    @property
    def objectives(self) -> tuple[Objective, ...]:
        """See `Solver`; while the tasks wait, these wait too."""
        return self._own

    @objectives.setter
    def objectives(self, objectives: Iterable[Objective]) -> None:
        Solver.objectives.__set__(self, objectives)  # type: ignore[attr-defined]
        self._own = self._objectives

    def move(self, body: int, placement: pin.SE3) -> None:
        """Puts an obstacle elsewhere. Where that has gone some way, ways that led nowhere are tried again.

        Args:
            body: its number in the clearance.
            placement: of its shape in the mechanism's world.
        """
        self.clearance.move(body, placement)
        seen = self._seen.setdefault(body, placement.copy())
        way = seen.actInv(placement)
        turned = float(np.linalg.norm(pin.log3(way.rotation)))
        if max(float(np.linalg.norm(way.translation)) / self.mechanism.length, turned) > _MOVED:
            self._seen[body] = placement.copy()
            if not self._ways:
                self._begin_anew()

    def step(self) -> Step:
        """One tick of dt. Never raises: the status says what happened."""
        try:
            self._look()
        except Exception as error:  # the loop must go on; the barrier keeps the mechanism clear
            self._begin_anew()
            self._catch(f"the search for a path around obstacles of {self.mechanism.name}", error)
        step = super().step()
        self._objectives = self._own
        slow = float(np.abs(step.v / self.mechanism.scale).max(initial=0.0)) < _REST
        self._still = self._still + 1 if slow else 0
        return step

    # --- going round ---------------------------------------------------------------------------------------------

    def _begin_anew(self) -> None:
        """For other targets."""
        self._ways = [_Way(None, turning) for turning in _FIRST]
        self._search: _Search | None = None
        self._aims: tuple[Array, ...] = ()
        self._calm = 0
        self._set_out()
        self._wait(False)

    def _set_out(self) -> None:
        """On the first of the ways that are left."""
        self._nearest, self._since, self._still = math.inf, 0, 0
        self._hit: frozenset[int] = frozenset()
        self._scout.q = None
        self.vortices.rest()
        if self._ways:
            self.vortices.turning = self._ways[0].turning

    def _wait(self, waits: bool) -> None:
        """Whether the tasks wait."""
        self._waits = waits
        self._suspend_tasks(waits)

    def _look(self) -> None:
        """Before a tick: what is in the way, and how to get round it."""
        tasks = [task for task in self.tasks if task.is_valid()]
        if not tasks or any(task.twist is not None for task in tasks):
            if self._aims:
                self._begin_anew()
            return
        aims = tuple(task.target.homogeneous for task in tasks)
        if self._are_others(aims):
            self._begin_anew()
            self._aims = tuple(aim.copy() for aim in aims)
        if not self._ways:
            self._look_for_postures(tasks)
            return
        q = self.q
        posture = self._ways[0].posture
        self._run_ahead(q, tasks, posture)
        motion = self._follower.motion(q, tasks, self.gain) if posture is None else self._towards(q, posture)
        turned = self.vortices.turn(q, motion, lambda: self._hit)
        turning = len(self.vortices.awake) > 0
        self._calm = 0 if turning else self._calm + 1
        if self._waits:
            self._objectives = (_Wish(turned),)
        elif turning:
            self._objectives = (*self._own, _Wish(turned - motion))
        if turning or posture is not None:
            self._notice_progress(tasks, posture)
        elif self._waits and self._calm * self.dt >= _CALM:
            self._wait(False)

    def _are_others(self, aims: tuple[Array, ...]) -> bool:
        """Whether targets are elsewhere than when they were looked at first."""
        if len(aims) != len(self._aims):
            return True
        length = self.mechanism.length
        return any(
            np.linalg.norm(now[:3, 3] - then[:3, 3]) > _MOVED * length
            or float(np.abs(now[:3, :3] - then[:3, :3]).max()) > _MOVED
            for now, then in zip(aims, self._aims, strict=True)
        )

    def _run_ahead(self, q: Array, tasks: Sequence[FrameTask], posture: Array | None) -> None:
        """The shadow goes on; where it hits something or arrives, it comes back."""
        scout = self._scout
        before = q if scout.q is None else scout.q
        if posture is None:
            scout.q = scout.ahead(before, tasks)
        else:
            scout.q = self.mechanism.integrate(before, 3.0 * self._towards(before, posture))
        hit = self.vortices.hits(scout.q)
        if hit or float(np.abs(scout.q - before).max(initial=0.0)) < _THERE:
            self._hit, scout.q = hit, None

    def _towards(self, q: Array, posture: Array) -> Array:
        """(nv,) a tick's motion to a posture, loops apart."""
        largest = self.mechanism.distance(q, posture)
        return self.mechanism.difference(q, posture) * min(self.tick_gain, _STRIDE / max(largest, 1e-300))

    def _notice_progress(self, tasks: Sequence[FrameTask], posture: Array | None) -> None:
        """Tries harder where it comes no nearer."""
        left = self._left(tasks) if posture is None else self.mechanism.distance(self._q, posture)
        if posture is not None and left < _AT_POSTURE:
            self._ways = [_Way(None, Turning.SHORTER)]
            self._set_out()
            self._wait(False)
            return
        self._since += 1
        if left < (1.0 - _NEARER) * self._nearest:
            self._nearest, self._since = left, 0
        still = self._still * self.dt >= _STILL
        if not self._waits and (still or self._since * self.dt >= _TRUSTED):
            self._wait(True)
            self._since, self._still = 0, 0
        elif self._waits and (still or self._since * self.dt >= _TRIED):
            self._ways.pop(0)
            self._set_out()
            self._wait(bool(self._ways))

    def _left(self, tasks: Sequence[FrameTask]) -> float:
        """How far tasks are from their targets, lengths and rad."""
        total = 0.0
        for task in tasks:
            axes = np.eye(3) if task.axes == "world" else None
            straight, turn = task.errors(self.mechanism.placement(self._q, task.node) * task.offset, axes)
            total += float(np.linalg.norm(straight)) / self.mechanism.length + float(np.linalg.norm(turn))
        return total

    # --- postures ------------------------------------------------------------------------------------------------

    def _look_for_postures(self, tasks: Sequence[FrameTask]) -> None:
        """One more start, once for each place of the targets; then the postures found are tried."""
        if self._search is None:
            self._search = _Search(self.mechanism, tasks)
        if self._search.ends(self.clearance, self.keep.safety):
            nearest = sorted(self._search.found, key=lambda q: self.mechanism.distance(self._q, q))[:_POSTURES]
            others = _OTHERS if self.vortices.plane is None else _OTHERS[:1]
            self._ways = [_Way(q, turning) for q in nearest for turning in _FIRST]
            self._ways += [_Way(None, turning) for turning in others]
            self._set_out()
            self._wait(bool(self._ways))


class _Search:
    """For postures in which all targets are reached, clear of everything."""

    def __init__(self, mechanism: Mechanism, tasks: Sequence[FrameTask]) -> None:
        self._seeker = Seeker(mechanism, tuple(tasks))
        for own, task in zip(self._seeker.tasks, tasks, strict=True):
            own.target = task.target.copy()
        self._rng, self._left = np.random.default_rng(0), _STARTS
        self.found: list[Array] = []

    def ends(self, clearance: Clearance, safety: float) -> bool:
        """Looks from one more start; whether that was the last."""
        if self._left == 0:
            return False
        self._left -= 1
        seeker = self._seeker
        if seeker.seek(seeker.anywhere(self._rng), 1e-8) and seeker.open_by <= CLOSURE:
            q = seeker.best
            if clearance.least(q) >= safety:
                self.found.append(q)
        return self._left == 0


class _Wish:
    """A motion in one tick."""

    def __init__(self, motion: Array) -> None:
        self._motion = motion

    def velocity(self, state: State) -> Array:
        """(nv,) rad/s and m/s."""
        return self._motion / state.dt
