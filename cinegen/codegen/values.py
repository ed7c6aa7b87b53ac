"""Values of a translation: what names and expressions of a kernel stand for in generated code."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import reduce
from typing import Any

import numpy as np

from cinegen.errors import CinegenError
from cinegen.jit.memory import Memory

Rank = IntEnum("Rank", "CHOICE OR AND BITS EQUALITY COMPARISON SHIFT SUM PRODUCT UNARY ATOM")
"""Precedence of operators in both languages, the lowest first."""

KINDS: Mapping[object, str] = {float: "float", int: "int", bool: "bool"}
"""Kinds of numbers by their types in Python."""


class TranslationError(CinegenError):
    """A kernel uses what the translation does not know; the message names it."""


@dataclass(frozen=True)
class Number:
    """A number: of kind "float", "int" or "bool"; `value` if it is a constant, `least` if it is never less."""

    kind: str
    code: str
    rank: int = Rank.ATOM
    value: float | None = None
    least: float | None = None

    def at(self, rank: int) -> str:
        """Return the code as an operand of an operator of a precedence."""
        return self.code if self.rank >= rank else f"({self.code})"


@dataclass(frozen=True)
class Known:
    """Numbers of an array that are constants."""

    numbers: Any  # of numpy

    def at(self, index: Number, is_joint: bool) -> Known | None:
        """Return those of a part, if they are the same at every index; joint 0 is the world, which has none."""
        if index.value is not None:
            return Known(self.numbers[int(index.value)])
        rows = self.numbers[1:] if is_joint else self.numbers
        return Known(rows[0]) if len(rows) and (rows == rows[0]).all() else None

    def number(self, index: Number, is_joint: bool) -> Number | None:
        """Return a number of a list if it is a constant, or the index and a constant."""
        known = self.at(index, is_joint)
        if known is not None:
            return None if known.numbers.ndim else constant_of(known.numbers.item())
        rows = self.numbers[1:] if is_joint else self.numbers
        if rows.dtype.kind != "i" or len(rows) == 0 or (np.diff(rows) != 1).any():
            return None
        shifted = sum_of(index, integer(int(rows[0]) - is_joint))
        return Number(shifted.kind, shifted.code, shifted.rank, least=float(rows[0]))

    def least(self, is_joint: bool) -> float | None:
        """Return the least of them."""
        rows = self.numbers[1:] if is_joint else self.numbers
        return float(rows.min()) if rows.size else None

    @property
    def is_plain(self) -> bool:
        """True of few numbers 0 and 1: functions are translated for them."""
        return bool(self.numbers.size <= 3 and np.isin(self.numbers, (0.0, 1.0)).all())


@dataclass(frozen=True)
class View:
    """An array: the table it is in, the index of its first number, its dimensions, the name of the field that it is a
    part of, and its numbers if they are constants."""

    table: str
    begin: Number
    shape: tuple[Number, ...]
    field: str = ""
    known: Known | None = None

    @property
    def kind(self) -> str:
        """Kind of its numbers."""
        return kind_of(self.table)


@dataclass(frozen=True)
class Memories:
    """One of some memories, or the only one."""

    all: tuple[Memory, ...]
    index: Number


@dataclass(frozen=True)
class Target:
    """The address of a task's target: its own one here."""

    of: Memories


@dataclass(frozen=True)
class Ended:
    """The variable of a loop that has ended: Python keeps its last value, the other languages the one behind it."""

    name: str


Value = Any
"""A `Number`, a `View`, `Memories`, a `Target`, a tuple of these, or an object of Python."""


def kind_of(table: str) -> str:
    """Return the kind of the numbers of a table of the heap."""
    return "float" if table == "D" else "int"


def constant_of(value: float) -> Number:
    """Return a constant that a function may be translated for."""
    return Number("float" if isinstance(value, float) else "int", str(value), Rank.ATOM, value)


def integer(value: int) -> Number:
    """Return an integer that is a constant."""
    return Number("int", str(value), Rank.ATOM if value >= 0 else Rank.UNARY, int(value))


def sum_of(a: Number, b: Number, sign: int = 1) -> Number:
    """Return a sum or a difference of integers, constants added up."""
    if a.value is not None and b.value is not None:
        return integer(int(a.value + sign * b.value))
    if b.value == 0:
        return a
    if a.value == 0 and sign > 0:
        return b
    return Number("int", f"{a.at(Rank.SUM)} {'+' if sign > 0 else '-'} {b.at(Rank.SUM + 1)}", Rank.SUM)


def product_of(a: Number, b: Number) -> Number:
    """Return a product of integers, constants multiplied."""
    if a.value is not None and b.value is not None:
        return integer(int(a.value * b.value))
    for factor, other in ((a, b), (b, a)):
        if factor.value == 0:
            return integer(0)
        if factor.value == 1:
            return other
    return Number("int", f"{a.at(Rank.PRODUCT)} * {b.at(Rank.PRODUCT + 1)}", Rank.PRODUCT)


def count_of(shape: Iterable[Number]) -> Number:
    """Return the number of elements of an array."""
    return reduce(product_of, shape, integer(1))
