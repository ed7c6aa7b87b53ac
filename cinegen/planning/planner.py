"""`plan`: a path to a goal around obstacles, by vortices, and by sampling where these do not reach it."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from importlib.util import find_spec
from itertools import pairwise, product
from typing import Any, NoReturn

import numpy as np

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance, clearance_of
from cinegen.collision.direct_scene import Goal, scene_for
from cinegen.collision.errors import PlanningError, SceneError
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.obstacle import Obstacle
from cinegen.collision.scene import Scene
from cinegen.errors import ClosureError
from cinegen.html import table
from cinegen.ik.barrier import Range
from cinegen.ik.given_task import Task, is_task
from cinegen.ik.joints import checked_names
from cinegen.ik.objectives import Objective
from cinegen.model import Mechanism
from cinegen.model.motion_plane import motion_plane
from cinegen.planning.attempt import Attempt, PlanStatus, attempt, checked
from cinegen.planning.attraction import Attraction, ConfigurationAttraction, DeflectedAttraction, TaskAttraction
from cinegen.planning.clear_motion import clear_motion
from cinegen.planning.clearance_barrier import path_clearance
from cinegen.planning.descent import AvoidanceField, Descent, Potential
from cinegen.planning.goal_configurations import TOLERANCE, Refusal, free_goals, goal_distance, goal_poses
from cinegen.planning.locked_joints import with_joints_locked
from cinegen.planning.path_constraints import Kept, Projection, projection
from cinegen.planning.path_sampler import RRT_CONNECT, PathSampler
from cinegen.planning.shortcuts import path_length, shortened
from cinegen.planning.vortices import STRENGTH, DetourDirection, Vortices
from raff2urdf.extras import install
from raff2urdf.quantities import TIME, shown

FieldFunction = Callable[[Scene, Clearance, float], Objective]
"""Makes the objective of a field from a scene, its clearance and the field's reach, m."""

STEPS = 3000
"""Largest number of steps of an attempt."""

_REACH = 0.5  # characteristic lengths: default reach of fields
_CONFIGURATIONS = 6  # goal configurations that are tried
_COARSE, _FINE = 0.1, 0.03  # rad or characteristic lengths: steps of a path that is checked, and of the result
_NEAR = 1e-3  # rad or characteristic lengths
_SHARE = 0.2  # of the time, for vortices and sampling in turn
_RATIO = 3.0  # of the turns of sampling to those of vortices
_LEAST = 0.05  # of the time, for sampling at least
DIRECT = "all joints straight to the goal"


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """Path to a goal, or the reason why there is none.

    Attributes:
        scene: scene of the plan.
        status: status; a plan is true if it is REACHED.
        path: (steps + 1, nq) from the start to the goal, or to where the last attempt ended; (1, nq) without an
            attempt. Loops are closed at each configuration; joints move straight between two of them.
        attempts: all attempts in order; `path` is that of the last one.
        reason: explanation of the status.
        mesh_check: check that the path passed: a plan is only REACHED if the meshes touch nowhere on the path.
        field: name of the field that was followed; None: RRT-Connect follows none.
    """

    scene: Scene
    status: PlanStatus
    path: Array
    attempts: tuple[Attempt, ...]
    reason: str
    _clearance: Clearance
    mesh_check: MeshCheck
    field: str | None = AvoidanceField.VORTEX.value

    def __bool__(self) -> bool:
        return self.status is PlanStatus.REACHED

    def __str__(self) -> str:
        return f"{self.status.value}: {self.reason}" if self.reason else self.status.value

    def __repr__(self) -> str:
        attempts, steps = len(self.attempts), len(self.path) - 1
        return f"<Plan {self.status.name}: {steps} steps, {attempts} attempt{'s' * (attempts != 1)}>"

    def _repr_html_(self) -> str:
        return table(
            f"Plan of scene {self.scene.name}",
            ("property", "value"),
            [
                ("status", self),
                ("steps", len(self.path) - 1),
                ("path", f"{self.length:.4g} m, of {self.scene.node}"),
                ("clearance", f"{self.clearance:.4g} m"),
                ("attempts", "; ".join(f"{one.status.value}: {one.strategy}" for one in self.attempts) or "none"),
            ],
        )

    @cached_property
    def clearance(self) -> float:
        """Lower bound of all distances on the path, joints straight between its configurations, m, by conservative
        advancement. Closed loops lead from these straight motions by second order of the step."""
        return path_clearance(self._clearance, self.path, safety=self.scene.safety)

    @cached_property
    def clearances(self) -> Array:
        """(steps + 1,) shortest distance at each configuration of the path, m."""
        return np.array([self._clearance.least(q) for q in self.path])

    @cached_property
    def trace(self) -> Array:
        """(steps + 1, 3) positions of the node in the world, m."""
        mechanism, node = self.scene.mechanism, self.scene.node
        return np.array([mechanism.placement(q, node).translation for q in self.path])

    @property
    def length(self) -> float:
        """Length of the node's path, m."""
        return float(np.linalg.norm(np.diff(self.trace, axis=0), axis=1).sum())

    @property
    def motion(self) -> float:
        """Length of the path in joint space, rad and characteristic lengths."""
        return path_length(self.scene.mechanism, self.path)

    @property
    def weighted_motion(self) -> float:
        """Length of the path in joint space, each joint's motion multiplied by its weight; `motion` without weights."""
        return path_length(self.scene.mechanism, self.path, self.scene.metric)


