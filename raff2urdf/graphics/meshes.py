"""Prepare graphic files for a URDF.

STL, OBJ and DAE files are named as they are. Others are converted: every viewer reads STL, so a file becomes one
binary STL for each of its colours, with a material of that colour.
"""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from raff2urdf.command.extras import needs
from raff2urdf.errors import RaffError
from raff2urdf.files import note, signed, write_all
from raff2urdf.graphics.collada import ENDING, unit_of
from raff2urdf.graphics.names import cache_folder, check_mesh, may_read
from raff2urdf.graphics.solids import SCHEME, stl_of
from raff2urdf.raff.document import RaffNode, RaffRobot

if TYPE_CHECKING:  # slow to import, and only needed where there are graphics
    from yourdfpy import Material, Visual

    from raff2urdf.graphics.surface import Colour, ColouredSurface

SHOWN = (".stl", ".obj", ".dae")  # URDF viewers, Pinocchio and browsers read them
_READERS = {".nff": "nff", ".dxf": "dxf"}  # modules; the others are read by `scene`
CONVERTED = (".nff", ".dxf", ".3mf", ".glb", ".gltf", ".off", ".ply")


@dataclass(frozen=True, slots=True)
class Drawing:
    """A mesh that can be shown: its file, and its colour if the URDF must give it."""

    path: Path
    colour: Colour | None = None

    def visual(self, out: Path | None, scale: float) -> Visual:
        """Return the mesh as a visual of a URDF.

        Args:
            out: the folder of the URDF, relative to which the file is named; an absolute name if None.
            scale: metres in the file's unit of length.
        """
        from yourdfpy import Visual

        from raff2urdf.writers.urdf_object import geometry

        shape = geometry("mesh", np.full(3, scale), _relative(self.path, out))
        return Visual(geometry=shape, material=_material(self.colour))


class Graphics:
    """The graphics of one robot.

    Args:
        robot: whose `path` is the folder of its files (`~` is the home folder).
        folder: of the RAFF file; a relative `path` is relative to it.
        meshes: the folder to which the caller will write converted meshes; if None, they are written to the user's
            cache at once.
        written_out: False if solids that are drawn are named by their recipes, without a file.

    Attributes:
        written: converted meshes to be written: their contents by their paths in `meshes`.
    """

    def __init__(self, robot: RaffRobot, folder: Path, meshes: Path | None = None, written_out: bool = True) -> None:
        self.robot, self.folder, self.meshes, self.written_out = robot, folder, meshes, written_out
        self.written: dict[Path, bytes] = {}
        self._read_files: dict[Path, tuple[list[Drawing], str | None]] = {}  # arms of one kind share their files
        self._stems: set[str] = set()
        self._solids: dict[str, Path] = {}  # by recipe

    def of(self, node: RaffNode) -> tuple[list[Drawing], list[str]]:
        """Return the drawings of a node's graphic files, and why others, or parts of them, can't be shown."""
        files = [(name, *self.of_file(name)) for name in node.filenames or ()]
        reasons = [f"{name} ({reason})" for name, _, reason in files if reason is not None]
        return [drawing for _, drawings, _ in files for drawing in drawings], reasons

    def of_file(self, name: str) -> tuple[list[Drawing], str | None]:
        """Return the drawings of a graphic file, and why it, or a part of it, can't be shown; None if it can."""
        try:
            path = self.folder / Path(self.robot.path or "").expanduser() / Path(name).expanduser()
            if path not in self._read_files:
                self._read_files[path] = self._read(path)
            return self._read_files[path]
        except RuntimeError as error:  # "~nobody"
            return [], str(error)

    def name_of(self, recipe: str, out: Path | None) -> str:
        """Return the name of a solid (`raff2urdf.graphics.solids`) in a URDF in the folder `out`."""
        if not self.written_out:
            return f"{SCHEME}://{recipe}"
        if recipe not in self._solids:
            content, kind = stl_of(recipe), Path(recipe.partition("/")[0])
            file = keep(content, ".stl") if self.meshes is None else self.meshes / f"{self._stem(kind)}.stl"
            if self.meshes is not None:
                self.written[file] = content
            self._solids[recipe] = file
        return _relative(self._solids[recipe], out)

    def _read(self, path: Path) -> tuple[list[Drawing], str | None]:
        note(path)
        try:
            if may_read(path, self.folder) and not path.is_file():
                return [], "not found"
            check_mesh(path, self.folder, "it")
        except OSError as error:
            return [], str(error.strerror)
        except RaffError as error:
            return [], str(error)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of the readers, such as an overflow, which is checked here
                return self._drawn(path)
        except RaffError as error:
            return [], _summary(error)
        except Exception as error:  # each reader has its own errors
            return [], f"unreadable: {_line(str(error) or type(error).__name__)}"

    def _drawn(self, path: Path) -> tuple[list[Drawing], str | None]:
        kind = path.suffix.lower()
        if kind in SHOWN and unit_of(path) == 1.0:  # viewers would apply another one
            return ([], "holds no surface") if _is_empty(path) else ([Drawing(path)], None)
        if kind in (*CONVERTED, ENDING):
            surfaces, omitted = _surfaces(path)
            return self._converted(path, surfaces), omitted
        return [], f"{path.suffix or 'no extension'}: only {', '.join((*SHOWN, *CONVERTED))} can be shown"

    def _converted(self, path: Path, surfaces: list[ColouredSurface]) -> list[Drawing]:
        from raff2urdf.graphics.surface import stl

        stem = self._stem(path)
        drawings = []
        for number, surface in enumerate(surfaces, 1):
            content = stl(surface.triangles)
            if self.meshes is None:
                file = keep(content, ".stl")
            else:
                file = self.meshes / f"{stem}.{number}.stl"
                self.written[file] = content
            drawings.append(Drawing(file, surface.colour))
        return drawings

    def _stem(self, path: Path) -> str:
        """Return a name for a file, in portable characters, that no other file of this robot has."""
        stem = base = re.sub(r"[^\w.-]", "_", path.name)[:60].lstrip(".")
        number = 1
        while stem.casefold() in self._stems:  # some systems do not distinguish a.nff and A.nff
            number += 1
            stem = f"{base}-{number}"
        self._stems.add(stem.casefold())
        return stem


