"""`DrawnObstacle`: an obstacle as sessions and recordings have it, as shapes that can move."""

from __future__ import annotations

from typing import Literal

import pinocchio as pin
from msgspec import Struct

from cinegen.collision.body import PlacedShape
from cinegen.collision.shapes import NAMED, kind_of


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
        """Return a shape as numbers."""
        kind = kind_of(placed.shape)
        return cls(kind.name, tuple(kind.numbers(placed.shape).tolist()), placed.placement)  # type: ignore[arg-type]

    def placed(self) -> PlacedShape:
        """Return the shape with its pose in the frame of the obstacle."""
        return PlacedShape(self.placement, NAMED[self.shape].made(self.numbers))


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
