"""Global inverse kinematics: a configuration that brings nodes to poses, from many starts of a local solver; or all."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, overload

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError
from cinegen.hexapod import SolutionCounts
from cinegen.html import table
from cinegen.ik.all_solutions import all_solutions
from cinegen.ik.by_ticks import solve_by_ticks
from cinegen.ik.given_task import Task, errors_of
from cinegen.ik.joint_settings import checked_names
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.solutions import IKError, IKSolutions, with_closest
from cinegen.ik.solver import Solver
from cinegen.ik.state import State
from cinegen.ik.step import Status
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism
from cinegen.model.plausible import FAR_TARGET, check_configuration, check_lengths
from cinegen.recent import Recent
from cinegen.tolerances import CLOSURE
from raff2urdf.errors import counted

_SAMPLES = 1000  # configurations that starts are taken from
_CLOSED_SAMPLES = 400  # with loops, where they cost more
_NEAREST = 8  # starts that are nearest to the targets; after them every other one is random
_KEPT = 16  # global solvers that are kept
_LAST = 20  # starts where no solution was found otherwise
_APPROACH = 400  # ticks towards targets that were not reached


@dataclass(frozen=True, eq=False, repr=False)
class IKResult:
    """Result of `inverse_kinematics`; true if all targets are reached.

    Attributes:
        found: whether all targets are reached.
        q: (nq,) configuration, loops closed; if no solution was found, one as near to the targets as possible.
        closure: largest loop residual at q, rad or characteristic lengths.
        starts: number of starts.
        iterations: number of iterations from all starts.
        saturated: if no solution was found, joints at a limit that restricts the motion towards the targets.
    """

    found: bool
    q: Array
    closure: float
    starts: int
    iterations: int
    saturated: tuple[str, ...]
    _mechanism: Mechanism = field(repr=False)
    _tasks: tuple[FrameTask | Task, ...] = field(repr=False)

    @property
    def errors(self) -> tuple[tuple[float, float], ...]:
        """Remaining error of each target: m and rad."""
        state = State(self._mechanism, self.q, 1.0)
        return tuple(errors_of(task, state) for task in self._tasks)

    def as_solutions(self) -> IKSolutions:
        """Return the result of a single task as a list of one solution, or of none with this as the closest.

        Raises:
            IKError: there are several tasks.
        """
        task = self._tasks[0]
        if len(self._tasks) > 1 or not isinstance(task, FrameTask):
            raise IKError("solutions are listed for one node at a time")
        none = IKSolutions(
            self._mechanism, task, self._mechanism.q_home, {}, (), (), (), False, f"local search: {self}",
            SolutionCounts(),
        )  # fmt: skip
        return with_closest(none, self.q, self.found)

    def __bool__(self) -> bool:
        return self.found

    def __str__(self) -> str:
        effort = f"{counted(self.starts, 'start')}, {self.iterations} iterations"
        if self.found:
            return f"reached ({effort})"
        left = ", ".join(f"{linear:.3g} m and {angular:.3g} rad" for linear, angular in self.errors)
        limits = f"; {', '.join(self.saturated)} at the limit" if self.saturated else ""
        return f"not reached: remaining error at the nearest configuration {left}{limits} ({effort})"

    def __repr__(self) -> str:
        return f"<IKResult of {self._mechanism.name}: {self}>"

    def _repr_html_(self) -> str:
        """Show the error of each target as a table in a notebook."""
        errors = zip(self._tasks, self.errors, strict=True)
        rows = [
            (getattr(task, "node", repr(task)), f"{linear:.3g}", f"{angular:.3g}") for task, (linear, angular) in errors
        ]
        return table(f"{self._mechanism.name}: {self}", ("node", "error (m)", "error (rad)"), rows)


@overload
def inverse_kinematics(
    mechanism: Mechanism,
    targets: Mapping[str, pin.SE3] | Sequence[FrameTask | Task],
    q: ArrayLike | None = None,
    *,
    tolerance: float = 1e-6,
    limits: bool = True,
    starts: int = 100,
    seed: int = 0,
    all: Literal[False] = False,
    locked: Mapping[str, float] | Iterable[str] | None = None,
) -> IKResult: ...
@overload
def inverse_kinematics(
    mechanism: Mechanism,
    targets: Mapping[str, pin.SE3] | Sequence[FrameTask],
    q: ArrayLike | None = None,
    *,
    all: Literal[True],
    locked: Mapping[str, float] | Iterable[str] | None = None,
    report: Callable[[str], None] | None = None,
    effort: float = 1.0,
) -> IKSolutions: ...
def inverse_kinematics(
    mechanism: Mechanism,
    targets: Mapping[str, pin.SE3] | Sequence[FrameTask | Task],
    q: ArrayLike | None = None,
    *,
    tolerance: float = 1e-6,
    limits: bool = True,
    starts: int = 100,
    seed: int = 0,
    all: bool = False,
    locked: Mapping[str, float] | Iterable[str] | None = None,
    report: Callable[[str], None] | None = None,
    effort: float = 1.0,
) -> IKResult | IKSolutions:
    """Find a configuration that brings nodes to targets, loops closed and joints within their limits; or all.

    The first start is q; the next are the nearest to the targets among samples of all configurations that can be
    reached from home; later ones are random. The first solution is returned. Samples are kept: the first call for a
    mechanism and its nodes takes milliseconds, later ones microseconds. Threads do not share them.

    With `all=True` all isolated configurations are computed, by the methods of `assembly_modes`: within limits or not,
    as `IKSolutions.outside` lists. The first call for a mechanism and a node may take seconds, later ones milliseconds.
    A robot with more DoF than the task constrains has curves of solutions: lock some of its joints.

    Args:
        mechanism: mechanism.
        targets: pose of each node in the world; or tasks, where a pose is constrained in part. With `all` a single one.
            Tasks may be of any kind (`Task`) and priority: then the solver runs from each start until it rests, and the
            best configuration is that whose first level has the smallest error, then the second, and so on.
        q: (nq,) first start, loops closed or not; a solution near it is preferred. With `all` the configuration from
            which distances are measured; joints that don't move the node stay there.
        tolerance: largest error, m and rad. Usually less than 1e-12 remains.
        limits: whether joints must keep their position limits.
        starts: largest number of starts. A target is reported as not reached only after all of them.
        seed: seed of the samples and random starts.
        all: whether all solutions are computed; then the four above are not used.
        locked: joints that do not move: by name where q has them, or a mapping to the values that they keep, rad and m.
            A floating base, "base", is named only; with `all` it is locked in any case.
        report: with `all`, called with a sentence on the progress, if it takes long.
        effort: with `all`, how much may be done the first time for a mechanism of no known family; 1 is about half a
            minute. What was not done is stated in the result, and done if more is allowed.

    Raises:
        UnknownNameError: no such node or joint.
        ConfigurationError: q has a wrong shape or is not finite.
        IKError: all solutions can't be computed, for instance as there is a curve of them.
        ClosureError: the loops can't be closed with joints locked at these values.
        CinegenError: there is no target, a target is invalid, or tolerance or starts is not positive; or a target, q or
            a value was meant in mm or degrees.
    """
    if isinstance(targets, Mapping):
        targets = [FrameTask(node, target) for node, target in targets.items()]
    if not targets:
        raise CinegenError("inverse kinematics needs a target for at least one node")
    frames = [task for task in targets if isinstance(task, FrameTask)]
    for task in frames:
        if not task.is_valid() or task.twist is not None:
            raise CinegenError(f"a target of '{task.node}' must be a finite pinocchio.SE3, and its weight above 0")
        check_lengths(mechanism, f"target of '{task.node}'", task.target.translation, FAR_TARGET)
    if not (tolerance > 0.0 and starts > 0):
        raise CinegenError(f"tolerance and starts must be above 0, not {tolerance} and {starts}")
    checked = None if q is None else mechanism.structure.checked(q)
    if checked is not None:
        check_configuration(mechanism, checked)
    of_levels = len(frames) < len(targets) or len({task.priority for task in targets}) > 1
    if all and of_levels:
        raise IKError("all solutions are computed for the pose of a node, not for tasks of other kinds or priorities")
    names = checked_names(mechanism, locked or ())
    if names:
        checked = _with_values(mechanism, locked if isinstance(locked, Mapping) else {}, names, checked)
    if all:
        assert checked is not None or not names
        values = {name: _value(mechanism, name, checked) for name in names if name != mechanism.base}
        return _all(mechanism, frames, checked, values, report, effort)
    held = _held(mechanism, names, checked)
    if of_levels:
        success, at, tried, ticks, saturated = solve_by_ticks(held, targets, checked, tolerance, limits, starts, seed)
        closure = mechanism.closure(at)
        return IKResult(success, at, closure, tried, ticks, () if success else saturated, mechanism, tuple(targets))
    poses = [task.target for task in frames]
    solved = _global_ik(held, tuple(frames), limits, seed).solve(poses, checked, tolerance, starts)
    return replace(solved, _mechanism=mechanism)


def _with_values(mechanism: Mechanism, values: Mapping[str, float], names: tuple[str, ...], q: Array | None) -> Array:
    """Return a closed configuration (nq,) near q or home in which locked joints have their values."""
    if mechanism.base in names and ("base" in values or mechanism.base in values):
        raise CinegenError("the base keeps its pose in q: name it without a value, as in locked=['base']")
    near = mechanism.configuration(values, q)
    check_configuration(mechanism, near)
    return near if mechanism.closure(near) <= CLOSURE else mechanism.close(near, names)


def _value(mechanism: Mechanism, joint: str, q: Array | None) -> float:
    if q is None or joint not in mechanism.joints:
        raise IKError(f"'{joint}' can't be locked where all solutions are computed: it is not one number")
    return float(q[mechanism.q_index(joint)])


def _all(
    mechanism: Mechanism, tasks: Sequence[FrameTask], q: Array | None, locked: Mapping[str, float],
    report: Callable[[str], None] | None, effort: float,
) -> IKSolutions:  # fmt: skip
    """Return all solutions; without any, a configuration near the target that many starts of the local solver find."""
    if len(tasks) > 1:
        names = ", ".join(f"'{task.node}'" for task in tasks)
        raise IKError(f"all solutions are computed for one node at a time, not for {names}")
    start = mechanism.q_home if q is None else q
    solutions = all_solutions(mechanism, tasks[0], start, locked, report, effort)
    if solutions or locked:
        return solutions
    nearest = inverse_kinematics(mechanism, tasks, start, limits=False, starts=_LAST)
    if nearest:
        solutions = replace(solutions, method=f"{solutions.method}; one was found by a local search")
    return with_closest(solutions, nearest.q, nearest.found)


class _GlobalIK:
    """Local solver of some frames of a mechanism, with its starts."""

    def __init__(self, mechanism: Mechanism, tasks: tuple[FrameTask, ...], limits: bool, seed: int) -> None:
        self._mechanism, self._limits, self._seed = mechanism, limits, seed
        self._local = LocalIK(mechanism, tasks, limits)
        self._weights = [placement_weights(task, mechanism.length) for task in tasks]
        closing = LocalIK(mechanism, (), limits) if mechanism.is_constrained else self._local
        count = _CLOSED_SAMPLES if mechanism.is_constrained else _SAMPLES
        self._samples = closing.samples(count, np.random.default_rng(seed))
        self._features = np.array([self._feature(self._local.placements(q)) for q in self._samples])

    def _feature(self, placements: Sequence[pin.SE3]) -> Array:
        """Return the constrained parts of some placements as one point; its distances are dimensionless."""
        parts = []
        for placement, (linear, angular) in zip(placements, self._weights, strict=True):
            parts += [linear * placement.translation, (angular * placement.rotation).ravel()]
        return np.concatenate(parts)

    def solve(self, targets: Sequence[pin.SE3], q: Array | None, tolerance: float, starts: int) -> IKResult:
        """Solve from one start after the other."""
        local = self._local
        for task, target in zip(local.tasks, targets, strict=True):
            task.target = target
        goal = 0.5 * min(tolerance, tolerance / self._mechanism.length)  # of each of up to three residuals
        rng: np.random.Generator | None = None  # anew in each call: results do not depend on earlier calls
        nearest = self._nearest(targets)
        iterations = 0
        best: tuple[float, Array] = (np.inf, self._mechanism.q_home)
        for count in range(starts):
            if count == 0 and q is not None:
                start = q
            else:
                known = next(nearest, None) if count < _NEAREST or count % 2 == 0 else None
                if known is not None:
                    start = known
                else:
                    rng = rng or np.random.default_rng(self._seed)
                    start = local.random_start(rng)
            success = local.solve(start, goal)
            iterations += local.iterations
            if success:
                return self._result(True, local.best, local.closure, count + 1, iterations, ())
            if local.closure <= CLOSURE and local.cost < best[0]:
                best = local.cost, local.best
        return self._approached(best[1], starts, iterations)

    def _nearest(self, targets: Sequence[pin.SE3]) -> Iterator[Array]:
        """Yield the samples (nq,), those whose nodes are nearest to the targets first."""
        distances = ((self._features - self._feature(targets)) ** 2).sum(axis=1)
        yield from self._samples[np.argsort(distances, kind="stable")]

    def _approached(self, q: Array, starts: int, iterations: int) -> IKResult:
        """Return the configuration as near to the targets as ticks from q come."""
        solver = Solver(self._mechanism, 1.0, q)
        solver.copy_tasks(self._local.tasks)
        solver.lift_limits(position=not self._limits)
        for _ in range(_APPROACH):
            step = solver.step()
            if step.status is Status.OUT_OF_REACH or not np.abs(step.v).max(initial=0.0) > 1e-7:
                break
        return self._result(False, step.q, step.closure, starts, iterations, step.saturated)

    def _result(
        self, success: bool, q: Array, closure: float, starts: int, iterations: int, saturated: tuple[str, ...]
    ) -> IKResult:
        tasks = tuple(task.copy() for task in self._local.tasks)  # the solver's change with the next call
        return IKResult(success, q, closure, starts, iterations, saturated, self._mechanism, tasks)


def placement_weights(task: FrameTask, length: float) -> tuple[float, Array]:
    """Return the weights of a task's position (1/m) and of its three axes in the distance between placements."""
    angular = np.full(3, 0.5 * (task.rotation / 3.0))
    if task.rotation == 2:
        angular = np.where(task.weights[3:] > 0.0, 0.0, 0.5)
    return task.translation / 3.0 / length, angular


