"""What is around a scene's robot."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.bodies import bodies_of, pairs_of
from cinegen.collision.body import Body
from cinegen.collision.clearance import Clearance
from cinegen.collision.scene import Scene
from cinegen.model import Mechanism

_KEPT = 8  # mechanisms whose links are


def surroundings(scene: Scene) -> tuple[Clearance, NDArray[np.int64]]:
    """The clearance of a scene's robot, and for each of its pairs what is gone round: the obstacle's place in the
    scene, or a number behind these for two links of the robot."""
    own = scene.bodies
    bodies, links = links_of(scene.mechanism) if own is None else (own, ())
    checked = scene.without_allowed(bodies, links)
    obstacles = [body for obstacle in scene.obstacles for body in obstacle.bodies]
    owner = [i for i, obstacle in enumerate(scene.obstacles) for _ in obstacle.bodies]
    clearance = Clearance(scene.mechanism, bodies, obstacles, checked)
    around, links_met = [], dict[tuple[int, int], int]()
    for first, second in clearance.pairs.tolist():
        if second >= len(bodies):
            around.append(owner[second - len(bodies)])
        else:
            joints = (bodies[first].joint, bodies[second].joint)
            around.append(links_met.setdefault(joints, len(scene.obstacles) + len(links_met)))
    return clearance, np.array(around, dtype=np.int64)


@lru_cache(maxsize=_KEPT)
def links_of(mechanism: Mechanism) -> tuple[tuple[Body, ...], tuple[tuple[int, int], ...]]:
    """A mechanism's bodies, and the pairs of them that may collide; kept, they take a while."""
    bodies = bodies_of(mechanism)
    return bodies, pairs_of(mechanism, bodies)
