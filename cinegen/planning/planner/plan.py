"""`plan`: a way to a goal around obstacles, by vortices or another field."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.around import surroundings
from cinegen.collision.clearance import Clearance
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.scene import Scene
from cinegen.ik.objectives import Objective
from cinegen.planning.keep import least_along
from cinegen.planning.planar import plane_of
from cinegen.planning.planner.attempt import Attempt, attempt, checked
from cinegen.planning.planner.attraction import Attraction, PostureAttraction, TaskAttraction
from cinegen.planning.planner.descent import Descent, Potential
from cinegen.planning.planner.ends import Refusal, free_goals
from cinegen.planning.planner.field import Field
from cinegen.planning.planner.lead import Lead
from cinegen.planning.planner.literal import Literal
from cinegen.planning.planner.postures import TOLERANCE, Postures
from cinegen.planning.planner.status import PlanStatus
from cinegen.planning.vortices import Turning, Vortices

Array = NDArray[np.float64]

STEPS = 3000
"""Of an attempt, at most."""

_REACH = 0.5  # characteristic lengths: from where on vortices act, unless the scene says it
_POSTURES = 6  # that are tried


@dataclass(frozen=True, eq=False)
class Plan:
    """A way to the goal, or why there is none.

    Attributes:
        scene: that it is for.
        status: in one word.
        path: (steps + 1, nq) from the start to the goal, or as far as the last attempt came; (1, nq) where none made
            sense. Loops are closed at each; between two of them joints go straight.
        attempts: all that were made, in order; the last one is what `path` is of.
        reason: the status, in words.
        mesh_check: that the path passed: REACHED is only said where the meshes themselves touch nowhere on it.
        field: that was followed; None: `rrt_connect` follows none.
    """

    scene: Scene
    status: PlanStatus
    path: Array
    attempts: tuple[Attempt, ...]
    reason: str
    _clearance: Clearance
    mesh_check: MeshCheck
    field: Field | None = Field.VORTEX

    def __bool__(self) -> bool:
        return self.status is PlanStatus.REACHED

    def __str__(self) -> str:
        return f"{self.status.value}: {self.reason}" if self.reason else self.status.value

    @cached_property
    def clearance(self) -> float:
        """m: nothing comes nearer to anything than that, anywhere on the path, by conservative advancement."""
        return least_along(self._clearance, self.path, asked=self.scene.safety)

    @cached_property
    def clearances(self) -> Array:
        """(steps + 1,) m: the shortest distance at each configuration of the path."""
        return np.array([self._clearance.least(q) for q in self.path])

    @cached_property
    def trace(self) -> Array:
        """(steps + 1, 3) where the node goes, in the world, m."""
        mechanism, node = self.scene.mechanism, self.scene.node
        return np.array([mechanism.placement(q, node).translation for q in self.path])

    @property
    def length(self) -> float:
        """Of the way that the node goes, m."""
        return float(np.linalg.norm(np.diff(self.trace, axis=0), axis=1).sum())

    @property
    def motion(self) -> float:
        """Of the joints: the lengths of all steps together, rad and characteristic lengths."""
        steps = (self.scene.mechanism.scaled_difference(a, b) for a, b in pairwise(self.path))
        return float(sum(np.linalg.norm(step) for step in steps))


def plan(
    scene: Scene,
    *,
    field: Field | str = Field.VORTEX,
    steps: int = STEPS,
    attempts: int = 40,
    say: Callable[[str], None] | None = None,
) -> Plan:
    """Looks for a way to a scene's goal, by vortex fields (C. De Medio and G. Oriolo, 1991).

    Goal and start are tested first. Then the node is led straight to the goal, vortices turning toward the base or the
    shorter way (of a mobile robot, only that); if that ends somewhere else, all joints are led straight to postures in
    which the goal is reached: the one nearest to the start, then those that differ most; then all of that again by the
    other ways round. All that was tried is in the plan.

    Other fields are there to be compared, under the same barrier: potentials and the paper's letter make one attempt.

    Args:
        scene: what is where.
        field: one of `Field`, or its value.
        steps: of one attempt, at most.
        attempts: at most.
        say: told in words what is being tried.

    Raises:
        AvoidError: there is no such field.
    """
    field = Field(field)
    clearance, around = surroundings(scene)
    check = MeshCheck(scene)
    say = say or _nobody

    def without(status: PlanStatus, reason: str) -> Plan:
        return Plan(scene, status, scene.start[None].copy(), (), reason, clearance, check, field)

    goals = free_goals(scene, clearance, check, say)
    if isinstance(goals, Refusal):
        return without(goals.status, goals.reason)
    made: list[Attempt] = []
    task = TaskAttraction(scene.mechanism, scene.node, scene.goal, scene.translation, scene.rotation)
    for words, lead, left in _leads(scene, field, clearance, around, task, goals):
        if len(made) == attempts:
            break
        say(f"attempt {len(made) + 1}: {words}")
        made.append(
            attempt(
                clearance, scene.start, lead, left, lambda q: task.left(q) < TOLERANCE, scene.safety, steps, words,
                isinstance(lead, Descent),
            )
        )  # fmt: skip
        if made[-1].status is PlanStatus.REACHED:
            say(f"attempt {len(made)}: checking its path against the meshes")
            made[-1] = checked(made[-1], check)
        if made[-1].status is PlanStatus.REACHED:
            break
    if made[-1].status is not PlanStatus.REACHED:
        made[-1] = checked(made[-1], check)
    last = made[-1]
    reason = f"{last.reason} (the last of {len(made)} attempts)" if len(made) > 1 else last.reason
    reason = "" if last.status is PlanStatus.REACHED else reason
    return Plan(scene, last.status, last.path, tuple(made), reason, clearance, check, field)


def _leads(
    scene: Scene,
    field: Field,
    clearance: Clearance,
    around: NDArray[np.int64],
    task: TaskAttraction,
    goals: Postures,
) -> Iterator[tuple[str, Objective, Callable[[Array], float]]]:
    """What is followed, in order: in words, as an objective, and how far it then is to the goal."""
    reach = scene.influence or _REACH * scene.mechanism.length
    if field is Field.VORTEX:
        for attraction, turning in _ways(scene, task, goals, plane_of(scene.mechanism)):
            lead = Lead(attraction, Vortices(clearance, around, reach, scene.safety, turning, up=scene.up))
            yield f"{attraction.words}, {turning.value}", lead, attraction.left
        return
    if field is Field.NONE:
        for attraction in _attractions(scene, task, goals):
            still = Vortices(clearance, around, reach, scene.safety, strength=0.0)
            yield f"{attraction.words}, nothing turns", Lead(attraction, still), attraction.left
        return
    bodies = clearance.bodies[: len(clearance.bodies) - sum(len(obstacle.bodies) for obstacle in scene.obstacles)]
    words = f"{task.words}, {field.value}"
    if field is Field.LITERAL:
        yield words, Literal(scene, bodies, reach), task.left
    else:
        potential = Potential(scene, bodies, field, reach)
        yield words, Descent(scene.mechanism, potential.value, potential.gradient), task.left


def _ways(
    scene: Scene, task: TaskAttraction, goals: Postures, plane: Array | None
) -> Iterator[tuple[Attraction, Turning]]:
    """What is tried, in order."""
    first = (Turning.SHORTER,) if scene.mobile is not None else (Turning.FOLDING, Turning.SHORTER)
    others = (Turning.LONGER,) if plane is not None else (Turning.LONGER, Turning.UP, Turning.DOWN, Turning.ASIDE)
    for attraction, turning in product(_attractions(scene, task, goals), first):
        yield attraction, turning
    for attraction, turning in product(_attractions(scene, task, goals), others):
        yield attraction, turning


def _attractions(scene: Scene, task: TaskAttraction, goals: Postures) -> Iterator[Attraction]:
    """What leads, in order."""
    yield task
    if scene.mobile is None:
        for i, posture in enumerate(goals.free[:_POSTURES]):
            yield PostureAttraction(scene.mechanism, posture, f"the joints to posture {i + 1} of the goal")


def _nobody(_: str) -> None:
    """Nobody is told."""
