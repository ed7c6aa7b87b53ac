"""`plan`: a path to a goal around obstacles, by vortices or another field."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.clearance import Clearance, clearance_of
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.scene import Scene
from cinegen.errors import ClosureError
from cinegen.html import table
from cinegen.ik.objectives import Objective
from cinegen.model import Mechanism
from cinegen.model.motion_plane import motion_plane
from cinegen.planning.attempt import Attempt, PlanStatus, attempt, checked
from cinegen.planning.attraction import Attraction, ConfigurationAttraction, DeflectedAttraction, TaskAttraction
from cinegen.planning.clearance_barrier import path_clearance
from cinegen.planning.descent import AvoidanceField, Descent, Potential
from cinegen.planning.goal_configurations import TOLERANCE, Refusal, free_goals
from cinegen.planning.vortices import STRENGTH, DetourDirection, Vortices

Array = NDArray[np.float64]
FieldFunction = Callable[[Scene, Clearance, float], Objective]
"""Makes the objective of a field from a scene, its clearance and the field's reach, m."""

STEPS = 3000
"""Largest number of steps of an attempt."""

_REACH = 0.5  # characteristic lengths: default reach of fields
_CONFIGURATIONS = 6  # goal configurations that are tried
_FINE = 0.03  # rad or characteristic lengths


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
        field: name of the field that was followed; None: `rrt_connect` follows none.
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
        """Lower bound of all distances anywhere on the path, m, by conservative advancement."""
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
        steps = (self.scene.mechanism.scaled_difference(a, b) for a, b in pairwise(self.path))
        return float(sum(np.linalg.norm(step) for step in steps))


def plan(
    scene: Scene,
    *,
    field: AvoidanceField | str | FieldFunction = AvoidanceField.VORTEX,
    steps: int = STEPS,
    attempts: int = 40,
    report: Callable[[str], None] = lambda text: None,
) -> Plan:
    """Plan a path to a scene's goal by vortex fields (C. De Medio and G. Oriolo, 1991).

    Goal and start are tested first. Then the node moves straight to the goal, deflected by vortices toward the base or
    along the shorter side (for a mobile robot, only that). If that does not reach the goal, all joints move straight to
    configurations at the goal: the one nearest to the start, then those that differ most. Then all of that is repeated
    with the other detour directions. All attempts are in the plan.

    Other fields serve for comparison, with the same safety distance: FIRAS makes one attempt.

    Args:
        scene: scene.
        field: one of `AvoidanceField` or its value; or a function that makes the objective of another field, for one
            attempt.
        steps: largest number of steps of an attempt.
        attempts: largest number of attempts.
        report: called with a text about what is tried.

    Raises:
        PlanningError: unknown field.
    """
    if isinstance(field, str):
        field = AvoidanceField(field)
    name = field.value if isinstance(field, AvoidanceField) else getattr(field, "__name__", "custom")
    clearance, check = clearance_of(scene), MeshCheck(scene)
    goals = free_goals(scene, clearance, check, report)
    if isinstance(goals, Refusal):
        return Plan(scene, goals.status, scene.start[None].copy(), (), goals.reason, clearance, check, name)
    made: list[Attempt] = []
    task = TaskAttraction(scene.mechanism, scene.node, scene.goal, scene.translation, scene.rotation)
    for strategy, objective, remaining in _strategies(scene, field, clearance, task, goals):
        if len(made) == attempts:
            break
        report(f"attempt {len(made) + 1}: {strategy}")
        made.append(
            attempt(
                clearance, scene.start, objective, remaining, lambda q: task.remaining(q) < TOLERANCE, scene.safety,
                steps, strategy, isinstance(objective, Descent),
            )
        )  # fmt: skip
        if made[-1].status is PlanStatus.REACHED:
            report(f"attempt {len(made)}: checking its path against the meshes")
            made[-1] = checked(made[-1], check)
        if made[-1].status is PlanStatus.REACHED:
            break
    if made[-1].status is not PlanStatus.REACHED:
        made[-1] = checked(made[-1], check)
    last = made[-1]
    reason = f"{last.reason} (the last of {len(made)} attempts)" if len(made) > 1 else last.reason
    reason = "" if last.status is PlanStatus.REACHED else reason
    return Plan(scene, last.status, last.path, tuple(made), reason, clearance, check, name)


def _strategies(
    scene: Scene,
    field: AvoidanceField | FieldFunction,
    clearance: Clearance,
    task: TaskAttraction,
    goals: tuple[Array, ...],
) -> Iterator[tuple[str, Objective, Callable[[Array], float]]]:
    """Yield what is followed, in order: a description, an objective, and the distance from the goal."""
    reach = scene.influence or _REACH * scene.mechanism.length
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
    attractions: list[Attraction] = [task]
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
