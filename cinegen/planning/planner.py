"""`plan`: a path to a goal around obstacles, by vortices, and by sampling where these do not reach it."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from importlib.util import find_spec
from typing import Any, NoReturn

import numpy as np

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance, clearance_of
from cinegen.collision.direct_scene import Goal, scene_for
from cinegen.collision.errors import PlanningError, SceneError
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.obstacle import Obstacle
from cinegen.collision.scene import Scene
from cinegen.html import table
from cinegen.ik.barrier import Range
from cinegen.ik.given_task import Task, is_task
from cinegen.ik.joint_settings import checked_names
from cinegen.model import Mechanism
from cinegen.planning.attempt import Attempt, PlanStatus
from cinegen.planning.clearance_barrier import path_clearance
from cinegen.planning.goal_configurations import Refusal, free_goals
from cinegen.planning.locked_joints import with_joints_locked
from cinegen.planning.path_constraints import Kept, projection
from cinegen.planning.sampling.path_sampler import RRT_CONNECT, PathSampler
from cinegen.planning.sampling.shortcuts import path_length
from cinegen.planning.search import DIRECT, NONE, VORTEX, FieldFunction, Search
from raff2urdf.command.extras import install
from raff2urdf.errors import counted

STEPS = 3000
"""Largest number of steps of an attempt."""

_SHARE = 0.2  # of the time, for vortices and sampling in turn


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
    field: str | None = VORTEX

    def __bool__(self) -> bool:
        return self.status is PlanStatus.REACHED

    def __str__(self) -> str:
        return f"{self.status.value}: {self.reason}" if self.reason else self.status.value

    def __repr__(self) -> str:
        attempts, steps = len(self.attempts), len(self.path) - 1
        return f"<Plan {self.status.name}: {steps} steps, {counted(attempts, 'attempt')}>"

    def _repr_html_(self) -> str:
        return table(
            f"Plan of scene {self.scene.name}",
            ("property", "value"),
            [
                ("status", self),
                ("steps", len(self.path) - 1),
                ("path", f"{self.length:.4g} m, of {self.scene.node}"),
                ("clearance", f"{self.clearance:.4g} m"),
                ("attempts", "; ".join(f"{each.status.value}: {each.strategy}" for each in self.attempts) or "none"),
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
        raise PlanningError(f"unknown planner {value!r}; use one of {', '.join(planner.value for planner in cls)}")


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
    field: str | FieldFunction = VORTEX,
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
    for comparison, with the same safety distance and without sampling.

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
        field: `vortex`; `none`: only the safety distance is kept; or a function that makes the objective of another
            field, for one attempt.
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
    scene = _locking(_scene_of(scene, goal, start, tuple(obstacles), node), locked)
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise PlanningError(f"seconds must be above 0, not {seconds}")
    if seed < 0:
        raise PlanningError(f"seed must be 0 or above, not {seed}")
    deadline, planner = time.monotonic() + seconds, Planner(planner)
    if isinstance(field, str) and field not in (VORTEX, NONE):
        raise PlanningError(f"unknown field '{field}'; use {VORTEX}, {NONE}, or a function that makes an objective")
    name = field if isinstance(field, str) else getattr(field, "__name__", "custom")
    missing = ""
    if planner is Planner.AUTO and field != VORTEX:
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
    if isinstance(goals, Refusal):
        used = None if planner is Planner.RRT_CONNECT else name
        return Plan(scene, goals.status, scene.start[None].copy(), (), goals.reason, clearance, check, used)
    is_auto = planner is Planner.AUTO
    sampler = None if planner is Planner.VORTEX else PathSampler(task, clearance, goals, seed, is_auto, kept)
    search = Search(
        task, clearance, check, goals, seconds, deadline, seed, shorten, report, projection(task, kept), sampler
    )
    parts = [search.straight()] if is_auto else []
    if planner is not Planner.RRT_CONNECT and not needs_sampling:
        ends = time.monotonic() + _SHARE * seconds if is_auto else deadline
        parts.append(search.along(field, steps, attempts, ends))
    if sampler is not None:
        parts.append(search.sampled())
    made = search.first_reached(itertools.chain(*parts))
    last = made[-1]
    reason = f"{last.reason} (the last of {len(made)} attempts)" if len(made) > 1 else last.reason
    reason = "" if last.status is PlanStatus.REACHED else reason + missing
    used = None if last.strategy in (DIRECT, sampler and sampler.method) else name
    return Plan(scene, last.status, last.path, tuple(made), reason, clearance, check, used)


def _checked_tasks(tasks: Iterable[Task | Range]) -> Kept:
    """Return the tasks that are to be kept along a path."""
    kept = tuple(tasks)
    for task in kept:
        if not isinstance(task, Range) and not is_task(task):
            needed = "objects with error(state) and jacobian(state), or ranges of these"
            raise PlanningError(f"tasks along a path are {needed}, not {task!r:.80}")
    return kept


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
    robot: Scene | Mechanism,
    goal: Goal | None,
    start: Array | Sequence[float] | Mapping[str, float] | None,
    obstacles: tuple[Mapping[str, Any] | Obstacle, ...],
    node: str | None,
) -> Scene:
    """Return the scene of `plan`.

    Raises:
        SceneError: see `plan`.
    """
    if isinstance(robot, Scene):
        if goal is not None or start is not None or obstacles or node is not None:
            raise SceneError("a scene has a goal, a start, obstacles and a node: give them only with a mechanism")
        return robot
    if goal is None:
        raise SceneError(f"goal is missing: write plan(mechanism, goal), such as a point of '{robot.end}'")
    return scene_for(robot, goal, start=start, obstacles=obstacles, **({} if node is None else {"node": node}))
