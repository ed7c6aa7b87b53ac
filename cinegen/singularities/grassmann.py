"""Grassmann classes: the smallest sets of lines that are dependent, and the variety that each spans.

Six legs constrain a platform unless their lines are dependent: where the variety that n of them span is of rank n - 1
(J-P. Merlet, "Singular configurations of parallel manipulators and Grassmann geometry", Int. J. of Robotics Research
8(5), 1989). Lines count as (d, m / length), with moments about one origin: "dependent" means that the smallest singular
value of these vectors is at most a tolerance, and results do not depend on the frame and the unit of the lines.

All lines of space, as Pluecker vectors, span rank 6; those that lie in a subspace of rank r make a variety of rank r,
and r + 1 of them are dependent. Its class follows from the Klein form x.K.x = 2 d.m on the subspace V (F. Klein, "Zur
Theorie der Liniencomplexe des ersten und zweiten Grades", Math. Annalen 2, 1870), or, as V's signature and that of its
reciprocal complement W add up to (3, 3), on W. With a set of r + 1 lines of which every r are independent:

    rank 1: the form vanishes on V                            one line
    rank 2: ... too, as three of its vectors are lines        flat pencil
            (1, 1) on V                                       two skew lines
    rank 3: (2, 1) or (1, 2) on V                             regulus
            (1, 1) and one 0                                  two flat pencils that share a line
            0 on V                                            bundle, or plane: incidence decides
    rank 4: on W (2, 0) or (0, 2)                             elliptic congruence: no director
            (1, 1)                                            hyperbolic congruence: two skew directors
            one of 1 and one 0                                parabolic congruence: one director, counted twice
            0                                                 degenerate congruence
    rank 5: W is one screw, with a pitch                      general linear complex
            without                                           special linear complex: the screw is a line

Numbers can't distinguish a form that vanishes from one that nearly does. So incidence decides first wherever lines that
meet show the special case: in a regulus no two lines meet, in two pencils one pair and its opposite pair, in bundles
and planes all; a degenerate congruence has three lines through one point or in one plane and all others in one plane or
through one point. The remaining cases are decided on W by how far the lines, moved by no more than they are known, can
change the form (`KleinSpan.contains_line`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import comb
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.singularities import reason
from cinegen.singularities.line_varieties import DEPENDENT, MARGIN, GrassmannClass, class_of_span, span, variety
from cinegen.singularities.pluecker import (
    AnyLine,
    LineFrame,
    LinePlane,
    PlueckerError,
    PlueckerLine,
    ProjectivePoint,
    Screw,
    sense,
)
from cinegen.singularities.screw_system import ScrewSystem
from cinegen.typed_json import as_json

Circuit = tuple[int, ...]
"""Lines that are dependent while no fewer of them are, counted from 0, in order."""

_NEW = 1e-6  # how much of a unit dependence must be no sum of others


@dataclass(frozen=True, eq=False, repr=False)
class DependentSet:
    """Lines that span a variety too small for them. Lines are counted from 0.

    Attributes:
        lines: all that are in the smallest sets, and lie in the variety.
        smallest: the sets of one line more than the rank, of which no fewer lines are dependent; if there is one, it is
            `lines`.
        grassmann_class: of the variety.
        sigma: smallest singular value of the first smallest set.
        coefficients: unit vector, for each line of the first smallest set: the sum of these times the lines' Pluecker
            vectors is 0. Forces of these sizes along the lines are in equilibrium.
        points: the vertex of a pencil, of each of two pencils, of a bundle, of a degenerate congruence.
        planes: the plane of a pencil, of each of two pencils, of a plane, of a degenerate congruence.
        directors: the line that all are; that two pencils share; the two, one or no lines that all of a congruence
            meet; the line that all of a special complex meet.
        groups: lines of each of two pencils; those through the point and those in the plane of a degenerate congruence.
        screw: reciprocal to all lines of a complex: the motion that they leave free.
        directions: number of independent directions of the lines.
    """

    lines: tuple[int, ...]
    smallest: tuple[Circuit, ...]
    grassmann_class: GrassmannClass
    sigma: float
    coefficients: Array
    points: tuple[ProjectivePoint, ...]
    planes: tuple[LinePlane, ...]
    directors: tuple[AnyLine, ...]
    groups: tuple[tuple[int, ...], ...]
    screw: Screw | None
    directions: int

    def __repr__(self) -> str:
        return f"<DependentSet of lines {', '.join(map(str, self.lines))} (from 0): {self.grassmann_class.title}>"


@dataclass(frozen=True, eq=False, repr=False)
class Dependence:
    """The reason why lines are dependent.

    Attributes:
        rank: of all lines together.
        sigma: the smallest singular value of all lines, 0 if they are dependent. To make them dependent, lines must
            change by at least as much, all changes together: sum |change|^2 >= sigma^2, in rad for directions and in
            `length` for moments. So it bounds the distance of a pose from any singularity from below.
        count: number of lines.
        sets: the sets that are dependent while no fewer of their lines are: all of the smallest size, then larger ones
            until the rank is explained. Those that span the same count as one.
        class_of_all: the class of the variety that all lines span together.
        forces: all wrenches that the lines can support together, of order `rank`.
        length: the characteristic length.
        nearly: whether the lines are only near to it.
    """

    rank: int
    sigma: float
    count: int
    sets: tuple[DependentSet, ...]
    class_of_all: GrassmannClass
    forces: ScrewSystem
    length: float
    nearly: bool = False

    def __repr__(self) -> str:
        return f"<Dependence of {self.count} lines of rank {self.rank}, {self.class_of_all.title}: {self.text()}>"

    @property
    def motions(self) -> ScrewSystem:
        """All twists that the lines leave free: those on which forces along them do no work."""
        return self.forces.reciprocal

    @property
    def uncontrolled(self) -> tuple[Screw, ...]:
        """A basis of `motions`. One screw if the rank is 5."""
        return self.motions.screws

    @property
    def lines(self) -> tuple[int, ...]:
        """The lines of the first set, counted from 0."""
        return self.sets[0].lines

    @property
    def grassmann_class(self) -> GrassmannClass:
        """The class of the first set."""
        return self.sets[0].grassmann_class

    def text(self, unit: str = "") -> str:
        """Return the reason as a text about legs, lengths in a unit such as "mm" or without one."""
        reasons = "; ".join(reason.text(some, self.count, unit, self.length) for some in self.sets)
        return f"nearly: {reasons}" if self.nearly else reasons

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad, legs counted from 1."""
        sets = [
            {
                "class": some.grassmann_class.title,
                "legs": [i + 1 for i in some.lines],
                "text": reason.text(some, self.count, "m", self.length),
            }
            for some in self.sets
        ]
        systems = {name: getattr(self, name).as_dict() for name in ("forces", "motions")}
        return as_json(
            self, "rank", "sigma", near=self.nearly, class_of_all=self.class_of_all.title, **systems, sets=sets
        )