class Planner(Enum):
    """Method of `plan`."""

    AUTO = "auto"
    """Straight motions first, then vortices and sampling in turn, by RRT-Connect and LBKPIECE."""
    VORTEX = "vortex"
    """Attempts along a field only."""
    RRT_CONNECT = "rrtconnect"
    """RRT-Connect only."""

    @classmethod
    def _missing_(cls, value: object) -> NoReturn:
        raise PlanningError(f"unknown planner {value!r}; use one of {', '.join(one.value for one in cls)}")


def plan(
    scene: Scene | Mechanism,
    goal: Goal | None = None,
    *,
    start: Array | Sequence[float] | Mapping[str, float] | None = None,
    obstacles: Iterable[Mapping[str, Any] | Obstacle] = (),
    node: str | None = None,
    locked: Iterable[str] = (),
    tasks: Iterable[Task | Range] = (),
    seconds: float = 10.0,
    planner: Planner | str = Planner.AUTO,
    field: AvoidanceField | str | FieldFunction = AvoidanceField.VORTEX,
    steps: int = STEPS,
    attempts: int = 40,
    shorten: bool = True,
    seed: int = 0,
    report: Callable[[str], None] = lambda text: None,
) -> Plan:
    """Plan a path to a goal that keeps clear of obstacles, within a time limit.

    `plan(mechanism, goal)` plans from home, or from `start`; `plan(scene)` the task of a scene, which can have more:
    locked joints, constraints along the path, attached objects ...

    Goal and start are tested first. Then there are up to three kinds of attempts, all of which are in the plan:

    - All joints move straight to configurations at the goal.
    - Vortex fields (C. De Medio and G. Oriolo, 1991): the node moves straight to the goal, deflected by vortices toward
      the base or along the shorter side (for a mobile robot, only that). If that does not reach the goal, all joints
      move straight to configurations at the goal: the one nearest to the start, then those that differ most. Then all
      of that is repeated with the other detour directions.
    - Sampling (`PathSampler`): RRT-Connect and LBKPIECE in turn; with loops or constraints along the path RRT-Connect.
      It takes turns with the vortices for a bounded share of the time: after each of their steps, it searches for three
      times as long. When it finds a path first, their attempt is INTERRUPTED. The rest of the time is its own.

    With constraints along the path or weights of joints, vortices are left out: no field obeys them. Other fields serve
    for comparison, with the same safety distance and without sampling: FIRAS makes one attempt.

    Args:
        scene: a scene; or a mechanism, for which `scene_for` makes one.
        goal: of a mechanism: a pose (`pin.SE3`) or a point (3,) of its end, m, in the world; or a mapping from joint
            names to values, rad and m.
        start: of a mechanism: (nq,) configuration, or values of joints, the others at home.
        obstacles: around a mechanism: each an `Obstacle` or its keys and values.
        node: of a mechanism: the node that is to reach the goal, its end by default.
        locked: names of joints that keep their values of the start, besides those that a scene locks.
        tasks: tasks of any kind, and ranges, that are kept along the path: configurations, at most 0.1 rad or
            characteristic lengths apart, keep them to 1e-6 m or rad; in between joints move straight, which is tested
            in the middle only. Frames are constrained by a scene's `path`.
        seconds: time limit, s; the final check against the meshes may take longer.
        planner: one of `Planner` or its value.
        field: one of `AvoidanceField` or its value; or a function that makes the objective of another field, for one
            attempt.
        steps: largest number of steps of an attempt along a field.
        attempts: largest number of attempts along a field.
        shorten: whether the path is shortened.
        seed: seed of random samples, from 0: the same seed finds the same path, if no share of the time ends before.
        report: called with a text about what is tried.

    Raises:
        PlanningError: unknown planner or field; what is no task; a field is to be followed with constraints along the
            path or with weights of joints; seconds or seed is invalid.
        SceneError: a mechanism has no goal, or a scene has two; or a value is invalid; or a joint of the goal is
            locked.
        UnknownNameError: there is no such joint to be locked.
        MissingExtraError: `planner` is RRT_CONNECT, and OMPL is not installed.
    """
    scene = _scene_of(scene, goal, start, tuple(obstacles), node)
    scene = _locking(scene, locked)
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise PlanningError(f"seconds must be above 0, not {seconds}")
    if seed < 0:
        raise PlanningError(f"seed must be 0 or above, not {seed}")
    deadline, planner = time.monotonic() + seconds, Planner(planner)
    field = AvoidanceField(field) if isinstance(field, str) else field
    name = field.value if isinstance(field, AvoidanceField) else getattr(field, "__name__", "custom")
    missing = ""
    if planner is Planner.AUTO and field is not AvoidanceField.VORTEX:
        planner = Planner.VORTEX
    elif planner is Planner.AUTO and not find_spec("ompl"):
        planner, missing = Planner.VORTEX, f"; no configurations were sampled: {install('sampling')}"
    kept = _checked_tasks(tasks)
    constrained = bool(scene.path_constraints or kept)
    needs_sampling = scene.has_weights * "weights of joints" or constrained * "constraints along a path"
    if needs_sampling and planner is Planner.VORTEX:
        raise PlanningError(f"{needs_sampling} need {RRT_CONNECT}, not a field: {install('sampling')}")
    task = with_joints_locked(scene)
    clearance, check = clearance_of(task), MeshCheck(task)
    goals = free_goals(task, clearance, check, report, kept)
    used = None if planner is Planner.RRT_CONNECT else name
    if isinstance(goals, Refusal):
        return Plan(scene, goals.status, scene.start[None].copy(), (), goals.reason, clearance, check, used)
    is_auto, project = planner is Planner.AUTO, projection(task, kept)
    sampler = None if planner is Planner.VORTEX else PathSampler(task, clearance, goals, seed, is_auto, kept)
    search = _Search(task, clearance, goals, seconds, deadline, seed, shorten, report, project, sampler)
    parts = list[Iterator[Attempt]]()
    if planner is Planner.AUTO:
        parts.append(search.straight())
    if planner is not Planner.RRT_CONNECT and not needs_sampling:
        ends = time.monotonic() + _SHARE * seconds if planner is Planner.AUTO else deadline
        parts.append(search.along(field, steps, attempts, ends))
    if planner is not Planner.VORTEX:
        parts.append(search.sampled())
    made = list[Attempt]()
    for found in itertools.chain(*parts):
        made.append(found)
        if found.status is PlanStatus.REACHED:
            report(f"{found.strategy}: checking the path")
            made[-1] = checked(replace(found, path=search.fine(found.path, _COARSE)), check)
            if made[-1].status is PlanStatus.REACHED:
                made[-1] = replace(made[-1], path=search.fine(made[-1].path, _FINE))
                break
    if made[-1].status not in (PlanStatus.REACHED, PlanStatus.IN_COLLISION):
        made[-1] = checked(made[-1], check)
    last = made[-1]
    reason = f"{last.reason} (the last of {len(made)} attempts)" if len(made) > 1 else last.reason
    reason = "" if last.status is PlanStatus.REACHED else reason + missing
    used = None if last.strategy in (DIRECT, sampler and sampler.method) else name
    return Plan(scene, last.status, last.path, tuple(made), reason, clearance, check, used)


