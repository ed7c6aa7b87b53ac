"""`MeshCheck`: contact between the shapes of a mechanism as its description gives them, along a path.

Planners keep distances between links by `Clearance`, which measures convex bodies first. This check is independent of
these: it takes the meshes themselves, by coal's bounding volume hierarchies, and finds the pairs to check by itself
(`mesh_pairs`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, Integers
from cinegen.collision.body import geometry_model
from cinegen.collision.mesh_pairs import mesh_pairs
from cinegen.collision.scene import Scene
from cinegen.errors import ClosureError
from cinegen.joints import kinematic_data, translations

STEP = 1e-3
"""Of the characteristic length: by how much two shapes move relative to each other at most from one checked
configuration to the next, where they are so near to each other that nothing is proved."""

_CURVED = 1.5  # factor of the estimated motion of closed loops, whose joints do not move on straight lines


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

    Pairs of links are left out as described in `mesh_pairs`, and where the scene allows their collision.

    Args:
        scene: with the robot; a mobile robot is checked as the disc that it is.

    Attributes:
        step: m: by how much two shapes move relative to each other at most between two checked configurations.
        unchecked: pairs of links, by name, that are not adjacent, but left out by the SRDF, or because their meshes
            touch in the sampled configurations.
    """

    def __init__(self, scene: Scene) -> None:
        mechanism = self._mechanism = scene.mechanism
        if scene.bodies is None:
            meshes = mechanism.structure.derived(mesh_pairs)
            bodies, pairs, self.unchecked = meshes.bodies, meshes.pairs, tuple(meshes.unchecked)
        else:
            bodies, pairs, self.unchecked = scene.bodies, (), ()
        obstacles = [body.as_described for obstacle in scene.obstacles for body in obstacle.bodies]
        links, checked = scene.with_attached(bodies, scene.checked_pairs(bodies, pairs))
        self._links = tuple(body.as_described for body in links)
        self._bodies = (*self._links, *obstacles)
        self._names = [body.name for body in self._bodies]
        self.step = STEP * mechanism.length
        linear = all(coupling.is_linear for coupling in mechanism.couplings)
        self._is_straight = not mechanism.loops and linear  # linear couplings hold on straight lines
        self._model, self._data = mechanism.model, kinematic_data(mechanism.model)
        self._geometry = geometry_model(mechanism, self._links, obstacles, checked)
        self._shapes = self._geometry.createData()
        index_pairs = [(pair.first, pair.second) for pair in self._geometry.collisionPairs]
        self._pairs = np.array(index_pairs, dtype=np.int64).reshape(-1, 2)
        self._measure = [coal.ComputeCollision(*(self._bodies[i].shape for i in pair)) for pair in index_pairs]
        self._joints = np.array([body.joint for body in self._bodies], dtype=np.int64)
        self._centres = np.array([body.centre for body in self._bodies]).reshape(-1, 3)
        self._radii = np.array([body.radius for body in self._bodies])
        self._supports = np.zeros((mechanism.model.njoints, mechanism.model.njoints), dtype=bool)
        for joint in range(1, mechanism.model.njoints):
            self._supports[joint, list(mechanism.model.supports[joint])[1:]] = True

    def contact(self, q: Array) -> str:
        """Return which two shapes touch at q (nq,), as text; empty if none do."""
        if not pin.computeCollisions(self._model, self._data, self._geometry, self._shapes, q, True):
            return ""
        pairs = zip(self._geometry.collisionPairs, self._shapes.collisionResults, strict=True)
        pair = next(pair for pair, result in pairs if result.isCollision())
        return f"'{self._names[pair.first]}' touches '{self._names[pair.second]}'"

    def first_contact(self, path: Array) -> Contact | None:
        """Return the first contact on a path (n, nq); None if there is none.

        Joints move on straight lines between the configurations of the path, and loops are closed. A pair of shapes is
        proved clear on an interval of such a motion if it is further apart in the middle than it can move relative to
        that; the interval is halved for the other pairs, until they move by no more than `step` there. Of closed loops
        the motion is not bounded but estimated, from both ends.
        """
        if touching := self.contact(path[0]):
            return Contact(-1, touching)
        for index, (begin, end) in enumerate(pairwise(path)):
            try:
                touching = self._contact_between(begin, end) or self.contact(end)
            except ClosureError:
                touching = f"loops cannot be closed between steps {index} and {index + 1}"
            if touching:
                return Contact(index, touching)
        return None

    def _contact_between(self, begin: Array, end: Array) -> str:
        """Return the first contact on a motion, as text; empty if there is none."""
        motion = self._motion(begin, end) if self._is_straight else self._estimated_motion(begin, end)
        left = [(0.0, 1.0, np.flatnonzero(motion > 0.0))]
        while left:
            low, high, pairs = left.pop()
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            q = self._mechanism.interpolate(begin, end, middle)
            q = q if self._is_straight else self._mechanism.close(q)
            near = self._nearer(q, pairs, half * motion)
            for pair in near[[self._touches(int(pair), 0.0) for pair in near]] if len(near) else ():
                first, second = self._pairs[pair]
                return f"'{self._names[first]}' touches '{self._names[second]}'"
            near = near[2.0 * half * motion[near] > self.step]
            if len(near):
                left += [(middle, high, near), (low, middle, near)]  # the earlier half first
        return ""

    def _nearer(self, q: Array, pairs: Integers, margins: Array) -> Integers:
        """Return which of some pairs may be nearer at q (nq,) than their margins (pairs,), m; places the shapes."""
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._shapes, q)
        frames = self._data.oMi
        centres = np.array(
            [frames[j].act(x) for j, x in zip(self._joints.tolist(), self._centres, strict=True)]
        ).reshape(-1, 3)
        first, second = self._pairs[pairs].T
        gaps = np.linalg.norm(centres[first] - centres[second], axis=1) - self._radii[first] - self._radii[second]
        pairs = pairs[gaps <= margins[pairs]]
        return pairs[[self._touches(int(pair), float(margins[pair])) for pair in pairs]] if len(pairs) else pairs

    def _touches(self, pair: int, margin: float) -> bool:
        """Return whether a pair is nearer than a margin, m, where the shapes are placed."""
        request = coal.CollisionRequest()
        request.security_margin = margin
        first, second = (self._shapes.oMg[int(i)] for i in self._pairs[pair])
        placed = (coal.Transform3s(place.rotation, place.translation) for place in (first, second))
        return bool(self._measure[pair](*placed, request, coal.CollisionResult()))

    # --- how far shapes move -------------------------------------------------------------------------------------

    def _motion(self, begin: Array, end: Array) -> Array:
        """Return bounds (pairs,) of how far shapes move relative to each other on a motion without loops, m.

        A joint moves no point of a link faster than by its speed times the point's largest distance from the joint: the
        sum of the distances from joint to joint, and from the last one to the point. Joints that move both shapes of a
        pair do not count.
        """
        model, velocity = self._model, np.abs(pin.difference(self._model, begin, end))
        between = np.zeros(model.njoints)  # of a joint from its parent, at most
        for q in (begin, end):
            pin.forwardKinematics(model, self._data, q)
            between = np.maximum(between, [np.linalg.norm(place.translation) for place in self._data.liMi])
        turning, sliding = np.zeros(model.njoints), np.zeros(model.njoints)
        for j, joint in enumerate(model.joints):
            if j and velocity[joint.idx_v : joint.idx_v + joint.nv].any():
                speeds, count = velocity[joint.idx_v : joint.idx_v + joint.nv], translations(joint)
                sliding[j], turning[j] = speeds[:count].sum(), speeds[count:].sum()
                if joint.nv > 1:  # a free joint need not go straight
                    between[j] += sliding[j]
        moves = np.zeros((len(self._bodies), model.njoints))
        far = np.linalg.norm(self._centres, axis=1) + self._radii
        for body in range(len(self._links)):
            reach, j = far[body], int(self._joints[body])
            while j:
                moves[body, j] = sliding[j] + turning[j] * reach
                reach, j = reach + between[j], int(model.parents[j])
        first, second = self._pairs.T
        apart = self._supports[self._joints[first]] != self._supports[self._joints[second]]
        return np.asarray(((moves[first] + moves[second]) * apart).sum(axis=1))

    def _estimated_motion(self, begin: Array, end: Array) -> Array:
        """Return estimates (pairs,) of how far shapes move relative to each other, m, by their poses at both ends."""
        first, second = self._pairs.T
        is_bounded = np.isfinite(self._radii[second])  # a half-space is the one that stays
        moving, seen_from = np.where(is_bounded, second, first), np.where(is_bounded, first, second)
        (turned, at), (turned_end, at_end) = (self._relative(self._poses(q), moving, seen_from) for q in (begin, end))
        rotations, centres = turned_end @ turned.transpose(0, 2, 1), self._centres[moving, :, None]
        moved = (turned_end - turned) @ centres + at_end - at
        # of a rotation R by an angle a, the Frobenius norm of R - 1 is 2 sqrt(2) sin(a / 2)
        sines = np.linalg.norm(rotations - np.eye(3), axis=(1, 2)) / math.sqrt(8.0)
        angles = 2.0 * np.arcsin(np.minimum(sines, 1.0))
        return np.asarray(_CURVED * (np.linalg.norm(moved, axis=(1, 2)) + self._radii[moving] * angles))

    @staticmethod
    def _relative(poses: list[pin.SE3], moving: Integers, seen_from: Integers) -> tuple[Array, Array]:
        """Return rotations (n, 3, 3) and positions (n, 3, 1) of bodies relative to others."""
        rotations, points = np.array([pose.rotation for pose in poses]), np.array([pose.translation for pose in poses])
        back = rotations[seen_from].transpose(0, 2, 1)
        return back @ rotations[moving], back @ (points[moving] - points[seen_from])[:, :, None]

    def _poses(self, q: Array) -> list[pin.SE3]:
        """Return the poses of the joints that carry the shapes."""
        pin.forwardKinematics(self._model, self._data, q)
        return [self._data.oMi[joint].copy() for joint in self._joints.tolist()]
