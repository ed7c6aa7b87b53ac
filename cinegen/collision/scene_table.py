"""Tables of a scene file: keys are read one by one, and errors name the file, the table and the key."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from numbers import Real
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.errors import SceneError
from cinegen.errors import read_all
from cinegen.model import Mechanism
from raff2urdf.errors import did_you_mean, near_names
from raff2urdf.files import note
from raff2urdf.quantities import ANGLE, LENGTH, NUMBER, Dimension, parse, refused_as
from raff2urdf.shipped import robots, similar_file

_Value = TypeVar("_Value")

LEAST = 1e-6
"""Least size that can be measured, m."""

FURTHEST = 1e6
"""Largest coordinate that can be measured, m or rad."""


class SceneTable:
    """Keys and values of a TOML or JSON table. Keys that were never asked for are unknown, see `finish`.

    Numbers may be strings with a unit, such as "250 mm". Without a unit lengths are in m.

    Args:
        values: the keys and values.
        where: file and table, for error messages.
        angle: unit of angles without one, deg or rad.

    Attributes:
        where: file and table, for error messages.
        read: values read so far, as JSON can hold them: numbers are floats, in m and rad.

    Raises:
        SceneError: the values are not a table; and in each method: a key is missing, or its value has a wrong type.
    """

    def __init__(self, values: Any, where: str, angle: str = "rad") -> None:
        if not isinstance(values, Mapping):
            raise SceneError(f"{where} must be a table of keys and values, not {_shown(values)}")
        self.where = where
        self.read: dict[str, Any] = {}
        self._angle = angle
        self._values = {str(key): value for key, value in values.items()}
        self._known: list[str] = []

    def __contains__(self, key: str) -> bool:
        """Return whether a key exists; it is a known key from now on."""
        self.know(key)
        return key in self._values

    def __iter__(self) -> Iterator[str]:
        """Return an iterator over all keys."""
        return iter(self._values)

    def know(self, *keys: str) -> None:
        """Declare keys that will be asked for later."""
        self._known += [key for key in keys if key not in self._known]

    def finish(self) -> None:
        """Raise SceneError if a key is unknown. Call it after all valid keys were asked for."""
        unknown = [key for key in self._values if key not in self._known]
        read_each(*(partial(self._refuse, key) for key in unknown))

    def _refuse(self, key: str) -> None:
        raise SceneError(f"{self.where}: unknown key '{key}'{did_you_mean(key, self._known)}")

    def error(self, key: str, why: str) -> SceneError:
        """Return the error that reports what is wrong with a key."""
        return SceneError(f"{self.where}: {key} {why}")

    def node(self, key: str, mechanism: Mechanism, default: str = "") -> str:
        """Return the name of a node; the default, or else the end, where the key is missing."""
        if key not in self:
            return default or mechanism.end
        return self.check_name(key, self.text(key), mechanism.nodes, f"a node of {mechanism.name}")

    def check_name(self, key: str, name: str, known: Sequence[str], what: str) -> str:
        """Return the name in a key, or with "" the key itself, which must be among the known ones."""
        if name not in known:
            raise self.error(f"{key} '{name}'".lstrip(), f"is not {what}{did_you_mean(name, known)}")
        return name

    # --- values --------------------------------------------------------------------------------------------------

    def number(self, key: str, dimension: Dimension = LENGTH) -> float:
        """Return a finite number of a dimension, m or rad."""
        return self._keep(key, self._number(key, self._value(key), dimension))

    def size(self, key: str, default: float | None = None) -> float:
        """Return a length above 0, m; the default, if there is one, where the key is missing."""
        if default is not None and key not in self:
            return default
        return self._keep(key, self._size(key, self._value(key)))

    def flag(self, key: str) -> bool:
        """Return true or false."""
        value = self._value(key)
        if not isinstance(value, bool):
            raise self.error(key, f"must be true or false, not {_shown(value)}")
        return self._keep(key, value)

    def text(self, key: str) -> str:
        """Return a string that is not blank."""
        value = self._value(key)
        if not isinstance(value, str) or not value.strip():
            raise self.error(key, f"must be a string, not {_shown(value)}")
        return self._keep(key, value)

    def file(self, key: str, folder: Path) -> Path:
        """Return the path of an existing file, relative to a folder; `~` is the user's home."""
        text = self.text(key)
        try:
            path = folder / Path(text).expanduser()
            note(path)
            exists = path.is_file()
        except (OSError, RuntimeError, ValueError) as error:  # the name is too long, or the user unknown
            raise self.error(key, f"{_shown(text)} can't be read: {error}") from None
        if not exists:
            raise self.error(key, f"'{path}' does not exist{similar_file(path)}")
        return path

    def robot_file(self, key: str, folder: Path) -> Path:
        """Return the path of a robot's file, as `file`; of the shipped robot of that name, if there is no such file."""
        text = self.text(key)
        shipped = robots()
        return shipped[text] if text in shipped and not (folder / text).is_file() else self.file(key, folder)

    def vector(self, key: str, *lengths: int, dimension: Dimension = LENGTH) -> Array:
        """Return a vector of one of these lengths, m or rad."""
        return np.array(self._keep(key, self._numbers(key, self._value(key), lengths, dimension)))

    def sizes(self, key: str, *lengths: int) -> Array:
        """Return a vector of lengths above 0, m."""
        sizes = self.vector(key, *lengths)
        for value in sizes:
            self._size(key, value)
        return sizes

    def direction(self, key: str, *lengths: int) -> Array:
        """Return a unit vector (3,); z is 0 if two numbers are given."""
        numbers = self.vector(key, *lengths, dimension=NUMBER)
        vector = np.pad(numbers, (0, 3 - len(numbers)))
        length = float(np.linalg.norm(vector))
        if length < LEAST:
            raise self.error(key, f"must be a direction: {numbers.tolist()} has length 0")
        return vector / length

    def points(self, key: str, *lengths: int) -> list[Array]:
        """Return a list of points, each of one of these lengths, m."""
        value = self._value(key)
        if not _is_list(value):
            raise self.error(key, f"must be a list of points, not {_shown(value)}")
        points = [self._numbers(f"{key}: point {i}", point, lengths) for i, point in enumerate(value, 1)]
        return [np.array(point) for point in self._keep(key, points)]

    def rows(self, key: str, dimensions: Sequence[Dimension]) -> Array:
        """Return rows (n, columns) of numbers, each column of a dimension, m and rad."""
        value = self._value(key)
        if not _is_list(value) or not all(_is_list(row) and len(row) == len(dimensions) for row in value):
            raise self.error(key, f"must be a list of rows of {len(dimensions)} numbers, not {_shown(value)}")
        rows = [
            [self._number(f"{key}: row {i}", x, of) for x, of in zip(row, dimensions, strict=True)]
            for i, row in enumerate(value, 1)
        ]
        return np.array(self._keep(key, rows)).reshape(-1, len(dimensions))

    def array(self, key: str, columns: int) -> Array:
        """Return rows of numbers (n, columns), which may be many and not finite, m."""
        value = self._value(key)
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            array = np.zeros(0)
        if array.ndim != 2 or array.shape[1] != columns:
            raise self.error(key, f"must be a list of rows of {columns} numbers, not {_shown(value)}")
        self._keep(key, array.tolist())
        return array

    def names(self, key: str) -> list[str]:
        """Return a list of names; a single one may be a string."""
        value = self._value(key)
        names = [value] if isinstance(value, str) else value
        if not _is_list(names) or not all(isinstance(name, str) for name in names):
            raise self.error(key, f"must be a list of names, not {_shown(value)}")
        return self._keep(key, list(names))

    def pairs(self, key: str) -> list[list[str]]:
        """Return a list of pairs of names."""
        value = self._value(key)
        rows = value if _is_list(value) else [value]
        if not all(_is_list(row) and len(row) == 2 and all(isinstance(name, str) for name in row) for row in rows):
            raise self.error(key, f"must be a list of pairs of names, not {_shown(value)}")
        return self._keep(key, [list(row) for row in rows])

    # --- poses ---------------------------------------------------------------------------------------------------

    def pose(self) -> pin.SE3:
        """Return the pose given by `point` (with two numbers z is 0), m, and the orientation; identity by default."""
        point, rotation = read_each(
            lambda: self.vector("point", 2, 3) if "point" in self else np.zeros(3), self.orientation
        )
        return pin.SE3(rotation, np.pad(point, (0, 3 - len(point))))

    def orientation(self) -> Array:
        """Return the rotation (3, 3) given by `rpy`, rotations about the fixed x, y and z axes as in a URDF, or by
        `angle`, the rotation about z; rad. Identity by default."""
        if "rpy" in self and "angle" in self:
            raise self.error("angle", "cannot be combined with rpy: remove one of them")
        if "rpy" in self:
            return np.asarray(pin.rpy.rpyToMatrix(self.vector("rpy", 3, dimension=ANGLE)))
        return about_z(self.number("angle", ANGLE) if "angle" in self else 0.0)

    # --- tables --------------------------------------------------------------------------------------------------

    def has_table(self, key: str) -> bool:
        """Return whether the value of a key is a table."""
        return key in self and isinstance(self._values[key], Mapping)

    def table(self, key: str) -> SceneTable:
        """Return a nested table."""
        table = SceneTable(self._value(key), f"{self.where}: {key}", self._angle)
        self.read[key] = table.read
        return table

    def tables(self, key: str) -> list[SceneTable]:
        """Return the tables of a list; none if the key is missing. Errors name each by its number and name."""
        if key not in self:
            return []
        value = self._value(key)
        if not _is_list(value):
            raise self.error(key, f"must be a list of tables ([[{key}]] in TOML), not {_shown(value)}")
        tables = []
        for number, values in enumerate(value, 1):
            name = values.get("name") if isinstance(values, Mapping) else None
            label = f" '{name}'" if isinstance(name, str) else ""
            tables.append(SceneTable(values, f"{self.where}: {key} {number}{label}", self._angle))
        return tables

    # --- checks --------------------------------------------------------------------------------------------------

    def _keep(self, key: str, value: _Value) -> _Value:
        self.read[key] = value
        return value

    def _value(self, key: str) -> Any:
        if key in self:
            return self._values[key]
        near = near_names(key, [other for other in self._values if other not in self._known])
        self.know(*near[:1])
        raise self.error(key, f"is missing: is '{near[0]}' misspelled?" if near else "is missing")

    def _number(self, key: str, value: Any, dimension: Dimension = LENGTH) -> float:
        unit = self._angle if dimension is ANGLE else None
        if isinstance(value, str) and dimension is not NUMBER:
            with refused_as(partial(self.error, key), "is wrong"):
                value, unit = parse(value, dimension, unit), None
        if isinstance(value, bool) or not isinstance(value, Real):
            raise self.error(key, f"must be a number, not {_shown(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(key, f"must be finite, not {number}")
        if unit == "deg":
            number = math.radians(number)
        if abs(number) > FURTHEST:
            raise self.error(key, f"is {number:g}: the largest value is {FURTHEST:g}")
        return number

    def _numbers(self, key: str, value: Any, lengths: tuple[int, ...], dimension: Dimension = LENGTH) -> list[float]:
        if not _is_list(value) or len(value) not in lengths:
            wanted = " or ".join(map(str, lengths))
            raise self.error(key, f"must be a list of {wanted} numbers, not {_shown(value)}")
        return [self._number(key, number, dimension) for number in value]

    def _size(self, key: str, value: Any) -> float:
        number = self._number(key, value)
        if number <= 0.0:
            raise self.error(key, f"must be above 0, not {number}")
        if number < LEAST:
            raise self.error(key, f"is {number:g} m: the least size is {LEAST:g} m")
        return number


def read_each(*reads: Callable[[], Any]) -> list[Any]:
    """Return what functions return that don't need each other; see `read_all`."""
    return [*read_all({str(number): read for number, read in enumerate(reads)}, SceneError).values()]


def about_z(angle: float) -> Array:
    """Return the rotation (3, 3) about z by an angle, rad."""
    return np.asarray(pin.rpy.rpyToMatrix(0.0, 0.0, angle))


def pose_keys(placement: pin.SE3) -> dict[str, Any]:
    """Return the keys that `SceneTable.pose` reads."""
    return {"point": placement.translation.tolist(), "rpy": pin.rpy.matrixToRpy(placement.rotation).tolist()}


def _is_list(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _shown(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