def _checked_tasks(tasks: Iterable[Task | Range]) -> Kept:
    """Return the tasks that are to be kept along a path."""
    found = tuple(tasks)
    for task in found:
        if not isinstance(task, Range) and not is_task(task):
            needed = "objects with error(state) and jacobian(state), or ranges of these"
            raise PlanningError(f"tasks along a path are {needed}, not {task!r:.80}")
    return found


def _locking(scene: Scene, joints: Iterable[str]) -> Scene:
    """Return a scene that locks some more joints."""
    names = checked_names(scene.mechanism, joints)
    for name in names:
        if name in scene.goal_joints:
            raise SceneError(f"'{name}' is a joint of the goal: it can't be locked")
        if name == scene.mechanism.base:
            raise SceneError("a plan can't lock a floating base: load the robot with fixed_base=True, or --fixed-base")
        if name not in scene.mechanism.joints:
            raise SceneError(f"a plan can't lock the ball joint '{name}': lock the joints that move it")
    return replace(scene, locked=tuple(dict.fromkeys((*scene.locked, *names)))) if names else scene


def _scene_of(
    given: Scene | Mechanism,
    goal: Goal | None,
    start: Array | Sequence[float] | Mapping[str, float] | None,
    obstacles: tuple[Mapping[str, Any] | Obstacle, ...],
    node: str | None,
) -> Scene:
    """Return the scene of `plan`.

    Raises:
        SceneError: see `plan`.
    """
    if isinstance(given, Scene):
        if goal is not None or start is not None or obstacles or node is not None:
            raise SceneError("a scene has a goal, a start, obstacles and a node: give them only with a mechanism")
        return given
    if goal is None:
        raise SceneError(f"goal is missing: write plan(mechanism, goal), such as a point of '{given.end}'")
    return scene_for(given, goal, start=start, obstacles=obstacles, **({} if node is None else {"node": node}))


