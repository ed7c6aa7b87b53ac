"""Numbers, points and ranges as options give them: `x=-0.5..0.5:80,y`, `joint3=21.7`, `-900mm`.

A number may have a unit: mm, cm, m, deg or rad. What a bare number means is said by each option.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from typer.core import TyperCommand

from cinegen.errors import CinegenError

if TYPE_CHECKING:
    from cinegen.model import Mechanism

_TO_SI: dict[str, Callable[[float], float]] = {
    "m": float, "cm": lambda x: x / 1e2, "mm": lambda x: x / 1e3, "rad": float, "deg": math.radians, "°": math.radians,
}  # fmt: skip
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([a-z°]*)")

Units = Callable[[str], str]
"""The unit of bare numbers, by the name of a coordinate or joint."""


def si(_: str) -> str:
    """Return the unit of bare numbers where they are m and rad."""
    return "m"


def mm_and_degrees(mechanism: Mechanism) -> Units:
    """Return the unit of bare numbers where they are mm for x, y, z and prismatic joints, else degrees."""

    def unit(name: str) -> str:
        return (
            "mm" if (mechanism.is_prismatic(name) if name in mechanism.joints else name in ("x", "y", "z")) else "deg"
        )

    return unit


def quantity(text: str, option: str, unit: str = "m") -> float:
    """Return a number in m or rad.

    Args:
        text: what was typed.
        option: where, for errors.
        unit: of a bare number.

    Raises:
        CinegenError: it is not a finite number, or its unit is unknown.
    """
    found = _NUMBER.fullmatch(text.strip())
    if found is None or found[2] not in {"", *_TO_SI} or not math.isfinite(float(found[1])):
        raise CinegenError(f"{option}: '{text}' is not a number (with a unit, if you like: {', '.join(_TO_SI)})")
    return _TO_SI[found[2] or unit](float(found[1]))


def parts(text: str) -> list[str]:
    """Return what commas or blanks separate."""
    return re.sub(r"\s*=\s*", "=", text).replace(",", " ").split()


def named(text: str, option: str, example: str) -> dict[str, str]:
    """Return the texts behind names: `x=10,rz=15`.

    Raises:
        CinegenError: a part has no name, or a name is given twice.
    """
    found: dict[str, str] = {}
    for part in parts(text):
        name, equals, value = part.partition("=")
        if not equals:
            raise CinegenError(f"{option}: '{part}': write NAME=VALUE, such as {example}")
        if name in found:
            raise CinegenError(f"{option}: {name} is given twice")
        found[name] = value
    return found


def values(text: str, option: str, example: str, units: Units) -> dict[str, float]:
    """Return numbers by name, m and rad.

    Raises:
        CinegenError: as `named` and `quantity`.
    """
    return {name: quantity(value, option, units(name)) for name, value in named(text, option, example).items()}


def interval(text: str, option: str, unit: str = "m") -> tuple[float, float]:
    """Return both ends of `LOW..HIGH`, m or rad; a unit behind the second is that of both.

    Raises:
        CinegenError: it is not an interval.
    """
    low, dots, high = text.partition("..")
    if not dots:
        raise CinegenError(f"{option}: '{text}': write LOW..HIGH, such as -0.5..0.5 or -500..500mm")
    first, last = _NUMBER.fullmatch(low.strip()), _NUMBER.fullmatch(high.strip())
    if first is not None and last is not None and not first[2]:
        low += last[2]
    return quantity(low, option, unit), quantity(high, option, unit)


def point(text: str, option: str) -> tuple[float, float, float]:
    """Return the three coordinates of `X,Y,Z`, m.

    Raises:
        CinegenError: it is not a point.
    """
    given = [quantity(part, option) for part in parts(text)]
    if len(given) != 3:
        raise CinegenError(f"{option}: '{text}': a point is x,y,z, not {len(given)} numbers")
    return given[0], given[1], given[2]


class NumberLists(TyperCommand):
    """A command whose lists of numbers may also be separated by blanks: `--at x=10 rz=15`."""

    _LISTS = frozenset({"--at", "--lengths", "--values"})
    _ITEM = re.compile(rf"{_NUMBER.pattern}|\w+=\S*")

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line, with the words of a list joined by commas."""
        joined, in_list = [""], False
        for word in args:
            if in_list and all(map(self._ITEM.fullmatch, parts(word))):
                joined[-1] += f",{word}"
            else:
                option, equals, _ = word.partition("=")
                in_list = joined[-1] in self._LISTS or bool(equals and option in self._LISTS)
                joined.append(word)
        return super().parse_args(ctx, joined[1:])
