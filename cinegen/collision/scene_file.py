"""Scenes read from files, TOML or JSON, and from keys and values."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
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
from cinegen.collision.scene_table import LEAST, SceneTable, about_z, read_all
from cinegen.errors import CinegenError, ClosureError
from cinegen.model import Mechanism
from cinegen.model.load import load_with
from cinegen.model.plausible import FAR, ImplausibleError, check_joint, check_lengths
from cinegen.tolerances import AT_LIMIT
from raff2urdf.errors import RaffError, did_you_mean
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
    given_values = read_all(
        {
            "name": lambda: table.text("name") if "name" in table else name,
            "distances": lambda: _distances(table),
            "up": lambda: table.direction("up", 3) if "up" in table else None,
            "obstacles": lambda: _obstacles(table, folder),
            "start": lambda: table.table("start") if "start" in table else SceneTable({}, f"{table.where}: start"),
            "goal": lambda: _goal_table(table),
            "rest": table.finish,  # before the robot is loaded, which may take a while
        }
    )
    name, up, obstacles, start, goal = (given_values[key] for key in ("name", "up", "obstacles", "start", "goal"))
    safety, own, influence = given_values["distances"]

    mechanism, written, radius = _robot(table, folder, given, settings)
    node = table.text("node") if "node" in table else mechanism.end
    table.check_name("node", node, mechanism.nodes, f"a node of {mechanism.name}")
    allowed = _allowed(table, mechanism)
    if radius is None:
        _check_lengths(table, mechanism, safety, influence, obstacles)
    q = _mobile_start(start) if radius is not None else _configuration(start, mechanism, np.array(mechanism.q_home))
    q.flags.writeable = False
    joints, end, region = tuple[str, ...](), None, _Region(None, None)
    if "path" in table and radius is not None:
        raise table.error("path", "is for robots: a mobile robot has no constraints along its path")
    constraints = _path_constraints(table.table("path")) if "path" in table else UNCONSTRAINED
    if "joints" in goal:
        joints = tuple(goal.table("joints"))
        if not joints:
            raise goal.error("joints", "is empty: name the joints whose values are the goal")
        end = _configuration(goal, mechanism, q.copy())
        end.flags.writeable = False
        aim = mechanism.placement(end, node), 3, 3
    else:
        region = _region(goal)
        aim = _goal(goal, mechanism if radius is None else None, mechanism.placement(q, node))
    locked = _locked(table, mechanism, joints) if "locked" in table else unmoving_joints(mechanism, node, joints)
    attached = _attached(table, folder, mechanism, node, obstacles) if "attached" in table else ()
    if attached and radius is not None:
        raise table.error("attached", "is for robots: nothing is attached to a mobile robot")
    weights = _weights(table.table("weights"), mechanism) if "weights" in table else {}
    return Scene(
        name, path, folder, mechanism, written, radius, obstacles, q, node, *aim, safety, influence, up, allowed,
        joints, end, locked, *region, constraints, own, attached, weights,
    )  # fmt: skip


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

    read_all({str(i): partial(add, each, i) for i, each in enumerate(table.tables("obstacle"), 1)})
    return tuple(obstacles.values())


def _attached(
    table: SceneTable, folder: Path, mechanism: Mechanism, node: str, obstacles: Sequence[Obstacle]
) -> tuple[Attached, ...]:
    """Return the objects that the robot holds, by default at the node that is to reach the goal."""
    objects, names = list[Attached](), {obstacle.name for obstacle in obstacles} | set(mechanism.nodes)
    for number, each in enumerate(table.tables("attached"), 1):
        held = read_attached(each, number, folder, mechanism, node, obstacles)
        if held.name in names:
            raise each.error("name", f"'{held.name}' is used by another object or node")
        names.add(held.name)
        objects.append(held)
    return tuple(objects)


def _weights(table: SceneTable, mechanism: Mechanism) -> dict[str, float]:
    """Return weights above 0, by the names of joints."""
    for name in table:
        if name not in mechanism.joints:
            raise table.error(f"'{name}'", f"is not a joint of {mechanism.name}{did_you_mean(name, mechanism.joints)}")
    weights = {name: table.number(name, NUMBER) for name in mechanism.joints if name in table}
    for name, weight in weights.items():
        if not 1e-2 <= weight <= 1e2:
            raise table.error(name, f"must be a weight from 0.01 to 100, not {weight:g}")
    return weights


def _allowed(table: SceneTable, mechanism: Mechanism) -> tuple[tuple[str, str], ...]:
    """Return the pairs of nodes that are not checked against each other."""
    pairs = table.pairs("allowed_collisions") if "allowed_collisions" in table else []
    for pair in pairs:
        for name in pair:
            table.check_name("allowed_collisions", name, mechanism.nodes, f"a node of {mechanism.name}")
        if pair[0] == pair[1]:
            raise table.error("allowed_collisions", f"names '{pair[0]}' twice in one pair: name two nodes")
    return tuple((first, second) for first, second in pairs)


def _locked(table: SceneTable, mechanism: Mechanism, goal: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that keep their values of the start."""
    names = table.names("locked")
    for name in names:
        table.check_name("locked", name, mechanism.joints, f"a joint of {mechanism.name}")
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


