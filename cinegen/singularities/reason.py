"""The geometric reason why lines are dependent, as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from cinegen.arrays import Array
from cinegen.singularities.pluecker import AnyLine, LineAtInfinity, LinePlane, PlueckerLine, ProjectivePoint
from raff2urdf.quantities import LENGTH, shown_scale

if TYPE_CHECKING:
    from cinegen.singularities.grassmann import DependentSet


_NUMBERS = ("no", "one", "two", "three", "four", "five", "six")
_DIGITS = 4  # of the characteristic length that are written


def text(some: DependentSet, count: int, unit: str, length: float) -> str:
    """Return why the lines of a set are dependent, as "legs 1, 2, 3 and 5 meet in one point, (0, 0, 3) mm".

    Args:
        some: the set.
        count: number of all lines.
        unit: of length, or nothing.
        length: the characteristic length: it determines the number of digits.
    """
    write = GeometryWriter(unit, length)
    lines, directors, points, planes = legs(some.lines, count), some.directors, some.points, some.planes
    name = some.grassmann_class.name
    if name == "ONE_LINE":
        return f"{lines} are one line, {write.line(directors[0])}"
    if name == "FLAT_PENCIL":
        return f"{lines} {write.meeting(points[0])}, and lie in one plane, {write.plane(planes[0])}"
    if name == "BUNDLE":
        return f"{lines} {write.meeting(points[0])}"
    if name == "PLANE":
        return f"{lines} lie in one plane, {write.plane(planes[0])}"
    if name == "REGULUS":
        quadric = "hyperbolic paraboloid" if some.directions == 2 else "hyperboloid of one sheet"
        return f"{lines} are lines of one family of a {quadric} (a regulus)"
    if name == "TWO_PENCILS":
        first, second = (f"{legs(g, count)} {write.meeting(p)}" for g, p in zip(some.groups, points, strict=True))
        shared = f"the planes of both pairs contain {write.line(directors[0])}, on which these points lie"
        return f"{first}, {second}, and {shared} (two flat pencils with a common line)"
    if name == "ELLIPTIC_CONGRUENCE":
        return f"{lines} twist around each other, and no line meets them all (an elliptic congruence)"
    if name == "HYPERBOLIC_CONGRUENCE":
        return f"{lines} {_two_met(directors, write)}"
    if name == "PARABOLIC_CONGRUENCE":
        far_away = isinstance(directors[0], LineAtInfinity)
        twist = "rotate from one such plane to the next" if far_away else "twist around it"
        return f"{lines} {write.met(directors[0])}, and {twist} as if they met it twice (a parabolic congruence)"
    if name == "DEGENERATE_CONGRUENCE":
        through, inside = (legs(group, count) for group in some.groups)
        where = "parallel to them" if points[0].at_infinity else "through it"
        return f"{through} {write.meeting(points[0])}, and {inside} lie in one plane {where}, {write.plane(planes[0])}"
    if name == "SPECIAL_COMPLEX":
        return f"{lines} {write.met(directors[0])}"
    assert some.screw is not None
    screw = f"pitch {write.pitch(some.screw.pitch)} about {write.line(some.screw.axis)}"
    return f"{lines} belong to one linear complex, of {screw}"


def _two_met(directors: Sequence[AnyLine], write: GeometryWriter) -> str:
    """Return how lines meet two others, of which one may be at infinity."""
    finite = [line for line in directors if isinstance(line, PlueckerLine)]
    if len(finite) == 2:
        return f"meet two lines, {write.line(finite[0])} and {write.line(finite[1])}"
    far = next(line for line in directors if isinstance(line, LineAtInfinity))
    return f"{write.met(finite[0])}, and {write.met(far)}"


def legs(which: Sequence[int], count: int) -> str:
    """Return the names of some legs, counted from 0, out of `count`: "legs 1, 2 and 3", "all six legs"."""
    if len(which) == count > 2:
        return f"all {_NUMBERS[len(which)]} legs"
    named = [str(line + 1) for line in which]
    if len(named) == 1:
        return f"leg {named[0]}"
    return f"legs {', '.join(named[:-1])} and {named[-1]}"


class GeometryWriter:
    """Writes points, lines, planes and pitches.

    Args:
        unit: of length: "m" for the unit that the user has chosen, another one as it is, or nothing.
        length: the characteristic length: it determines the number of digits.
    """

    def __init__(self, unit: str, length: float) -> None:
        self._scale, unit = shown_scale(LENGTH) if unit == "m" else (1.0, unit)
        self._length = self._scale * length
        self._unit = f" {unit}" if unit else ""
        self._per_radian = f" {unit}/rad" if unit else " per rad"

    def length(self, value: float) -> str:
        """A length, with as many digits as the characteristic length justifies."""
        value *= self._scale
        if abs(value) >= self._length * 10**_DIGITS:
            return f"{value:.{_DIGITS}g}"
        return _number(value, _DIGITS - 1 - math.floor(math.log10(self._length)))

    def pitch(self, value: float, wrench: bool = False) -> str:
        """The pitch of a twist, in length per radian, or of a wrench, in length."""
        return f"{self.length(value)}{self._unit if wrench else self._per_radian}"

    def position(self, xyz: Array) -> str:
        """ "(0, 0, 1) mm"."""
        return f"({', '.join(self.length(value) for value in xyz)}){self._unit}"

    def along(self, direction: Array) -> str:
        """ "(0, 0, 1)"."""
        return f"({', '.join(_number(value, _DIGITS) for value in direction)})"

    def line(self, line: AnyLine) -> str:
        """ "the line through (0, 0, 1) along (1, 0, 0)"."""
        if isinstance(line, LineAtInfinity):
            return f"the line at infinity of planes with normal {self.along(line.normal)}"
        return f"the line through {self.position(line.point)} along {self.along(line.direction)}"

    def met(self, line: AnyLine) -> str:
        """ "meet the line ...": of a line at infinity it means that they are parallel to its planes."""
        if isinstance(line, LineAtInfinity):
            return f"are parallel to the planes with normal {self.along(line.normal)}"
        return f"meet {self.line(line)}"

    def meeting(self, point: ProjectivePoint) -> str:
        """ "meet in one point, (0, 0, 1) mm"."""
        if point.at_infinity:
            return f"are parallel, along {self.along(point.xyz)}"
        return f"meet in one point, {self.position(point.xyz)}"

    def plane(self, plane: LinePlane) -> str:
        """ "with normal (0, 0, 1) at 3 mm from the origin"."""
        return f"with normal {self.along(plane.normal)} at {self.length(plane.offset)}{self._unit} from the origin"


def _number(value: float, decimals: int) -> str:
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
