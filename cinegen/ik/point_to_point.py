"""`inverse_kinematics`: which configuration brings some nodes to some poses?"""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import CinegenError
from cinegen.ik._kernels.local_ik import nearest_start
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.solver import Solver
from cinegen.ik.step import Status
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism
from cinegen.tolerances import CLOSURE

Array = NDArray[np.float64]

_SPREAD = 1000  # configurations that starts are taken from
_SPREAD_CLOSED = 400  # these cost more
_NEAREST = 8  # starts that are near the targets; after them every other one is anywhere
_KEPT = 16  # mechanisms and nodes whose starts are kept
_APPROACH = 400  # ticks towards what can't be reached


@dataclass(frozen=True, eq=False)
class IKResult:
    """What `inverse_kinematics` has found; true if all targets were reached.

    Attributes:
        found: whether they were.
        q: (nq,) the configuration. Where nothing was found, one as near as could be, loops closed all the same.
        closure: largest loop residual at q, rad or characteristic lengths.
        starts: from how many configurations it was looked for.
        iterations: in all.
        holding: joints that stand on a limit and are driven against it, where nothing was found.
    """

    found: bool
    q: Array
    closure: float
    starts: int
    iterations: int
    holding: tuple[str, ...]
    _mechanism: Mechanism = field(repr=False)
    _tasks: tuple[FrameTask, ...] = field(repr=False)

    @property
    def errors(self) -> tuple[tuple[float, float], ...]:
        """For each target, what is left: m and rad."""
        return tuple(self._error(task) for task in self._tasks)

    def _error(self, task: FrameTask) -> tuple[float, float]:
        own = task.target.rotation
        if task.axes != "target":
            own = np.eye(3) if task.axes == "world" else self._mechanism.placement(self.q, task.axes).rotation
        straight, turn = task.errors(self._mechanism.placement(self.q, task.node) * task.offset, own)
        return math.hypot(*straight), math.hypot(*turn)

    def __bool__(self) -> bool:
        return self.found

    def __str__(self) -> str:
        tried = f"{self.starts} start{'s' * (self.starts != 1)}, {self.iterations} iterations"
        if self.found:
            return f"reached ({tried})"
        left = ", ".join(f"{straight:.3g} m and {turn:.3g} rad" for straight, turn in self.errors)
        held = f"; {', '.join(self.holding)} at the limit" if self.holding else ""
        return f"not reached: {left} are left at the nearest configuration found{held} ({tried})"


def inverse_kinematics(
    mechanism: Mechanism,
    targets: Mapping[str, pin.SE3] | Sequence[FrameTask],
    q: ArrayLike | None = None,
    *,
    tolerance: float = 1e-6,
    limits: bool = True,
    starts: int = 100,
    seed: int = 0,
) -> IKResult:
    """Looks for a configuration that brings nodes to targets, loops closed and joints within their limits.

    It begins at q, then at those configurations that are nearest to the targets of many that were spread over all that
    can be reached from home, then anywhere; the first one found is taken. What is spread is kept: the first call for a
    mechanism and its nodes takes milliseconds, later ones microseconds. Threads don't share it.

    Args:
        mechanism: which.
        targets: pose of each node in the world; or tasks, where not all of a pose counts.
        q: (nq,) where to begin, loops closed or not; a solution near it is preferred then.
        tolerance: m and rad that may be left. Usually less is left than 1e-12.
        limits: whether joints must keep to their position limits.
        starts: how many, at most. Nothing is said to be out of reach before.
        seed: of what is random.

    Raises:
        UnknownNameError: no such node.
        ConfigurationError: q is no configuration.
        CinegenError: nothing is asked for, a target makes no sense, or tolerance or starts are not positive.
    """
    if isinstance(targets, Mapping):
        targets = [FrameTask(node, target) for node, target in targets.items()]
    if not targets:
        raise CinegenError("reach needs a target for at least one node")
    for task in targets:
        if not task.is_valid() or task.twist is not None:
            raise CinegenError(f"a target of '{task.node}' must be a finite pinocchio.SE3, and its weight above 0")
    if not (tolerance > 0.0 and starts > 0):
        raise CinegenError(f"tolerance and starts must be above 0, not {tolerance} and {starts}")
    return _finder(mechanism, tuple(targets), limits, seed).find(
        [task.target for task in targets], None if q is None else mechanism.checked(q), tolerance, starts
    )