def classify(lines: Sequence[PlueckerLine], length: float, tolerance: float = DEPENDENT) -> Dependence | None:
    """Return why lines are dependent; None if they are not.

    Moments are taken about the centroid of the points at which the lines were made (`LineFrame.of`).

    Args:
        lines: one to six.
        length: the characteristic length, as the platform's radius.
        tolerance: how accurate the lines are: below it a singular value is 0, and lines meet.

    Raises:
        PlueckerError: more than six lines, or none; the length is not positive; a tolerance not between 0 and 1.
    """
    if not 1 <= len(lines) <= 6:
        raise PlueckerError(f"{len(lines)} lines were given; one to six can be independent in space")
    if not 0.0 < tolerance < 1.0:
        raise PlueckerError(f"the tolerance is {tolerance}; give one between 0 and 1, as {DEPENDENT}")
    frame = LineFrame.of(lines, length)
    vectors = frame.coordinates(lines)
    sigma = np.linalg.svd(vectors, compute_uv=False)
    if sigma[-1] > tolerance:
        return None
    rank = int((sigma > tolerance).sum())
    whole = span(vectors, rank)
    accuracy = max(tolerance, MARGIN * whole.vanishing)
    sets = tuple(_named(frame, vectors, circuits, tolerance) for circuits in _reasons(vectors, rank, tolerance))
    largest = next((some.grassmann_class for some in sets if some.grassmann_class.rank == rank), None)
    return Dependence(
        rank, float(sigma[-1]), len(lines), sets, largest or class_of_span(whole, accuracy),
        ScrewSystem(whole.basis, frame, whole.known(accuracy), wrenches=True), frame.length,
    )  # fmt: skip


def near(
    lines: Sequence[PlueckerLine], length: float, within: float, tolerance: float = DEPENDENT
) -> Dependence | None:
    """Return the dependence that lines are near to without being in it; None if they are in one, or near to none.

    It is classified as if the lines were only known to `within`: the smallest sets whose singular value is at most
    that, and the most special variety that is no further away. `Dependence.sigma` is the distance.

    Args:
        lines: one to six.
        length: the characteristic length.
        within: the largest singular value that is near, as 1e-2; more than `tolerance`.
        tolerance: up to which lines are dependent, not near.

    Raises:
        PlueckerError: see `classify`.
    """
    dependence = classify(lines, length, within)
    return None if dependence is None or dependence.sigma <= tolerance else replace(dependence, nearly=True)


