"""Task files of a synthesis: what varies, what the node must reach, what is optimised, and what must hold.

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
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.errors import SceneError
from cinegen.collision.scene_table import SceneTable
from cinegen.design.errors import DesignError
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.files import read_bytes
from raff2urdf.quantities import ANGLE, LENGTH, NUMBER, QuantityError, parse, parse_range

Array = NDArray[np.float64]

QUANTITIES = {"sigma_1": "maximise", "sigma_max": "minimise", "condition": "minimise", "size": "minimise"}
"""Quantities of objectives and constraints, and which direction is better."""

FLOOR = 0.01
"""Least distance to singularities of both types unless the task gives one: the smallest singular value, and the inverse
of the largest, dimensionless."""

_AXES = ("x", "y", "z")
_STARTS = 8
_MOST_STARTS = 10_000


@dataclass(frozen=True)
class DesignObjective:
    """One thing that is optimised.

    Attributes:
        quantity: a key of `QUANTITIES`.
        over: "worst" or "mean" over the points to reach.
        of: patterns of the parameters that `size` adds.
    """

    quantity: str
    over: str = "worst"
    of: tuple[str, ...] = ()

    @property
    def is_maximised(self) -> bool:
        """True where a larger value is better."""
        return QUANTITIES[self.quantity] == "maximise"

    @property
    def text(self) -> str:
        """The objective as people read it."""
        of = f" of {', '.join(self.of)}" if self.of else f", {self.over}"
        return f"{QUANTITIES[self.quantity]} {self.quantity}{of}"


@dataclass(frozen=True)
class Reach:
    """Points that the node must reach.

    Attributes:
        axes: coordinates of the world that are given, a part of x, y and z.
        low: (axes,) lower ends of the box, m.
        high: (axes,) upper ends, m; equal to the lower where a coordinate has one value.
        points: (n, axes) instead of a box, m; empty otherwise.
        keeps_orientation: whether the node keeps its orientation at home.
    """

    axes: tuple[str, ...]
    low: Array
    high: Array
    points: Array
    keeps_orientation: bool = False

    @property
    def rows(self) -> list[int]:
        """Components of the node's twist in the world that the task fixes."""
        return [_AXES.index(axis) for axis in self.axes] + [3, 4, 5] * self.keeps_orientation

    def grid(self, count: int) -> Array:
        """Return a regular grid (n, axes) with `count` points along each axis of the box, or the points."""
        if len(self.points):
            return self.points
        lines = [
            np.linspace(low, high, count if high > low else 1) for low, high in zip(self.low, self.high, strict=True)
        ]
        return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, len(self.axes))

    @property
    def varying(self) -> int:
        """Number of axes along which the box is wide."""
        return int((self.high > self.low).sum())


@dataclass(frozen=True)
class Task:
    """Parameters, points to reach, objectives and constraints of a synthesis.

    Attributes:
        parameters: range (low, high) of each parameter that varies, by pattern: m and rad.
        ties: see `cinegen.design.ties`.
        reach: points to reach.
        objectives: one, or two for a Pareto front.
        node: that reaches; empty for the last of the file.
        singular_values: least and greatest singular value, dimensionless.
        joint_limits: whether all joints must be within their limits.
        size: patterns of lengths and the most that their sum may be, m; None without.
        starts: number of starts: the file's values, then a Sobol sequence within the bounds.
        front: number of points of a Pareto front.
    """

    parameters: Mapping[str, tuple[float, float] | str]
    reach: Reach
    objectives: tuple[DesignObjective, ...]
    ties: tuple[str, ...] = ()
    node: str = ""
    singular_values: tuple[float, float] = (FLOOR, 1.0 / FLOOR)
    joint_limits: bool = True
    size: tuple[tuple[str, ...], float] | None = None
    starts: int = _STARTS
    front: int = 9
    written: Mapping[str, Any] = field(default_factory=dict, compare=False)


@dataclass(frozen=True)
class Precision:
    """Precision points of a linkage.

    Attributes:
        parameters: range (low, high) of each parameter that varies, by pattern: m and rad.
        targets: (points, rows) coordinates and angles, or values of joints, m and rad.
        ties: see `cinegen.design.ties`.
        node: that passes points or poses; empty for the last of the file.
        rows: components of the node's twist in the world that are given.
        joints: input and output of a function, instead of a node.
        starts: number of starts at most.
    """

    parameters: Mapping[str, tuple[float, float] | str]
    targets: Array
    ties: tuple[str, ...] = ()
    node: str = ""
    rows: tuple[int, ...] = (0, 1)
    joints: tuple[str, ...] = ()
    starts: int = 200


def load_task(path: str | Path) -> Task | Precision:
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


def task_of(values: Mapping[str, Any], where: str = "task") -> Task | Precision:
    """Return the task of the keys and values that a file would have.

    Raises:
        DesignError: a value is invalid; the message names the key.
    """
    try:
        return _task(SceneTable(values, where, "deg"), values)
    except SceneError as error:
        raise DesignError(str(error)) from None


