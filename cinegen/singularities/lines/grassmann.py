"""Why lines are dependent: the smallest sets of them that are, and the variety that each spans.

Six legs hold a platform unless their lines are dependent: where the variety that n of them span is of rank n - 1 (J-P.
Merlet, "Singular configurations of parallel manipulators and Grassmann geometry", Int. J. of Robotics Research 8(5),
1989). `variety` has the rule by which a set is named.

Lines count as (d, m / length), with moments about one origin: "dependent" means that the smallest singular value of
these vectors is at most a tolerance, and nothing that is said depends on where, and in which unit, the lines are given.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.lines import klein
from cinegen.singularities.lines.dependence import Dependence
from cinegen.singularities.lines.dependent_set import DependentSet
from cinegen.singularities.lines.frame import Frame, sense
from cinegen.singularities.lines.line import Line, LineError
from cinegen.singularities.lines.variety import Variety, figure

Array = NDArray[np.float64]

DEPENDENT = 1e-7
"""Lines whose smallest singular value is at most this are dependent."""

Circuit = tuple[int, ...]
"""Lines that are dependent while no fewer of them are, counted from 0, in order."""

_NEW = 1e-6  # how much of a unit dependence must be no sum of others
_MARGIN = 10.0  # lines may each be off by some times what their singular value tells


def nearness(lines: Sequence[Line], length: float, origin: Array | None = None) -> float:
    """The smallest singular value of the lines' (d, m / length), 0 where they are dependent.

    To make them dependent, lines must change by at least as much, all changes together: sum |change|^2 >= sigma^2, in
    rad for directions and in `length` for moments. So it is how far a pose is from any singularity at least.

    Args:
        lines: one to six.
        length: the characteristic length, as the platform's radius.
        origin: (3,) about which moments are taken; where not given, as in `classify`.
    """
    _check(lines)
    vectors = Frame.of(lines, length, origin).coordinates(lines)
    return float(np.linalg.svd(vectors, compute_uv=False)[-1])


def classify(
    lines: Sequence[Line],
    length: float,
    names: Sequence[str] | None = None,
    tolerance: float = DEPENDENT,
    origin: Array | None = None,
) -> Dependence | None:
    """Why lines are dependent; None where they are not.

    Args:
        lines: one to six.
        length: the characteristic length, as the platform's radius.
        names: of the lines, for the reason in words; "1", "2", ... where not given.
        tolerance: how accurate the lines are: below it a singular value is 0, and lines meet.
        origin: (3,) about which moments are taken; where not given, the centroid of the points at which the lines were
            made (`Frame.of`).

    Raises:
        LineError: more than six lines, or none; names that are not as many; a tolerance not between 0 and 1.
    """
    _check(lines)
    if not 0.0 < tolerance < 1.0:
        raise LineError(f"lines were to be known to {tolerance}; give a tolerance between 0 and 1, as {DEPENDENT}")
    labels = tuple(names) if names is not None else tuple(str(i + 1) for i in range(len(lines)))
    if len(labels) != len(lines):
        raise LineError(f"{len(lines)} lines have {len(labels)} names: {', '.join(labels)}; name each")
    frame = Frame.of(lines, length, origin)
    vectors = frame.coordinates(lines)
    sigma = np.linalg.svd(vectors, compute_uv=False)
    if sigma[-1] > tolerance:
        return None
    rank = int((sigma > tolerance).sum())
    whole = klein.span(vectors, rank)
    accuracy = max(tolerance, _MARGIN * whole.vanishing)
    return Dependence(
        rank=rank,
        sigma=float(sigma[-1]),
        names=labels,
        sets=tuple(_name(frame, vectors, circuits, tolerance) for circuits in _reasons(vectors, rank, tolerance)),
        gained=tuple(
            frame.screw(screw, whole.known(accuracy), whole.holds_line(screw, accuracy)) for screw in whole.reciprocal
        ),
        length=frame.length,
    )


def near(
    lines: Sequence[Line],
    length: float,
    within: float,
    names: Sequence[str] | None = None,
    tolerance: float = DEPENDENT,
    origin: Array | None = None,
) -> Dependence | None:
    """The dependence that lines are near to without being in it; None where they are in one, or near to none.

    It is named as if the lines were only known to `within`: the smallest sets whose singular value is at most that, and
    the most special variety that is no further away. `Dependence.sigma` says how near it is, its words say "nearly".

    Args:
        lines: one to six.
        length: the characteristic length.
        within: the largest singular value that is near, as 1e-2; more than `tolerance`.
        names: of the lines.
        tolerance: up to which lines are dependent, not near.
        origin: (3,) about which moments are taken; where not given, as in `classify`.
    """
    if nearness(lines, length, origin) <= tolerance:
        return None
    found = classify(lines, length, names, within, origin)
    return found and found.loosely()


def _check(lines: Sequence[Line]) -> None:
    if not 1 <= len(lines) <= 6:
        raise LineError(f"{len(lines)} lines were given; one to six can be independent in space")


def _reasons(vectors: Array, rank: int, tolerance: float) -> list[list[Circuit]]:
    """The circuits, sets of lines that are dependent while no fewer of them are: all of the smallest size, then larger
    ones until every dependence of the lines is a sum of theirs; those that span the same together."""
    count = len(vectors)
    found: list[list[Circuit]] = []
    known: list[Circuit] = []
    dependences = np.zeros((0, count))
    for size in range(2, count + 1):
        circuits = _circuits(vectors, size, known, tolerance)
        for together in _together(circuits):
            grown = np.vstack([dependences, *(_dependence(vectors, circuit) for circuit in together)])
            if not known or np.linalg.matrix_rank(grown, tol=_NEW) > np.linalg.matrix_rank(dependences, tol=_NEW):
                found.append(together)
                dependences = grown
        known += circuits
        if np.linalg.matrix_rank(dependences, tol=_NEW) >= count - rank:
            break
    return found or [[tuple(range(count))]]  # rounding parts the tests of all lines only


def _circuits(vectors: Array, size: int, smaller: list[Circuit], tolerance: float) -> list[Circuit]:
    """The dependent sets of a size that hold none of the smaller ones. A column more never raises the smallest singular
    value, so each set that holds a dependent one is dependent."""
    sets = [some for some in combinations(range(len(vectors)), size) if not any(set(c) <= set(some) for c in smaller)]
    if not sets:
        return []
    sigma = np.linalg.svd(vectors[np.array(sets)], compute_uv=False)[:, -1]
    return [some for some, value in zip(sets, sigma, strict=True) if value <= tolerance]


def _dependence(vectors: Array, circuit: Circuit) -> Array:
    """(n,) the coefficients with which the lines of a circuit add up to 0: a unit vector, the largest positive."""
    lines = list(circuit)
    coefficients = np.zeros(len(vectors))
    coefficients[lines] = np.linalg.svd(vectors[lines].T)[2][-1]
    return coefficients * sense(coefficients)


def _together(circuits: list[Circuit]) -> list[list[Circuit]]:
    """Circuits of one size that span the same: those that share all lines but one, which are independent."""
    groups: list[list[Circuit]] = []
    for some in circuits:
        same = [group for group in groups if any(len(set(some) & set(other)) == len(some) - 1 for other in group)]
        groups = [group for group in groups if group not in same]
        groups.append([*(other for group in same for other in group), some])
    return sorted((sorted(group) for group in groups), key=lambda group: (-len(group), group))


def _name(frame: Frame, vectors: Array, circuits: list[Circuit], tolerance: float) -> DependentSet:
    """The variety that some circuits span together."""
    rank = len(circuits[0]) - 1
    lines = tuple(sorted({line for circuit in circuits for line in circuit}))
    if len(circuits) < comb(len(lines), rank + 1):  # some of the lines are in smaller circuits
        lines, circuits = circuits[0], circuits[:1]
    spanned = klein.span(vectors[list(lines)], rank)
    accuracy = max(tolerance, _MARGIN * spanned.vanishing)
    known = spanned.known(accuracy)
    found = figure(vectors[list(lines)], rank, accuracy)
    screw = spanned.reciprocal[0]
    first = list(circuits[0])
    return DependentSet(
        lines=lines,
        smallest=tuple(circuits),
        variety=found.variety,
        sigma=float(np.linalg.svd(vectors[first], compute_uv=False)[-1]),
        coefficients=_dependence(vectors, circuits[0])[first],
        points=tuple(frame.point(point, accuracy) for point in found.points),
        planes=tuple(frame.plane(plane) for plane in found.planes),
        directors=tuple(frame.line(director, known) for director in found.directors),
        groups=tuple(tuple(lines[i] for i in group) for group in found.groups),
        screw=frame.screw(screw, known, found.variety is Variety.SPECIAL_COMPLEX) if rank == 5 else None,
        directions=_rank(vectors[list(lines), :3], accuracy),
    )


def _rank(directions: Array, accuracy: float) -> int:
    return int((np.linalg.svd(directions, compute_uv=False) > accuracy).sum())
