"""Read surfaces of other formats by trimesh: scenes of meshes, each placed, with colours."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from raff2urdf.errors import RaffError
from raff2urdf.graphics.names import LARGEST_MESH
from raff2urdf.graphics.surface import Colour, ColouredSurface, solid


def read(path: str | Path) -> list[ColouredSurface]:
    """Return the surfaces of a file, one for each mesh and colour; of a texture, the colour below it.

    Raises:
        RaffError: it is larger than a mesh may be when it is unpacked.
        Exception: of any type, depending on the reader.
    """
    if zipfile.is_zipfile(path):  # a short 3MF may unpack to more than any memory holds
        with zipfile.ZipFile(path) as archive:
            size = sum(part.file_size for part in archive.infolist())
        if size > LARGEST_MESH:
            raise RaffError(f"holds {size / 1e6:.0f} MB when unpacked: the most is {LARGEST_MESH / 1e6:.0f} MB")
    scene: Any = trimesh.load_scene(path)
    surfaces: list[ColouredSurface] = []
    for mesh in scene.dump():
        if isinstance(mesh, trimesh.Trimesh):
            surfaces += _of_mesh(mesh)
    return surfaces


def _of_mesh(mesh: Any) -> Iterator[ColouredSurface]:
    triangles = np.asarray(mesh.triangles, dtype=float)
    visual = mesh.visual
    if visual.kind == "texture":
        yield from _surface(triangles, _colour(visual.material.main_color))
    elif visual.kind in ("face", "vertex"):
        colours, which = np.unique(np.asarray(visual.face_colors), axis=0, return_inverse=True)
        for i, colour in enumerate(colours):
            yield from _surface(triangles[which.ravel() == i], _colour(colour))
    else:
        yield from _surface(triangles, None)


def _surface(triangles: np.ndarray, colour: Colour | None) -> Iterator[ColouredSurface]:
    shown = solid(triangles)
    if len(shown):
        yield ColouredSurface(shown, colour)


def _colour(colour: Any) -> Colour:
    red, green, blue, opacity = np.asarray(colour).astype(int).tolist()
    return red, green, blue, opacity
