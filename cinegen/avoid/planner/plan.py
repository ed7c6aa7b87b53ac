"""`plan`: a way to a goal around obstacles, by vortices."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.avoid.bodies import bodies_of, pairs_of
from cinegen.avoid.clearance import Clearance
from cinegen.avoid.keep import least_along
from cinegen.avoid.planar import plane_of
from cinegen.avoid.planner.attempt import Attempt, attempt
from cinegen.avoid.planner.attraction import Attraction, PostureAttraction, TaskAttraction
from cinegen.avoid.planner.lead import Lead
from cinegen.avoid.planner.postures import TOLERANCE, Postures, postures
from cinegen.avoid.planner.verdict import Verdict
from cinegen.avoid.scene import Scene
from cinegen.avoid.vortices import Turning, Vortices

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
        verdict: in one word.
        path: (steps + 1, nq) from the start to the goal, or as far as the last attempt came; (1, nq) where none made
            sense. Between two of them joints go straight, loops closed.
        attempts: all that were made, in order; the last one is what `path` is of.
        reason: the verdict, in words.
    """

    scene: Scene
    verdict: Verdict
    path: Array
    attempts: tuple[Attempt, ...]
    reason: str
    _clearance: Clearance

    def __bool__(self) -> bool:
        return self.verdict is Verdict.REACHED

    def __str__(self) -> str:
        return f"{self.verdict.value}: {self.reason}" if self.reason else self.verdict.value

    @cached_property
    def clearance(self) -> float:
        """m: nothing comes nearer to anything than that, anywhere on the path, by conservative advancement."""
        return least_along(self._clearance, self.path)

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
        model, scale = self.scene.mechanism.model, self.scene.mechanism.scale
        steps = (pin.difference(model, a, b) / scale for a, b in itertools.pairwise(self.path))
        return float(sum(np.linalg.norm(step) for step in steps))


def surroundings(scene: Scene) -> tuple[Clearance, NDArray[np.int64]]:
    """The clearance of a scene's robot, and for each of its pairs what is gone round: the obstacle's place in the
    scene, or a number behind these for two links of the robot."""
    own = scene.bodies
    bodies = bodies_of(scene.mechanism) if own is None else own
    obstacles = [body for obstacle in scene.obstacles for body in obstacle.bodies]
    owner = [i for i, obstacle in enumerate(scene.obstacles) for _ in obstacle.bodies]
    links = () if own is not None else pairs_of(scene.mechanism, bodies)
    clearance = Clearance(scene.mechanism, bodies, obstacles, links)
    around, links_met = [], dict[tuple[int, int], int]()
    for first, second in clearance.pairs.tolist():
        if second >= len(bodies):
            around.append(owner[second - len(bodies)])
        else:
            joints = (bodies[first].joint, bodies[second].joint)
            around.append(links_met.setdefault(joints, len(scene.obstacles) + len(links_met)))
    return clearance, np.array(around, dtype=np.int64)


def plan(scene: Scene, *, steps: int = STEPS, attempts: int = 40, say: Callable[[str], None] | None = None) -> Plan:
    """Looks for a way to a scene's goal, by vortex fields (C. De Medio and G. Oriolo, 1991).

    Goal and start are tested first. Then the node is led straight to the goal, vortices turning toward the base (of a
    mobile robot, the shorter way); if that ends somewhere else, other ways round are tried, and then the joints are
    led straight to postures in which the goal is reached, nearest first. All that was tried is in the plan.

    Args:
        scene: what is where.
        steps: of one attempt, at most.
        attempts: at most.
        say: told in words what is being tried.
    """
    clearance, around = surroundings(scene)
    say = say or _nobody

    def without(verdict: Verdict, reason: str) -> Plan:
        return Plan(scene, verdict, scene.start[None].copy(), (), reason, clearance)

    distances = clearance.distances(scene.start)
    if len(distances) and distances.min() < scene.safety:
        pair = int(distances.argmin())
        return without(Verdict.START_IN_COLLISION, _too_near(clearance, scene, pair, float(distances[pair])))
    say("looking for postures at the goal")
    goals = postures(scene, clearance)
    if not goals.free:
        if goals.blocked:
            _, pair, distance = max(goals.blocked, key=lambda one: one[2])
            return without(Verdict.GOAL_IN_COLLISION, _too_near(clearance, scene, pair, distance))
        return without(Verdict.OUT_OF_REACH, f"no posture was found in which '{scene.node}' is at the goal")
    made: list[Attempt] = []
    reach = scene.influence or _REACH * scene.mechanism.length
    plane = plane_of(scene.mechanism)
    task = TaskAttraction(scene.mechanism, scene.node, scene.goal, scene.translation, scene.rotation)
    for attraction, turning in _ways(scene, task, goals, plane):
        if len(made) == attempts:
            break
        words = f"{attraction.words}, {turning.value}"
        say(f"attempt {len(made) + 1}: {words}")
        lead = Lead(attraction, Vortices(clearance, around, reach, scene.safety, turning))
        made.append(
            attempt(
                clearance, scene.start, lead, attraction.left, lambda q: task.left(q) < TOLERANCE, scene.safety, steps,
                words,
            )
        )  # fmt: skip
        if made[-1].verdict is Verdict.REACHED:
            break
    last = made[-1]
    reason = "" if last.verdict is Verdict.REACHED else f"{last.reason} (the last of {len(made)} attempts)"
    return Plan(scene, last.verdict, last.path, tuple(made), reason, clearance)


def _ways(
    scene: Scene, task: TaskAttraction, goals: Postures, plane: Array | None
) -> Iterator[tuple[Attraction, Turning]]:
    """What is tried, in order."""
    first = (Turning.SHORTER,) if scene.mobile is not None else (Turning.FOLDING, Turning.SHORTER)
    others = (Turning.LONGER,) if plane is not None else (Turning.LONGER, Turning.UP, Turning.DOWN, Turning.ASIDE)
    led: list[Attraction] = [task]
    if scene.mobile is None:
        for i, posture in enumerate(goals.free[:_POSTURES]):
            led.append(PostureAttraction(scene.mechanism, posture, f"the joints to posture {i + 1} of the goal"))
    for attraction in led:
        for turning in first:
            yield attraction, turning
    for attraction in led:
        for turning in others:
            yield attraction, turning


def _too_near(clearance: Clearance, scene: Scene, pair: int, distance: float) -> str:
    one, other = clearance.names(pair)
    if distance <= 0.0:
        return f"'{one}' is in '{other}'"
    kept = f"the safety distance of {1e3 * scene.safety:.3g} mm"
    return f"'{one}' is {1e3 * distance:.3g} mm from '{other}', nearer than {kept}"


def _nobody(_: str) -> None:
    """Nobody is told."""
