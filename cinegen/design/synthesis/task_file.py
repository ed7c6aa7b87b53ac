"""Task files of a synthesis.

    ties = ["link2.d = link4.d"]

    [parameters]
    "link2.d" = "150..400mm"

    [reach]
    x = "-150..150mm"
    y = "300..500mm"

    [[objective]]
    maximise = "sigma_1"

    [constraints]
    joint_limits = true

Keys are read strictly: an unknown one is an error that suggests the nearest.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.errors import SceneError
from cinegen.collision.scene_table import SceneTable
from cinegen.design.errors import DesignError
from cinegen.design.synthesis.quantities import QUANTITIES
from cinegen.design.synthesis.region import AXES, Reach
from cinegen.design.synthesis.task import (
    FRONT,
    STARTS,
    DesignClearance,
    DesignErrors,
    DesignLoad,
    DesignObjective,
    Precision,
    SynthesisTask,
)
from cinegen.errors import read_all
from raff2urdf.errors import RaffError, did_you_mean, raised_as
from raff2urdf.files import read_bytes
from raff2urdf.quantities import ANGLE, LENGTH, MASS, NUMBER, Dimension, parse, parse_range, refused_as

_MOST = 10_000  # starts, points of a front
_BOUNDED = {"condition": NUMBER, "mass": MASS, "accuracy": LENGTH}


def load_task(path: str | Path) -> SynthesisTask | Precision:
    """Return the task of a TOML file; numbers without a unit are in m and degrees.

    Raises:
        DesignError: the file can't be read, or a value is invalid; the message names the file and the key.
    """
    try:
        values = tomllib.loads(read_bytes(path).decode())
    except RaffError as error:
        raise DesignError(str(error)) from None
    except (ValueError, RecursionError) as error:
        raise DesignError(f"{path}: invalid TOML: {error}") from None
    return task_of(values, str(path))


def task_of(values: Mapping[str, Any], where: str = "task") -> SynthesisTask | Precision:
    """Return the task of the keys and values that a file would have.

    Raises:
        DesignError: a value is invalid; the message names the key.
    """
    with raised_as(DesignError, SceneError):
        return _task(SceneTable(values, where, "deg"), values)


def _task(table: SceneTable, values: Mapping[str, Any]) -> SynthesisTask | Precision:
    common: dict[str, Callable[[], Any]] = {
        "parameters": lambda: _parameters(table.table("parameters")),
        "ties": lambda: tuple(table.names("ties")) if "ties" in table else (),
        "node": lambda: table.text("node") if "node" in table else "",
    }
    kinds = [key for key in ("path", "guidance", "function") if key in table]
    if kinds:
        of_kind = {"points": lambda: _precision(table, kinds), "rest": lambda: None if kinds[1:] else table.finish()}
        read = read_all({**common, "starts": lambda: _count(table, "starts", 200), **of_kind}, SceneError)
        points, rows, joints = read["points"]
        return Precision(read["parameters"], points, read["ties"], read["node"], rows, joints, read["starts"])
    reads = {
        **common,
        "reach": lambda: _reach(table.table("reach")),
        "objectives": lambda: _objectives(table),
        "starts": lambda: _count(table, "starts", STARTS),
        "front": lambda: _count(table, "front", FRONT, 2),
        "constraints": lambda: _constraints(table.table("constraints")) if "constraints" in table else {},
        "load": lambda: _load(table.table("load")) if "load" in table else DesignLoad(),
        "errors": lambda: _errors(table.table("tolerances")) if "tolerances" in table else DesignErrors(),
        "rest": table.finish,
    }
    settings = read_all(reads, SceneError)
    del settings["rest"]
    settings |= settings.pop("constraints")
    task = SynthesisTask(**settings, written=dict(values))
    _check_needs(table, task)
    return task


def _parameters(table: SceneTable) -> dict[str, str]:
    if not [*table]:
        raise table.error("a parameter", 'is missing: write for example "link2.d" = "150..400mm"')
    return read_all({name: partial(table.text, name) for name in table}, SceneError)


def _objectives(table: SceneTable) -> tuple[DesignObjective, ...]:
    reads = {str(i): partial(_objective, each) for i, each in enumerate(table.tables("objective"))}
    objectives = tuple(read_all(reads, SceneError).values())
    if not objectives:
        raise table.error("objective", "is missing: write [[objective]], several of them for a Pareto front")
    if len(set(objectives)) < len(objectives):
        raise table.error("objective", "is given twice: a Pareto front has different ones")
    return objectives


def _check_needs(table: SceneTable, task: SynthesisTask) -> None:
    if task.uses("accuracy") != (task.errors != DesignErrors()):
        why = "is missing: accuracy is that by tolerances" if task.uses("accuracy") else "is of no use without accuracy"
        raise table.error("tolerances", f'{why}: sigma = {{ "link*.d" = "0.05mm" }}')
    if task.load != DesignLoad() and not task.uses("torque"):
        raise table.error("load", "is of no use: no objective and no constraint is a torque")
    if task.proved and (len(task.reach.given) or not task.reach.varying):
        raise table.error("constraints.proved", "needs a region with an extent: give x = ..., or a radius, in [reach]")
    if task.grows and len(task.reach.given):
        raise table.error("objective", "'region' grows a box or a ball, not single points: give x = ..., or a radius")
    if task.grows and not task.reach.varying:
        raise table.error("objective", "'region' needs a region with an extent")


def _constraints(table: SceneTable) -> dict[str, Any]:
    bounds: dict[str, Callable[[], float | str]] = {
        name: partial(_positive, table, name, dimension) for name, dimension in _BOUNDED.items() if name in table
    }
    if "torque" in table:  # its dimension depends on the mechanism
        bounds["torque"] = lambda: _text_or_number(table, "torque")
    reads = {
        "joint_limits": lambda: table.flag("joint_limits") if "joint_limits" in table else True,
        "proved": lambda: table.flag("proved"),
        "singular_values": lambda: _singular_values(table),
        "size": lambda: _bounded_size(table.table("size")),
        "most": lambda: read_all(bounds, SceneError),
        "clearance": lambda: _clearance(table),
    }
    present = {key: read for key, read in reads.items() if key in table or key in ("joint_limits", "most")}
    values = read_all({**present, "rest": table.finish}, SceneError)
    del values["rest"]
    return values


def _singular_values(table: SceneTable) -> tuple[float, float]:
    low, high = _range(table, "singular_values", NUMBER)
    if low <= 0.0:
        raise table.error("singular_values", "must begin above 0: a robot with a smaller one is singular")
    return low, high


def _bounded_size(table: SceneTable) -> tuple[tuple[str, ...], float]:
    size = tuple(table.names("of")), table.size("most")
    table.finish()
    return size


def _clearance(table: SceneTable) -> DesignClearance:
    if not table.has_table("clearance"):
        raise table.error("clearance", 'must be a table, such as { least = "20mm", radius = "15mm" }')
    inner = table.table("clearance")
    least = inner.size("least")
    radius = inner.size("radius") if "radius" in inner else 0.0
    obstacles = []
    for obstacle in inner.tables("obstacle"):
        ends = [tuple(obstacle.vector(key, 3).tolist()) for key in ("from", "to" if "to" in obstacle else "from")]
        obstacles.append((ends[0], ends[1], obstacle.size("radius")))
        obstacle.finish()
    inner.finish()
    return DesignClearance(least, radius, tuple(obstacles))


def _load(table: SceneTable) -> DesignLoad:
    values = read_all(
        {
            "payload": lambda: _positive(table, "payload", MASS) if "payload" in table else 0.0,
            "wrench": lambda: table.vector("wrench", 6, dimension=NUMBER) if "wrench" in table else np.zeros(6),
            "gravity": lambda: table.vector("gravity", 3, dimension=NUMBER) if "gravity" in table else np.zeros(0),
            "rest": table.finish,
        },
        SceneError,
    )
    return DesignLoad(values["payload"], tuple(values["wrench"].tolist()), tuple(values["gravity"].tolist()))


def _errors(table: SceneTable) -> DesignErrors:
    errors = {}
    for key in ("sigma", "play", "encoder"):
        inner = table.table(key) if key in table else SceneTable({}, table.where)
        errors[key] = tuple(read_all({name: partial(inner.text, name) for name in inner}, SceneError).items())
    table.finish()
    if not any(errors.values()):
        raise table.error("sigma", 'is missing: write sigma = { "link*.d" = "0.05mm" }, play or encoder')
    return DesignErrors(**errors)


def _precision(table: SceneTable, kinds: list[str]) -> tuple[Array, tuple[int, ...], tuple[str, ...]]:
    """Return the precision points of `[path]`, `[guidance]` or `[function]`, their rows of a twist, and joints."""
    if len(kinds) > 1:
        raise table.error(kinds[1], f"cannot be combined with {kinds[0]}: remove one of them")
    inner = table.table(kinds[0])
    key = {"path": "points", "guidance": "poses", "function": "pairs"}[kinds[0]]
    joints = tuple(inner.text(name) for name in ("input", "output")) if kinds[0] == "function" else ()
    if len(joints) > len(set(joints)):
        raise inner.error("output", "must be another joint than the input")
    columns = {"path": (LENGTH,) * 2, "guidance": (LENGTH, LENGTH, ANGLE), "function": (ANGLE,) * 2}
    points = inner.rows(key, columns[kinds[0]])
    inner.finish()
    if len(points) < 2:
        raise inner.error(key, "must be two or more")
    return points, (0, 1, 5) if kinds[0] == "guidance" else (0, 1), joints


# --- where the node must get to --------------------------------------------------------------------------------------


def _reach(table: SceneTable) -> Reach:
    keeps = False
    if "orientation" in table:
        text = table.text("orientation")
        if text not in ("free", "home"):
            raise table.error("orientation", f"must be 'free' or 'home', not '{text}'{did_you_mean(text, ['home'])}")
        keeps = text == "home"
    if "points" in table:
        return _points(table, keeps)
    if "poses" in table:
        if keeps:
            raise table.error("orientation", "cannot be combined with poses, which state theirs: remove it")
        poses = table.rows("poses", (LENGTH,) * 3 + (ANGLE,) * 3)
        table.finish()
        if not len(poses):
            raise table.error("poses", "is empty")
        targets = np.array([[*row[:3], *pin.log3(pin.rpy.rpyToMatrix(row[3:]))] for row in poses])
        return Reach(AXES, poses[:, :3].min(0), poses[:, :3].max(0), targets, 0.0, True, True)
    table.know("axes")
    axes = tuple(axis for axis in AXES if axis in table)
    ends = list(read_all({axis: partial(_range, table, axis, LENGTH) for axis in axes}, SceneError).values())
    if not axes:
        raise table.error("x", 'is missing: write the box, for example x = "-150..150mm", or points')
    radius = table.size("radius") if "radius" in table else 0.0
    table.finish()
    low, high = np.array(ends).T
    if radius:
        wide = [axis for axis, a, b in zip(axes, low, high, strict=True) if a < b]
        if wide:
            raise table.error(wide[0], "is a range: with a radius each coordinate has one value, that of the centre")
        low, high = low - radius, high + radius
    return Reach(axes, low, high, radius=radius, is_oriented=keeps)


def _points(table: SceneTable, keeps: bool) -> Reach:
    axes = tuple(table.names("axes")) if "axes" in table else AXES
    if not axes or len(set(axes)) < len(axes) or not set(axes) <= set(AXES):
        raise table.error("axes", f"must be some of x, y and z, not {list(axes)}")
    points = np.array(table.points("points", len(axes)))
    if not len(points):
        raise table.error("points", "is empty")
    table.finish()
    order = [axes.index(axis) for axis in AXES if axis in axes]
    points = points[:, order]
    targets = np.hstack([points, np.zeros((len(points), 3))]) if keeps else points
    return Reach(tuple(axes[i] for i in order), points.min(0), points.max(0), targets, 0.0, keeps)


# --- values ----------------------------------------------------------------------------------------------------------


def _range(table: SceneTable, key: str, dimension: Dimension) -> tuple[float, float]:
    """Return both ends of a range, or one number twice."""
    try:
        text = table.text(key)
    except SceneError:
        value = table.number(key, dimension)
        return value, value
    with refused_as(partial(table.error, key), "is wrong"):
        ends = parse_range(text, dimension) if ".." in text else (parse(text, dimension),) * 2
    if ends[0] > ends[1] or (dimension is NUMBER and ends[0] == ends[1]):
        raise table.error(key, f"'{text}' is no range: give the lower end first")
    return ends[0], ends[1]


def _positive(table: SceneTable, key: str, dimension: Dimension) -> float:
    value = table.number(key, dimension)
    if value <= 0.0:
        raise table.error(key, f"must be above 0, not {value:g}")
    return value


def _text_or_number(table: SceneTable, key: str) -> float | str:
    try:
        return table.text(key)
    except SceneError:
        return _positive(table, key, NUMBER)


def _objective(table: SceneTable) -> DesignObjective:
    goals = [key for key in ("minimise", "maximise") if key in table]
    if len(goals) != 1:
        raise table.error("minimise or maximise", "must be given, and only one of them")
    name = table.text(goals[0])
    if name not in QUANTITIES:
        raise table.error(
            goals[0], f"'{name}' is none of {', '.join(QUANTITIES)}{did_you_mean(name, list(QUANTITIES))}"
        )
    quantity = QUANTITIES[name]
    if quantity.better != goals[0]:
        raise table.error(goals[0], f"'{name}': a robot is better in the opposite direction: write {quantity.better}")
    over = table.text("over") if "over" in table else "worst"
    if over not in ("worst", "mean"):
        raise table.error("over", f"must be 'worst' or 'mean', not '{over}'")
    if over == "mean" and not quantity.pointwise:
        raise table.error("over", f"is of no use: {name} is one number, not one at each point")
    of = tuple(table.names("of")) if "of" in table else ()
    if (name == "size") != bool(of):
        raise table.error("of", "names the lengths that size adds, and only size has it")
    table.finish()
    return DesignObjective(name, over, of)


def _count(table: SceneTable, key: str, default: int, least: int = 1) -> int:
    if key not in table:
        return default
    value = table.number(key, NUMBER)
    if value != int(value) or not least <= value <= _MOST:
        raise table.error(key, f"must be a whole number from {least} to {_MOST}, not {value:g}")
    return int(value)
