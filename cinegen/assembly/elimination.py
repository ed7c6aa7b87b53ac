"""All closures of a loop of six revolute joints by elimination, counted with balls: at most 16.

The loop is Rz(q1) K1 Rz(q2) K2 ... Rz(q6) K6 = 1, with constant placements K. M. Raghavan and B. Roth, "Inverse
kinematics of the general 6R manipulator and related linkages", J. Mechanical Design 115, 1993, cut it twice:

    K2 Rz(q3) K3 Rz(q4) K4 Rz(q5) K5  =  Rz(-q2) K1^-1 Rz(-q1) K6^-1 Rz(-q6)                                        (1)

The third axis l and the origin p of both sides do not depend on q6. Displacements act linearly on the 15 numbers

    v = (p, l, p x l, p.p, p.l, (p.p) l - 2 (p.l) p, 1)                                                              (2)

so (1) gives 14 equations, trilinear in 1, cos, sin of q3, q4, q5 at the left, bilinear in those of q1, q2 at the right.
Eight of them yield the eight products at the right. With these, six equations are left in q3, q4, q5. In the tangents
x4, x5 of half of q4 and q5 they are of degree 2 in each. They, and x4 times they, are 12 linear equations for 12
products of powers, with a matrix S(q3), affine in cos q3 and sin q3, whose determinant vanishes at every closure.

With x the tangent of half of q3 minus a constant, det S (1 + x^2)^8 is a polynomial of degree 16 (Raghavan and Roth).
If its leading coefficient is not 0 and its roots are simple, no two closures, real or complex, have the same q3: at a
simple root the null space of S has one dimension, hence one x4 and one x5, then one right side of the eight equations,
and one q6. So there are at most as many real closures as real roots.

Raghavan and Roth expand the determinant; D. Manocha and J. Canny, "Efficient inverse kinematics for general 6R
manipulators", IEEE Trans. Robotics and Automation 10, 1994, compute eigenvalues in doubles. Where three axes are almost
parallel or almost meet, as in a calibrated arm, both lose all digits: eight closures tend to infinity, or to others,
and det S tends to 0. Here all numbers are balls, of so many digits that rounding stays far below what is left. They
enclose the polynomial, and Arb isolates its roots by a proof. Where axes are exactly special nothing is left, and there
is no result. Nor is there one where rounding of the loop's numbers changes it, as where the first axis and the last are
one line: there the loop has a curve of closures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from flint import acb, acb_poly, arb, arb_mat, arb_poly
from scipy.linalg import qr

from cinegen.arrays import Array
from cinegen.balls import axes_and_origin, cross, dot, precise

BITS = 512
"""Precision: enough for axes that are parallel, or meet, to within rounding."""

DEGREE = 16
"""Largest number of closures."""

_OFFSET = 0.3  # of q3, rad: a general angle
_NODES = 25  # det S has 12 harmonics, of which those above 8 are 0
_NEARLY = 1e-6  # rad, imaginary part of an angle that rounding of the loop's numbers may have made complex
_FAR = 3.0  # ... beyond which angles are not compared
_OPEN = 1e-4  # rad, characteristic lengths: what is not nearly closed belongs to a complex closure
_TOLERANCE = 1e-60  # of roots, so that angles which follow from them are right in spite of cancellation
_NUDGE = 1e-15  # rad, characteristic lengths: rounding of a pose
_MOVED = 1e-3  # rad: what it may move angles by

_HALVES = np.kron(*[np.array([[1, 0, 1], [1, 0, -1], [0, 2, 0]])] * 2)
"""Products of 1, cos q4, sin q4 with those of q5, as polynomials in x4, x5, times (1 + x4^2) (1 + x5^2)."""


class DegenerateError(ArithmeticError):
    """Closures that are not counted: a curve of them, several with the same angle, or axes that are exactly special."""


class Closures(NamedTuple):
    """The real closures of a loop, and their largest number.

    Attributes:
        angles: (n, 6) of the real ones first, then of pairs that rounding may have made complex.
        real: number of real ones: there are no more.
    """

    angles: Array
    real: int


def closures(constants: Sequence[arb_mat]) -> Closures:
    """Return all real closures of a loop.

    Args:
        constants: K1 to K6, placements (4, 4) computed with `BITS`.

    Raises:
        DegenerateError: they can't be counted, or rounding of the numbers to doubles would change them.
    """
    with precise(BITS):
        nudged = [*constants[:5], constants[5] * _nudge()]
        turned = [(_Loop(_turn(constants, k)), k) for k in range(6)]
        for loop, k in sorted(turned, key=lambda pair: -pair[0].pivot):
            try:
                roots, moved = loop.roots, _Loop(_turn(nudged, k)).roots
            except (DegenerateError, ZeroDivisionError):
                continue
            if not (_are_among(roots, moved) and _are_among(moved, roots)):
                break
            real = [x for x in roots if _is_real(x, roots)]
            others = [x for x in roots if x not in real and abs(_angle(x).imag) < _NEARLY]
            ends = [loop.angles(x) for x in (*real, *others)]
            if all(gap < _OPEN for _, gap in ends[: len(real)]):
                closed = [np.roll(angles, k) for angles, gap in ends if gap < _OPEN]
                return Closures(np.array(closed).reshape(-1, 6), len(real))
    raise DegenerateError


class _Loop:
    """A loop of given constants."""

    def __init__(self, constants: Sequence[arb_mat]) -> None:
        self._constants = constants
        first, last = (constants[k].inv() for k in (0, 5))
        self._right = _turned(_moved(first, _turned(_vector(last))))
        matrix = np.array([[float(x.mid()) for x in row[1:]] for row in self._right.tolist()[:14]])
        triangle, order = qr(matrix.T, mode="r", pivoting=True)
        self._top, self._rest = order[:8].tolist(), order[8:].tolist()
        self.pivot = float(abs(triangle[7, 7] / triangle[0, 0]))

    @cached_property
    def _left(self) -> arb_mat:
        """(15, 27) coefficients of (1, cos, sin) of q3 times those of q4 times those of q5; the constant of the right
        side is among them."""
        left = _vector(self._constants[4])
        for k in (3, 2, 1):
            left = _moved(self._constants[k], _turned(left))
        for i in range(15):
            left[i, 0] = left[i, 0] - self._right[i, 0]
        return left

    @cached_property
    def _eight(self) -> arb_mat:
        """(8, 8) of the equations that yield the products at the right."""
        return _part(self._right, self._top, range(1, 9))

    @cached_property
    def _matrices(self) -> list[arb_mat]:
        """S (12, 12) is the first plus cos q3 times the second plus sin q3 times the third."""
        right = _part(self._right, self._rest, range(1, 9)).transpose()
        weights = self._eight.transpose().solve(right).transpose()
        every = range(27)
        six = _part(self._left, self._rest, every) - weights * _part(self._left, self._top, every)
        halves, zero, matrices = arb_mat(9, 9, _HALVES.ravel().tolist()), [arb(0)] * 3, []
        for k in range(0, 27, 9):
            rows = (_part(six, range(6), range(k, k + 9)) * halves).tolist()
            matrices.append(arb_mat([padded for row in rows for padded in (row + zero, zero + row)]))
        return matrices

    def _matrix(self, x: arb) -> arb_mat:
        """Return S where x is the tangent of half of q3 minus the offset."""
        s, c = _third(x).sin_cos()
        first, second, third = self._matrices
        return first + c * second + s * third

    @cached_property
    def roots(self) -> list[acb]:
        """The roots of the polynomial: disjoint balls with one each.

        Raises:
            DegenerateError: its degree is less, or roots are multiple.
        """
        nodes = [*range(DEGREE + 1), *np.arange(0.5, _NODES - DEGREE - 1).tolist()]
        angles = [arb.pi() * (2 * k - DEGREE) / (2 * DEGREE + 2) for k in nodes]
        points = [angle.tan() for angle in angles]
        values = [self._matrix(x).det() / angle.cos() ** DEGREE for x, angle in zip(points, angles, strict=True)]
        polynomial = arb_poly.interpolate(points[: DEGREE + 1], values[: DEGREE + 1], algorithm="newton")
        as_known = all(polynomial(x).overlaps(y) for x, y in zip(points, values, strict=True))
        if len(polynomial) <= DEGREE or polynomial[DEGREE].contains(0) or not as_known:
            raise DegenerateError
        try:
            return list(acb_poly(polynomial).roots(tol=_TOLERANCE))
        except ValueError:
            raise DegenerateError from None

    def angles(self, root: acb) -> tuple[Array, float]:
        """Return the angles (6,) that belong to a root's real part, and how far the loop is open there."""
        x = arb(root.real.mid())
        null = self._matrix(x).solve(arb_mat(12, 1, [1] * 12), algorithm="approx").entries()
        largest = int(np.argmax([float((entry / null[0]).abs_upper()) for entry in null]))
        above, beside = max(largest - 3, largest % 3), max(largest - 1, 3 * (largest // 3))
        q3: arb = _third(x)
        q4, q5 = _twice(null[above + 3], null[above]), _twice(null[beside + 1], null[beside])
        products = [arb(1)]
        for angle in (q3, q4, q5):
            s, c = angle.sin_cos()
            products = [x * y for x in products for y in (arb(1), c, s)]
        right = _part(self._left, self._top, range(27)) * arb_mat(27, 1, products)
        c1, s1, c2, _, _, s2, _, _ = map(float, self._eight.solve(right, algorithm="approx").entries())
        angles = [math.atan2(-s1, c1), math.atan2(-s2, c2), *map(float, (q3, q4, q5))]
        placement = np.eye(4)
        constants = [np.array([float(x) for x in k.entries()]).reshape(4, 4) for k in self._constants]
        for value, constant in zip(angles, constants, strict=False):
            placement = placement @ _rotation(value) @ constant
        last = -math.atan2(*(constants[5] @ placement)[1::-1, 0])
        gap = np.abs(placement @ _rotation(last) @ constants[5] - np.eye(4)).max()
        return np.array([*angles, last]), float(gap)


def _turn(constants: Sequence[arb_mat], first: int) -> list[arb_mat]:
    return [*constants[first:], *constants[:first]]


def _rotation(angle: float) -> Array:
    """Return a rotation about z (4, 4)."""
    return np.asarray(pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3)).homogeneous)


