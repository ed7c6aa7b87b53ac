"""Which graphic files can be shown, and what a URDF names for them.

STL, OBJ and DAE files are named as they are. Others are converted: every viewer reads STL, so a file becomes one
binary STL for each of its colours, with a material of that colour.
"""

from __future__ import annotations

import os
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from raff2urdf.document import RaffNode, RaffRobot
from raff2urdf.errors import RaffError

if TYPE_CHECKING:  # slow to import, and only needed where there are graphics
    import yourdfpy

    from raff2urdf.graphics.surface import Colour, ColouredSurface

SHOWN = (".stl", ".obj", ".dae")  # what URDF viewers, Pinocchio and browsers read
CONVERTED = (".nff", ".dxf", ".3mf", ".glb", ".gltf", ".off", ".ply")


@dataclass(frozen=True, slots=True)
class Drawing:
    """A mesh that can be shown: its file, and its colour if the URDF must say it."""

    path: Path
    colour: Colour | None = None

    def visual(self, out: Path | None, scale: float) -> yourdfpy.Visual:
        """As a URDF has it.

        Args:
            out: the folder that the URDF will stand in; the file is named as seen from there. Absolutely, if None.
            scale: metres in the file's unit of length.
        """
        import yourdfpy

        path = self.path.resolve()
        name = str(path) if out is None else Path(os.path.relpath(path, out.resolve())).as_posix()
        mesh = yourdfpy.Mesh(filename=name, scale=np.full(3, scale))
        return yourdfpy.Visual(geometry=yourdfpy.Geometry(mesh=mesh), material=_material(self.colour))


class Graphics:
    """The graphics of one robot.

    Args:
        robot: says in `path` where its files lie (`~` is the home folder).
        beside: the RAFF file's folder, from which a relative `path` counts.
        folder: where converted meshes are to be written, by whoever writes the URDF; if None they are kept in the
            user's cache at once.

    Attributes:
        written: converted meshes to be written: their paths in `folder`, and their bytes.
    """

    def __init__(self, robot: RaffRobot, beside: Path, folder: Path | None = None) -> None:
        self.robot, self.beside, self.folder = robot, beside, folder
        self.written: dict[Path, bytes] = {}
        self._found: dict[Path, tuple[list[Drawing], str | None]] = {}  # arms of one kind share their files
        self._stems: set[str] = set()

    def of(self, part: RaffNode) -> tuple[list[Drawing], list[str]]:
        """What can be shown of a node's graphic files, and why not, for each that can't or that lacks something."""
        drawings: list[Drawing] = []
        reasons = []
        for name in part.filenames or ():
            try:
                path = self.beside / Path(self.robot.path or "").expanduser() / Path(name).expanduser()
                if path not in self._found:
                    self._found[path] = self._read(path)
                found, reason = self._found[path]
            except RuntimeError as error:  # "~nobody"
                found, reason = [], str(error)
            drawings += found
            if reason is not None:
                reasons.append(f"{name} ({reason})")
        return drawings, reasons

    def _read(self, path: Path) -> tuple[list[Drawing], str | None]:
        try:
            if not path.is_file():
                return [], "not found"
        except OSError as error:
            return [], str(error.strerror)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of the readers', say of an overflow: we check for ourselves
                return self._drawn(path)
        except RaffError as error:
            return [], _said(error)
        except Exception as error:  # every reader has errors of its own
            return [], f"unreadable: {_line(str(error) or type(error).__name__)}"

    def _drawn(self, path: Path) -> tuple[list[Drawing], str | None]:
        kind = path.suffix.lower()
        if kind in SHOWN:
            return ([], "holds no surface") if _is_empty(path) else ([Drawing(path)], None)
        if kind in CONVERTED:
            surfaces, lacking = _surfaces(path)
            return self._converted(path, surfaces), lacking
        return [], f"{path.suffix or 'no extension'}: only {', '.join((*SHOWN, *CONVERTED))} can be shown"

    def _converted(self, path: Path, surfaces: list[ColouredSurface]) -> list[Drawing]:
        from raff2urdf.graphics.surface import stl

        stem = self._stem(path)
        drawings = []
        for number, surface in enumerate(surfaces, 1):
            content = stl(surface.triangles)
            if self.folder is None:
                from raff2urdf.graphics.cache import keep

                file = keep(content, ".stl")
            else:
                file = self.folder / f"{stem}.{number}.stl"
                self.written[file] = content
            drawings.append(Drawing(file, surface.colour))
        return drawings

    def _stem(self, path: Path) -> str:
        """The name of a file in letters that are safe everywhere, and one that no other file of this robot has."""
        stem = base = re.sub(r"[^\w.-]", "_", path.name)[:60].lstrip(".")
        number = 1
        while stem.casefold() in self._stems:  # where there is no difference between a.nff and A.nff
            number += 1
            stem = f"{base}-{number}"
        self._stems.add(stem.casefold())
        return stem


def converted(path: Path) -> list[Drawing]:
    """What viewers can read of a file that they can't: one STL for each of its colours, in the user's cache.

    Args:
        path: of a file of one of the `CONVERTED` kinds.

    Raises:
        RaffError: it holds no surface, or its reader says that it is wrong.
        Exception: of any kind, as other readers have it.
    """
    from raff2urdf.graphics.cache import keep
    from raff2urdf.graphics.surface import stl

    surfaces, _ = _surfaces(path)
    return [Drawing(keep(stl(surface.triangles), ".stl"), surface.colour) for surface in surfaces]


def _surfaces(path: Path) -> tuple[list[ColouredSurface], str | None]:
    """The surfaces of a file, one for each colour, and what they lack of it."""
    from raff2urdf.graphics.surface import fewer_colours

    kind, lacking = path.suffix.lower(), None
    if kind == ".nff":
        from raff2urdf.graphics import nff

        surfaces = nff.read(path)
    elif kind == ".dxf":
        from raff2urdf.graphics import dxf

        surfaces, lacking = dxf.read(path)
    else:
        from raff2urdf.graphics import scene

        surfaces = scene.read(path)
    if not surfaces:
        raise RaffError("holds no surface")
    return fewer_colours(surfaces), lacking


def _is_empty(path: Path) -> bool:
    import trimesh  # 0.5 s

    return bool(trimesh.load(path, force="mesh").is_empty)


def _material(colour: Colour | None) -> yourdfpy.Material | None:
    """Named by its colour, so that the same name never means two."""
    import yourdfpy

    if colour is None:
        return None
    red, green, blue, opacity = colour
    name = f"rgb{red:02x}{green:02x}{blue:02x}" + (f"{opacity:02x}" if opacity < 255 else "")
    rgba = np.array([round(channel / 255.0, 4) for channel in colour])
    return yourdfpy.Material(name=name, color=yourdfpy.Color(rgba=rgba))


def _said(error: RaffError) -> str:
    """An error without the file's name and text, which a warning for several files has no room for."""
    problem = error.problems[0]
    return _line(problem.message if problem.location is None else f"line {problem.location.line}: {problem.message}")


def _line(text: str) -> str:
    """A text on one line, of moderate length."""
    shown = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return shown if len(shown) <= 200 else shown[:200] + "..."