class _Finder:
    """For one mechanism and some nodes: the local solver and its starts."""

    def __init__(self, mechanism: Mechanism, tasks: tuple[FrameTask, ...], limits: bool, seed: int) -> None:
        self.mechanism = mechanism
        self.local = LocalIK(mechanism, tasks, limits)
        self._seed, self._limits = seed, limits
        self._weights = [_weights(task, mechanism.length) for task in tasks]
        closer = LocalIK(mechanism, (), limits) if mechanism.loops else self.local
        self._spread = closer.spread(_SPREAD_CLOSED if mechanism.loops else _SPREAD, np.random.default_rng(seed))
        self._features = np.array([self._feature(self.local.placements(q)) for q in self._spread])
        self._used = np.zeros(len(self._spread))

    def _feature(self, placements: Sequence[pin.SE3]) -> Array:
        """What of some placements counts, as one point."""
        parts = []
        for placement, (straight, turn) in zip(placements, self._weights, strict=True):
            parts += [straight * placement.translation, (turn * placement.rotation).ravel()]
        return np.concatenate(parts)

    def find(self, targets: Sequence[pin.SE3], q: Array | None, tolerance: float, starts: int) -> IKResult:
        local = self.local
        for task, target in zip(local.tasks, targets, strict=True):
            task.target = target
        goal = 0.5 * min(tolerance, tolerance / self.mechanism.length)  # of each of up to three residuals
        rng: np.random.Generator | None = None  # begun anew: what was asked before makes no difference
        point = self._feature(targets)
        self._used[:] = 0.0
        iterations = 0
        best: tuple[float, Array] = (np.inf, self.mechanism.q_home)
        for count in range(starts):
            if count == 0 and q is not None:
                start = q
            else:
                nearest = -1
                if count < _NEAREST or count % 2 == 0:
                    nearest = nearest_start(self._features, point, self._used)
                if nearest >= 0:
                    start = self._spread[nearest]
                    self._used[nearest] = 1.0
                else:
                    rng = rng or np.random.default_rng(self._seed)
                    start = local.anywhere(rng)
            found = local.seek(start, goal)
            iterations += local.iterations
            if found:
                return self._reached(count + 1, iterations)
            if local.open_by <= CLOSURE and local.cost < best[0]:
                best = local.cost, local.best
        return self._approached(best[1], starts, iterations)

    def _reached(self, starts: int, iterations: int) -> IKResult:
        local = self.local
        return IKResult(True, local.best, local.open_by, starts, iterations, (), self.mechanism, self._aims())

    def _approached(self, q: Array, starts: int, iterations: int) -> IKResult:
        """As near as ticks come, from the best that was found."""
        solver = Solver(self.mechanism, 1.0, q)
        for task in self.local.tasks:
            solver.add_task(
                task.node, task.target, task.translation, task.rotation, task.weight, task.axes, task.offset
            )
        solver.lift_limits(position=not self._limits)
        for _ in range(_APPROACH):
            step = solver.step()
            if step.status is Status.OUT_OF_REACH or not np.abs(step.v).max(initial=0.0) > 1e-7:
                break
        held, aims = step.saturated, self._aims()
        return IKResult(False, step.q, step.closure, starts, iterations, held, self.mechanism, aims)

    def _aims(self) -> tuple[FrameTask, ...]:
        """What was asked for, as values of its own: the solver's tasks are for the next one."""
        return tuple(
            FrameTask(task.node, task.target, task.translation, task.rotation, 1.0, task.axes, offset=task.offset)
            for task in self.local.tasks
        )


def _weights(task: FrameTask, length: float) -> tuple[float, Array]:
    """How much place and axes of a task count."""
    turn = np.full(3, 0.5 * (task.rotation / 3.0))
    if task.rotation == 2:
        turn = np.array([0.0, 0.0, 0.5])
    return task.translation / 3.0 / length, turn


class _Finders(threading.local):
    """The last ones that were made, of this thread."""

    def __init__(self) -> None:
        self.recent: OrderedDict[tuple[object, ...], _Finder] = OrderedDict()


_finders = _Finders()


def _finder(mechanism: Mechanism, tasks: tuple[FrameTask, ...], limits: bool, seed: int) -> _Finder:
    what = [
        (task.node, task.translation, task.rotation, task.axes, task.weight, *task.offset.homogeneous.ravel().tolist())
        for task in tasks
    ]
    key = (id(mechanism), limits, seed, *what)
    recent = _finders.recent
    finder = recent.get(key)
    if finder is None:
        finder = recent[key] = _Finder(mechanism, tasks, limits, seed)  # holds the mechanism, so that its id stays
        if len(recent) > _KEPT:
            recent.popitem(last=False)
    else:
        recent.move_to_end(key)
    return finder
