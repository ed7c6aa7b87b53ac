"""`rrt_connect`: a way to a goal around obstacles, by sampling: for what vortices can't do."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.around import surroundings
from cinegen.collision.errors import AvoidError
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.scene import Scene
from cinegen.errors import ClosureError
from cinegen.planning.planner.attempt import Attempt, checked
from cinegen.planning.planner.edge import edge
from cinegen.planning.planner.ends import Refusal, free_goals
from cinegen.planning.planner.plan import Plan
from cinegen.planning.planner.space import Space
from cinegen.planning.planner.status import PlanStatus

Array = NDArray[np.float64]

_WORDS = "RRT-Connect"
_LONGEST = 0.8  # rad or lengths: to a new configuration


def rrt_connect(
    scene: Scene, *, seconds: float = 10.0, seed: int = 0, say: Callable[[str], None] | None = None
) -> Plan:
    """Looks for a way to a scene's goal by sampling configurations: RRT-Connect of OMPL, on the distances of `plan`.

    It knows no forces, so nothing can hold it fast, and given time it finds a way if there is one that is not too
    narrow; but never that there is none. Each time the way is another, unless the seed is the same, and crooked, though
    shortened.

    - No motion is tested at samples: each on which the trees grow, and each shortcut, is one for which `edge` shows
      that nothing comes nearer than the safety distance anywhere on it. The way in the plan is fine enough for
      `Plan.clearance` to show it again.
    - Mechanisms with loops are sampled on what their loops leave, by OMPL's projection with our closing of loops.
      Motors and passive joints keep to their limits, and the assembly mode is kept from step to step.
    - All free postures at the goal are aimed at, joints without limits to both sides.

    Args:
        scene: what is where.
        seconds: that the search may take, once start and goal are tested; shortening the way comes on top.
        seed: of what is random.
        say: told in words what is being done.

    Returns:
        REACHED, IN_COLLISION where the meshes touch on the path, or TIME_LIMIT; or without looking what `plan` says
        too: START_IN_COLLISION, GOAL_IN_COLLISION, OUT_OF_REACH. Where there is no way, `path` is the start alone.

    Raises:
        AvoidError: OMPL is not installed; or there is no such time, or no such seed.
    """
    try:
        from cinegen.planning.planner.trees import connect
    except ImportError:
        raise AvoidError('RRT-Connect needs the package ompl: pip install "cinegen[sampling]"') from None
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise AvoidError(f"seconds must be above 0, not {seconds}")
    if seed < 0:
        raise AvoidError(f"a seed must not be below 0, as {seed} is")
    clearance, _ = surroundings(scene)
    check = MeshCheck(scene)
    say = say or _nobody

    def made(status: PlanStatus, way: Array, reason: str) -> Plan:
        found = checked(Attempt(_WORDS, status, way, (), reason), check)
        return Plan(scene, found.status, found.path, (found,), found.reason, clearance, check, None)

    nowhere = scene.start[None].copy()
    found = free_goals(scene, clearance, check, say)
    if isinstance(found, Refusal):
        return Plan(scene, found.status, nowhere, (), found.reason, clearance, check, None)
    mechanism = scene.mechanism
    if mechanism.model.nv == 0:
        return made(PlanStatus.REACHED, nowhere, "")
    space = Space(scene, clearance)

    def between(begin: Array, end: Array) -> Array | None:
        return edge(clearance, space.at(begin), space.at(end), scene.safety)

    def close(point: Array) -> Array | None:
        try:
            return space.point(mechanism.close(space.at(point)))
        except ClosureError:
            return None

    say(f"{_WORDS}, {seconds:g} s at most")
    ways = connect(
        space.low, space.high, np.zeros(mechanism.model.nv), [point for q in found.free for point in space.points(q)],
        lambda begin, end: between(begin, end) is not None, _LONGEST, seconds, seed,
        close if mechanism.loops else None, mechanism.loop_rank,
    )  # fmt: skip
    for way in ways:
        pieces = [between(begin, end) for begin, end in itertools.pairwise(way)]
        clear = [piece for piece in pieces if piece is not None]
        if len(clear) == len(pieces):
            return made(PlanStatus.REACHED, np.vstack([nowhere, *(piece[1:] for piece in clear)]), "")
    return made(PlanStatus.TIME_LIMIT, nowhere, f"{_WORDS} found no way in {seconds:g} s")


def _nobody(_: str) -> None:
    """Nobody is told."""
