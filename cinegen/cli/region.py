"""The region of a map as options give it: `x=-0.5..0.5:80,y`, `xyz`, `joint1,joint2=0..90`, in m and degrees."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from cinegen.cli.numbers import interval_of, parts, point, segment, values
from raff2urdf.command.command_line import UsageError

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
        UsageError: an option is wrong.
        ImplausibleError: a number would fit in another unit only.
    """
    from cinegen.model.plausible import check_lengths
    from cinegen.workspace import Region, line_region

    others = values(at, "--at", "z=-0.9, z=-900mm or rz=15", mechanism)
    fixed = "fixed" if orientation == "home" else orientation
    if line is not None:
        both, _, cells = line.partition(":")
        ends = segment(both, "--line")
        check_lengths(mechanism, "--line", [*ends[0], *ends[1]])
        count = _count("--line", line, cells) if cells else grid or CELLS[1]
        return line_region(*ends, count, at=others, orientation=fixed)
    names = [
        name for part in parts(over)
        for name in (part if re.fullmatch("[xyz]{2,3}", part) and part not in mechanism.joints else [part])
    ] or _translations(mechanism, node, others)  # fmt: skip
    count = grid or CELLS.get(len(names), _CELLS_OF_MANY)
    origin = None if centre is None else point(centre, "--centre")
    check_lengths(mechanism, "--centre", origin or ())
    return Region(
        tuple(_axis(mechanism, name, node, count, origin or (0.0, 0.0, 0.0)) for name in names), others, fixed, origin
    )


def _translations(mechanism: Mechanism, node: str | None, fixed: dict[str, float]) -> list[str]:
    """Return the translations that the node can make, without those whose value is given; the actuated joints of a
    robot that has fewer degrees of freedom, whose node moves along a curve or on a surface."""
    from cinegen.workspace import MapError

    if mechanism.mobility == 1 and len(mechanism.actuated) == 1 and not fixed:
        return list(mechanism.actuated)
    from cinegen.workspace.default_range import default_range

    names = []
    for name in ("x", "y", "z"):
        if name not in fixed:
            try:
                default_range(mechanism, name, node)
            except MapError:
                continue
            names.append(name)
    is_thin = len(names) > mechanism.mobility == len(mechanism.actuated)
    return list(mechanism.actuated) if is_thin and not fixed else names


def _axis(
    mechanism: Mechanism, text: str, node: str | None, count: int, centre: tuple[float, float, float]
) -> GridAxis:
    from cinegen.workspace import GridAxis
    from cinegen.workspace.default_range import default_range

    range_text, colon, cells = text.partition(":")
    name, equals, ends = range_text.partition("=")
    if equals:
        low, high = interval_of(mechanism, name, ends, "--over")
    else:
        low, high = default_range(mechanism, name, node, centre)
    return GridAxis(name, low, high, _count("--over", text, cells) if colon else count)


def _count(option: str, text: str, cells: str) -> int:
    if not re.fullmatch(r"\d{1,18}", cells, re.ASCII):
        raise UsageError(f"{option}: '{text}': '{cells}' is not a number of cells, as in x=-0.3..0.3:60")
    return int(cells)