def _third(x: arb) -> arb:
    """Return q3 for the tangent of half of it minus the offset."""
    return 2 * x.atan() + _OFFSET


def _twice(above: arb, below: arb) -> arb:
    """Return twice the angle of a given tangent."""
    return 2 * arb.atan2(above.mid(), below.mid())


def _vector(placement: arb_mat) -> arb_mat:
    """Return v (15, 1) of a placement's third axis and origin."""
    (_, _, axis), p = axes_and_origin(placement)
    square, along = dot(p, p), dot(p, axis)
    twisted = [square * x - 2 * along * y for x, y in zip(axis, p, strict=True)]
    return arb_mat(15, 1, [*p, *axis, *cross(p, axis), square, along, *twisted, arb(1)])


def _turned(columns: arb_mat) -> arb_mat:
    """Return v (15, 3 n) of columns (15, n) rotated about z: the coefficients of 1, cos and sin of the angle."""
    rows, by_row = columns.tolist(), dict[int, list[arb]]()
    zero = [arb(0)] * len(rows[0])
    for at in (0, 3, 6, 11):
        x, y, z = rows[at : at + 3]
        by_row |= {at: zero + x + [-entry for entry in y], at + 1: zero + y + x, at + 2: z + zero + zero}
    by_row |= {at: rows[at] + zero + zero for at in (9, 10, 14)}
    return arb_mat([by_row[at] for at in range(15)])