def converted(path: Path) -> list[Drawing]:
    """Convert a file for viewers: one STL for each of its colours, in the user's cache.

    Args:
        path: of a file of one of the `CONVERTED` formats.

    Raises:
        RaffError: it holds no surface, or is wrong.
        Exception: of any type, depending on the reader.
    """
    from raff2urdf.graphics.surface import stl

    surfaces, _ = _surfaces(path)
    return [Drawing(keep(stl(surface.triangles), ".stl"), surface.colour) for surface in surfaces]


def _relative(path: Path, out: Path | None) -> str:
    """Return the name of a file in a URDF in a folder; an absolute one without a folder."""
    path = path.resolve()
    return str(path) if out is None else Path(os.path.relpath(path, out.resolve())).as_posix()


def _surfaces(path: Path) -> tuple[list[ColouredSurface], str | None]:
    """Return the surfaces of a file, one for each colour, and what was left out."""
    from raff2urdf.graphics.surface import fewer_colours

    kind, omitted = path.suffix.lower(), None
    with needs("dxf", "DXF files"):
        reader = import_module(f"raff2urdf.graphics.{_READERS.get(kind, 'scene')}")  # trimesh is slow to import
    surfaces = reader.read(path)
    if kind == ".dxf":
        surfaces, omitted = surfaces
    if not surfaces:
        raise RaffError("holds no surface")
    return fewer_colours(surfaces), omitted


def _is_empty(path: Path) -> bool:
    import trimesh  # 0.5 s

    return bool(trimesh.load(path, force="mesh").is_empty)


def _material(colour: Colour | None) -> Material | None:
    """Return a material named by its colour, so that a name never has two meanings."""
    from raff2urdf.writers.urdf_object import material_of

    if colour is None:
        return None
    red, green, blue, opacity = colour
    name = f"rgb{red:02x}{green:02x}{blue:02x}" + (f"{opacity:02x}" if opacity < 255 else "")
    return material_of(name, [round(channel / 255.0, 4) for channel in colour])


def _summary(error: RaffError) -> str:
    """Return an error without the file's name and line of text, for a warning about several files."""
    problem = error.problems[0]
    line = "" if problem.location is None else f"line {problem.location.line}: "
    return _line(line + problem.message)


def _line(text: str) -> str:
    """Return a text on one line, of moderate length."""
    shown = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return shown if len(shown) <= 200 else shown[:200] + "..."


# --- the cache ----------------------------------------------------------------------------------------------------


def keep(content: bytes, ending: str) -> Path:
    """Return a file with the content: the existing one, or a new one.

    It is in `$XDG_CACHE_HOME/raff2urdf`, by default `~/.cache/raff2urdf`; if that can't be written, in a temporary
    folder that is removed when Python ends.

    Args:
        content: of the file, whose hash is its name.
        ending: of its name, such as ".stl".

    Raises:
        OSError: no folder can be written.
    """
    content = signed(content)
    name = hashlib.sha256(content).hexdigest()[:32] + ending
    reason = OSError("no folder for temporary files")
    for folder in _folders():
        path = folder / name
        try:
            if not _holds(path, content):
                write_all({path: content})
        except OSError as error:
            reason = error
        else:
            return path
    raise reason


def _folders() -> Iterator[Path]:
    if (cache := cache_folder()) is not None:
        yield cache
    yield Path(_temporary().name)


def _holds(path: Path, content: bytes) -> bool:
    """Return whether a file exists and is complete: a disk may have been full."""
    try:
        return path.stat().st_size == len(content) and path.read_bytes() == content
    except FileNotFoundError:
        return False


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="raff2urdf-")
