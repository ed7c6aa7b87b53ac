"""Shapes as triangles; and one mesh for all shapes of a link that have the same opacity, which a page draws at once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pinocchio as pin
from meshcat.geometry import Mesh, MeshLambertMaterial, TriangularMeshGeometry

from cinegen.arrays import Array, Integers
from cinegen.collision.shapes import SIDES, kind_of
from cinegen.collision.triangle_mesh import Surface, faceted

_SIDES = 16  # of a circle, where there are many shapes
_HEAD, _RECORD = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])  # of binary STL


def surface_of(solid: pin.GeometryObject, sides: int = SIDES) -> Surface:
    """Return a shape as a surface in its frame, m; where it is round, with so many sides."""
    records = _records(solid.meshPath)
    if records is None:
        return kind_of(solid.geometry).surface(solid.geometry, sides)
    return records[0] * np.array(solid.meshScale), records[1]


def merged(solids: Iterable[tuple[pin.GeometryObject, pin.SE3]]) -> list[Mesh]:
    """Return shapes and their placements (m) as meshes, one for each opacity."""
    parts = defaultdict[float, list[tuple[Array, Integers, Array]]](list)
    for solid, placement in solids:
        corners, faces = surface_of(solid, _SIDES)
        colour = np.clip(np.nan_to_num(solid.meshColor, nan=0.5), 0.0, 1.0)
        placed = corners @ placement.rotation.T + placement.translation
        parts[float(colour[3])].append((placed, faces, np.tile(colour[:3], (len(corners), 1))))
    return [_mesh(surfaces, opacity) for opacity, surfaces in parts.items()]


def _mesh(surfaces: list[tuple[Array, Integers, Array]], opacity: float) -> Mesh:
    first = np.cumsum([0, *(len(corners) for corners, _, _ in surfaces)])
    corners, colours = (np.concatenate([surface[i] for surface in surfaces]) for i in (0, 2))
    faces = np.concatenate([faces + i for (_, faces, _), i in zip(surfaces, first, strict=False)])
    look = MeshLambertMaterial(color=0xFFFFFF, vertexColors=True, opacity=opacity)
    return Mesh(TriangularMeshGeometry(corners, faces, colours), look)


def _records(name: str) -> Surface | None:
    """Return the surface of a binary STL, in its unit of length; None of any other file."""
    path = Path(name)
    data = path.read_bytes() if path.suffix.lower() == ".stl" else b""
    if len(data) < _HEAD or len(data) != _HEAD + _RECORD.itemsize * int.from_bytes(data[_HEAD - 4 : _HEAD], "little"):
        return None
    return _faceted(data)


@lru_cache(16)
def _faceted(data: bytes) -> Surface:
    """Return the surface of a binary STL. (Many parts have the same.)"""
    return faceted(np.frombuffer(data, _RECORD, offset=_HEAD)["corners"].astype(float))
