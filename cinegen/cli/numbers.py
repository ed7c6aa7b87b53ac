"""Numbers, points and ranges as options give them: `x=-0.5..0.5:80,y`, `joint3=21.7mm`, `-900mm`.

A number may have a unit; without one it is in m, degrees, s or Hz, by its dimension (`raff2urdf.quantities`).
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from cinegen.errors import CinegenError
from raff2urdf.command.command_line import Command, UsageError, option
from raff2urdf.errors import counted
from raff2urdf.quantities import (
    ACCELERATION,
    ANGLE,
    LENGTH,
    Dimension,
    is_quantity,
    parse,
    parse_list,
    parse_range,
    refused_as,
)

if TYPE_CHECKING:
    from cinegen.model import Mechanism

UNITS = "m and degrees, or with a unit: -900mm, 0.3rad"
"""Units of numbers that are typed, for help."""

POSE_EXAMPLE = "x=0.1 or rz=15 (m and degrees)"
"""What an error shows about a pose."""

AT = option(
    "POSE", f"where: x=0,y=0.1,rz=15 of the node, or joint3=0.7 of actuated joints ({UNITS}; default: home)", ""
)
"""The option `--at` of commands that analyse a configuration."""
_LENGTHS = ("x", "y", "z", "radius")
_ANGLES = ("rx", "ry", "rz", "azimuth", "elevation")


def dimension_of(mechanism: Mechanism, name: str) -> Dimension | None:
    """Return the dimension of a coordinate or a joint; None if there is none of that name."""
    if name in mechanism.joints:
        return LENGTH if mechanism.is_prismatic(name) else ANGLE
    return LENGTH if name in _LENGTHS else ANGLE if name in _ANGLES else None


def parts(text: str) -> list[str]:
    """Return what commas or blanks separate; a blank before a unit separates nothing."""
    joined = re.sub(r"\s*=\s*", "=", text).replace(",", " ").split()
    texts: list[str] = []
    for part in joined:
        if texts and re.fullmatch(r"[A-Za-zµ°]+", part) and is_quantity(f"{texts[-1].rpartition('=')[2]} {part}"):
            texts[-1] += part
        else:
            texts.append(part)
    return texts


def named(text: str, option: str, example: str) -> dict[str, str]:
    """Return the texts behind names: `x=10,rz=15`.

    Raises:
        UsageError: a part has no name, or a name is given twice.
    """
    texts: dict[str, str] = {}
    for part in parts(text):
        name, equals, value = part.partition("=")
        if not equals:
            raise UsageError(f"{option}: '{part}': write NAME=VALUE, such as {example}")
        if name in texts:
            raise UsageError(f"{option}: {name} is given twice")
        texts[name] = value
    return texts


def quantity(text: str, option: str, dimension: Dimension) -> float:
    """Return a number in SI units and radians.

    Args:
        text: what was typed.
        option: where, for errors.
        dimension: of the number.

    Raises:
        UsageError: it is no quantity of that dimension.
    """
    with refused_as(UsageError, option):
        return parse(text, dimension)


def values(text: str, option: str, example: str, mechanism: Mechanism) -> dict[str, float]:
    """Return values of coordinates and joints by name, m and rad; 0 for an unknown name, which the caller refuses.

    Raises:
        UsageError: as `named` and `quantity`.
        ImplausibleError: a value would fit in another unit only.
    """
    from cinegen.model.plausible import check_joint, check_lengths

    numbers = {}
    for name, value in named(text, option, example).items():
        dimension = dimension_of(mechanism, name)
        numbers[name] = 0.0 if dimension is None else quantity(value, f"{option}: {name}", dimension)
        if name in mechanism.joints:
            check_joint(mechanism, name, [numbers[name]])
        elif dimension is LENGTH:
            check_lengths(mechanism, f"{option} {name}", [numbers[name]])
    return numbers


def locked_joints(text: str | None, mechanism: Mechanism) -> tuple[tuple[str, ...], dict[str, float]]:
    """Return the joints that --lock names, and the values of those that it gives one, m and rad.

    Raises:
        UsageError: as `values`.
        UnknownNameError: there is no such joint.
    """
    from cinegen.ik.joint_settings import checked_names

    names = parts(text or "")
    fixed = values(",".join(part for part in names if "=" in part), "--lock", "joint3=0.7 (m and degrees)", mechanism)
    return checked_names(mechanism, [part.partition("=")[0] for part in names]), fixed


def configuration_at(mechanism: Mechanism, at: str, node: str | None) -> Any:
    """Return the configuration (nq,) that --at gives: of a node's pose, or of actuated joints; home without any.

    Raises:
        CinegenError: it can't be reached along a straight line from home.
    """
    coordinates = values(at, "--at", POSE_EXAMPLE, mechanism)
    if not coordinates:
        return mechanism.q_home
    from cinegen.singularities.slice import POSE, Coordinates

    names = mechanism.actuated if all(name in mechanism.actuated for name in coordinates) else POSE
    q = Coordinates(mechanism, [name for name in names if name in coordinates], node).from_home(coordinates)
    if q is None:
        raise CinegenError(
            f"{mechanism.name}: --at {at} can't be reached along a straight line from home on its branch"
        )
    return q


def interval_of(mechanism: Mechanism, name: str, text: str, option: str) -> tuple[float, float]:
    """Return both ends of the range `LOW..HIGH` of a coordinate or joint, m or rad; 0 and 1 for an unknown name, which
    the caller refuses.

    Raises:
        UsageError: it is not an interval, or its lower end is not the first.
        ImplausibleError: the range would fit in another unit only.
    """
    from cinegen.model.plausible import check_joint, check_lengths, check_revolution

    dimension = dimension_of(mechanism, name)
    if dimension is None:
        return 0.0, 1.0
    with refused_as(UsageError, f"{option}: {name}"):
        ends = parse_range(text, dimension)
    if not ends[0] < ends[1]:
        raise UsageError(f"{option}: {name}: '{text}' is no range: give the lower end first")
    if name in mechanism.joints:
        check_joint(mechanism, name, ends)
    elif dimension is LENGTH:
        check_lengths(mechanism, f"{option} {name}", ends)
    else:
        check_revolution(f"{option} {name}", *ends)
    return ends


def point(text: str, option: str, dimension: Dimension = LENGTH) -> tuple[float, float, float]:
    """Return the three coordinates of `X,Y,Z`, in SI units.

    Args:
        text: what was typed.
        option: where, for errors.
        dimension: of the coordinates.

    Raises:
        UsageError: they are not three quantities of that dimension.
    """
    texts = parts(text)
    if len(texts) != 3:
        what = (
            "an acceleration, such as 0,0,-9.81,"
            if dimension is ACCELERATION
            else "a point"
            if dimension is LENGTH
            else "a direction"
        )
        raise UsageError(f"{option}: '{text}': {what} is x,y,z, not {counted(len(texts), 'number')}")
    with refused_as(UsageError, option):
        x, y, z = parse_list(texts, dimension)
    return x, y, z


def segment(text: str, option: str) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return both ends of a line `X,Y,Z..X,Y,Z`, m.

    Raises:
        UsageError: it is not a line between two points.
    """
    ends = re.split(r"(\.{2,})", text)
    if len(ends) != 3 or ends[1] != "..":
        raise UsageError(f"{option}: '{text}': write X,Y,Z..X,Y,Z with two dots, such as 0,0,-1..0.5,0,-1")
    first, last = point(ends[0], option), point(ends[2], option)
    with refused_as(UsageError, option):
        parse_list([*parts(ends[0]), *parts(ends[2])], LENGTH)
    return first, last


class NumberLists(Command):
    """A command whose lists of numbers may also be separated by blanks: `--at x=10 rz=15`."""

    _LISTS = frozenset({"--acceleration", "--at", "--lock", "--values", "--velocity"})

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line, with the words of a list joined by commas."""
        joined, in_list = [""], False
        for word in args:
            if in_list and all(is_quantity(part) or re.fullmatch(r"\w+=\S*", part) for part in parts(word)):
                joined[-1] += f",{word}"
            else:
                option, equals, _ = word.partition("=")
                in_list = joined[-1] in self._LISTS or bool(equals and option in self._LISTS)
                joined.append(word)
        return super().parse_args(ctx, joined[1:])
