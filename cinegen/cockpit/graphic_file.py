"""Draw a graphic file: its own surfaces and colours, as the viewer reads them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from meshcat.geometry import (
    Geometry,
    Material,
    MeshLambertMaterial,
    ObjMeshGeometry,
    StlMeshGeometry,
    TriangularMeshGeometry,
)
from numpy.typing import ArrayLike

from raff2urdf.graphics.collada import ENDING

if TYPE_CHECKING:  # trimesh takes its time
    from raff2urdf.graphics.surface import ColouredSurface

_READERS = {".stl": StlMeshGeometry, ".obj": ObjMeshGeometry}


def draw_file(path: Path, rgba: ArrayLike, is_own: bool = True) -> Iterator[tuple[Geometry, Material]]:
    """Yield the surfaces of a file as geometries and materials, in the file's unit of length.

    Args:
        path: of a file; nothing is yielded for formats that the viewer does not read.
        rgba: colour (4,) of what has none, 0 to 1.
        is_own: use the file's own colours, if it has any.
    """
    is_dae = path.suffix.lower() == ENDING  # the viewer's own reader turns it, and applies the unit once more
    surfaces = _surfaces(path) if is_dae or (is_own and _is_coloured(path)) else ()
    for surface in surfaces:
        colour = np.array(surface.colour) / 255.0 if is_own and surface.colour is not None else rgba
        corners = surface.triangles.reshape(-1, 3)
        yield TriangularMeshGeometry(corners, np.arange(len(corners)).reshape(-1, 3)), material_of(colour)
    reader = _READERS.get(path.suffix.lower())
    if reader is not None and not surfaces:
        yield reader.from_file(path), material_of(rgba)


def material(colour: int, opacity: float = 1.0) -> Material:
    """Return a material: a colour 0xRRGGBB, and an opacity from 0 to 1."""
    return MeshLambertMaterial(color=colour, opacity=opacity)


def material_of(rgba: ArrayLike) -> Material:
    """Return a material; any four numbers are valid, as in a URDF."""
    red, green, blue, opacity = np.clip(np.nan_to_num(rgba, nan=0.5), 0.0, 1.0)
    colour = (round(255 * red) << 16) + (round(255 * green) << 8) + round(255 * blue)
    return material(colour, float(opacity))


@cache
def _surfaces(path: Path) -> tuple[ColouredSurface, ...]:
    """Return the surfaces of a file in its own colours; none if they can't be read. (Robots often use a file twice.)"""
    from raff2urdf.graphics import scene

    with suppress(Exception):  # every reader has errors of its own
        return tuple(scene.read(path))
    return ()


def _is_coloured(path: Path) -> bool:
    """Return whether an OBJ has colours of its own."""
    if path.suffix.lower() != ".obj":
        return False
    text = path.read_text(encoding="utf-8", errors="replace")
    named = re.search(r"^mtllib[ \t]+(.+?)[ \t\r]*$", text, flags=re.MULTILINE)
    return named is not None and (path.parent / named[1]).is_file()