def _check_lengths(
    table: SceneTable, robot: Mechanism, safety: float, influence: float | None, obstacles: tuple[Obstacle, ...]
) -> None:
    """Refuse distances and obstacles that would fit in mm only."""
    _check_length(table, robot, "safety", [safety], 1.0)
    if influence is not None:
        _check_length(table, robot, "influence", [influence])
    for obstacle in obstacles:
        _check_length(
            table, robot, f"obstacle '{obstacle.name}'", obstacle.placement.translation.tolist(), _FAR_OBSTACLE
        )


def _check_length(table: SceneTable, robot: Mechanism, name: str, values: list[float], far: float = FAR) -> None:
    try:
        check_lengths(robot, name, values, far)
    except ImplausibleError as error:
        raise SceneError(f"{table.where}: {error}") from None


# --- start and goal ----------------------------------------------------------------------------------------------


def _mobile_start(table: SceneTable) -> Array:
    """Return the configuration of a mobile robot at `point`, the origin by default."""
    x, y = table.vector("point", 2).tolist() if "point" in table else (0.0, 0.0)
    table.finish()
    return mobile_robot().configuration({X: x, Y: y})


def _configuration(table: SceneTable, mechanism: Mechanism, home: Array) -> Array:
    """Return the configuration (nq,) of a start or a goal, loops closed, within all limits.

    `joints` are names and values, of ball joints quaternions (x y z w); the other joints are as in `home` (nq,): a
    start's at home, a goal's at the start. A floating base is placed by `point` and `rpy`. With loops, actuated joints
    have the given values, and the others follow the motion of these from `home`; unless a passive joint is named, too:
    the values are then the guess from which the loops are closed.

    Raises:
        SceneError: a joint is unknown or beyond its limits, or the loops can't be closed.
    """
    values = _joint_values(table.table("joints"), mechanism) if "joints" in table else {}
    if mechanism.floating and ("point" in table or "rpy" in table or "angle" in table):
        home[:7] = pin.SE3ToXYZQUAT(table.pose())
    table.finish()
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


def _joint_values(table: SceneTable, mechanism: Mechanism) -> dict[str, float | Array]:
    known, values = (*mechanism.joints, *mechanism.balls), dict[str, float | Array]()
    for name in table:
        if name not in known:
            raise table.error(f"'{name}'", f"is not a joint of {mechanism.name}{did_you_mean(name, known)}")
    for name in table:
        if name in mechanism.balls:
            values[name] = table.vector(name, 4, dimension=NUMBER)
            continue
        values[name] = value = table.number(name, LENGTH if mechanism.is_prismatic(name) else ANGLE)
        try:
            check_joint(mechanism, name, [value])
        except ImplausibleError as error:
            raise SceneError(f"{table.where}: {error}") from None
    return values


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


def _goal(table: SceneTable, robot: Mechanism | None, node: pin.SE3) -> tuple[pin.SE3, int, int]:
    """Return the goal pose, and how many of its translations and rotations count (see `Scene`).

    `point` has three numbers, or two: z does not count then. With `rpy` the orientation counts, with `angle` only the
    direction of the node's x axis in the xy plane, rad; with neither, the orientation does not count.

    Args:
        table: of a scene.
        robot: whose reach the point is compared with; None for a mobile robot.
        node: pose of the node at the start: what does not count stays as it is there.
    """
    given = table.vector("point", 2, 3)
    if robot is not None:
        _check_length(table, robot, "point", given.tolist())
    point = np.array([*given, node.translation[2]])[:3]
    rotation, count = table.orientation(), 3 if "rpy" in table else int("angle" in table)
    if count == 1:
        if np.linalg.norm(node.rotation[:2, 0]) < LEAST:
            raise table.error("angle", "is undefined: the node's x axis is vertical at the start; write rpy")
        rotation = about_z(table.number("angle", ANGLE) - heading(node)) @ node.rotation
    table.finish()
    return pin.SE3(rotation, point), len(given), count


class _Region(NamedTuple):
    """`Scene.tolerance` and `Scene.cone`."""

    tolerance: Array | None
    cone: float | None


def _region(table: SceneTable) -> _Region:
    """Return `tolerance`, half of the size of a box about the goal's point, m; and `cone`, rad."""
    tolerance = table.vector("tolerance", 3) if "tolerance" in table else None
    if tolerance is not None and (tolerance < 0.0).any():
        raise table.error("tolerance", f"must not be below 0, not {tolerance.tolist()}")
    cone = table.number("cone", ANGLE) if "cone" in table else None
    if cone is not None and not 0.0 <= cone <= np.pi:
        raise table.error("cone", f"must be an angle from 0 to 180 deg, not {shown(cone, ANGLE, 6)}")
    if cone is not None and "rpy" not in table:
        raise table.error("cone", "needs rpy: its axis is z of the goal's orientation")
    if (tolerance is not None or cone is not None) and "angle" in table:
        raise table.error("angle", "cannot be combined with a region: write rpy, and cone, or leave it out")
    return _Region(tolerance, cone)


def _path_constraints(table: SceneTable) -> PathConstraints:
    """Return `upright`, and the direction of a `line` or the normal of a `plane`."""
    upright = table.flag("upright") if "upright" in table else False
    line, plane = (table.direction(key, 3) if key in table else None for key in ("line", "plane"))
    if line is not None and plane is not None:
        raise table.error("plane", "cannot be combined with line: remove one of them")
    table.finish()
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
