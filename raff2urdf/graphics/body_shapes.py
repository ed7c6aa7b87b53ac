"""Shapes of which bodies are drawn: rods, tubes, cups, discs and plates."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.graphics.skeleton import BASE
from raff2urdf.graphics.solids import hull, recipe
from raff2urdf.placement import inverse
from raff2urdf.raff.document import LoopKind, RaffLink, RaffPart

Colour = tuple[float, float, float]

SHARED = (0.87, 0.87, 0.85)
"""Of a body that closes loops of several branches, such as a platform."""

_END = 0.62  # of that, where it ends
TUBE = recipe("lathe", 18, 0.0, 0.0, 1.0, 0.0, _END, 1.0, 0.0, 1.0)
_OUTER, _INNER = 1.5, 1.2  # radii of a cup, in units
_ARCS = [(_OUTER, t) for t in (-0.5, -0.34, -0.16, 0.03)] + [(_INNER, t) for t in (0.03, -0.23, -0.5)]
CUP = recipe("lathe", 18, *(x for r, t in _ARCS for x in (r * math.cos(math.pi * t), r * math.sin(math.pi * t))))


class Shape(NamedTuple):
    """A shape in the frame of the node that has it.

    Attributes:
        kind: box, cylinder, sphere or mesh.
        sizes: as `raff2urdf.writers.urdf_object.geometry` takes them, m.
        placement: (4, 4).
        colour: red, green, blue.
        recipe: of a mesh, see `raff2urdf.graphics.solids`.
    """

    kind: str
    sizes: tuple[float, ...]
    placement: Array
    colour: Colour
    recipe: str = ""


@dataclass(eq=False)
class DrawnBody:
    """Nodes that are rigidly connected.

    Attributes:
        nodes: placement (4, 4) of each on the body, by number; first the node in whose frame it is described.
        points: where its joints are (3,), its own first, each with the child to which a path leads.
        shapes: in its frame.
    """

    nodes: dict[int, Array]
    points: list[tuple[Array, RaffPart | None]] = field(default_factory=list)
    shapes: list[Shape] = field(default_factory=list)
    colour: Colour = BASE


Solid = tuple[str, tuple[float, ...], Array, str]


class Joint(NamedTuple):
    """A joint of one variable between two bodies, with its frame (z is the axis) on each of them."""

    first: DrawnBody
    on_first: Array
    second: DrawnBody
    on_second: Array
    kind: LoopKind
    link: RaffLink | None  # None: a loop's


def principal(points: Array) -> tuple[Array, Array]:
    """Return the placement (4, 4) of points: in the middle, z in their flattest direction, x to the farthest of them;
    and their extents along these axes. Both are the same on every machine."""
    middle = points.mean(axis=0)
    z = np.linalg.svd(points - middle)[2][2]
    z *= math.copysign(1.0, z[np.abs(np.round(z, 9)).argmax()])
    flat = points - middle - np.outer((points - middle) @ z, z)
    lengths = np.linalg.norm(flat, axis=1)
    x = flat[(lengths > lengths.max() * (1.0 - 1e-6)).argmax()]
    placement = np.eye(4)
    if lengths.max() > 0.0:
        x = x / np.linalg.norm(x)
        placement[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    placement[:3, 3] = middle
    return placement, np.abs((points - middle) @ placement[:3, :3]).max(axis=0)


def is_inside(point: Array, corners: Array) -> bool:
    """Return whether a point (2,) is in the convex hull of others (n, 2)."""
    return len(corners) not in hull([*corners, point])


def composed(chain: list[Joint]) -> Array:
    """Return the frame of the last joint on the first body where all variables are 0."""
    placement = chain[0].on_first
    for before, after in pairwise(chain):
        placement = placement @ inverse(before.on_second) @ after.on_first
    return placement


def shifted(place: Array, z: float) -> Array:
    """Return a placement (4, 4) moved along its z axis."""
    placement = place.copy()
    placement[:3, 3] += z * place[:3, 2]
    return placement


def cylinder(place: Array, radius: float, low: float, high: float) -> Solid:
    """Return a cylinder about z from one height to another."""
    return "cylinder", (radius, abs(high - low)), shifted(place, 0.5 * (low + high)), ""


def box(place: Array, sides: tuple[float, float], low: float, high: float) -> Solid:
    """Return a box from one height to another."""
    return "box", (*sides, abs(high - low)), shifted(place, 0.5 * (low + high)), ""


def sphere(centre: Array, radius: float) -> Solid:
    """Return a sphere."""
    placement = np.eye(4)
    placement[:3, 3] = centre
    return "sphere", (radius,), placement, ""