class _Kept(threading.local):
    """Global solvers and mechanisms with locked joints that this thread used last. Each is kept with its mechanism, so
    that the id in its key stays."""

    def __init__(self) -> None:
        self.solvers = Recent[_GlobalIK](_KEPT)
        self.held = Recent[tuple[Mechanism, Mechanism]](_KEPT)


_kept = _Kept()


def _held(mechanism: Mechanism, joints: tuple[str, ...], q: Array | None) -> Mechanism:
    """Return the mechanism with joints locked where q has them."""
    if not joints or q is None:
        return mechanism
    parts = [mechanism.model.joints[mechanism.model.getJointId(name)] for name in joints]
    values = np.concatenate([q[joint.idx_q : joint.idx_q + joint.nq] for joint in parts])
    key = (id(mechanism), joints, values.tobytes())
    return _kept.held.get(key, lambda: (mechanism, mechanism.with_held(joints, q)))[1]


def _global_ik(mechanism: Mechanism, tasks: tuple[FrameTask, ...], limits: bool, seed: int) -> _GlobalIK:
    frames = [
        (task.node, task.axes, task.weight, *task.weights.tolist(), *task.offset.homogeneous.ravel().tolist())
        for task in tasks
    ]
    key = (id(mechanism), limits, seed, *frames)
    return _kept.solvers.get(key, lambda: _GlobalIK(mechanism, tasks, limits, seed))
