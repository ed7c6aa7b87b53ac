"""The numbers of generated code: two tables, one of doubles and one of integers, that hold every array and state of the
kernels' memories. What never changes is a constant of the code instead."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cinegen.jit.memory import Field, Memory

BEGIN = "begin"
"""Last part of the key of a table of places."""


def table_of(dtype: np.dtype[Any]) -> str:
    """Return the name of the table that holds numbers of a type."""
    return "D" if dtype.kind == "f" else "I"


def key_of(memories: Sequence[Memory], name: str) -> tuple[object, ...]:
    """Return the key of a number of memories."""
    return tuple(map(id, memories)), name


@dataclass(frozen=True)
class HeapArray:
    """Position of an array.

    Attributes:
        table: "D" or "I".
        begin: index of its first number.
        shape: its dimensions.
    """

    table: str
    begin: int
    shape: tuple[int, ...]


class Heap:
    """Places of all fields of some memories, each allocated when it is first asked for.

    Args:
        free: names of parameters that the code's user may set: they are states, and no constants.
        structure: names of arrays that nothing writes.

    Attributes:
        values: initial values of both tables, by name.
        unread: names of arrays that nothing reads.
    """

    def __init__(self, free: Collection[str] = (), structure: Collection[str] = ()) -> None:
        self.values: dict[str, list[float]] = {"D": [], "I": []}
        self._free, self._structure = frozenset(free), frozenset(structure)
        self.unread = frozenset[str]()
        self._changing: frozenset[tuple[object, ...]] | None = None
        self._asked = set[tuple[object, ...]]()
        self._places: dict[tuple[object, ...], HeapArray] = {}
        self._initial: dict[tuple[object, ...], np.ndarray] = {}

    def sorted(self, changing: frozenset[tuple[object, ...]] | None, unread: frozenset[str]) -> Heap:
        """Return a heap with the fields that were used, those that are not 0 first: only these need initial values.

        Args:
            changing: keys of all states that kernels change; others are constants. Not known yet if None.
            unread: names of arrays that nothing reads.
        """
        heap = Heap(self._free, self._structure)
        kept = [key for key in self._places if key in self._asked and key[-1] != BEGIN]  # these have places of others
        for key in sorted(kept, key=lambda key: not self._initial[key].any()):
            heap.allocate(key, self._initial[key])
        heap._asked.clear()
        heap._changing, heap.unread = changing, unread
        return heap

    def allocate(self, key: tuple[object, ...], values: np.ndarray) -> HeapArray:
        """Return the address of values; a key has one address."""
        self._asked.add(key)
        if key not in self._places:
            table = table_of(values.dtype)
            numbers = self.values[table]
            self._places[key] = HeapArray(table, len(numbers), values.shape)
            self._initial[key] = values.copy()
            numbers.extend(values.ravel().tolist())
        return self._places[key]

    def is_constant(self, name: str, field: Field) -> bool:
        """Return whether a number never changes."""
        return field.is_invariant and name not in self._free

    def number(self, memories: Sequence[Memory], name: str) -> HeapArray | float:
        """Return a number of memories: where it is, one for each of them; or itself, if it is the same constant."""
        field = type(memories[0]).fields[name]
        values, key = np.array([getattr(each, name) for each in memories], dtype=field.dtype), key_of(memories, name)
        is_settled = self._changing is not None and key not in self._changing and name not in self._free
        if is_settled or self.is_constant(name, field):
            first = values[0].item()
            if all(value == first or (math.isnan(value) and math.isnan(first)) for value in values.tolist()):
                return float(first) if field.dtype.kind == "f" else int(first)
        return self.allocate(key, values)

    def known(self, memory: Memory, name: str) -> np.ndarray | None:
        """Return the numbers of an array that nothing writes; None of others."""
        return np.asarray(getattr(memory, name)) if name in self._structure else None

    def place(self, memory: Memory, name: str) -> HeapArray:
        """Return where an array or a number that is no constant is."""
        place = self.number((memory,), name) if memory.fields[name].shape is None else self.array(memory, name)
        assert isinstance(place, HeapArray)
        return place

    def array(self, memory: Memory, name: str) -> HeapArray:
        """Return where an array of a memory is."""
        values = np.asarray(getattr(memory, name))
        if name.endswith("_handles"):  # of a table of memories: they are counted instead
            values = np.arange(len(values))
        return self.allocate((id(memory), name), values)
