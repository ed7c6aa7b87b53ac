"""Meshes of an MJCF."""

from __future__ import annotations

import warnings
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from raff2urdf.errors import RaffWarning
from raff2urdf.escape import unique_name

if TYPE_CHECKING:
    from raff2urdf.conversion import Translation


_MOST_FACES = 200_000  # of an STL file
_LEAST_VERTICES = 4


class MeshAssets:
    """The meshes of a robot as assets that MuJoCo reads.

    Attributes:
        files: of the assets, with their scales, by name.
        converted: contents of the files that were converted, by name.
    """

    def __init__(self, translation: Translation, stem: str) -> None:
        self.translation, self.folder = translation, f"meshes/{stem}"
        self.files: dict[str, tuple[str, tuple[float, ...]]] = {}
        self.converted: dict[str, bytes] = {}
        self.names: dict[str, str | None] = {}

    def name(self, mesh: str, scale: tuple[float, ...]) -> str | None:
        """Return the name of a mesh in the assets; None if MuJoCo can't read it."""
        if mesh not in self.names:
            self.names[mesh] = None
            if file := mesh if self._is_readable(mesh) else self._convert(mesh):
                name = self.names[mesh] = unique_name(PurePosixPath(file).stem, self.files)
                self.files[name] = file, scale
        return self.names[mesh]

    def _is_readable(self, mesh: str) -> bool:
        suffix = PurePosixPath(mesh).suffix.lower()
        content = self.translation.content(mesh) if suffix == ".stl" else b""
        faces = int.from_bytes(content[80:84], "little")
        binary = len(content) == 84 + 50 * faces and _LEAST_VERTICES <= faces <= _MOST_FACES
        return suffix == ".obj" or binary

    def _convert(self, mesh: str) -> str | None:
        surface = self.translation.surface(mesh)
        if len(surface.vertices) < _LEAST_VERTICES or len(surface.faces) > _MOST_FACES:
            return None
        name = f"{self.folder}/{PurePosixPath(mesh).name}.stl"
        while name in self.converted:
            name = f"{name.removesuffix('.stl')}-.stl"
        self.converted[name] = surface.export(file_type="stl")
        return name

    def warn(self) -> None:
        """Warn of meshes that were left out."""
        if lost := [mesh for mesh, name in self.names.items() if name is None]:
            reason = f"MuJoCo reads meshes from {_LEAST_VERTICES} vertices on up to {_MOST_FACES} faces"
            robot = self.translation.robot.name
            warnings.warn(f"robot '{robot}': left out {', '.join(lost)}: {reason}", RaffWarning, stacklevel=3)
