"""Configurations in which a goal is reached, and the tests of start and goal with which every planner begins."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.clearance import Clearance
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.scene import Scene
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism
from cinegen.planning.attempt import PlanStatus
from cinegen.tolerances import CLOSURE
from raff2urdf.quantities import LENGTH, shown

Array = NDArray[np.float64]

TOLERANCE = 1e-4
"""Tolerance of a goal, characteristic lengths and rad."""

_STARTS = 200  # start configurations of the search
_ENOUGH = 24  # configurations
_SAMPLES = 200
_DISTINCT = 0.1  # rad or characteristic lengths: nearer configurations count as one


class Refusal(NamedTuple):
    """Why no path is searched: START_IN_COLLISION, GOAL_IN_COLLISION or OUT_OF_REACH, with an explanation."""

    status: PlanStatus
    reason: str


def free_goals(
    scene: Scene, clearance: Clearance, check: MeshCheck, report: Callable[[str], None]
) -> tuple[Array, ...] | Refusal:
    """Return the configurations at the goal that are free of collisions, at least one; or a refusal, also if the start
    is in collision.

    Args:
        scene: scene.
        clearance: distances of its robot.
        check: check of its meshes.
        report: called with a text about what is done.
    """
    distances = clearance.distances(scene.start)
    if len(distances) and distances.min() < scene.safety:
        pair = int(distances.argmin())
        return Refusal(PlanStatus.START_IN_COLLISION, _too_near(clearance, scene, pair, float(distances[pair])))
    if touching := check.contact(scene.start):
        return Refusal(PlanStatus.START_IN_COLLISION, touching)
    report("searching configurations at the goal")
    found, blocked = _search(scene, clearance)
    contacts = [check.contact(q) for q in found]
    free = tuple(q for q, touching in zip(found, contacts, strict=True) if not touching)
    if free:
        return free
    if contacts:
        return Refusal(PlanStatus.GOAL_IN_COLLISION, contacts[0])
    if blocked:
        distance, pair = max(blocked)
        return Refusal(PlanStatus.GOAL_IN_COLLISION, _too_near(clearance, scene, pair, distance))
    return Refusal(PlanStatus.OUT_OF_REACH, f"no configuration was found in which '{scene.node}' is at the goal")


def _search(scene: Scene, clearance: Clearance) -> tuple[list[Array], list[tuple[float, int]]]:
    """Search closed configurations within all limits in which the node is at the goal.

    The search starts at the scene's start, then at configurations sampled over the whole range of motion: an empty
    result means that none of these leads to the goal.

    Returns:
        configurations (nq,) with all distances above the safety distance, the one nearest to the start first, then
        always the one that differs most from those before; and of others the smallest distance, m, and its pair.
    """
    mechanism, rng = scene.mechanism, np.random.default_rng(0)
    task = FrameTask(scene.node, scene.goal, scene.translation, scene.rotation, axes="world")
    local = LocalIK(mechanism, (task,))
    starts = [scene.start]
    if mechanism.is_constrained:
        starts += list(LocalIK(mechanism).samples(_SAMPLES, rng))
    free, blocked = list[Array](), list[tuple[float, int]]()
    for count in range(_STARTS):
        start = starts[count] if count < len(starts) else local.random_start(rng)
        if not local.solve(start, 1e-10) or local.closure > CLOSURE:
            continue
        q = local.best
        if any(mechanism.distance(q, other) < _DISTINCT for other in free):
            continue
        if clearance.least(q) < scene.safety:
            distances = clearance.distances(q)
            blocked.append((float(distances.min()), int(distances.argmin())))
            continue
        free.append(q)
        if len(free) == _ENOUGH:
            break
    return _varied(mechanism, scene.start, free), blocked[:_ENOUGH]


def _varied(mechanism: Mechanism, start: Array, found: list[Array]) -> list[Array]:
    """Return the configurations, sorted: the one nearest to the start, then always the furthest from all before."""
    left = sorted(found, key=lambda q: mechanism.distance(start, q))
    chosen = left[:1]
    left = left[1:]
    while left:
        at = int(np.argmax([min(mechanism.distance(q, other) for other in chosen) for q in left]))
        chosen.append(left.pop(at))
    return chosen


def _too_near(clearance: Clearance, scene: Scene, pair: int, distance: float) -> str:
    one, other = clearance.names(pair)
    if distance <= 0.0:
        reason = f"'{one}' penetrates '{other}' by {shown(-distance, LENGTH, 3)}"
    else:
        kept = f"the safety distance of {shown(scene.safety, LENGTH, 3)}"
        reason = f"'{one}' is {shown(distance, LENGTH, 3)} from '{other}', below {kept}"
    if clearance.pairs[pair].max() >= len(clearance.links):
        return reason
    return f'{reason}, as convex bodies; if these links may touch, add allowed_collisions = [["{one}", "{other}"]]'
