"""The region of a map as options give it: `x=-0.5..0.5:80,y`, `xyz`, `joint1,joint2=0..90deg`; bare numbers are SI."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from cinegen.cli.numbers import interval, parts, point, si, values
from cinegen.errors import CinegenError

if TYPE_CHECKING:
    from cinegen.model import Mechanism
    from cinegen.workspace import GridAxis, Region

CELLS = {1: 400, 2: 80, 3: 30}
"""Default number of cells along each axis, by the number of axes."""

_CELLS_OF_MANY = 8  # ... of more


def region(
    mechanism: Mechanism, over: str, at: str, node: str | None, orientation: str, grid: int | None,
    centre: str | None = None, line: str | None = None,
) -> Region:  # fmt: skip
    """Return the region that options ask for.

    Args:
        mechanism: the robot.
        over: the axes, each `NAME`, `NAME=LOW..HIGH` or `NAME=LOW..HIGH:COUNT`, or x, y and z together; empty for all
            translations that the node can make.
        at: values of other coordinates, `NAME=VALUE`.
        node: whose pose.
        orientation: one of `ORIENTATIONS`, or home: fixed as at home.
        grid: cells along each axis without a count.
        centre: `X,Y,Z`, the centre of azimuth, elevation and radius.
        line: `X,Y,Z..X,Y,Z[:COUNT]`, instead of axes.

    Raises:
        CinegenError: an option is wrong.
    """
    from cinegen.workspace import Region, line_region

    given = values(at, "--at", "z=-0.9, z=-900mm or rz=15deg", si)
    fixed = "fixed" if orientation == "home" else orientation
    if line is not None:
        found = re.fullmatch(r"(.+?)\.\.(?=[-+\d])(.+?)(?::(\d{1,18}))?", line.strip())
        if found is None:
            raise CinegenError(f"--line {line}: write X,Y,Z..X,Y,Z or X,Y,Z..X,Y,Z:COUNT, such as 0,0,-1..0.5,0,-1:200")
        count = int(found[3] or grid or CELLS[1])
        ends = point(found[1], "--line"), point(found[2], "--line")
        return line_region(*ends, count, at=given, orientation=fixed)
    names = [
        name for part in parts(over)
        for name in (part if re.fullmatch("[xyz]{2,3}", part) and part not in mechanism.joints else [part])
    ] or _translations(mechanism, node, given)  # fmt: skip
    count = grid or CELLS.get(len(names), _CELLS_OF_MANY)
    origin = None if centre is None else point(centre, "--centre")
    return Region(
        tuple(_axis(mechanism, name, node, count, origin or (0.0, 0.0, 0.0)) for name in names), given, fixed, origin
    )


def _translations(mechanism: Mechanism, node: str | None, given: dict[str, float]) -> list[str]:
    """Return the translations that the node can make, without those whose value is given; with mobility 1 the actuated
    joint, whose range is all of the motion."""
    from cinegen.workspace import MapError

    if mechanism.mobility == 1 and len(mechanism.actuated) == 1 and not given:
        return list(mechanism.actuated)
    from cinegen.workspace.default_range import default_range

    found = []
    for name in ("x", "y", "z"):
        if name not in given:
            try:
                default_range(mechanism, name, node)
            except MapError:
                continue
            found.append(name)
    return found


def _axis(
    mechanism: Mechanism, text: str, node: str | None, count: int, centre: tuple[float, float, float]
) -> GridAxis:
    from cinegen.workspace import GridAxis
    from cinegen.workspace.default_range import default_range

    text, colon, cells = text.partition(":")
    name, equals, ends = text.partition("=")
    low, high = interval(ends, "--over") if equals else default_range(mechanism, name, node, centre)
    if colon and not re.fullmatch(r"\d{1,18}", cells):
        raise CinegenError(f"--over: '{text}:{cells}': '{cells}' is not a number of cells, as in x=-0.3..0.3:60")
    return GridAxis(name, low, high, int(cells) if colon else count)
