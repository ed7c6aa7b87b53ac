"""Start and goal, tested before a way is looked for: every planner begins with the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from cinegen.collision.clearance import Clearance
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.scene import Scene
from cinegen.planning.planner.postures import Postures, postures
from cinegen.planning.planner.status import PlanStatus


class Refusal(NamedTuple):
    """Why no way needs to be looked for: START_IN_COLLISION, GOAL_IN_COLLISION or OUT_OF_REACH, and that in words."""

    status: PlanStatus
    reason: str


def free_goals(scene: Scene, clearance: Clearance, check: MeshCheck, say: Callable[[str], None]) -> Postures | Refusal:
    """Postures at the goal of which at least one is free, if the start is free too.

    Args:
        scene: what is where.
        clearance: of its robot.
        check: of its meshes.
        say: told in words what is being done.
    """
    distances = clearance.distances(scene.start)
    if len(distances) and distances.min() < scene.safety:
        pair = int(distances.argmin())
        return Refusal(PlanStatus.START_IN_COLLISION, _too_near(clearance, scene, pair, float(distances[pair])))
    if touching := check.contact(scene.start):
        return Refusal(PlanStatus.START_IN_COLLISION, touching)
    say("looking for postures at the goal")
    found = postures(scene, clearance)
    contacts = [check.contact(q) for q in found.free]
    free = tuple(q for q, touching in zip(found.free, contacts, strict=True) if not touching)
    if free:
        return found._replace(free=free)
    if contacts:
        return Refusal(PlanStatus.GOAL_IN_COLLISION, contacts[0])
    if found.blocked:
        _, pair, distance = max(found.blocked, key=lambda one: one[2])
        return Refusal(PlanStatus.GOAL_IN_COLLISION, _too_near(clearance, scene, pair, distance))
    return Refusal(PlanStatus.OUT_OF_REACH, f"no posture was found in which '{scene.node}' is at the goal")


def _too_near(clearance: Clearance, scene: Scene, pair: int, distance: float) -> str:
    one, other = clearance.names(pair)
    if distance <= 0.0:
        reason = f"'{one}' is {-1e3 * distance:.3g} mm deep in '{other}'"
    else:
        kept = f"the safety distance of {1e3 * scene.safety:.3g} mm"
        reason = f"'{one}' is {1e3 * distance:.3g} mm from '{other}', nearer than {kept}"
    links = len(clearance.bodies) - sum(len(obstacle.bodies) for obstacle in scene.obstacles)
    if clearance.pairs[pair].max() >= links:
        return reason
    return f'{reason}, as convex solids; if these links may touch, add allowed_collisions = [["{one}", "{other}"]]'
