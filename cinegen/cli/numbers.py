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

UNITS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0}
"""SI values of the units that may follow a number."""

_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([a-z°]*)")

Scale = Callable[[str], float]
"""For a coordinate or joint by name, the SI value of 1 without a unit."""


def si(_: str) -> float:
    """Bare numbers are m and rad."""
    return 1.0


def mm_and_degrees(mechanism: Mechanism) -> Scale:
    """Bare numbers are mm for x, y, z and prismatic joints, else degrees."""

    def scale(name: str) -> float:
        long = mechanism.slides(name) if name in mechanism.joints else name in ("x", "y", "z")
        return UNITS["mm" if long else "deg"]

    return scale


def quantity(text: str, option: str, scale: float = 1.0) -> float:
    """Return a number in m or rad.

    Args:
        text: what was typed.
        option: where, for errors.
        scale: SI value of 1 without a unit.

    Raises:
        CinegenError: it is not a finite number, or its unit is unknown.
    """
    found = _NUMBER.fullmatch(text.strip())
    if found is None or found[2] not in {"", *UNITS} or not math.isfinite(float(found[1])):
        units = ", ".join(UNITS)
        raise CinegenError(f"{option}: '{text}' is not a number (it may have a unit, as in -900mm: {units})")
    return float(found[1]) * (UNITS[found[2]] if found[2] else scale)


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


def values(text: str, option: str, example: str, scale: Scale) -> dict[str, float]:
    """Return numbers by name, m and rad.

    Raises:
        CinegenError: as `named` and `quantity`.
    """
    return {name: quantity(value, option, scale(name)) for name, value in named(text, option, example).items()}


def interval(text: str, option: str, scale: float = 1.0) -> tuple[float, float]:
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
    return quantity(low, option, scale), quantity(high, option, scale)


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

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line, with the words of a list joined by commas."""
        joined, in_list = [""], False
        for word in args:
            if in_list and all("=" in part or _NUMBER.fullmatch(part) for part in parts(word)):
                joined[-1] += f",{word}"
            else:
                option, equals, _ = word.partition("=")
                in_list = joined[-1] in self._LISTS or bool(equals and option in self._LISTS)
                joined.append(word)
        return super().parse_args(ctx, joined[1:])