def _moved(placement: arb_mat, columns: arb_mat) -> arb_mat:
    """Return v (15, n) of columns (15, n) that are displaced."""
    every = range(columns.ncols())
    rotation = _part(placement, range(3), range(3))
    p, axis, moment, twisted = (rotation * _part(columns, range(at, at + 3), every) for at in (0, 3, 6, 11))
    square, along, constant = (_part(columns, [at], every) for at in (9, 10, 14))
    x, y, z = (placement[i, 3] for i in range(3))
    shift, across = arb_mat(3, 1, [x, y, z]), arb_mat([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    size, along_shifted = x * x + y * y + z * z, along + shift.transpose() * axis
    parts = (
        p + shift * constant, axis, moment + across * axis, square + 2 * (shift.transpose() * p) + size * constant,
        along_shifted, twisted - 2 * (across * moment) + size * axis - 2 * (shift * along_shifted), constant,
    )  # fmt: skip
    return arb_mat([row for part in parts for row in part.tolist()])


def _part(matrix: arb_mat, rows: Iterable[int], columns: Iterable[int]) -> arb_mat:
    every = list(columns)
    return arb_mat([[matrix[i, j] for j in every] for i in rows])


def _nudge() -> arb_mat:
    """Return a displacement (4, 4) of the size of rounding."""
    skew = arb_mat([[0, -1, 1, 1], [1, 0, -1, -1], [-1, 1, 0, 1], [0, 0, 0, 0]])
    return arb_mat(4, 4, [int(i == j) for i in range(4) for j in range(4)]) + arb(_NUDGE) * skew


def _angle(root: acb) -> complex:
    return complex(2.0 * np.arctan(complex(float(root.real.mid()), float(root.imag.mid()))))


def _are_among(some: Sequence[acb], others: Sequence[acb]) -> bool:
    """Return whether all angles, except those that are far from real, are among others."""
    angles, other = (np.array([_angle(x) for x in roots]) for roots in (some, others))
    gaps = angles[:, None] - other
    near = np.hypot((gaps.real + np.pi) % (2.0 * np.pi) - np.pi, gaps.imag).min(axis=1)
    return bool((near[np.abs(angles.imag) < _FAR] < _MOVED).all())


def _is_real(root: acb, roots: Sequence[acb]) -> bool:
    """Return whether the root in a ball is real: its conjugate is a root too, and in no other ball."""
    return bool(root.imag.contains(0)) and sum(root.conjugate().overlaps(other) for other in roots) == 1
