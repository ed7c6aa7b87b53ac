"""Scenes read from files, TOML or JSON, and from keys and values."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.errors import SceneError
from cinegen.collision.mobile_robot import X, Y, mobile_robot
from cinegen.collision.obstacle import Attached, Obstacle, read_attached, read_obstacle
from cinegen.collision.scene import UNCONSTRAINED, PathConstraints, Scene, heading, unmoving_joints
from cinegen.collision.scene_table import LEAST, SceneTable, about_z, read_each
from cinegen.errors import CinegenError, ClosureError, read_all
from cinegen.model import Mechanism
from cinegen.model.load import load_with
from cinegen.model.plausible import FAR, ImplausibleError, check_joint, check_lengths
from cinegen.tolerances import AT_LIMIT
from raff2urdf.errors import RaffError
from raff2urdf.files import STANDARD, stem_of
from raff2urdf.quantities import ANGLE, LENGTH, NUMBER, shown
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.xml_file import read_text
from raff2urdf.shipped import find_scene

SAFETY = 0.01
"""Default safety distance, m."""

SELF_CLEARANCE = 1e-3
"""Default distance between links, m; or the safety distance, if that is less."""

_STEP = 0.1  # rad or characteristic lengths: largest step of the actuated joints from home to the start


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
    try:
        path = find_scene(path)
    except RaffError as error:
        raise SceneError(str(error)) from None
    parse = {".toml": _toml, ".json": _json}.get(path.suffix.lower())
    if parse is None and path != STANDARD:
        raise SceneError(f"{path}: a scene is a .toml or a .json file")
    try:
        text = read_text(path)
    except RaffError as error:
        raise SceneError(str(error)) from None
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
    given: Mechanism | None,
    settings: _Settings = MappingProxyType({}),
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
        "robot": lambda: _robot(table, folder, given, settings),
        "of robot": lambda: _read_of_robot(table, folder, values) if "robot" in values else None,
    }
    read_all(reads, SceneError, values)
    safety, own, influence = values["distances"]
    mechanism, written, radius = values["robot"]
    goal, translation, rotation = values["aim"].pose
    return Scene(
        values["name"], path, folder, mechanism, written, radius, values["obstacles"], values["start q"],
        values["node"], goal, translation, rotation, safety, influence, values["up"], values["allowed"],
        values["aim"].joints, values["aim"].q, values["locked"], values["aim"].tolerance, values["aim"].cone,
        values["path"], own, values["attached"], values["weights"],
    )  # fmt: skip


def _read_of_robot(table: SceneTable, folder: Path, values: dict[str, Any]) -> None:
    """Add to the values of a scene those that need its robot, which is one of them."""
    mechanism, _, radius = values["robot"]
    values |= {"node": mechanism.end, "aim": _Aim(())}
    reads: dict[str, Callable[[], Any]] = {
        "node": lambda: table.node("node", mechanism),
        "allowed": lambda: _allowed(table, mechanism),
        "lengths": lambda: _check_lengths(table, mechanism, values) if radius is None else None,
        "path": lambda: _path_constraints(table, radius),
        "start q": lambda: _start(values["start"], mechanism, radius) if "start" in values else None,
        "aim": lambda: _aim(values["goal"], mechanism, radius, values) if "goal" in values else _Aim(()),
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
    own = table.number("self_clearance") if "self_clearance" in table else min(SELF_CLEARANCE, safety)
    if not 0.0 <= own <= safety:
        raise table.error("self_clearance", f"must be from 0 to the safety distance, {safety:g} m, not {own:g}")
    influence = table.size("influence") if "influence" in table else None
    if influence is not None and influence <= safety:
        raise table.error("influence", f"must be above the safety distance, {safety:g} m, not {influence:g}")
    return safety, own, influence


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


_Settings = Mapping[str, Any]
"""Arguments of `cinegen.load`."""


class _Robot(NamedTuple):
    """A mechanism, its file as it was written, and the radius of a mobile robot, m."""

    mechanism: Mechanism
    written: str | Mapping[str, Any] | None
    radius: float | None


def _robot(table: SceneTable, folder: Path, mechanism: Mechanism | None, settings: _Settings) -> _Robot:
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
        return _Robot(mobile_robot(), None, radius)
    if "robot" not in table:
        if mechanism is None:
            raise table.error("robot", "is missing: name a robot's file, or write mobile = { radius = ... }")
        return _Robot(mechanism, None, None)
    if not table.has_table("robot"):
        text = table.text("robot")
        return _Robot(mechanism or _load(table, "robot", folder, settings), text, None)
    inner = table.table("robot")
    inner.text("file")
    if "name" in inner:
        settings = {**settings, "robot": inner.text("name")}
    if "srdf" in inner:
        settings = {"srdf": inner.file("srdf", folder), **settings}
    inner.finish()
    return _Robot(mechanism or _load(inner, "file", folder, settings), inner.read, None)


def _load(table: SceneTable, key: str, folder: Path, settings: _Settings) -> Mechanism:
    path = table.robot_file(key, folder)
    try:
        return load_with(path=path, **{"options": ReadOptions(), **settings})
    except (CinegenError, RaffError, OSError) as error:
        raise table.error(key, f"can't be loaded: {error}") from None


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
    read_each(*(partial(_check_length, table, robot, name, *of) for name, of in lengths.items()))


def _check_length(table: SceneTable, robot: Mechanism, name: str, values: list[float], far: float = FAR) -> None:
    try:
        check_lengths(robot, name, values, far)
    except ImplausibleError as error:
        raise SceneError(f"{table.where}: {error}") from None


# --- start and goal ----------------------------------------------------------------------------------------------


def _start(table: SceneTable, mechanism: Mechanism, radius: float | None) -> Array:
    """Return the configuration (nq,) of a start: of a mobile robot at `point`, the origin by default."""
    if radius is None:
        q = _configuration(table, mechanism, np.array(mechanism.q_home))
    else:
        x, y = table.vector("point", 2).tolist() if "point" in table else (0.0, 0.0)
        table.finish()
        q = mobile_robot().configuration({X: x, Y: y})
    q.flags.writeable = False
    return q


def _configuration(table: SceneTable, mechanism: Mechanism, home: Array) -> Array:
    """Return the configuration (nq,) of a start or a goal, loops closed, within all limits.

    `joints` are names and values, of ball joints quaternions (x y z w); the other joints are as in `home` (nq,): a
    start's at home, a goal's at the start. A floating base is placed by `point` and `rpy`. With loops, actuated joints
    have the given values, and the others follow the motion of these from `home`; unless a passive joint is named, too:
    the values are then the guess from which the loops are closed.

    Raises:
        SceneError: a joint is unknown or beyond its limits, or the loops can't be closed.
    """
    values, placement = _given(table, mechanism)
    if placement is not None:
        home[:7] = pin.SE3ToXYZQUAT(placement)
    q = mechanism.configuration(values, home)
    if mechanism.is_constrained:
        try:
            q = _closed(mechanism, home, q, any(name not in mechanism.actuated for name in values))
        except ClosureError as error:
            raise table.error("joints", f"do not allow closed loops: {error}") from None
        unwound = mechanism.limits.unwound(q)  # a guess far away may have added revolutions to passive joints
        for name in mechanism.limits.exceeded(q, AT_LIMIT):
            if name not in mechanism.actuated:
                q[mechanism.q_index(name)] = unwound[mechanism.q_index(name)]
    for name in mechanism.limits.exceeded(q, AT_LIMIT):
        low, high, *_ = mechanism.limits[name]
        dimension = LENGTH if mechanism.is_prismatic(name) else ANGLE
        value, *limits = (shown(x, dimension, 6) for x in (float(q[mechanism.q_index(name)]), low, high))
        why = f"'{name}' is at {value}, its limits are {limits[0]} and {limits[1]}"
        raise table.error("joints", why if name in values else f"{why}: give its value, or other actuated joints")
    return q


def _given(table: SceneTable, mechanism: Mechanism) -> tuple[dict[str, float | Array], pin.SE3 | None]:
    """Return the `joints` of a start or a goal, by their names, and the pose of a floating base, if it has one."""
    is_placed = mechanism.floating and ("point" in table or "rpy" in table or "angle" in table)
    values, placement, _ = read_each(
        lambda: _joint_values(table.table("joints"), mechanism) if "joints" in table else {},
        lambda: table.pose() if is_placed else None,
        table.finish,
    )
    return values, placement


def _joint_values(table: SceneTable, mechanism: Mechanism) -> dict[str, float | Array]:
    known = (*mechanism.joints, *mechanism.balls)

    def value(name: str) -> float | Array:
        table.check_name("", name, known, f"a joint of {mechanism.name}")
        if name in mechanism.balls:
            return table.vector(name, 4, dimension=NUMBER)
        number = table.number(name, LENGTH if mechanism.is_prismatic(name) else ANGLE)
        try:
            check_joint(mechanism, name, [number])
        except ImplausibleError as error:
            raise SceneError(f"{table.where}: {error}") from None
        return number

    return read_all({name: partial(value, name) for name in table}, SceneError)


def _closed(mechanism: Mechanism, home: Array, q: Array, is_guess: bool) -> Array:
    """Return q (nq,) with closed loops and its values of the actuated joints: from home along the straight line of
    these, or from q itself if it is a guess for the others, too."""
    actuated = [mechanism.q_index(name) for name in mechanism.actuated]
    columns = [mechanism.v_index(name) for name in mechanism.actuated]
    if not is_guess:
        line = q[actuated] - home[actuated]
        steps = int(np.ceil(np.abs(line / mechanism.scale[columns]).max(initial=0.0) / _STEP))
        closed = home.copy()
        for step in range(1, steps + 1):
            closed[actuated] = home[actuated] + line * (step / steps)
            closed = mechanism.close(closed, locked=mechanism.actuated)
        closed[actuated] = q[actuated]
        q = closed
    return mechanism.close(q, locked=mechanism.actuated)


class _Aim(NamedTuple):
    """`Scene.goal_joints` and `goal_configuration`, `goal` with `translation` and `rotation`, `tolerance`, `cone`."""

    joints: tuple[str, ...]
    q: Array | None = None
    pose: tuple[pin.SE3, int, int] | None = None
    tolerance: Array | None = None
    cone: float | None = None


def _aim(table: SceneTable, mechanism: Mechanism, radius: float | None, values: Mapping[str, Any]) -> _Aim:
    """Return the goal: `joints`, or a pose and its region. Without a start only names and values are checked."""
    q, node = values.get("start q"), values["node"]
    if "joints" not in table:
        pose = pin.SE3.Identity() if q is None else mechanism.placement(q, node)
        robot = mechanism if radius is None else None
        goal, region, _ = read_each(lambda: _goal(table, robot, pose), lambda: _region(table), table.finish)
        return _Aim((), None, goal, *region)
    joints = tuple(table.table("joints"))
    if not joints:
        raise table.error("joints", "is empty: name the joints whose values are the goal")
    if q is None:
        _given(table, mechanism)
        return _Aim(joints)
    end = _configuration(table, mechanism, q.copy())
    end.flags.writeable = False
    return _Aim(joints, end, (mechanism.placement(end, node), 3, 3))


def _goal(table: SceneTable, robot: Mechanism | None, node: pin.SE3) -> tuple[pin.SE3, int, int]:
    """Return the goal pose, and how many of its translations and rotations count (see `Scene`).

    `point` has three numbers, or two: z does not count then. With `rpy` the orientation counts, with `angle` only the
    direction of the node's x axis in the xy plane, rad; with neither, the orientation does not count.

    Args:
        table: of a scene.
        robot: whose reach the point is compared with; None for a mobile robot.
        node: pose of the node at the start: what does not count stays as it is there.
    """

    def point() -> Array:
        given = table.vector("point", 2, 3)
        if robot is not None:
            _check_length(table, robot, "point", given.tolist())
        return given

    def rotation() -> tuple[Array, int]:
        turned, count = table.orientation(), 3 if "rpy" in table else int("angle" in table)
        if count != 1:
            return turned, count
        if np.linalg.norm(node.rotation[:2, 0]) < LEAST:
            raise table.error("angle", "is undefined: the node's x axis is vertical at the start; write rpy")
        return about_z(table.number("angle", ANGLE) - heading(node)) @ node.rotation, 1

    given, (turned, count) = read_each(point, rotation)
    return pin.SE3(turned, np.array([*given, node.translation[2]])[:3]), len(given), count


def _region(table: SceneTable) -> tuple[Array | None, float | None]:
    """Return `tolerance`, half of the size of a box about the goal's point, m; and `cone`, rad."""

    def tolerance() -> Array | None:
        size = table.vector("tolerance", 3) if "tolerance" in table else None
        if size is not None and (size < 0.0).any():
            raise table.error("tolerance", f"must not be below 0, not {size.tolist()}")
        return size

    def cone() -> float | None:
        angle = table.number("cone", ANGLE) if "cone" in table else None
        if angle is not None and not 0.0 <= angle <= np.pi:
            raise table.error("cone", f"must be an angle from 0 to 180 deg, not {shown(angle, ANGLE, 6)}")
        if angle is not None and "rpy" not in table:
            raise table.error("cone", "needs rpy: its axis is z of the goal's orientation")
        return angle

    box, angle = read_each(tolerance, cone)
    if (box is not None or angle is not None) and "angle" in table:
        raise table.error("angle", "cannot be combined with a region: write rpy, and cone, or leave it out")
    return box, angle


def _path_constraints(table: SceneTable, radius: float | None) -> PathConstraints:
    """Return `upright`, and the direction of a `line` or the normal of a `plane`."""
    if "path" not in table:
        return UNCONSTRAINED
    if radius is not None:
        raise table.error("path", "is for robots: a mobile robot has no constraints along its path")
    inner = table.table("path")
    upright, line, plane, _ = read_each(
        lambda: "upright" in inner and inner.flag("upright"),
        lambda: inner.direction("line", 3) if "line" in inner else None,
        lambda: inner.direction("plane", 3) if "plane" in inner else None,
        inner.finish,
    )
    if line is not None and plane is not None:
        raise inner.error("plane", "cannot be combined with line: remove one of them")
    return PathConstraints(upright, line, plane)


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
        return json.loads(text, object_pairs_hook=_unique)
    except json.JSONDecodeError as error:
        raise SceneError(f"{path}:{error.lineno}:{error.colno}: invalid JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{path}: invalid JSON: {error}") from None


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"key '{next(key for key in keys if keys.count(key) > 1)}' occurs twice in a table")
    return found
