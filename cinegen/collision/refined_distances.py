"""Distances of the exact shapes of bodies, measured for few pairs at a time: those whose convex bodies are near."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, Integers
from cinegen.collision.body import Body
from cinegen.collision.shapes import kind_of, rounded_hull
from cinegen.jit.foreign import DISTANCE, FIRST_POINT, NORMAL, SECOND_POINT


class ExactDistances:
    """Replaces distances of convex bodies by those of the shapes inside.

    A mesh is a surface: a body inside of a closed one does not touch it. The convex bodies then overlap by at least the
    thickness of the body inside, and the hull of the mesh holds two distant points of it; where that is so, one of the
    points is tested. Of a body with an `Interior`, a point of each part is.

    Args:
        bodies: bodies with exact shapes, or without.
        pairs: (pairs, 2) indices into `bodies`.
    """

    def __init__(self, bodies: Sequence[Body], pairs: Integers) -> None:
        self._pairs: list[tuple[int, int]] = [(first, second) for first, second in pairs.tolist()]
        self._is_enclosed = np.array([any(bodies[i].exact is not None for i in pair) for pair in pairs], dtype=bool)
        used = sorted({i for pair in pairs[self._is_enclosed].tolist() for i in pair})
        exact = {i: bodies[i].as_described for i in used}
        self._joints = {i: body.joint for i, body in exact.items()}
        self._placements = {i: body.placement for i, body in exact.items()}
        self._meshes = {i: body.mesh for i, body in exact.items() if body.mesh is not None}
        self._interiors = {i: body.interior for i, body in exact.items() if body.interior is not None}
        self._contains = {
            i: self._interiors[i].contains if i in self._interiors else mesh.contains
            for i, mesh in self._meshes.items()
        }
        self._points = {i: _distant_points(body.shape) for i, body in exact.items() if i not in self._interiors}
        self._thickness = {
            i: self._interiors[i].thickness if i in self._interiors else body.thickness for i, body in exact.items()
        }
        self._measure = {
            pair: coal.ComputeDistance(exact[first].shape, exact[second].shape)
            for pair, (first, second) in enumerate(self._pairs)
            if self._is_enclosed[pair]
        }
        self._request = coal.DistanceRequest(True)

    def move(self, body: int, placement: pin.SE3) -> None:
        """Move the exact shape of a body of an obstacle, by its index, to another pose in the world."""
        self._placements[body] = placement

    def refine(self, table: Array, within: Array, poses: Sequence[pin.SE3]) -> None:
        """Write the exact results of pairs whose distances in the table are below a bound.

        Where meshes overlap, or hold each other, the distance stays the negative depth by which the convex bodies do.

        Args:
            table: (pairs, RESULT_WIDTH) results of the convex bodies.
            within: (pairs,) the bounds, m. Distances above `UP_TO` times as much are not measured but replaced by that.
            poses: poses of the joints in the world.
        """
        placed: dict[int, pin.SE3] = {}
        for pair in np.flatnonzero(self._is_enclosed & (table[:, DISTANCE] < within)).tolist():
            self.refine_pair(pair, table[pair], UP_TO * float(within[pair]), poses, placed)

    def refine_pair(
        self, pair: int, row: Array, up_to: float, poses: Sequence[pin.SE3], placed: dict[int, pin.SE3]
    ) -> None:
        """Write the exact result of one pair, see `refine`; nothing if both bodies are exact.

        Args:
            pair: index of the pair.
            row: (RESULT_WIDTH,) result of the convex bodies.
            up_to: distance above which it is not measured but replaced by that, m; above that of the row.
            poses: poses of the joints in the world.
            placed: poses of exact shapes in the world that are known already; those of this pair are added.
        """
        if not self._is_enclosed[pair]:
            return
        for body in self._pairs[pair]:
            if body not in placed:
                placed[body] = poses[self._joints[body]] * self._placements[body]
        first, second = (placed[body] for body in self._pairs[pair])
        result = coal.DistanceResult()
        result.min_distance = up_to  # coal skips what is further apart
        self._measure[pair](_transform(first), _transform(second), self._request, result)
        distance = float(result.min_distance)
        is_mesh = not self._meshes.keys().isdisjoint(self._pairs[pair])
        if is_mesh and (distance <= 0.0 or self._is_inside(pair, -row[DISTANCE], placed)):
            row[DISTANCE] = min(row[DISTANCE], 0.0)  # above 0 by rounding only
            return
        if distance >= up_to:
            row[DISTANCE] = up_to
            return
        point, other = result.getNearestPoint1(), result.getNearestPoint2()
        row[DISTANCE] = distance
        if distance > _TOUCHING:
            row[NORMAL : NORMAL + 3] = (other - point) / distance  # coal leaves out that of two meshes
        elif not is_mesh:
            row[NORMAL : NORMAL + 3] = result.normal
        row[FIRST_POINT : FIRST_POINT + 3], row[SECOND_POINT : SECOND_POINT + 3] = point, other

    def _is_inside(self, pair: int, overlap: float, placed: dict[int, pin.SE3]) -> bool:
        """Return whether one body of a pair is inside of the other, whose convex bodies overlap by a depth, m."""
        for inner, outer in (self._pairs[pair], self._pairs[pair][::-1]):
            if outer not in self._meshes or overlap < self._thickness[inner]:
                continue
            moved, holds = placed[outer].actInv(placed[inner]), self._meshes[outer].hull
            parts = self._interiors[inner].parts if inner in self._interiors else self._points[inner]
            points = parts @ moved.rotation.T + moved.translation
            held = points[(points @ holds.normals.T <= holds.offsets).all(axis=1)]
            if inner not in self._interiors:  # connected: one point decides
                held = held[:1] if len(held) == len(points) else held[:0]
            if any(self._contains[outer](point) for point in held):
                return True
        return False


UP_TO = 3.0
"""Largest distance of exact shapes that is measured, as a multiple of the bound below which it is."""

_TOUCHING = 1e-6  # m: nearer points do not determine a normal


def _transform(placement: pin.SE3) -> coal.Transform3s:
    return coal.Transform3s(placement.rotation, placement.translation)


def _distant_points(shape: coal.CollisionGeometry) -> Array:
    """Return two points (2, 3) of a shape in its own frame, m: of meshes and hulls a corner, and the one furthest from
    it; of a shape of revolution the ends of its axis; of other shapes the origin, twice."""
    kind = kind_of(shape)
    points = rounded_hull(shape)[0] if kind.is_polyhedron else kind.axis(shape)
    if points is None:
        return np.zeros((2, 3))
    return points[[0, int(np.linalg.norm(points - points[0], axis=1).argmax())]]
