"""`Looks`: how a scene's obstacles are drawn."""

from __future__ import annotations

from collections.abc import Iterator

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision import Obstacle, Scene
from cinegen.collision.body import PlacedShape
from cinegen.collision.convex_hull import hull
from cinegen.collision.obstacle_kinds import HEIGHT
from cinegen.model.motion_plane import motion_plane

Array = NDArray[np.float64]

_FLAT = 0.25  # characteristic lengths
_THIN = 0.02  # of a half-space's width
_AROUND = 1.3  # times as wide as what there is in the scene
_POINT = 0.015  # of the scene's radius: the ball that a point is drawn as


class Looks:
    """Of one scene.

    What is drawn in the plane is taken for very tall in space; where the robot moves in that plane it is drawn flat. A
    half-space, which has no end, is drawn as a slab as wide as the scene, behind its plane.

    Args:
        scene: what is where.

    Attributes:
        flat: m, how high what was drawn in the plane is shown; None where the robot moves in space.
    """

    def __init__(self, scene: Scene) -> None:
        mechanism = scene.mechanism
        normal = motion_plane(mechanism)
        upright = normal is not None and abs(normal[2]) > 1.0 - 1e-9
        self.flat: float | None = _FLAT * mechanism.length if upright else None
        points = [mechanism.placement(scene.start, node).translation for node in mechanism.nodes]
        points += [scene.goal.translation]
        for obstacle in scene.obstacles:
            for body in obstacle.bodies:
                if np.isfinite(body.radius):
                    points += [body.centre + sign * np.array([body.radius, body.radius, 0.0]) for sign in (-1.0, 1.0)]
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        self._middle: Array = (low + high) / 2.0
        self._radius = float(np.linalg.norm(high - low)) / 2.0

    def solids(self, obstacle: Obstacle) -> Iterator[PlacedShape]:
        """What is drawn of an obstacle, in its own frame."""
        for piece in obstacle.pieces:
            if isinstance(piece.shape, coal.Halfspace):
                yield self._slab(piece.shape, obstacle.placement * piece.placement, piece.placement)
            else:
                yield PlacedShape(piece.placement, piece.shape if self.flat is None else _flat(piece.shape, self.flat))

    def mobile(self, radius: float) -> PlacedShape:
        """What is drawn of a mobile robot: a disc, or for a point a small ball."""
        if radius == 0.0:
            return PlacedShape(pin.SE3.Identity(), coal.Sphere(_POINT * self._radius))
        return PlacedShape(pin.SE3.Identity(), coal.Cylinder(radius, self.flat or radius))

    def _slab(self, half_space: coal.Halfspace, world: pin.SE3, placement: pin.SE3) -> PlacedShape:
        """Of a half-space that stands there in the world, and so in its obstacle."""
        normal = np.array(half_space.n)
        middle = world.actInv(self._middle)
        wide = 2.0 * _AROUND * self._radius
        thick = _THIN * wide
        centre = middle - normal * (float(normal @ middle) - half_space.d + thick / 2.0)
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).toRotationMatrix()
        sides = [wide, wide, thick]
        if self.flat is not None and abs(normal[2]) < 0.5:  # a wall, seen from above
            turn = np.column_stack([np.cross(normal, [0.0, 0.0, 1.0]), [0.0, 0.0, 1.0], normal])
            turn[:, 0] = np.cross(turn[:, 1], turn[:, 2])
            sides = [wide, self.flat, thick]
        return PlacedShape(placement * pin.SE3(turn, centre), coal.Box(np.array(sides)))


def _flat(shape: coal.ShapeBase, height: float) -> coal.ShapeBase:
    """A shape that is as tall as what is drawn in the plane, flat; another as it is."""
    match shape:
        case coal.Cylinder() if 2.0 * shape.halfLength == HEIGHT:
            return coal.Cylinder(shape.radius, height)
        case coal.Box() if 2.0 * shape.halfSide[2] == HEIGHT:
            return coal.Box(np.array([*(2.0 * shape.halfSide[:2]), height]))
        case coal.Convex():
            corners = np.array(shape.points())
            if np.ptp(corners[:, 2]) == HEIGHT:
                return hull(corners * np.array([1.0, 1.0, height / HEIGHT])).shape
    return shape
