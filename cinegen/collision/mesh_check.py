"""`MeshCheck`: contact between the shapes of a mechanism as its description gives them, along a path.

Planners keep distances between links by `Clearance`, which measures convex bodies first. This check is independent of
these: it takes only the meshes themselves, by coal's bounding volume hierarchies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body, Pairs, geometry_model
from cinegen.collision.scene import Scene
from cinegen.collision.self_collision import PairReason, link_pairs
from cinegen.errors import ClosureError
from cinegen.joints import kinematic_data
from cinegen.model import Mechanism

Array = NDArray[np.float64]

STEP = 1e-2
"""Of the characteristic length: by how much a shape moves at most from one checked configuration to the next."""


@dataclass(frozen=True, slots=True)
class Contact:
    """The first contact on a path.

    Attributes:
        index: of the last configuration of the path before it; -1 where the first one is in contact.
        reason: which shapes touch, or why the path cannot be checked there.
    """

    index: int
    reason: str


class MeshCheck:
    """Checks a scene's robot for contact with itself and with the obstacles.

    Pairs of links are left out where they are adjacent by structure, where their meshes touch in every sampled
    configuration (`pair_reasons`), and where the scene allows their collision.

    Args:
        scene: with the robot; a mobile robot is checked as the disc that it is.

    Attributes:
        step: m: by how much a shape moves at most between two checked configurations.
        unchecked: pairs of links, by name, whose meshes touch in every sampled configuration.
    """

    def __init__(self, scene: Scene) -> None:
        mechanism = self._mechanism = scene.mechanism
        if scene.bodies is None:
            self._bodies, pairs, always = meshes_of(mechanism)
        else:
            self._bodies, pairs, always = scene.bodies, (), ()
        obstacles = [body.as_described for obstacle in scene.obstacles for body in obstacle.bodies]
        links, own = scene.with_attached(self._bodies, scene.checked_pairs(self._bodies, pairs))
        self._bodies = tuple(body.as_described for body in links)
        self._names = [body.name for body in (*self._bodies, *obstacles)]
        self.unchecked = tuple(dict.fromkeys((self._names[i], self._names[k]) for i, k in always))
        self.step = STEP * mechanism.length
        self._model, self._data = mechanism.model, kinematic_data(mechanism.model)
        self._geometry = geometry_model(mechanism, self._bodies, obstacles, own)
        self._shapes = self._geometry.createData()
        self._centres = np.array([body.centre for body in self._bodies]).reshape(-1, 3)
        self._radii = np.array([body.radius for body in self._bodies])

    def contact(self, q: Array) -> str:
        """Return which two shapes touch at q (nq,), as text; empty if none do."""
        if not pin.computeCollisions(self._model, self._data, self._geometry, self._shapes, q, True):
            return ""
        pairs = zip(self._geometry.collisionPairs, self._shapes.collisionResults, strict=True)
        pair = next(pair for pair, result in pairs if result.isCollision())
        return f"'{self._names[pair.first]}' touches '{self._names[pair.second]}'"

    def first_contact(self, path: Array) -> Contact | None:
        """Return the first contact on a path (n, nq); None if there is none.

        Joints move on straight lines between the configurations of the path, and loops are closed. Configurations are
        checked so densely that no shape moves by more than `step` from one to the next.
        """
        if touching := self.contact(path[0]):
            return Contact(-1, touching)
        for index, (begin, end) in enumerate(pairwise(path)):
            try:
                between = self._between(begin, end)
            except ClosureError:
                return Contact(index, f"loops cannot be closed between steps {index} and {index + 1}")
            for q in (*between, end):
                if touching := self.contact(q):
                    return Contact(index, touching)
        return None

    def _between(self, begin: Array, end: Array) -> list[Array]:
        """Return the configurations to be checked between two others."""
        count = math.ceil(self._motion(begin, end) / self.step)
        parts = [part / count for part in range(1, count)]
        between = [self._mechanism.interpolate(begin, end, part) for part in parts]
        return [self._mechanism.close(q) for q in between] if self._mechanism.is_constrained else between

    def _motion(self, begin: Array, end: Array) -> float:
        """Return by how far a point of a shape moves at most, m, to second order of the motion."""
        if not self._bodies:
            return 0.0
        poses = [self._poses(q) for q in (begin, end)]
        moves = (first.actInv(second) for first, second in zip(*poses, strict=True))
        found = [
            np.linalg.norm(move.act(centre) - centre) + radius * np.linalg.norm(pin.log3(move.rotation))
            for move, centre, radius in zip(moves, self._centres, self._radii, strict=True)
        ]
        return float(max(found))

    def _poses(self, q: Array) -> list[pin.SE3]:
        """Return the poses of the joints that carry the shapes."""
        pin.forwardKinematics(self._model, self._data, q)
        return [self._data.oMi[body.joint].copy() for body in self._bodies]


def meshes_of(mechanism: Mechanism) -> tuple[tuple[Body, ...], Pairs, Pairs]:
    """Return the shapes that a mechanism collides with, the pairs to check, and those that always touch."""
    links = mechanism.derived(link_pairs)
    bodies = tuple(body.as_described for body in links.bodies)
    return bodies, links.of(PairReason.CHECKED), links.of(PairReason.ALWAYS)
