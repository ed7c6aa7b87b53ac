"""The kinds of obstacles.

Each is a module with `solids(table, folder)`: it reads the keys that say the shape, and answers the convex solids that
it is made of, in the obstacle's own frame. A new kind is a new module and one line here.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol, cast

from cinegen.collision.scene.solid import Solid
from cinegen.collision.scene.table import Table
from raff2urdf.errors import did_you_mean

KINDS: Mapping[str, str] = {
    "sphere": "cinegen.collision.scene.kinds.sphere",
    "box": "cinegen.collision.scene.kinds.box",
    "cylinder": "cinegen.collision.scene.kinds.cylinder",
    "capsule": "cinegen.collision.scene.kinds.capsule",
    "half_plane": "cinegen.collision.scene.kinds.half_space",
    "half_space": "cinegen.collision.scene.kinds.half_space",
    "disc": "cinegen.collision.scene.kinds.disc",
    "polygon": "cinegen.collision.scene.kinds.polygon",
    "mesh": "cinegen.collision.scene.kinds.mesh",
}


class Kind(Protocol):
    """What such a module has."""

    @staticmethod
    def solids(table: Table, folder: Path) -> list[Solid]:
        """What an obstacle is made of; files are looked for from that folder.

        Raises:
            SceneError: a value is wrong.
        """


def kind_of(table: Table) -> Kind:
    """The kind that a table names.

    Raises:
        SceneError: there is no such kind.
    """
    name = table.text("kind")
    if name not in KINDS:
        raise table.wrong("kind", f"'{name}' is unknown{did_you_mean(name, tuple(KINDS))}")
    return cast(Kind, importlib.import_module(KINDS[name]))
