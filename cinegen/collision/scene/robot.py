"""Which robot a scene is about: `robot` or `mobile`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from cinegen.collision.scene.mobile import mobile
from cinegen.collision.scene.table import Table
from cinegen.errors import CinegenError
from cinegen.model import Mechanism, load
from raff2urdf.errors import RaffError


class Robot(NamedTuple):
    """A mechanism, what was written for it, and the radius of a mobile one (m)."""

    mechanism: Mechanism
    written: str | Mapping[str, Any] | None
    radius: float | None


def robot(table: Table, folder: Path, mechanism: Mechanism | None, ignore_loops: bool = False) -> Robot:
    """Reads one.

    Its keys: `robot`, a file that `cinegen.load` reads, or of a file with several a table with its `file` and a `name`;
    or `mobile`, a table with the `radius` of a disc, m, 0 for a point.

    Args:
        table: of the scene.
        folder: where the file is looked for.
        mechanism: the robot, if it has been loaded: what is written is then kept, and not read.
        ignore_loops: as for `cinegen.load`.

    Raises:
        SceneError: there is no robot, or more than one, or it can't be loaded.
    """
    if "mobile" in table:
        if "robot" in table or mechanism is not None:
            raise table.wrong("mobile", "can't stand beside a robot: a scene is about one of them")
        inner = table.inner("mobile")
        radius = inner.number("radius")
        if radius != 0.0:
            radius = inner.size("radius")
        inner.finish()
        return Robot(mobile(), None, radius)
    if "robot" not in table:
        if mechanism is None:
            raise table.wrong("robot", "is missing: name a robot's file, or write mobile = { radius = ... }")
        return Robot(mechanism, None, None)
    if not table.is_table("robot"):
        written: str | Mapping[str, Any] = table.text("robot")
        return Robot(mechanism or _load(table, "robot", folder, None, ignore_loops), written, None)
    inner = table.inner("robot")
    inner.text("file")
    name = inner.text("name") if "name" in inner else None
    inner.finish()
    return Robot(mechanism or _load(inner, "file", folder, name, ignore_loops), inner.read, None)


def _load(table: Table, key: str, folder: Path, name: str | None, ignore_loops: bool) -> Mechanism:
    path = table.file(key, folder)
    try:
        return load(path, robot=name, ignore_loops=ignore_loops)
    except (CinegenError, RaffError, OSError) as error:
        raise table.wrong(key, f"can't be loaded: {error}") from None