@dataclass(frozen=True)
class _Search:
    """Attempts of `plan`, each made when it is asked for.

    Attributes:
        scene: scene, its locked joints without motion.
        clearance: distances of its robot.
        goals: (nq,) each, free of collisions.
        seconds: time limit, s.
        deadline: value of `time.monotonic` at which it ends, s.
        seed: seed of random samples.
        shorten: whether paths are shortened.
        report: called with a text about what is tried.
        project: projection onto the constraints along the path; None without any.
        sampler: sampling planner; None to do without.
    """

    scene: Scene
    clearance: Clearance
    goals: tuple[Array, ...]
    seconds: float
    deadline: float
    seed: int
    shorten: bool
    report: Callable[[str], None]
    project: Projection | None
    sampler: PathSampler | None

    def straight(self) -> Iterator[Attempt]:
        """Yield straight motions to goals, as far as they are clear."""
        for q in self.goals[:_CONFIGURATIONS]:
            motion = clear_motion(self.clearance, self.scene.start, q, self.scene.safety, project=self.project)
            if motion is not None:
                yield Attempt(DIRECT, PlanStatus.REACHED, motion, (), "")

    def along(self, field: AvoidanceField | FieldFunction, steps: int, attempts: int, ends: float) -> Iterator[Attempt]:
        """Yield attempts along a field, in turn with sampling; no further one after a value of `time.monotonic`, or
        after that has found a path."""
        distance, safety = goal_distance(self.scene), self.scene.safety
        strategies, begin = _strategies(self.scene, field, self.clearance, self.goals), time.monotonic()

        def interrupted() -> bool:
            nonlocal begin
            if self.sampler is None:
                return False
            spent = time.monotonic() - begin
            is_found = self.sampler.search(time.monotonic() + _RATIO * spent)
            begin = time.monotonic()
            return is_found

        for number, (strategy, objective, remaining) in enumerate(itertools.islice(strategies, attempts), 1):
            if number > 1 and time.monotonic() >= ends:
                break
            self.report(
                f"attempt {number}: {strategy}"
                + ("" if self.sampler is None else f", in turn with {self.sampler.method}")
            )
            found = attempt(
                self.clearance, self.scene.start, objective, remaining, lambda q: distance(q) < TOLERANCE, safety,
                steps, strategy, isinstance(objective, Descent), ends, interrupted,
            )  # fmt: skip
            if found.status is PlanStatus.REACHED and self.shorten:
                found = replace(found, path=self._shortened(self._to_goal(found.path)))
            yield found
            if found.status is PlanStatus.INTERRUPTED:
                break

    def sampled(self) -> Iterator[Attempt]:
        """Yield the path of the sampling planner."""
        assert self.sampler is not None
        method = self.sampler.method
        if self.sampler.path is None:
            left = max(self.deadline - time.monotonic(), _LEAST * self.seconds)
            self.report(f"{method}, {shown(left, TIME, 2)} at most")
            self.sampler.search(time.monotonic() + left)
        path, method = self.sampler.path, self.sampler.method
        if path is None:
            reason = f"{method} found no path in {self.seconds:g} s"
            yield Attempt(method, PlanStatus.TIME_LIMIT, self.scene.start[None].copy(), (), reason)
            return
        if self.shorten:
            self.report(f"{method}: shortening the path")
            path = self._shortened(path)
        yield Attempt(method, PlanStatus.REACHED, path, (), "")

    def _to_goal(self, path: Array) -> Array:
        """Return a path that ends in a goal configuration if its end is near to one, instead of within tolerance."""
        mechanism = self.scene.mechanism
        q = min(self.goals, key=lambda q: mechanism.distance(path[-1], q))
        if mechanism.distance(path[-1], q) > _NEAR or np.array_equal(path[-1], q):
            return path
        motion = clear_motion(self.clearance, path[-1], q, self.scene.safety)
        return path if motion is None else np.vstack([path, motion[1:]])

    def _shortened(self, path: Array) -> Array:
        metric = self.scene.metric
        shorter = shortened(self.clearance, path, self.scene.safety, self.seed, self.deadline, self.project, metric)
        return path if shorter is None else shorter

    def fine(self, path: Array, step: float) -> Array:
        """Return a path with configurations inserted; with loops or constraints, `clear_motion` has done so."""
        is_curved = self.scene.mechanism.is_constrained or self.project is not None
        return path if is_curved else refined(self.scene.mechanism, path, step)


