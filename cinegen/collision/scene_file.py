"""Scenes read from files, TOML or JSON, and from keys and values."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from cinegen.collision.errors import SceneError
from cinegen.collision.obstacle import Attached, Obstacle, read_attached, read_obstacle
from cinegen.collision.scene import Scene, unmoving_joints
from cinegen.collision.scene_goal import SceneGoal, check_length, read_goal, read_path_constraints, read_start
from cinegen.collision.scene_robot import LoadArguments, read_robot
from cinegen.collision.scene_table import SceneTable, read_each
from cinegen.errors import read_all
from cinegen.model import Mechanism
from cinegen.model.plausible import FAR
from cinegen.typed_json import unique_keys
from raff2urdf.errors import RaffError, raised_as
from raff2urdf.files import STANDARD, stem_of
from raff2urdf.quantities import NUMBER
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.xml_file import read_text
from raff2urdf.shipped import find_scene

SAFETY = 0.01
"""Default safety distance, m."""

SELF_CLEARANCE = 1e-3
"""Default distance between links, m; or the safety distance, if that is less."""


def load_scene(
    path: str | Path,
    ignore_loops: bool = False,
    ignore: Sequence[str] = (),
    srdf: str | Path | None = None,
    self_clearance: float | None = None,
    fixed_base: bool = False,
    actuated: Sequence[str] | None = None,
    options: ReadOptions | None = None,
) -> Scene:
    """Return the scene of a file; numbers without a unit are in m and degrees.

    Args:
        path: a .toml or .json file, or the name of a shipped scene, such as "disc"; `-` is standard input.
        ignore_loops: as for `cinegen.load`, for the robot of the scene.
        ignore: likewise.
        srdf: likewise; in place of the scene's.
        self_clearance: distance between links, m, in place of the scene's.
        fixed_base: as for `cinegen.load`.
        actuated: likewise.
        options: of how the robot's file is read; `ReadOptions.check` then refuses those without effect.

    Raises:
        SceneError: the file can't be read, or a value is invalid; the message names the file and the key.
    """
    with raised_as(SceneError, RaffError):
        path = find_scene(path)
    parse = {".toml": _toml, ".json": _json}.get(path.suffix.lower())
    if parse is None and path != STANDARD:
        raise SceneError(f"{path}: a scene is a .toml or a .json file")
    with raised_as(SceneError, RaffError):
        text = read_text(path)
    if parse is None:
        parse = _json if text.lstrip().startswith("{") else _toml
    values, where, unit = _angles(parse(text, path), str(path), "deg")
    if self_clearance is not None and isinstance(values, Mapping):
        values = {**values, "self_clearance": self_clearance}
    settings: dict[str, Any] = {
        "ignore_loops": ignore_loops, "ignore": ignore, "fixed_base": fixed_base, "actuated": actuated,
    }  # fmt: skip
    settings |= {} if options is None else {"options": options}
    settings |= {} if srdf is None else {"srdf": srdf}
    return _scene(SceneTable(values, where, unit), stem_of(path), path, path.parent, None, settings)


def scene_of(values: Mapping[str, Any], folder: str | Path = ".", mechanism: Mechanism | None = None) -> Scene:
    """Return the scene of the keys and values that a file would have; angles without a unit are in rad.

    Args:
        values: as in a file, in m and rad; arrays are read as lists.
        folder: folder of the files that they name.
        mechanism: the robot, if it has been loaded; `robot` is then optional, and not loaded.

    Raises:
        SceneError: a value is invalid; the message names the key.
    """
    return _scene(SceneTable(*_angles(values, "scene", "rad")), "scene", None, Path(folder), mechanism)


def _scene(
    table: SceneTable,
    name: str,
    path: Path | None,
    folder: Path,
    robot: Mechanism | None,
    settings: LoadArguments = MappingProxyType({}),
) -> Scene:
    table.know("node", "robot", "mobile", "allowed_collisions", "locked", "path", "weights", "attached")
    values = dict[str, Any]()
    reads = {
        "name": lambda: table.text("name") if "name" in table else name,
        "distances": lambda: _distances(table),
        "up": lambda: table.direction("up", 3) if "up" in table else None,
        "obstacles": lambda: _obstacles(table, folder),
        "start": lambda: table.table("start") if "start" in table else SceneTable({}, f"{table.where}: start"),
        "goal": lambda: _goal_table(table),
        "rest": table.finish,
        "robot": lambda: read_robot(table, folder, robot, settings),
        "of robot": lambda: _read_of_robot(table, folder, values) if "robot" in values else None,
    }
    read_all(reads, SceneError, values)
    safety, clearance, influence = values["distances"]
    mechanism, written, radius = values["robot"]
    goal, translation, rotation = values["aim"].pose
    return Scene(
        values["name"], path, folder, mechanism, written, radius, values["obstacles"], values["start q"],
        values["node"], goal, translation, rotation, safety, influence, values["up"], values["allowed"],
        values["aim"].joints, values["aim"].q, values["locked"], values["aim"].tolerance, values["aim"].cone,
        values["path"], clearance, values["attached"], values["weights"],
    )  # fmt: skip


def _read_of_robot(table: SceneTable, folder: Path, values: dict[str, Any]) -> None:
    """Add to the values of a scene those that need its robot, which is one of them."""
    mechanism, _, radius = values["robot"]
    values |= {"node": mechanism.end, "aim": SceneGoal(())}
    reads: dict[str, Callable[[], Any]] = {
        "node": lambda: table.node("node", mechanism),
        "allowed": lambda: _allowed(table, mechanism),
        "lengths": lambda: _check_lengths(table, mechanism, values) if radius is None else None,
        "path": lambda: read_path_constraints(table, radius),
        "start q": lambda: read_start(values["start"], mechanism, radius) if "start" in values else None,
        "aim": lambda: read_goal(values["goal"], mechanism, radius, values) if "goal" in values else SceneGoal(()),
        "locked": lambda: _locked(table, mechanism, values["node"], values["aim"][0]),
        "attached": lambda: _attached(table, folder, mechanism, radius, values),
        "weights": lambda: _weights(table, mechanism),
    }
    read_all(reads, SceneError, values)


def _distances(table: SceneTable) -> tuple[float, float, float | None]:
    """Return the distances that are kept, m: safety distance, between links, and influence."""
    safety = table.number("safety") if "safety" in table else SAFETY
    if safety < 0.0:
        raise table.error("safety", f"must not be below 0, not {safety:g}")
    clearance = table.number("self_clearance") if "self_clearance" in table else min(SELF_CLEARANCE, safety)
    if not 0.0 <= clearance <= safety:
        raise table.error("self_clearance", f"must be from 0 to the safety distance, {safety:g} m, not {clearance:g}")
    influence = table.size("influence") if "influence" in table else None
    if influence is not None and influence <= safety:
        raise table.error("influence", f"must be above the safety distance, {safety:g} m, not {influence:g}")
    return safety, clearance, influence


def _goal_table(table: SceneTable) -> SceneTable:
    if "goal" not in table:
        raise table.error("goal", "is missing: write the goal of the robot, as goal = { point = [x, y, z] }")
    return table.table("goal")


def _obstacles(table: SceneTable, folder: Path) -> tuple[Obstacle, ...]:
    obstacles = dict[str, Obstacle]()

    def add(each: SceneTable, number: int) -> None:
        obstacle = read_obstacle(each, number, folder)
        if obstacle.name in obstacles:
            raise each.error("name", f"'{obstacle.name}' is used by another obstacle")
        obstacles[obstacle.name] = obstacle

    read_each(*(partial(add, each, i) for i, each in enumerate(table.tables("obstacle"), 1)))
    return tuple(obstacles.values())


def _attached(
    table: SceneTable, folder: Path, mechanism: Mechanism, radius: float | None, values: Mapping[str, Any]
) -> tuple[Attached, ...]:
    """Return the objects that the robot holds, by default at the node that is to reach the goal."""
    if "attached" not in table:
        return ()
    if radius is not None:
        raise table.error("attached", "is for robots: nothing is attached to a mobile robot")
    obstacles: Sequence[Obstacle] | None = values.get("obstacles")
    objects, names = list[Attached](), {obstacle.name for obstacle in obstacles or ()} | set(mechanism.nodes)

    def add(each: SceneTable, number: int) -> None:
        held = read_attached(each, number, folder, mechanism, values["node"], obstacles)
        if held.name in names:
            raise each.error("name", f"'{held.name}' is used by another object or node")
        names.add(held.name)
        objects.append(held)

    read_each(*(partial(add, each, i) for i, each in enumerate(table.tables("attached"), 1)))
    return tuple(objects)


def _weights(table: SceneTable, mechanism: Mechanism) -> dict[str, float]:
    """Return weights above 0, by the names of joints."""
    if "weights" not in table:
        return {}
    inner = table.table("weights")

    def weight(name: str) -> float:
        inner.check_name("", name, mechanism.joints, f"a joint of {mechanism.name}")
        value = inner.number(name, NUMBER)
        if not 1e-2 <= value <= 1e2:
            raise inner.error(name, f"must be a weight from 0.01 to 100, not {value:g}")
        return value

    return read_all({name: partial(weight, name) for name in inner}, SceneError)


def _allowed(table: SceneTable, mechanism: Mechanism) -> tuple[tuple[str, str], ...]:
    """Return the pairs of nodes that are not checked against each other."""
    pairs = table.pairs("allowed_collisions") if "allowed_collisions" in table else []

    def check(pair: Sequence[str]) -> tuple[str, str]:
        _check_names(table, "allowed_collisions", pair, mechanism.nodes, f"a node of {mechanism.name}")
        if pair[0] == pair[1]:
            raise table.error("allowed_collisions", f"names '{pair[0]}' twice in one pair: name two nodes")
        return pair[0], pair[1]

    return tuple(read_each(*(partial(check, pair) for pair in pairs)))


def _check_names(table: SceneTable, key: str, names: Sequence[str], known: Sequence[str], what: str) -> None:
    read_each(*(partial(table.check_name, key, name, known, what) for name in names))


def _locked(table: SceneTable, mechanism: Mechanism, node: str, goal: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that keep their values of the start: by default those that don't move the node."""
    if "locked" not in table:
        return unmoving_joints(mechanism, node, goal)
    names = table.names("locked")
    _check_names(table, "locked", names, mechanism.joints, f"a joint of {mechanism.name}")
    for name in names:
        if name in goal:
            raise table.error("locked", f"'{name}' is also a joint of the goal: remove it from one of them")
    return tuple(names)


