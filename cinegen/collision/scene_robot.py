"""The robot of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from cinegen.collision.mobile_robot import mobile_robot
from cinegen.collision.scene_table import SceneTable
from cinegen.errors import CinegenError
from cinegen.model import Mechanism
from cinegen.model.load import load_with
from raff2urdf.errors import RaffError, raised_as
from raff2urdf.readers.options import ReadOptions

LoadArguments = Mapping[str, Any]
"""Arguments of `cinegen.load`."""


class SceneRobot(NamedTuple):
    """A mechanism, its file as it was written, and the radius of a mobile robot, m."""

    mechanism: Mechanism
    written: str | Mapping[str, Any] | None
    radius: float | None


def read_robot(table: SceneTable, folder: Path, mechanism: Mechanism | None, settings: LoadArguments) -> SceneRobot:
    """Return the robot of a scene.

    It is given by `robot`, a file that `cinegen.load` reads, or for a file with several robots a table with its `file`
    and a `name`, or with the file of an `srdf`; or by `mobile`, a table with the `radius` of a disc, m, 0 for a point.
    """
    if "mobile" in table:
        if "robot" in table or mechanism is not None:
            raise table.error("mobile", "cannot be combined with a robot: remove one of them")
        if "srdf" in settings:
            raise table.error("mobile", "is a robot of one link, for which there is no SRDF: leave it out")
        inner = table.table("mobile")
        radius = inner.number("radius")
        if radius != 0.0:
            radius = inner.size("radius")
        inner.finish()
        return SceneRobot(mobile_robot(), None, radius)
    if "robot" not in table:
        if mechanism is None:
            raise table.error("robot", "is missing: name a robot's file, or write mobile = { radius = ... }")
        return SceneRobot(mechanism, None, None)
    if not table.has_table("robot"):
        text = table.text("robot")
        return SceneRobot(mechanism or _load(table, "robot", folder, settings), text, None)
    inner = table.table("robot")
    inner.text("file")
    if "name" in inner:
        settings = {**settings, "robot": inner.text("name")}
    if "srdf" in inner:
        settings = {"srdf": inner.file("srdf", folder), **settings}
    inner.finish()
    return SceneRobot(mechanism or _load(inner, "file", folder, settings), inner.read, None)


def _load(table: SceneTable, key: str, folder: Path, settings: LoadArguments) -> Mechanism:
    path = table.robot_file(key, folder)
    with raised_as(partial(table.error, key), (CinegenError, RaffError, OSError), "can't be loaded: "):
        return load_with(path=path, **{"options": ReadOptions(), **settings})
