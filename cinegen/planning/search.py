"""Attempts of `plan`: straight motions, fields and sampling, each made when it is asked for."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.scene import Scene
from cinegen.errors import ClosureError
from cinegen.ik.objectives import Objective
from cinegen.model import Mechanism
from cinegen.model.motion_plane import motion_plane
from cinegen.planning.attempt import Attempt, PlanStatus, attempt, checked
from cinegen.planning.attraction import Attraction, ConfigurationAttraction, DeflectedAttraction, TaskAttraction
from cinegen.planning.clear_motion import clear_motion
from cinegen.planning.goal_configurations import TOLERANCE, goal_distance, goal_poses
from cinegen.planning.path_constraints import Projection
from cinegen.planning.sampling.path_sampler import PathSampler
from cinegen.planning.sampling.shortcuts import shortened
from cinegen.planning.vortices import STRENGTH, DetourDirection, Vortices
from raff2urdf.quantities import TIME, shown

FieldFunction = Callable[[Scene, Clearance, float], Objective]
"""Makes the objective of a field from a scene, its clearance and the field's reach, m."""

VORTEX, NONE = "vortex", "none"
"""Fields by name: vortices; and none, for comparison: only the safety distance is kept."""

_REACH = 0.5  # characteristic lengths: default reach of fields
_CONFIGURATIONS = 6  # goal configurations that are tried
_COARSE, _FINE = 0.1, 0.03  # rad or characteristic lengths: steps of a path that is checked, and of the result
_NEAR = 1e-3  # rad or characteristic lengths
_RATIO = 3.0  # of the turns of sampling to those of vortices
_LEAST = 0.05  # of the time, for sampling at least
DIRECT = "all joints straight to the goal"


@dataclass(frozen=True)
class Search:
    """Attempts of `plan`, each made when it is asked for.

    Attributes:
        scene: scene, its locked joints without motion.
        clearance: distances of its robot.
        check: check of its meshes.
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
    check: MeshCheck
    goals: tuple[Array, ...]
    seconds: float
    deadline: float
    seed: int
    shorten: bool
    report: Callable[[str], None]
    project: Projection | None
    sampler: PathSampler | None

    def first_reached(self, attempts: Iterable[Attempt]) -> list[Attempt]:
        """Make attempts until one reaches the goal without contact of meshes; return them, the last one checked."""
        made = list[Attempt]()
        for attempt_made in attempts:
            made.append(attempt_made)
            if attempt_made.status is PlanStatus.REACHED:
                self.report(f"{attempt_made.strategy}: checking the path")
                made[-1] = checked(replace(attempt_made, path=self._fine(attempt_made.path, _COARSE)), self.check)
                if made[-1].status is PlanStatus.REACHED:
                    made[-1] = replace(made[-1], path=self._fine(made[-1].path, _FINE))
                    break
        if made[-1].status not in (PlanStatus.REACHED, PlanStatus.IN_COLLISION):
            made[-1] = checked(made[-1], self.check)
        return made

    def straight(self) -> Iterator[Attempt]:
        """Yield straight motions to goals, as far as they are clear."""
        for q in self.goals[:_CONFIGURATIONS]:
            motion = clear_motion(self.clearance, self.scene.start, q, self.scene.safety, project=self.project)
            if motion is not None:
                yield Attempt(DIRECT, PlanStatus.REACHED, motion, (), "")

    def along(self, field: str | FieldFunction, steps: int, attempts: int, ends: float) -> Iterator[Attempt]:
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
            made = attempt(
                self.clearance, self.scene.start, objective, remaining, lambda q: distance(q) < TOLERANCE, safety,
                steps, strategy, getattr(objective, "repels", False), ends, interrupted,
            )  # fmt: skip
            if made.status is PlanStatus.REACHED and self.shorten:
                made = replace(made, path=self._shortened(self._to_goal(made.path)))
            yield made
            if made.status is PlanStatus.INTERRUPTED:
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

    def _fine(self, path: Array, step: float) -> Array:
        """Return a path with configurations inserted; with loops or constraints, `clear_motion` has done so."""
        is_curved = self.scene.mechanism.is_constrained or self.project is not None
        return path if is_curved else refined(self.scene.mechanism, path, step)


def _strategies(
    scene: Scene, field: str | FieldFunction, clearance: Clearance, goals: tuple[Array, ...]
) -> Iterator[tuple[str, Objective, Callable[[Array], float]]]:
    """Yield what is followed, in order: a description, an objective, and the distance from the goal."""
    reach = scene.influence or _REACH * scene.mechanism.length
    task = TaskAttraction(scene.mechanism, scene.node, next(goal_poses(scene)), scene.translation, scene.rotation)
    if isinstance(field, str):
        for attraction, direction in _detours(scene, field, task, goals):
            strength = 0.0 if direction is None else STRENGTH
            vortices = Vortices(
                clearance, reach, scene.safety, direction or DetourDirection.SHORTER, strength, scene.up
            )
            label = f"{attraction.label}, {'no field' if direction is None else direction.value}"
            yield label, DeflectedAttraction(attraction, vortices), attraction.remaining
    else:
        name = getattr(field, "__name__", "custom field")
        yield f"{task.label}, {name}", field(scene, clearance, reach), task.remaining


def _detours(
    scene: Scene, field: str, task: TaskAttraction, goals: tuple[Array, ...]
) -> Iterator[tuple[Attraction, DetourDirection | None]]:
    """Yield attractions with detour directions, in the order in which they are tried."""
    attractions: list[Attraction] = [] if scene.goal_joints else [task]
    if scene.mobile is None:
        attractions += [
            ConfigurationAttraction(scene.mechanism, q, f"all joints to configuration {i} at the goal")
            for i, q in enumerate(goals[:_CONFIGURATIONS], 1)
        ]
    if field == NONE:
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
    parts = [path[:1]]
    for begin, end in pairwise(path):
        count = max(1, int(np.ceil(mechanism.distance(begin, end) / step)))
        between = [mechanism.interpolate(begin, end, i / count) for i in range(1, count)]
        if mechanism.is_constrained:
            try:
                between = [mechanism.close(q) for q in between]
            except ClosureError:
                between = []
        parts.append(np.array([*between, end]))
    return np.vstack(parts)
