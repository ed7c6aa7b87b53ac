"""Meshes as MuJoCo reads them: OBJ, and STL in its binary form. Others are converted to that."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

import yourdfpy

from raff2urdf.errors import RaffWarning
from raff2urdf.formats import Described

_MOST_FACES = 200_000  # of an STL file
_LEAST_VERTICES = 4


def with_readable_meshes(described: Described, converted: dict[str, bytes]) -> yourdfpy.Robot:
    """The tree, with meshes that MuJoCo reads. Contents of those made for it are added to `converted`, by name.

    One warning tells of those that it can't have at all.
    """
    readable: dict[str, str | None] = {}
    lost: list[str] = []

    def name_of(mesh: str) -> str | None:
        if mesh not in readable:
            readable[mesh] = _readable(described, mesh, converted)
            if readable[mesh] is None:
                lost.append(mesh)
        return readable[mesh]

    def shown(shape: Any) -> Any:
        mesh = None if shape.geometry is None else shape.geometry.mesh
        if mesh is None:
            return shape
        name = name_of(mesh.filename)
        if name is None:
            return None
        return replace(shape, geometry=replace(shape.geometry, mesh=replace(mesh, filename=name)))

    links = [
        replace(
            link,
            visuals=[shape for shape in map(shown, link.visuals) if shape is not None],
            collisions=[shape for shape in map(shown, link.collisions) if shape is not None],
        )
        for link in described.model.links
    ]
    if lost:
        reason = f"MuJoCo takes from {_LEAST_VERTICES} vertices on up to {_MOST_FACES} faces"
        message = f"robot '{described.model.name}': meshes left out, for {reason}: {', '.join(lost)}"
        warnings.warn(message, RaffWarning, stacklevel=2)
    return replace(described.model, links=links)


def _readable(described: Described, mesh: str, converted: dict[str, bytes]) -> str | None:
    """The name of a mesh that MuJoCo reads instead of this one; None if there can be none."""
    suffix = PurePosixPath(mesh).suffix.lower()
    if suffix == ".obj":
        return mesh
    if suffix == ".stl":
        content = described.content(mesh)
        faces = int.from_bytes(content[80:84], "little")
        if len(content) == 84 + 50 * faces and _LEAST_VERTICES <= faces <= _MOST_FACES:
            return mesh
    surface = described.surface(mesh)
    if len(surface.vertices) < _LEAST_VERTICES or len(surface.faces) > _MOST_FACES:
        return None
    name = f"meshes/{described.stem}/{PurePosixPath(mesh).name}.stl"
    while name in converted:
        name = f"{name.removesuffix('.stl')}-.stl"
    stl: bytes = surface.export(file_type="stl")
    converted[name] = stl
    return name