def _strategies(
    scene: Scene,
    field: AvoidanceField | FieldFunction,
    clearance: Clearance,
    goals: tuple[Array, ...],
) -> Iterator[tuple[str, Objective, Callable[[Array], float]]]:
    """Yield what is followed, in order: a description, an objective, and the distance from the goal."""
    reach = scene.influence or _REACH * scene.mechanism.length
    task = TaskAttraction(scene.mechanism, scene.node, next(goal_poses(scene)), scene.translation, scene.rotation)
    if field in (AvoidanceField.VORTEX, AvoidanceField.NONE):
        for attraction, direction in _detours(scene, field, task, goals):
            strength = 0.0 if direction is None else STRENGTH
            vortices = Vortices(
                clearance, reach, scene.safety, direction or DetourDirection.SHORTER, strength, scene.up
            )
            label = f"{attraction.label}, {'no field' if direction is None else direction.value}"
            yield label, DeflectedAttraction(attraction, vortices), attraction.remaining
    elif isinstance(field, AvoidanceField):
        potential = Potential(scene, clearance.links, reach)
        descent = Descent(scene.mechanism, potential.value, potential.gradient)
        yield f"{task.label}, {field.value}", descent, task.remaining
    else:
        name = getattr(field, "__name__", "custom field")
        yield f"{task.label}, {name}", field(scene, clearance, reach), task.remaining


def _detours(
    scene: Scene, field: AvoidanceField, task: TaskAttraction, goals: tuple[Array, ...]
) -> Iterator[tuple[Attraction, DetourDirection | None]]:
    """Yield attractions with detour directions, in the order in which they are tried."""
    attractions: list[Attraction] = [] if scene.goal_joints else [task]
    if scene.mobile is None:
        attractions += [
            ConfigurationAttraction(scene.mechanism, q, f"all joints to configuration {i} at the goal")
            for i, q in enumerate(goals[:_CONFIGURATIONS], 1)
        ]
    if field is AvoidanceField.NONE:
        yield from product(attractions, (None,))
        return
    D = DetourDirection
    first = (D.SHORTER,) if scene.mobile is not None else (D.FOLDING, D.SHORTER)
    others = (D.LONGER,) if motion_plane(scene.mechanism) is not None else (D.LONGER, D.UP, D.DOWN, D.ASIDE)
    for directions in (first, others):
        yield from product(attractions, directions)


def refined(mechanism: Mechanism, path: Array, step: float = _FINE) -> Array:
    """Return a path (n, nq) with configurations inserted, so that no joint moves by more than a step (rad or
    characteristic lengths) between two of them; joints straight, loops closed.

    Nothing is inserted between two configurations where loops can't be closed.
    """
    found = [path[:1]]
    for begin, end in pairwise(path):
        count = max(1, int(np.ceil(mechanism.distance(begin, end) / step)))
        between = [mechanism.interpolate(begin, end, i / count) for i in range(1, count)]
        if mechanism.is_constrained:
            try:
                between = [mechanism.close(q) for q in between]
            except ClosureError:
                between = []
        found.append(np.array([*between, end]))
    return np.vstack(found)
