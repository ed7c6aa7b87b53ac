"""Scenes from files, TOML or JSON, and from programs."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cinegen.collision.errors import SceneError
from cinegen.collision.scene.goal import goal
from cinegen.collision.scene.obstacle import Obstacle, obstacle
from cinegen.collision.scene.robot import robot
from cinegen.collision.scene.scene import Scene
from cinegen.collision.scene.start import start
from cinegen.collision.scene.table import Table
from cinegen.model import Mechanism
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.readers.xml_file import read_text

SAFETY = 0.01
"""m: distance that is kept from obstacles unless the scene says another."""


def load_scene(path: str | Path, ignore_loops: bool = False) -> Scene:
    """Reads a scene's file.

    Args:
        path: of a .toml or .json.
        ignore_loops: as for `cinegen.load`, for the scene's robot.

    Raises:
        SceneError: the file can't be read, or something in it is wrong: says where.
    """
    path = Path(path)
    parse = {".toml": _toml, ".json": _json}.get(path.suffix.lower())
    if parse is None:
        raise SceneError(f"{path}: a scene is a .toml or a .json file")
    try:
        text = read_text(path)
    except RaffError as error:
        raise SceneError(str(error)) from None
    return _scene(Table(parse(text, path), str(path)), path.stem, path, path.parent, None, ignore_loops)


def scene_of(values: Mapping[str, Any], folder: str | Path = ".", mechanism: Mechanism | None = None) -> Scene:
    """A scene from the keys and values that a file would have.

    Args:
        values: as a file has them; arrays are read as lists.
        folder: where the files that they name are looked for.
        mechanism: the robot, if it has been loaded; `robot` need not be among the keys then, and is not read.

    Raises:
        SceneError: something is wrong: says where.
    """
    return _scene(Table(values, "scene"), "scene", None, Path(folder), mechanism)


def _scene(
    table: Table, name: str, path: Path | None, folder: Path, given: Mechanism | None, ignore_loops: bool = False
) -> Scene:
    name = table.text("name") if "name" in table else name
    safety = _safety(table)
    influence = table.size("influence") if "influence" in table else None
    if influence is not None and influence <= safety:
        raise table.wrong("influence", f"must be above the safety distance, {safety:g} m, not {influence:g}")
    up = table.direction("up", 3) if "up" in table else None
    obstacles = _obstacles(table, folder)
    if "goal" not in table:
        raise table.wrong("goal", "is missing: write where the robot is to go, as goal = { point = [x, y, z] }")
    begin, end = table.inner("start") if "start" in table else Table({}, f"{table.where}: start"), table.inner("goal")
    table.know("node", "robot", "mobile", "allowed_collisions")
    table.finish()  # before the robot is loaded, which may take its time

    mechanism, written, radius = robot(table, folder, given, ignore_loops)
    node = table.text("node") if "node" in table else mechanism.end
    if node not in mechanism.nodes:
        raise table.wrong("node", f"'{node}' is none of {mechanism.name}{did_you_mean(node, mechanism.nodes)}")
    allowed = _allowed(table, mechanism)
    q = start(begin, mechanism, radius is not None)
    aim = goal(end, mechanism.placement(q, node))
    q.flags.writeable = False
    return Scene(
        name=name,
        path=path,
        folder=folder,
        mechanism=mechanism,
        robot=written,
        mobile=radius,
        obstacles=obstacles,
        start=q,
        node=node,
        goal=aim.placement,
        translation=aim.translation,
        rotation=aim.rotation,
        safety=safety,
        influence=influence,
        up=up,
        allowed_collisions=allowed,
    )


def _safety(table: Table) -> float:
    if "safety" not in table:
        return SAFETY
    safety = table.number("safety")
    if safety < 0.0:
        raise table.wrong("safety", f"must not be below 0, as {safety:g} is")
    return safety


def _allowed(table: Table, mechanism: Mechanism) -> tuple[tuple[str, str], ...]:
    """Read the pairs of nodes that are not checked against each other."""
    found = []
    for one, other in table.names("allowed_collisions", 2) if "allowed_collisions" in table else ():
        for name in (one, other):
            if name not in mechanism.nodes:
                near = did_you_mean(name, mechanism.nodes)
                raise table.wrong("allowed_collisions", f"'{name}' is no node of {mechanism.name}{near}")
        if one == other:
            raise table.wrong("allowed_collisions", f"names '{one}' twice in one pair: name two nodes")
        found.append((one, other))
    return tuple(found)


def _obstacles(table: Table, folder: Path) -> tuple[Obstacle, ...]:
    found: dict[str, Obstacle] = {}
    for number, each in enumerate(table.each("obstacle"), 1):
        read = obstacle(each, number, folder)
        if read.name in found:
            raise each.wrong("name", f"'{read.name}' is another obstacle's too")
        found[read.name] = read
    return tuple(found.values())


def _toml(text: str, path: Path) -> Any:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        place = re.search(r" \(at line (\d+), column (\d+)\)$", str(error))
        if place is None:
            raise SceneError(f"{path}: this is no TOML: {error}") from None
        raise SceneError(f"{path}:{place[1]}:{place[2]}: this is no TOML: {str(error)[: place.start()]}") from None


def _json(text: str, path: Path) -> Any:
    try:
        return json.loads(text, object_pairs_hook=_unique)
    except json.JSONDecodeError as error:
        raise SceneError(f"{path}:{error.lineno}:{error.colno}: this is no JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{path}: this is no JSON: {error}") from None


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"key '{next(key for key in keys if keys.count(key) > 1)}' stands twice in one table")
    return found
