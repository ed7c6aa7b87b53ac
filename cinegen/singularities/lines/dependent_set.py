"""A set of lines that is dependent, and the variety that it spans."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.lines.frame import Plane, Point
from cinegen.singularities.lines.line import Line, LineAtInfinity
from cinegen.singularities.lines.screw import Screw
from cinegen.singularities.lines.variety import Variety

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DependentSet:
    """Lines that span a variety too small for them. Lines are counted from 0.

    Attributes:
        lines: all that are in the smallest sets, and lie in the variety.
        smallest: the sets of one line more than the rank, of which no fewer lines are dependent; where there is one, it
            is `lines`.
        variety: which.
        sigma: smallest singular value of the first smallest set.
        coefficients: unit vector, for each line of the first smallest set: the sum of these times the lines' Pluecker
            vectors is 0. Forces of these sizes along the lines hold each other.
        points: the vertex of a pencil, of each of two pencils, of a bundle, of a degenerate congruence.
        planes: the plane of a pencil, of each of two pencils, of a plane, of a degenerate congruence.
        directors: the line that all are; that two pencils share; the two, one or no lines that all of a congruence
            meet; the line that all of a special complex meet.
        groups: lines of each of two pencils; those through the point and those in the plane of a degenerate congruence.
        screw: what is reciprocal to all lines of a complex: the motion that they leave free.
        directions: how many of the lines' directions are independent.
    """

    lines: tuple[int, ...]
    smallest: tuple[tuple[int, ...], ...]
    variety: Variety
    sigma: float
    coefficients: Array
    points: tuple[Point, ...]
    planes: tuple[Plane, ...]
    directors: tuple[Line | LineAtInfinity, ...]
    groups: tuple[tuple[int, ...], ...]
    screw: Screw | None
    directions: int
