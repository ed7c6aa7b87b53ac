"""Shapes as triangles; and one mesh for all shapes of a link that have the same opacity, which a page draws at once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from meshcat.geometry import Mesh, MeshLambertMaterial, TriangularMeshGeometry

from cinegen.arrays import Array, Integers
from cinegen.collision.triangle_mesh import TriangleMesh

_SIDES = 16  # of a circle
_CREASE = 0.6  # rad: an edge between faces that differ by more is sharp
_HEAD, _RECORD = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])  # of binary STL

Surface = tuple[Array, Integers]
"""Corners (n, 3) and triangles (m, 3). Triangles that share a corner are drawn as one smooth surface."""


def surface_of(solid: pin.GeometryObject) -> Surface:
    """Return a shape as a surface, in its own frame (m)."""
    geometry = solid.geometry
    if isinstance(geometry, coal.Box):
        return _scaled("box", geometry.halfSide)
    if isinstance(geometry, coal.Sphere):
        return _scaled("sphere", np.full(3, geometry.radius))
    if isinstance(geometry, coal.Cylinder):
        return _scaled("cylinder", np.array([geometry.radius, geometry.radius, geometry.halfLength]))
    if isinstance(geometry, coal.Capsule):
        return _capsule(geometry)
    if isinstance(geometry, coal.Convex):
        faces = map(geometry.polygons, range(geometry.num_polygons))
        return sharp(np.array(geometry.points())[[[face[0], face[1], face[2]] for face in faces]])
    records = _records(solid.meshPath)
    return sharp(TriangleMesh(geometry).corners if records is None else records * np.array(solid.meshScale))


def sharp(triangles: Array) -> Surface:
    """Return triangles (m, 3, 3) as a surface that is smooth nowhere."""
    return triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)


def merged(solids: Iterable[tuple[pin.GeometryObject, pin.SE3]]) -> list[Mesh]:
    """Return shapes and their placements (m) as meshes, one for each opacity."""
    parts = defaultdict[float, list[tuple[Array, Integers, Array]]](list)
    for solid, placement in solids:
        corners, faces = surface_of(solid)
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


def _scaled(kind: str, scale: Array) -> Surface:
    corners, faces = _unit(kind)
    return corners * scale, faces


@cache
def _unit(kind: str) -> Surface:
    """Return a box, a sphere or a cylinder between -1 and 1."""
    from trimesh import creation, graph  # takes its time

    if kind == "box":
        made = creation.box((2.0, 2.0, 2.0))
    elif kind == "sphere":
        made = creation.uv_sphere(1.0, count=[_SIDES // 2, _SIDES])
    else:
        made = creation.cylinder(1.0, 2.0, sections=_SIDES)
    smooth = graph.smooth_shade(made, angle=_CREASE)
    return np.asarray(smooth.vertices), np.asarray(smooth.faces)


def _capsule(capsule: coal.Capsule) -> Surface:
    from trimesh import creation

    made = creation.capsule(2.0 * float(capsule.halfLength), float(capsule.radius), count=[32, 16])
    points = np.asarray(made.vertices) - made.bounds.mean(axis=0)  # some versions of trimesh begin at the origin
    return points, np.asarray(made.faces)


def _records(name: str) -> Array | None:
    """Return the triangles (m, 3, 3) of a binary STL, in its unit of length; None of any other file."""
    path = Path(name)
    data = path.read_bytes() if path.suffix.lower() == ".stl" else b""
    if len(data) < _HEAD or len(data) != _HEAD + _RECORD.itemsize * int.from_bytes(data[_HEAD - 4 : _HEAD], "little"):
        return None
    return np.frombuffer(data, _RECORD, offset=_HEAD)["corners"].astype(float)
