"""`Recent`: values that take long to make, kept for those who ask again."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

_Value = TypeVar("_Value")


class Recent(Generic[_Value]):
    """The values that were asked for last, by their keys. For one thread at a time.

    Args:
        most: number of values that are kept.
    """

    def __init__(self, most: int) -> None:
        self._most, self._values = most, dict[Hashable, _Value]()

    def get(self, key: Hashable, make: Callable[[], _Value]) -> _Value:
        """Return the value of a key, made where it is not kept."""
        value = self._values.pop(key) if key in self._values else make()
        self._values[key] = value  # the last
        if len(self._values) > self._most:
            del self._values[next(iter(self._values))]
        return value
