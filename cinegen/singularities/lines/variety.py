"""The varieties of lines that Grassmann geometry knows, and which of them some dependent lines span.

J-P. Merlet, "Singular configurations of parallel manipulators and Grassmann geometry", Int. J. of Robotics Research
8(5), 1989. All lines of space, as Pluecker vectors, span rank 6; those that lie in a subspace of rank r make a variety
of rank r, and r + 1 of them are dependent.

Which one it is follows from the Klein form on the subspace V, or, as V's signature and that of what is reciprocal to it
add up to (3, 3), on its complement W. With a set of r + 1 lines of which every r are independent:

    rank 1: the form vanishes on V                            one line
    rank 2: ... too, as three of its vectors are lines        flat pencil
    rank 3: (2, 1) or (1, 2) on V                             regulus
            (1, 1) and one 0                                  two flat pencils that share a line
            0 on V                                            bundle, or plane: incidence decides
    rank 4: on W (2, 0) or (0, 2)                             elliptic congruence: no director
            (1, 1)                                            hyperbolic congruence: two skew directors
            one of 1 and one 0                                parabolic congruence: one director, counted twice
            0                                                 degenerate congruence
    rank 5: W is one screw, with a pitch                      general linear complex
            without                                           special linear complex: the screw is a line

Numbers can't tell a form that vanishes from one that nearly does. So incidence is asked first wherever lines that meet
tell the special case: in a regulus no two lines meet, in two pencils one pair and its opposite pair, in bundles and
planes all; a degenerate congruence has three lines through one point or in one plane and all others in one plane or
through one point. What is left to the form on W is decided by how far the lines, moved by no more than they are known,
can change it (`klein.Span.holds_line`).
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.lines import klein
from cinegen.singularities.lines.incidence import Fit, fit_plane, fit_point

Array = NDArray[np.float64]


class Variety(Enum):
    """A variety of lines by its number in Merlet's paper. (2a, two skew lines, holds no third line: no lines are
    dependent in it.)"""

    ONE_LINE = "1"
    FLAT_PENCIL = "2b"
    REGULUS = "3a"
    TWO_PENCILS = "3b"
    BUNDLE = "3c"
    PLANE = "3d"
    ELLIPTIC_CONGRUENCE = "4a"
    HYPERBOLIC_CONGRUENCE = "4b"
    PARABOLIC_CONGRUENCE = "4c"
    DEGENERATE_CONGRUENCE = "4d"
    GENERAL_COMPLEX = "5a"
    SPECIAL_COMPLEX = "5b"

    @property
    def rank(self) -> int:
        """How many of its lines can be independent."""
        return int(self.value[0])


class Figure(NamedTuple):
    """A variety and what defines it, in the coordinates of the lines.

    Attributes:
        variety: which.
        points: homogeneous (4,): a vertex for each pencil or bundle.
        planes: homogeneous (4,): for each pencil or plane.
        directors: (6,) the line itself, the line that two pencils share, the lines that all meet.
        groups: positions of the lines that go through a point or lie in a plane apart from the others.
    """

    variety: Variety
    points: tuple[Array, ...] = ()
    planes: tuple[Array, ...] = ()
    directors: tuple[Array, ...] = ()
    groups: tuple[tuple[int, ...], ...] = ()


def figure(lines: Array, rank: int, accuracy: float) -> Figure:
    """The variety of rank `rank` that lines (n, 6) span, of which every `rank` are independent, n > rank.

    Of several that fit, the most special one: lines of that variety can be found within `accuracy` of the given ones.
    """
    return (_of_one, _of_two, _of_three, _of_four, _of_five)[rank - 1](lines, accuracy)


def _of_one(lines: Array, accuracy: float) -> Figure:
    return Figure(Variety.ONE_LINE, directors=(klein.span(lines, 1).basis[0],))


def _of_two(lines: Array, accuracy: float) -> Figure:
    return Figure(Variety.FLAT_PENCIL, (fit_point(lines).homogeneous,), (fit_plane(lines).homogeneous,))


def _of_three(lines: Array, accuracy: float) -> Figure:
    point, plane = fit_point(lines), fit_plane(lines)
    if min(point.residual, plane.residual) <= accuracy:
        if point.residual <= plane.residual:
            return Figure(Variety.BUNDLE, points=(point.homogeneous,))
        return Figure(Variety.PLANE, planes=(plane.homogeneous,))
    if len(lines) == 4:  # of five, three would be in one of two pencils
        first, second = min((((0, i), _others(4, (0, i))) for i in (1, 2, 3)), key=lambda pair: _apart(lines, *pair))
        if _apart(lines, first, second) <= accuracy:
            return _two_pencils(lines, first, second)
    return Figure(Variety.REGULUS)


def _two_pencils(lines: Array, first: tuple[int, ...], second: tuple[int, ...]) -> Figure:
    pairs = [lines[list(group)] for group in (first, second)]
    coefficients = np.linalg.svd(lines.T)[2][-1]
    shared = coefficients[list(first)] @ pairs[0]  # and the opposite of the same sum over the second
    return Figure(
        Variety.TWO_PENCILS,
        tuple(fit_point(pair).homogeneous for pair in pairs),
        tuple(fit_plane(pair).homogeneous for pair in pairs),
        (shared / np.linalg.norm(shared),),
        (first, second),
    )


def _of_four(lines: Array, accuracy: float) -> Figure:
    fits = [fit for fit in _degenerate(lines) if fit[0] <= accuracy]
    if fits:
        return min(fits, key=lambda fit: fit[0])[1]
    spanned = klein.span(lines, 4)
    found = klein.directors(spanned, accuracy)
    if found.all:  # W is next to a flat pencil, but no three lines show it
        found = klein.directors(spanned, 0.0)
    variety = {
        0: Variety.ELLIPTIC_CONGRUENCE,
        1: Variety.PARABOLIC_CONGRUENCE,
        2: Variety.HYPERBOLIC_CONGRUENCE,
    }[len(found.lines)]
    return Figure(variety, directors=tuple(found.lines))


def _degenerate(lines: Array) -> Iterator[tuple[float, Figure]]:
    """All ways to part the lines into three through one point, or in one plane, and the others in one plane, or through
    one point, with the point in the plane; each with how far the lines are from it."""
    for three in combinations(range(len(lines)), 3):
        others = _others(len(lines), three)
        one, rest = lines[list(three)], lines[list(others)]
        for point, plane, groups in (
            (fit_point(one), fit_plane(rest), (three, others)),
            (fit_point(rest), fit_plane(one), (others, three)),
        ):
            apart = max(point.residual, plane.residual, _off(point, plane))
            yield (
                apart,
                Figure(
                    Variety.DEGENERATE_CONGRUENCE,
                    points=(point.homogeneous,),
                    planes=(plane.homogeneous,),
                    groups=groups,
                ),
            )


def _of_five(lines: Array, accuracy: float) -> Figure:
    spanned = klein.span(lines, 5)
    screw = spanned.reciprocal[0]
    if spanned.holds_line(screw, accuracy):
        return Figure(Variety.SPECIAL_COMPLEX, directors=(screw,))
    return Figure(Variety.GENERAL_COMPLEX)


def _apart(lines: Array, first: tuple[int, ...], second: tuple[int, ...]) -> float:
    """How far two pairs of lines are from meeting: their larger mutual moment."""
    return max(abs(float(lines[i] @ klein.KLEIN @ lines[j])) for i, j in (first, second))


def _off(point: Fit, plane: Fit) -> float:
    """How far a point is from lying in a plane: n.x - c w."""
    x, n = point.homogeneous, plane.homogeneous
    return abs(float(x[:3] @ n[:3] - x[3] * n[3]))


def _others(count: int, some: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(i for i in range(count) if i not in some)
