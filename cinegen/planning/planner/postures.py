"""Postures in which a goal is reached."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.clearance import Clearance
from cinegen.collision.scene import Scene
from cinegen.ik.seeker import Seeker
from cinegen.ik.task import FrameTask
from cinegen.tolerances import CLOSURE

Array = NDArray[np.float64]

TOLERANCE = 1e-4
"""Of a goal: lengths and rad that may be left."""

_STARTS = 200  # configurations from which postures are looked for
_ENOUGH = 24  # postures
_SPREAD = 200
_APART = 0.1  # rad or lengths: nearer than that, two postures are one


class Postures(NamedTuple):
    """Attributes:
    free: (nq,) each, clear of everything by the safety distance; that nearest to the start first, then always that
        which is least like those before it.
    blocked: others that reach the goal, with what is in the way: the pair of bodies that is nearest, and its distance.
    """

    free: tuple[Array, ...]
    blocked: tuple[tuple[Array, int, float], ...]


def postures(scene: Scene, clearance: Clearance, seed: int = 0) -> Postures:
    """Closed configurations within all limits in which the node is at the goal.

    From the start first, then from configurations spread over all that can be reached: where none is found, there is
    none that these lead to.
    """
    mechanism, rng = scene.mechanism, np.random.default_rng(seed)
    task = FrameTask(scene.node, scene.goal, scene.translation, scene.rotation, axes="world")
    seeker = Seeker(mechanism, (task,))
    seeker.tasks[0].target = scene.goal
    starts = [scene.start]
    if mechanism.loops:
        starts += list(Seeker(mechanism).spread(_SPREAD, rng))
    free: list[Array] = []
    blocked: list[tuple[Array, int, float]] = []
    for count in range(_STARTS):
        start = starts[count] if count < len(starts) else seeker.anywhere(rng)
        if not seeker.seek(start, 1e-10) or seeker.open_by > CLOSURE:
            continue
        q = seeker.best
        if any(mechanism.distance(q, other) < _APART for other in free):
            continue
        distances = clearance.distances(q)
        nearest = int(distances.argmin()) if len(distances) else -1
        if nearest >= 0 and distances[nearest] < scene.safety:
            if len(blocked) < _ENOUGH:
                blocked.append((q, nearest, float(distances[nearest])))
            continue
        free.append(q)
        if len(free) == _ENOUGH:
            break
    return Postures(tuple(_varied(scene, free)), tuple(blocked))


def _varied(scene: Scene, found: list[Array]) -> list[Array]:
    """Sorted: what is nearest to the start, then what is furthest from all before."""
    left = sorted(found, key=lambda q: scene.mechanism.distance(scene.start, q))
    chosen = left[:1]
    left = left[1:]
    while left:
        at = int(np.argmax([min(scene.mechanism.distance(q, other) for other in chosen) for q in left]))
        chosen.append(left.pop(at))
    return chosen