# --- dependent sets ---------------------------------------------------------------------------------------------------


def _reasons(vectors: Array, rank: int, tolerance: float) -> list[list[Circuit]]:
    """Return the circuits, sets of lines that are dependent while no fewer of them are: all of the smallest size, then
    larger ones until every dependence of the lines is a sum of theirs; those that span the same together."""
    count = len(vectors)
    reasons: list[list[Circuit]] = []
    known: list[Circuit] = []
    dependences = np.zeros((0, count))
    for size in range(2, count + 1):
        circuits = _circuits(vectors, size, known, tolerance)
        for together in _merged(circuits):
            grown = np.vstack([dependences, *(_dependence(vectors, circuit) for circuit in together)])
            if not known or np.linalg.matrix_rank(grown, tol=_NEW) > np.linalg.matrix_rank(dependences, tol=_NEW):
                reasons.append(together)
                dependences = grown
        known += circuits
        if np.linalg.matrix_rank(dependences, tol=_NEW) >= count - rank:
            break
    return reasons or [[tuple(range(count))]]  # rounding parts the tests of all lines only


def _circuits(vectors: Array, size: int, smaller: list[Circuit], tolerance: float) -> list[Circuit]:
    """Return the dependent sets of a size that contain none of the smaller ones. A column more never raises the
    smallest singular value, so each set that contains a dependent one is dependent."""
    sets = [some for some in combinations(range(len(vectors)), size) if not any(set(c) <= set(some) for c in smaller)]
    if not sets:
        return []
    sigma = np.linalg.svd(vectors[np.array(sets)], compute_uv=False)[:, -1]
    return [some for some, value in zip(sets, sigma, strict=True) if value <= tolerance]


def _dependence(vectors: Array, circuit: Circuit) -> Array:
    """Return the coefficients (n,) with which the lines of a circuit add up to 0: a unit vector, the largest
    positive."""
    lines = list(circuit)
    coefficients = np.zeros(len(vectors))
    coefficients[lines] = np.linalg.svd(vectors[lines].T)[2][-1]
    return coefficients * sense(coefficients)


def _merged(circuits: list[Circuit]) -> list[list[Circuit]]:
    """Return circuits in groups of those that span the same: two that differ in one line only."""
    groups: list[list[Circuit]] = []
    for some in circuits:
        same = [group for group in groups if any(len(set(some) & set(other)) == len(some) - 1 for other in group)]
        groups = [group for group in groups if group not in same]
        groups.append([*(other for group in same for other in group), some])
    return sorted((sorted(group) for group in groups), key=lambda group: (-len(group), group))


def _named(frame: LineFrame, vectors: Array, circuits: list[Circuit], tolerance: float) -> DependentSet:
    """Return the variety that some circuits span together."""
    rank = len(circuits[0]) - 1
    lines = tuple(sorted({line for circuit in circuits for line in circuit}))
    if len(circuits) < comb(len(lines), rank + 1):  # some of the lines are in smaller circuits
        lines, circuits = circuits[0], circuits[:1]
    some, first = vectors[list(lines)], list(circuits[0])
    spanned = span(some, rank)
    accuracy = max(tolerance, MARGIN * spanned.vanishing)
    known, geometry = spanned.known(accuracy), variety(some, rank, accuracy)
    special = geometry.grassmann_class is GrassmannClass.SPECIAL_COMPLEX
    return DependentSet(
        lines=lines,
        smallest=tuple(circuits),
        grassmann_class=geometry.grassmann_class,
        sigma=float(np.linalg.svd(vectors[first], compute_uv=False)[-1]),
        coefficients=_dependence(vectors, circuits[0])[first],
        points=tuple(frame.point(point, accuracy) for point in geometry.points),
        planes=tuple(frame.plane(plane) for plane in geometry.planes),
        directors=tuple(frame.line(director, known) for director in geometry.directors),
        groups=tuple(tuple(lines[i] for i in group) for group in geometry.groups),
        screw=frame.screw(spanned.reciprocal[0], known, special) if rank == 5 else None,
        directions=int((np.linalg.svd(some[:, :3], compute_uv=False) > accuracy).sum()),
    )


# --- the Klein form ---------------------------------------------------------------------------------------------------


# --- varieties --------------------------------------------------------------------------------------------------------
