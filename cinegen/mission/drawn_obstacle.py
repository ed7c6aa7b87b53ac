"""`DrawnObstacle`: an obstacle as sessions and recordings have it, as shapes that can move."""

from __future__ import annotations

from typing import Literal

import coal
import numpy as np
import pinocchio as pin
from msgspec import Struct

from cinegen.collision.body import PlacedShape
from cinegen.collision.convex_hull import hull
from cinegen.collision.triangle_mesh import TriangleMesh, tree_of


class DrawnShape(Struct, frozen=True, forbid_unknown_fields=True):
    """A shape of an obstacle.

    Attributes:
        shape: box, sphere, cylinder, capsule, hull or mesh; cylinders and capsules are along z.
        numbers: m: the sides of a box; the radius, then the length; the corners of a hull, or of the triangles of a
            mesh, one after the other.
        placement: in the frame of the obstacle.
    """

    shape: Literal["box", "sphere", "cylinder", "capsule", "hull", "mesh"]
    numbers: tuple[float, ...]
    placement: pin.SE3

    @classmethod
    def of(cls, placed: PlacedShape) -> DrawnShape:
        """Return a shape as numbers.

        Raises:
            TypeError: the shape has another type.
        """
        match placed.shape:
            case coal.Box():
                return cls("box", tuple((2.0 * placed.shape.halfSide).tolist()), placed.placement)
            case coal.Sphere():
                return cls("sphere", (placed.shape.radius,), placed.placement)
            case coal.Cylinder():
                return cls("cylinder", (placed.shape.radius, 2.0 * placed.shape.halfLength), placed.placement)
            case coal.Capsule():
                return cls("capsule", (placed.shape.radius, 2.0 * placed.shape.halfLength), placed.placement)
            case coal.Convex():
                return cls("hull", tuple(np.ravel(placed.shape.points()).tolist()), placed.placement)
            case coal.BVHModelOBBRSS():
                return cls("mesh", tuple(TriangleMesh(placed.shape).corners.ravel().tolist()), placed.placement)
        raise TypeError(f"a {type(placed.shape).__name__} is not drawn")

    def placed(self) -> PlacedShape:
        """Return the shape with its pose in the frame of the obstacle."""
        if self.shape == "hull":
            return PlacedShape(self.placement, hull(np.reshape(self.numbers, (-1, 3))).shape)
        if self.shape == "mesh":
            corners = np.reshape(self.numbers, (-1, 3))
            return PlacedShape(self.placement, tree_of(corners, np.arange(len(corners)).reshape(-1, 3)))
        kinds = {"sphere": coal.Sphere, "cylinder": coal.Cylinder, "capsule": coal.Capsule}
        shape = coal.Box(np.array(self.numbers)) if self.shape == "box" else kinds[self.shape](*self.numbers)
        return PlacedShape(self.placement, shape)


class DrawnObstacle(Struct, frozen=True, forbid_unknown_fields=True):
    """An obstacle.

    Attributes:
        shapes: its shapes.
        placement: initial pose in the world (m).
        dof: degrees of freedom: 6; 3 in the horizontal plane; 0 if it can't be moved.
    """

    shapes: tuple[DrawnShape, ...]
    placement: pin.SE3
    dof: Literal[0, 3, 6]
