"""Certificates of real solutions: Krawczyk's test in ball arithmetic.

Let f be n differentiable functions of n unknowns, x an approximate solution, A an approximate inverse of the derivative
f'(x), and X the box of all points within a radius of x. If the set

    K(X) = x - A f(x) + (I - A f'(X)) (X - x)

lies in the interior of X, then f has exactly one zero in X, and K(X) contains it (R. Krawczyk, "Newton-Algorithmen zur
Bestimmung von Nullstellen mit Fehlerschranken", Computing 4, 1969; S. M. Rump, "Verification methods: rigorous results
using floating-point arithmetic", Acta Numerica 19, 2010). As x, A and f are real, the zero is real. All numbers are
balls, a midpoint and a radius that bounds all rounding (F. Johansson, "Arb: efficient arbitrary-precision
midpoint-radius interval arithmetic", IEEE Trans. Computers 66, 2017), so that the test is a proof. It is the one that
HomotopyContinuation.jl's `certify` makes (P. Breiding, K. Rose, S. Timme, "Certifying zeros of polynomial systems using
interval arithmetic", ACM TOMS 49, 2023), with real boxes from the start.

Equations of mechanisms are often more than are independent. n of them are selected, and the values of the others are
bounded in K(X), in which the zero lies. An equation whose bound is exactly 0 holds, as all of a planar linkage do that
are not in its plane. For the others no numerical method can do more: a small value is not 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from flint import arb, arb_mat
from scipy.linalg import qr

from cinegen.arrays import Array
from cinegen.balls import precise

_RADII = 1e-8, 1e-10, 1e-12  # of boxes that are tried, from the largest
_MARGIN, _LARGEST = 4.0, 1e-6  # ... and a box so many times as large as a Newton step, up to this
_DEPENDENT = 1e-6  # part of the largest pivot
_HOLDS = 1e-9  # bound of the equations that are not selected


class Values(NamedTuple):
    """Equations over a box.

    Attributes:
        residual: (m,) their values.
        jacobian: (m, k) their derivatives.
        positive: numbers that are positive at a solution.
    """

    residual: list[arb]
    jacobian: list[list[arb]]
    positive: list[arb]


@dataclass(frozen=True)
class Certificate:
    """Proof that equations have a real solution near a point, and no other one there.

    Attributes:
        radius: of the box around the point in which the solution is the only one, rad and characteristic lengths.
        error: bound of the distance from the point to the solution, in any coordinate, rad and characteristic lengths.
        equations: number of independent equations that the solution fulfils exactly.
        others: number of further equations, of which it is proved only that the solution fulfils them to within `gap`:
            those that depend on the first in this mechanism, as it was designed. 0 if all hold.
        gap: bound of their values, rad and characteristic lengths; 0 if there are none.
    """

    radius: float
    error: float
    equations: int
    others: int
    gap: float


def certify(
    equations: Callable[[Sequence[arb], bool], Values], point: Array, units: Array, rank: int
) -> tuple[Certificate, list[arb]] | None:
    """Return the certificate of a solution near a point, and a box (k,) that contains the solution; None if there is no
    certificate, as of singular solutions.

    Args:
        equations: returns their values over a box (k,), with derivatives if asked for.
        point: (k,) approximate solution, taken as exact doubles.
        units: (k,) size of a dimensionless step of each unknown.
        rank: number of independent equations, where the solution is regular. If it is less than k, some unknowns are
            kept at the point's values, so that the solution is the only one with these.
    """
    with precise():
        centre, steps = [arb(float(x)) for x in point], [arb(float(unit)) for unit in units]
        start = equations(centre, True)
        slopes = np.array([[float(entry) for entry in row] for row in start.jacobian]).reshape(-1, len(point)) * units
        if rank > min(slopes.shape) or not np.isfinite(slopes).all():
            return None
        triangle, order = qr(slopes, mode="r", pivoting=True)
        columns = np.sort(order[:rank])
        if rank < min(slopes.shape) and abs(triangle[rank, rank]) > _DEPENDENT * abs(triangle[0, 0]):
            return None  # more equations are independent than was assumed
        rows = np.sort(qr(slopes[:, columns].T, mode="r", pivoting=True)[1][:rank])
        try:
            inverse = np.linalg.inv(slopes[np.ix_(rows, columns)])
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(inverse).all():
            return None
        newton = arb_mat(inverse.tolist())
        step = [-entry for entry in (newton * arb_mat(rank, 1, [start.residual[i] for i in rows])).entries()]
        length = max((_bound(entry) for entry in step), default=0.0)
        identity = arb_mat(rank, rank, [int(i == j) for i in range(rank) for j in range(rank)])

        def moved(offsets: Sequence[arb]) -> list[arb]:
            box = list(centre)
            for column, offset in zip(columns.tolist(), offsets, strict=True):
                box[column] = centre[column] + steps[column] * offset
            return box

        for radius in sorted({*_RADII, min(_MARGIN * length, _LARGEST)}, reverse=True):
            if not radius > length:
                break
            values = equations(moved([arb(0, radius)] * rank), True)
            derivative = arb_mat([[values.jacobian[i][j] * steps[j] for j in columns] for i in rows.tolist()])
            spread = (identity - newton * derivative) * arb_mat(rank, 1, [arb(0, radius)] * rank)
            image = [offset + wide for offset, wide in zip(step, spread.entries(), strict=True)]
            error = max((_bound(entry) for entry in image), default=0.0)
            if not error < radius:
                continue
            box = moved(image)
            inside = equations(box, False)
            chosen = set(rows.tolist())
            bounds = [_bound(entry) for i, entry in enumerate(inside.residual) if i not in chosen]
            left = [bound for bound in bounds if bound > 0.0]
            gap = max(left, default=0.0)
            if not gap < _HOLDS or not all(number > 0 for number in inside.positive):
                return None
            return Certificate(radius, error, rank, len(left), gap), box
    return None


def distinct(certified: Iterable[tuple[Certificate, Sequence[arb]] | None]) -> tuple[Certificate | None, ...]:
    """Return the certificate of each solution, if there is one and if the solution differs from those before it.

    Args:
        certified: certificates, each with numbers that differ between solutions, computed over the solution's box.
    """
    certificates, boxes = list[Certificate | None](), list[Array]()
    for pair in certified:
        certificate = None
        if pair is not None:
            lower = [np.nextafter(float(number.lower()), -np.inf) for number in pair[1]]
            upper = [np.nextafter(float(number.upper()), np.inf) for number in pair[1]]
            if all((lower > other[1]).any() or (other[0] > upper).any() for other in boxes):
                boxes.append(np.array([lower, upper]))
                certificate = pair[0]
        certificates.append(certificate)
    return tuple(certificates)


def _bound(number: arb) -> float:
    """Return a double that is not below the absolute value of any number of a ball; 0.0 for the exact 0."""
    bound = float(number.abs_upper())
    return 0.0 if number.is_zero() else float(np.nextafter(bound, np.inf))
