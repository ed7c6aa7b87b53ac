"""The files next to a URDF: constraints, robot.yaml, loop_closures.yaml."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from raff2urdf.constraints import Constraints
from raff2urdf.errors import RaffError
from raff2urdf.files import note
from raff2urdf.readers.loops import loop_closures, robot_yaml, sidecar
from raff2urdf.readers.loops.declaration import IgnoreList
from raff2urdf.readers.urdf_file import parse
from raff2urdf.readers.urdf_tree import UrdfTree


class AdjacentFiles:
    """The files next to a URDF.

    Attributes:
        text: of the URDF, with joints replaced if a file asks for it.
        values: contents of a constraints file; None without any.
        dialect: of those; empty without any.
        checked: loops of robot.yaml, which must be among those of the values.
        left_out: files that were ignored.
    """

    def __init__(self, path: Path, text: str, ignore: IgnoreList, ignore_loops: bool, is_file: bool) -> None:
        self.text, self.dialect = text, ""
        self.left_out: tuple[str, ...] = ()
        self.values: Constraints | None = None
        self.checked: list[Mapping[str, Any]] = []
        near = ((sidecar.constraints_of(path), sidecar), (robot_yaml.sidecar_of(path), robot_yaml))
        for file, reader in near if is_file else ():
            if file is None:
                continue
            note(file)
            if not file.exists():
                continue
            if ignore.takes(file.name):
                self.left_out += (file.name,)
                continue
            self.text, self.values = reader.loops_of(path, text) or (text, None)
            self.dialect = file.name if file.name == "robot.yaml" else "".join(file.suffixes[-2:]) or file.name
            break
        embedded = None if ignore.takes("raff:robot") else sidecar.embedded(path, text)
        if embedded is not None and not self.dialect.endswith(".json"):
            self.checked = self.values["loops"] if self.values is not None else []
            self.text, self.values, self.dialect = text, embedded, "raff:robot"
        if self.values is not None and not ignore_loops and self.dialect.endswith(("raff:robot", ".json")):
            holder = self.dialect if embedded is not None else sidecar.constraints_of(path).name
            sidecar.check_hash(self.values, holder, path, parse(self.text, str(path)))
        tree = UrdfTree(parse(self.text, str(path)), str(path))
        own_closures = loop_closures.sidecar_of(path, tree) if is_file else None
        if own_closures is not None and ignore.takes(own_closures.name):
            self.left_out += (own_closures.name,)
            own_closures = None
        self._closures = own_closures
        self._read: loop_closures.LoopClosures | None = None
        if self.values is None and own_closures is None and not self.left_out:
            misplaced = sidecar.misplaced(path, text) if is_file else None
            if misplaced and not ignore_loops and not ignore.takes(misplaced.file):
                raise RaffError(misplaced.refusal(path))
            if misplaced:
                self.left_out += (f"the loops of {misplaced.file}",)
        elif ignore_loops and own_closures is not None:
            self.left_out += (f"the loops of {own_closures.name}",)

    def closures(self, tree: UrdfTree) -> loop_closures.LoopClosures | None:
        """Return the contents of `loop_closures.yaml`; None without it."""
        if self._closures is not None and self._read is None:
            self._read = loop_closures.read(self._closures, tree)
        return self._read
