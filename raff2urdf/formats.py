"""The formats in which a robot can be written.

Each is a module with a function `files`, which takes a `Described` and returns what to write: contents by name, as
seen from the folder to write to, the robot's own file first. A new format is a new module and one line here.
"""

from __future__ import annotations

import importlib
import io
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raff2urdf.errors import RaffError, did_you_mean

if TYPE_CHECKING:  # whoever only asks which formats there are does not wait for these
    import yourdfpy

    from raff2urdf.writers.bodies import TreeAtHome
    from raff2urdf.writers.inertia import Inertias

FORMATS: Mapping[str, str] = {
    "urdf": "raff2urdf.urdf_and_constraints",
    "sdf": "raff2urdf.writers.sdf",
    "mjcf": "raff2urdf.writers.mjcf",
}


@dataclass(frozen=True)
class Described:
    """A robot, as a format needs it.

    Attributes:
        stem: what its files are called.
        model: the tree; meshes are named as seen from `folder`.
        urdf: the same as the text of a URDF.
        constraints: what a URDF can't say, as in constraints.schema.json.
        home: the joint values at closed home, by name (rad, m).
        folder: where the files will stand.
        meshes: contents of meshes that are not written yet, by path.
        density: kg/m3, for formats that want masses; the usual one if None.
        constraint_elements: whether a URDF gets elements for its loops.
    """

    stem: str
    model: yourdfpy.Robot
    urdf: str
    constraints: Mapping[str, Any]
    home: Mapping[str, float]
    folder: Path
    meshes: Mapping[Path, bytes]
    density: float | None = None
    constraint_elements: bool = False

    @cached_property
    def bodies(self) -> TreeAtHome:
        """The tree at closed home."""
        from raff2urdf.writers.bodies import TreeAtHome

        return TreeAtHome(self.model, self.home)

    @cached_property
    def inertias(self) -> Inertias:
        """Of all links."""
        from raff2urdf.writers.inertia import DENSITY, inertias

        density = DENSITY if self.density is None else self.density
        return inertias(self.model, density, self.surface, self.bodies.moving)

    def content(self, mesh: str) -> bytes:
        """The bytes of a mesh, written or not.

        Raises:
            RaffError: it can't be read.
        """
        path = self._path(mesh)
        found = self._waiting.get(path)
        try:
            return path.read_bytes() if found is None else found
        except OSError as error:
            raise RaffError(f"{path}: can't be read: {error.strerror or error}") from None

    def surface(self, mesh: str) -> Any:
        """A mesh as one surface, in its own unit: a trimesh.Trimesh.

        Raises:
            RaffError: it can't be read.
        """
        from raff2urdf.writers.inertia import load_surface

        path = self._path(mesh)
        if path not in self._waiting:
            return load_surface(str(path))
        import trimesh

        return trimesh.load(io.BytesIO(self.content(mesh)), file_type=Path(mesh).suffix[1:].lower(), force="mesh")

    @cached_property
    def _waiting(self) -> Mapping[Path, bytes]:
        return {path.resolve(): content for path, content in self.meshes.items()}

    def _path(self, mesh: str) -> Path:
        """Where a mesh is; the folder need not exist yet."""
        return Path(os.path.normpath(self.folder.resolve() / mesh))


def files(name: str, described: Described) -> dict[str, bytes]:
    """What is written for a robot in the format of that name.

    Raises:
        RaffError: there is no such format, or it can't say what the robot is.
    """
    if name not in FORMATS:
        raise RaffError(f"there is no format '{name}'{did_you_mean(name, list(FORMATS))}")
    found: dict[str, bytes] = importlib.import_module(FORMATS[name]).files(described)
    return found