def _task(table: SceneTable, values: Mapping[str, Any]) -> Task | Precision:
    given = table.table("parameters")
    parameters = {name: given.text(name) for name in given}
    if not parameters:
        raise given.error("a parameter", 'is missing: write for example "link2.d" = "150..400mm"')
    ties = tuple(table.names("ties")) if "ties" in table else ()
    node = table.text("node") if "node" in table else ""
    kinds = [key for key in ("path", "guidance", "function") if key in table]
    if kinds:
        return _precision(table, kinds, parameters, ties, node)
    reach = _reach(table.table("reach"))
    objectives = tuple(_objective(one) for one in table.tables("objective"))
    if not 1 <= len(objectives) <= 2:
        raise table.error("objective", f"must be given once, or twice for a Pareto front, not {len(objectives)} times")
    starts = _count(table, "starts", _STARTS)
    front = _count(table, "front", 9)
    limits, bounds, size = True, (FLOOR, 1.0 / FLOOR), None
    if "constraints" in table:
        own = table.table("constraints")
        limits = own.flag("joint_limits") if "joint_limits" in own else True
        if "singular_values" in own:
            bounds = _range(own, "singular_values")
            if bounds[0] <= 0.0:
                raise own.error("singular_values", "must begin above 0: a robot with a smaller one is singular")
        if "size" in own:
            inner = own.table("size")
            size = (tuple(inner.names("of")), inner.size("most"))
            inner.finish()
        own.finish()
    table.finish()
    return Task(parameters, reach, objectives, ties, node, bounds, limits, size, starts, front, dict(values))


def _precision(
    table: SceneTable, kinds: list[str], parameters: dict[str, str], ties: tuple[str, ...], node: str
) -> Precision:
    """Return the precision points of `[path]`, `[guidance]` or `[function]`."""
    if len(kinds) > 1:
        raise table.error(kinds[1], f"cannot be combined with {kinds[0]}: remove one of them")
    starts = _count(table, "starts", 200)
    own = table.table(kinds[0])
    key = {"path": "points", "guidance": "poses", "function": "pairs"}[kinds[0]]
    joints = tuple(own.text(name) for name in ("input", "output")) if kinds[0] == "function" else ()
    columns = {"path": (LENGTH,) * 2, "guidance": (LENGTH, LENGTH, ANGLE), "function": (ANGLE,) * 2}
    given = own.rows(key, columns[kinds[0]])
    own.finish()
    table.finish()
    if len(given) < 2:
        raise own.error(key, "must be two or more")
    rows = (0, 1, 5) if kinds[0] == "guidance" else (0, 1)
    return Precision(parameters, given, ties, node, rows, joints, starts)


def _reach(table: SceneTable) -> Reach:
    keeps = False
    if "orientation" in table:
        text = table.text("orientation")
        if text not in ("free", "home"):
            raise table.error("orientation", f"must be 'free' or 'home', not '{text}'{did_you_mean(text, ['home'])}")
        keeps = text == "home"
    if "points" in table:
        axes = tuple(table.names("axes")) if "axes" in table else _AXES
        if not axes or len(set(axes)) < len(axes) or not set(axes) <= set(_AXES):
            raise table.error("axes", f"must be some of x, y and z, not {list(axes)}")
        points = np.array(table.points("points", len(axes)))
        if not len(points):
            raise table.error("points", "is empty")
        table.finish()
        return Reach(axes, points.min(0), points.max(0), points, keeps)
    table.know("axes")
    axes = tuple(axis for axis in _AXES if axis in table)
    ends = [_range(table, axis) for axis in axes]
    table.finish()
    if not axes:
        raise table.error("x", 'is missing: write the box, for example x = "-150..150mm", or points')
    low, high = np.array(ends).T
    return Reach(axes, low, high, np.zeros((0, len(axes))), keeps)


def _range(table: SceneTable, key: str) -> tuple[float, float]:
    """Return both ends of a range, or one number twice."""
    dimension = NUMBER if key == "singular_values" else LENGTH
    try:
        text = table.text(key)
    except SceneError:
        value = table.number(key, dimension)
        return value, value
    try:
        ends = parse_range(text, dimension) if ".." in text else (parse(text, dimension),) * 2
    except QuantityError as error:
        raise table.error(key, f"is wrong: {error}") from None
    if ends[0] > ends[1] or (dimension is NUMBER and ends[0] == ends[1]):
        raise table.error(key, f"'{text}' is no range: give the lower end first")
    return ends[0], ends[1]


def _objective(table: SceneTable) -> DesignObjective:
    given = [key for key in ("minimise", "maximise") if key in table]
    if len(given) != 1:
        raise table.error("minimise or maximise", "must be given, and only one of them")
    quantity = table.text(given[0])
    if quantity not in QUANTITIES:
        raise table.error(
            given[0],
            f"'{quantity}' is none of {', '.join(QUANTITIES)}{did_you_mean(quantity, list(QUANTITIES))}",
        )
    if QUANTITIES[quantity] != given[0]:
        raise table.error(given[0], f"'{quantity}': a robot is better the other way: write {QUANTITIES[quantity]}")
    over = table.text("over") if "over" in table else "worst"
    if over not in ("worst", "mean"):
        raise table.error("over", f"must be 'worst' or 'mean', not '{over}'")
    of = tuple(table.names("of")) if "of" in table else ()
    if (quantity == "size") != bool(of):
        raise table.error("of", "names the lengths that size adds, and only size has it")
    table.finish()
    return DesignObjective(quantity, over, of)


def _count(table: SceneTable, key: str, default: int) -> int:
    if key not in table:
        return default
    value = table.number(key, NUMBER)
    if value != int(value) or not 1 <= value <= _MOST_STARTS:
        raise table.error(key, f"must be a whole number from 1 to {_MOST_STARTS}, not {value:g}")
    return int(value)
