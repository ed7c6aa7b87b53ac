"""Start and goal, tested before a way is looked for: every planner begins with the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from cinegen.avoid.clearance import Clearance
from cinegen.avoid.planner.postures import Postures, postures
from cinegen.avoid.planner.verdict import Verdict
from cinegen.avoid.scene import Scene


class Refusal(NamedTuple):
    """Why no way needs to be looked for: START_IN_COLLISION, GOAL_IN_COLLISION or OUT_OF_REACH, and that in words."""

    verdict: Verdict
    reason: str


def free_goals(scene: Scene, clearance: Clearance, say: Callable[[str], None]) -> Postures | Refusal:
    """Postures at the goal of which at least one is free, if the start is free too.

    Args:
        scene: what is where.
        clearance: of its robot.
        say: told in words what is being done.
    """
    distances = clearance.distances(scene.start)
    if len(distances) and distances.min() < scene.safety:
        pair = int(distances.argmin())
        return Refusal(Verdict.START_IN_COLLISION, _too_near(clearance, scene, pair, float(distances[pair])))
    say("looking for postures at the goal")
    found = postures(scene, clearance)
    if found.free:
        return found
    if found.blocked:
        _, pair, distance = max(found.blocked, key=lambda one: one[2])
        return Refusal(Verdict.GOAL_IN_COLLISION, _too_near(clearance, scene, pair, distance))
    return Refusal(Verdict.OUT_OF_REACH, f"no posture was found in which '{scene.node}' is at the goal")


def _too_near(clearance: Clearance, scene: Scene, pair: int, distance: float) -> str:
    one, other = clearance.names(pair)
    if distance <= 0.0:
        return f"'{one}' is in '{other}'"
    kept = f"the safety distance of {1e3 * scene.safety:.3g} mm"
    return f"'{one}' is {1e3 * distance:.3g} mm from '{other}', nearer than {kept}"
