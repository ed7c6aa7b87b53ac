"""What a map is over, as options say it: `x=-0.5..0.5:80,y`, `xyz`, `joint1,joint2=0..90deg`.

Numbers are m and rad, as those in the map are, unless a unit stands behind.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from cinegen.cli.values import parts

if TYPE_CHECKING:
    from cinegen.model import Mechanism
    from cinegen.workspace import GridAxis, Region

_UNITS = {"": 1.0, "m": 1.0, "mm": 1e-3, "cm": 1e-2, "rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0}
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([a-z°]*)$")

COUNTS = {1: 400, 2: 80, 3: 30}
"""Cells along each of so many axes, where nobody says."""

_FEW = 8  # ... and of more


def quantity(text: str, option: str) -> float:
    """A number, in m or rad unless it has a unit: -0.9, -900mm, 15deg.

    Raises:
        CinegenError: it is none.
    """
    from cinegen.errors import CinegenError

    found = _NUMBER.match(text.strip())
    if found is None or found[2] not in _UNITS:
        raise CinegenError(f"{option}: '{text}' is no number: write one in m or rad, or with its unit, such as -900mm")
    return float(found[1]) * _UNITS[found[2]]


def region(
    mechanism: Mechanism, over: str, at: str, node: str | None, orientation: str, grid: int | None,
    centre: str | None = None, line: str | None = None,
) -> Region:  # fmt: skip
    """The region that options ask for.

    Args:
        mechanism: whose.
        over: the axes, each `NAME`, `NAME=LOW..HIGH` or `NAME=LOW..HIGH:COUNT`, or x, y and z together; all
            translations that the node can make unless given.
        at: values of others, `NAME=VALUE`.
        node: whose pose.
        orientation: of `ORIENTATIONS`, or home: fixed as at home.
        grid: cells along each axis that does not say it itself.
        centre: x,y,z from where azimuth, elevation and radius are seen.
        line: `X,Y,Z..X,Y,Z`, instead of axes.

    Raises:
        CinegenError: something there makes no sense.
    """
    from cinegen.workspace import Region, straight

    held = {name: quantity(value, "--at") for name, value in _named(at)}
    turned = "fixed" if orientation == "home" else orientation
    if line is not None:
        first, last, count = _line(line)
        return straight(first, last, count or grid or COUNTS[1], at=held, orientation=turned)
    asked = _spread_out(mechanism, parts([over])) if over else _translations(mechanism, node, held)
    each = grid or COUNTS.get(len(asked), _FEW)
    seen_from = None if centre is None else point(centre, "--centre")
    axes = tuple(_axis(mechanism, text, node, each, seen_from or (0.0, 0.0, 0.0)) for text in asked)
    return Region(axes, held, turned, seen_from)


def ranges(text: str, option: str) -> dict[str, tuple[float, float]]:
    """Ranges by name: `x=-0.5..0.5,y=0..200mm`.

    Raises:
        CinegenError: something else.
    """
    from cinegen.errors import CinegenError

    found = {}
    for part in parts([text]):
        name, _, span = part.partition("=")
        if name in found:
            raise CinegenError(f"{option}: {name} is given twice")
        found[name] = _range(part, span, option)
    return found


def _range(text: str, span: str, option: str) -> tuple[float, float]:
    """`LOW..HIGH`; a unit behind the second is that of both."""
    from cinegen.errors import CinegenError

    low, dots, high = span.partition("..")
    if not dots:
        raise CinegenError(f"{option}: '{text}': write NAME=LOW..HIGH, such as x=-0.5..0.5 or x=-500..500mm")
    found = _NUMBER.match(high.strip())
    first = _NUMBER.match(low.strip())
    if found is not None and first is not None and not first[2]:
        low += found[2]
    return quantity(low, option), quantity(high, option)


def _named(text: str) -> list[tuple[str, str]]:
    from cinegen.errors import CinegenError

    found: list[tuple[str, str]] = []
    for part in parts([text]):
        name, equals, value = part.partition("=")
        if not equals:
            raise CinegenError(f"--at: '{part}': write NAME=VALUE, m or rad, such as z=-0.9, z=-900mm or rz=15deg")
        if name in dict(found):
            raise CinegenError(f"--at: {name} is given twice")
        found.append((name, value))
    return found


def _spread_out(mechanism: Mechanism, asked: list[str]) -> list[str]:
    """`xyz` is x, y and z, unless a motor is called so."""
    return [
        name for part in asked
        for name in (part if re.fullmatch("[xyz]{2,3}", part) and part not in mechanism.joints else [part])
    ]  # fmt: skip


def _translations(mechanism: Mechanism, node: str | None, held: dict[str, float]) -> list[str]:
    """Those that the node can make and that are not held."""
    from cinegen.workspace import MapError
    from cinegen.workspace.about import about

    found = []
    for name in ("x", "y", "z"):
        if name not in held:
            try:
                about(mechanism, name, node)
            except MapError:
                continue
            found.append(name)
    return found


def _axis(
    mechanism: Mechanism, text: str, node: str | None, count: int, centre: tuple[float, float, float]
) -> GridAxis:
    from cinegen.errors import CinegenError
    from cinegen.workspace import GridAxis
    from cinegen.workspace.about import about

    name, equals, span = text.partition("=")
    span, colon, cells = span.partition(":")
    if not equals:
        name, colon, cells = text.partition(":")
        low, high = about(mechanism, name, node, centre)
    else:
        low, high = _range(text, span, "--over")
    if colon and not re.fullmatch(r"\d{1,18}", cells):
        raise CinegenError(f"--over: '{text}': {cells or 'nothing'} is no number of cells, such as x=-0.3..0.3:60")
    return GridAxis(name, low, high, int(cells) if colon else count)


def _line(text: str) -> tuple[tuple[float, ...], tuple[float, ...], int | None]:
    from cinegen.errors import CinegenError

    found = re.fullmatch(r"(.+?)\.\.(?=[-+\d])(.+?)(?::(\d{1,18}))?", text.strip())
    if found is None:
        raise CinegenError(f"--line {text}: write X,Y,Z..X,Y,Z or X,Y,Z..X,Y,Z:COUNT, m, such as 0,0,-1..0.5,0,-1:200")
    count = int(found[3]) if found[3] else None
    return point(found[1], "--line"), point(found[2], "--line"), count


def point(text: str, option: str) -> tuple[float, float, float]:
    """`X,Y,Z`.

    Raises:
        CinegenError: something else.
    """
    from cinegen.errors import CinegenError

    given = [quantity(part, option) for part in parts([text])]
    if len(given) != 3:
        raise CinegenError(f"{option}: '{text}': a point is x,y,z, not {len(given)} numbers")
    return given[0], given[1], given[2]
