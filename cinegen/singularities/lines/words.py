"""The geometric reason for which lines are dependent, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.lines.dependent_set import DependentSet
from cinegen.singularities.lines.frame import Plane, Point
from cinegen.singularities.lines.line import Line, LineAtInfinity
from cinegen.singularities.lines.variety import Variety

Array = NDArray[np.float64]

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six")
_DIGITS = 4  # of the characteristic length that are written


def reason(some: DependentSet, names: Sequence[str], noun: str, unit: str, length: float) -> str:
    """Why the lines of a set are dependent, as "legs 1, 2, 3 and 5 meet in one point, (0, 0, 3) mm".

    Args:
        some: the set.
        names: of all lines.
        noun: what a line is, "leg".
        unit: of length, or nothing.
        length: the characteristic length: it says how many digits are worth writing.
    """
    say = _Speaker(names, noun, unit, length)
    return {
        Variety.ONE_LINE: _one_line,
        Variety.FLAT_PENCIL: _flat_pencil,
        Variety.REGULUS: _regulus,
        Variety.TWO_PENCILS: _two_pencils,
        Variety.BUNDLE: _bundle,
        Variety.PLANE: _plane,
        Variety.ELLIPTIC_CONGRUENCE: _elliptic,
        Variety.HYPERBOLIC_CONGRUENCE: _hyperbolic,
        Variety.PARABOLIC_CONGRUENCE: _parabolic,
        Variety.DEGENERATE_CONGRUENCE: _degenerate,
        Variety.GENERAL_COMPLEX: _general_complex,
        Variety.SPECIAL_COMPLEX: _special_complex,
    }[some.variety](some, say)


class _Speaker:
    """Says lines, points and numbers."""

    def __init__(self, names: Sequence[str], noun: str, unit: str, length: float) -> None:
        self.names, self.noun, self.length = names, noun, length
        self.unit = f" {unit}" if unit else ""
        self.per_turn = f" {unit}/rad" if unit else " per rad"

    def lines(self, which: Sequence[int]) -> str:
        """ "legs 1, 2 and 3"; "all six legs"."""
        if len(which) == len(self.names) > 2:
            return f"all {_NUMBERS[len(which)]} {self.noun}s"
        named = [self.names[line] for line in which]
        if len(named) == 1:
            return f"{self.noun} {named[0]}"
        return f"{self.noun}s {', '.join(named[:-1])} and {named[-1]}"

    def size(self, value: float) -> str:
        """A length, to as many digits as the characteristic length is worth."""
        decimals = _DIGITS - 1 - math.floor(math.log10(self.length))
        if abs(value) >= self.length * 10**_DIGITS:
            return f"{value:.{_DIGITS}g}"
        return _number(value, decimals)

    def place(self, xyz: Array) -> str:
        return f"({', '.join(self.size(value) for value in xyz)}){self.unit}"

    def along(self, direction: Array) -> str:
        return f"({', '.join(_number(value, _DIGITS) for value in direction)})"

    def line(self, line: Line | LineAtInfinity) -> str:
        """ "the line through (0, 0, 1) along (1, 0, 0)"."""
        if isinstance(line, LineAtInfinity):
            return f"the line at infinity of planes with normal {self.along(line.normal)}"
        return f"the line through {self.place(line.point)} along {self.along(line.direction)}"

    def met(self, line: Line | LineAtInfinity) -> str:
        """That lines meet a line: at infinity it means that they are parallel to its planes."""
        if isinstance(line, LineAtInfinity):
            return f"are parallel to the planes with normal {self.along(line.normal)}"
        return f"meet {self.line(line)}"

    def meeting(self, point: Point) -> str:
        if point.at_infinity:
            return f"are parallel, along {self.along(point.xyz)}"
        return f"meet in one point, {self.place(point.xyz)}"

    def plane(self, plane: Plane) -> str:
        return f"with normal {self.along(plane.normal)} at {self.size(plane.offset)}{self.unit} from the origin"


def _one_line(some: DependentSet, say: _Speaker) -> str:
    return f"{say.lines(some.lines)} are one line, {say.line(some.directors[0])}"


def _flat_pencil(some: DependentSet, say: _Speaker) -> str:
    return f"{say.lines(some.lines)} {say.meeting(some.points[0])}, and lie in one plane, {say.plane(some.planes[0])}"


def _bundle(some: DependentSet, say: _Speaker) -> str:
    return f"{say.lines(some.lines)} {say.meeting(some.points[0])}"


def _plane(some: DependentSet, say: _Speaker) -> str:
    return f"{say.lines(some.lines)} lie in one plane, {say.plane(some.planes[0])}"


def _regulus(some: DependentSet, say: _Speaker) -> str:
    quadric = "hyperbolic paraboloid" if some.directions == 2 else "hyperboloid of one sheet"
    return f"{say.lines(some.lines)} are lines of one family of a {quadric} (a regulus)"


def _two_pencils(some: DependentSet, say: _Speaker) -> str:
    first, second = (
        f"{say.lines(group)} {say.meeting(point)}" for group, point in zip(some.groups, some.points, strict=True)
    )
    return (
        f"{first}, {second}, and the planes of both pairs hold {say.line(some.directors[0])},"
        " on which these points lie (two flat pencils with a common line)"
    )


def _elliptic(some: DependentSet, say: _Speaker) -> str:
    return f"{say.lines(some.lines)} twist round each other, and no line meets them all (an elliptic congruence)"


def _hyperbolic(some: DependentSet, say: _Speaker) -> str:
    finite = [line for line in some.directors if isinstance(line, Line)]
    if len(finite) == 2:
        return f"{say.lines(some.lines)} meet two lines, {say.line(finite[0])} and {say.line(finite[1])}"
    far = [line for line in some.directors if isinstance(line, LineAtInfinity)]
    return f"{say.lines(some.lines)} {say.met(finite[0])}, and {say.met(far[0])}"


def _parabolic(some: DependentSet, say: _Speaker) -> str:
    director = some.directors[0]
    far = isinstance(director, LineAtInfinity)
    twist = "turn from one such plane to the next" if far else "twist round it"
    return f"{say.lines(some.lines)} {say.met(director)}, and {twist} as if they met it twice (a parabolic congruence)"


def _degenerate(some: DependentSet, say: _Speaker) -> str:
    through, inside = some.groups
    point = some.points[0]
    return (
        f"{say.lines(through)} {say.meeting(point)}, and {say.lines(inside)} lie in one plane"
        f" {'parallel to them' if point.at_infinity else 'through it'}, {say.plane(some.planes[0])}"
    )


def _special_complex(some: DependentSet, say: _Speaker) -> str:
    return f"{say.lines(some.lines)} {say.met(some.directors[0])}"


def _general_complex(some: DependentSet, say: _Speaker) -> str:
    assert some.screw is not None
    pitch = f"{say.size(some.screw.pitch)}{say.per_turn}"
    return f"{say.lines(some.lines)} belong to one linear complex, of pitch {pitch} about {say.line(some.screw.axis)}"


def _number(value: float, decimals: int) -> str:
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