# --- the robot ---------------------------------------------------------------------------------------------------


# --- plausible lengths -------------------------------------------------------------------------------------------

_FAR_OBSTACLE = 100.0  # times the reach


def _check_lengths(table: SceneTable, robot: Mechanism, values: Mapping[str, Any]) -> None:
    """Refuse distances and obstacles that would fit in mm only."""
    safety, _, influence = values.get("distances", (None,) * 3)
    lengths = {"safety": ([safety], 1.0), "influence": ([influence], FAR)} if safety is not None else {}
    if influence is None:
        lengths.pop("influence", None)
    for obstacle in values.get("obstacles", ()):
        lengths[f"obstacle '{obstacle.name}'"] = obstacle.placement.translation.tolist(), _FAR_OBSTACLE
    read_each(*(partial(check_length, table, robot, name, *of) for name, of in lengths.items()))


# --- start and goal ----------------------------------------------------------------------------------------------


# --- TOML and JSON -----------------------------------------------------------------------------------------------


def _angles(values: Any, where: str, unit: str) -> tuple[Any, str, str]:
    """Return the values without the key `angles`, and the unit of angles: that of the key, if it is there."""
    if not isinstance(values, Mapping) or "angles" not in values:
        return values, where, unit
    if values["angles"] not in ("deg", "rad"):
        raise SceneError(f"{where}: angles must be 'deg' or 'rad', the unit of angles without one")
    return {key: value for key, value in values.items() if key != "angles"}, where, values["angles"]


def _toml(text: str, path: Path) -> Any:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        place = re.search(r" \(at line (\d+), column (\d+)\)$", str(error))
        if place is None:
            raise SceneError(f"{path}: invalid TOML: {error}") from None
        raise SceneError(f"{path}:{place[1]}:{place[2]}: invalid TOML: {str(error)[: place.start()]}") from None


def _json(text: str, path: Path) -> Any:
    try:
        return json.loads(text, object_pairs_hook=unique_keys)
    except json.JSONDecodeError as error:
        raise SceneError(f"{path}:{error.lineno}:{error.colno}: invalid JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{path}: invalid JSON: {error}") from None
