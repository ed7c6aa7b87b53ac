"""Shapes and colours of other formats as a URDF has them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import yourdfpy
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

Shape = tuple[yourdfpy.Geometry, Array]
"""A shape, and its placement (4, 4) in the visual."""


def box(size: ArrayLike) -> Shape:
    """A box of three sizes, m."""
    return yourdfpy.Geometry(box=yourdfpy.Box(size=np.asarray(size, dtype=float))), np.eye(4)


def sphere(radius: float, height: float = 0.0) -> Shape:
    """A sphere, its centre at a height along z, m."""
    placed = np.eye(4)
    placed[2, 3] = height
    return yourdfpy.Geometry(sphere=yourdfpy.Sphere(radius=radius)), placed


def cylinder(radius: float, length: float) -> Shape:
    """A cylinder along z, m."""
    return yourdfpy.Geometry(cylinder=yourdfpy.Cylinder(radius=radius, length=length)), np.eye(4)


def capsule(radius: float, length: float) -> Iterator[Shape]:
    """A capsule along z, m: a URDF has none, so it is a cylinder and two spheres."""
    yield cylinder(radius, length)
    for end in (-0.5, 0.5):
        yield sphere(radius, end * length)


def mesh(filename: str, scale: ArrayLike) -> Shape:
    """A mesh, by its file's name."""
    return yourdfpy.Geometry(mesh=yourdfpy.Mesh(filename=filename, scale=np.asarray(scale, dtype=float))), np.eye(4)


def material(rgba: ArrayLike) -> yourdfpy.Material:
    """A colour, from 0 to 1; named by itself, so that the same name never means two."""
    clipped = np.clip(np.asarray(rgba, dtype=float), 0.0, 1.0)
    name = "".join(f"{round(255 * value):02x}" for value in clipped.tolist())
    return yourdfpy.Material(name=f"c{name}", color=yourdfpy.Color(rgba=clipped))
