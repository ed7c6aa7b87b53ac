"""A table of a scene's file, read key by key; what is wrong is said with the file, the table and the key."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.errors import SceneError
from raff2urdf.errors import did_you_mean

Array = NDArray[np.float64]

LEAST = 1e-6
"""m: nothing smaller can be measured."""

FURTHEST = 1e6
"""m or rad: nothing further away can be measured."""


class Table:
    """Keys with values, as TOML and JSON have them. Keys that nobody has asked for are unknown (`finish`).

    Attributes:
        where: the file and the table in it, for errors.
        read: what has been read so far, as JSON can hold it: numbers are floats.

    Raises:
        SceneError: the values are no table.
    """

    def __init__(self, values: Any, where: str) -> None:
        if not isinstance(values, Mapping):
            raise SceneError(f"{where} must be a table of keys and values, not {_shown(values)}")
        self.where = where
        self.read: dict[str, Any] = {}
        self._values = {str(key): value for key, value in values.items()}
        self._asked: list[str] = []

    def __contains__(self, key: str) -> bool:
        """Whether there is such a key; it is a known one from now on."""
        self.know(key)
        return key in self._values

    def __iter__(self) -> Iterator[str]:
        """All its keys."""
        return iter(self._values)

    def know(self, *keys: str) -> None:
        """Makes keys known ones that will be asked for later."""
        self._asked += [key for key in keys if key not in self._asked]

    def is_table(self, key: str) -> bool:
        """Whether a table stands at a key."""
        return key in self and isinstance(self._values[key], Mapping)

    def wrong(self, key: str, why: str) -> SceneError:
        """The error that says what is wrong with a key."""
        return SceneError(f"{self.where}: {key} {why}")

    def finish(self) -> None:
        """To be called when all that may stand here has been asked for.

        Raises:
            SceneError: there is more.
        """
        for key in self._values:
            if key not in self._asked:
                raise SceneError(f"{self.where}: unknown key '{key}'{did_you_mean(key, self._asked)}")

    # Each of these raises SceneError where the key is missing, or its value is none of that kind.

    def number(self, key: str) -> float:
        """Any finite number."""
        return self._keep(key, self._number(key, self._value(key)))

    def size(self, key: str) -> float:
        """A length above 0, m."""
        return self._keep(key, self._size(key, self._value(key)))

    def text(self, key: str) -> str:
        """Some text."""
        value = self._value(key)
        if not isinstance(value, str) or not value.strip():
            raise self.wrong(key, f"must be a text, not {_shown(value)}")
        self.read[key] = value
        return value

    def file(self, key: str, folder: Path) -> Path:
        """A file that is there, looked for from a folder; `~` is the user's own."""
        said = self.text(key)
        try:
            path = folder / Path(said).expanduser()
            found = path.is_file()
        except (OSError, RuntimeError, ValueError) as error:  # a name too long, or of nobody
            raise self.wrong(key, f"{_shown(said)} can't be read: {error}") from None
        if not found:
            raise self.wrong(key, f"'{path}' is not there")
        return path

    def vector(self, key: str, *lengths: int) -> Array:
        """So many numbers."""
        found = self._numbers(key, self._value(key), lengths)
        self.read[key] = found
        return np.array(found)

    def sizes(self, key: str, *lengths: int) -> Array:
        """So many lengths above 0, m."""
        found = self.vector(key, *lengths)
        for value in found:
            self._size(key, value)
        return found

    def direction(self, key: str, *lengths: int) -> Array:
        """(3,) a unit vector; z is 0 where two numbers are given."""
        found = np.zeros(3)
        given = self.vector(key, *lengths)
        found[: len(given)] = given
        length = float(np.linalg.norm(found))
        if length < LEAST:
            raise self.wrong(key, f"must be a direction: {given.tolist()} has no length")
        return found / length

    def points(self, key: str, *lengths: int) -> list[Array]:
        """A list of points, each of so many numbers, m."""
        value = self._value(key)
        if not _is_list(value):
            raise self.wrong(key, f"must be a list of points, not {_shown(value)}")
        found = [self._numbers(f"{key}: point {i}", point, lengths) for i, point in enumerate(value, 1)]
        self.read[key] = found
        return [np.array(point) for point in found]

    def names(self, key: str, length: int) -> list[list[str]]:
        """A list of lists, each of so many texts."""
        value = self._value(key)
        rows = value if _is_list(value) else [value]
        if not all(_is_list(row) and len(row) == length and all(isinstance(name, str) for name in row) for row in rows):
            raise self.wrong(key, f"must be a list of lists of {length} names each, not {_shown(value)}")
        found = [list(row) for row in rows]
        self.read[key] = found
        return found

    def inner(self, key: str) -> Table:
        """A table in this one."""
        found = Table(self._value(key), f"{self.where}: {key}")
        self.read[key] = found.read
        return found

    def each(self, key: str) -> list[Table]:
        """The tables of a list; none where the key is missing. Errors call each by its number and name."""
        if key not in self:
            return []
        value = self._value(key)
        if not _is_list(value):
            raise self.wrong(key, f"must be a list of tables ([[{key}]] in TOML), not {_shown(value)}")
        found = []
        for number, values in enumerate(value, 1):
            name = values.get("name") if isinstance(values, Mapping) else None
            called = f" '{name}'" if isinstance(name, str) else ""
            found.append(Table(values, f"{self.where}: {key} {number}{called}"))
        return found

    def _keep(self, key: str, value: float) -> float:
        self.read[key] = value
        return value

    def _value(self, key: str) -> Any:
        if key in self:
            return self._values[key]
        near = get_close_matches(key, [other for other in self._values if other not in self._asked], n=1)
        raise self.wrong(key, f"is missing: is '{near[0]}' meant to be it?" if near else "is missing")

    def _number(self, key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, Real):
            raise self.wrong(key, f"must be a number, not {_shown(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.wrong(key, f"must be finite, not {number}")
        if abs(number) > FURTHEST:
            raise self.wrong(key, f"is {number:g}: nothing beyond {FURTHEST:g} can be measured")
        return number

    def _numbers(self, key: str, value: Any, lengths: tuple[int, ...]) -> list[float]:
        if not _is_list(value) or len(value) not in lengths:
            wanted = " or ".join(map(str, lengths))
            raise self.wrong(key, f"must be a list of {wanted} numbers, not {_shown(value)}")
        return [self._number(key, number) for number in value]

    def _size(self, key: str, value: Any) -> float:
        number = self._number(key, value)
        if number <= 0.0:
            raise self.wrong(key, f"must be above 0, not {number}")
        if number < LEAST:
            raise self.wrong(key, f"is {number:g} m: nothing smaller than {LEAST:g} can be measured")
        return number


def _is_list(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _shown(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
