"""Merlet's polynomial of degree 16 and the RSSR spin surface: equations 10-18, expanded and evaluated as printed.

J-P. Merlet, "Symbolic computation for the determination of the minimal direct kinematics polynomial and the singular
configurations of parallel manipulators". The library never expands the polynomial (`cinegen.hexapod.TSSM` solves an
eigenvalue problem); here it is, to be compared with that.

The spin surface (section 2.2) is where the third platform point can be with its two legs removed. Its order is 16 and
it contains the imaginary spherical circle eight times (equation 18), which is why there are no more than 16 assembly
modes: a circle meets it in 32 points, 16 of which are at infinity.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray

from cinegen.hexapod import TSSM, HexapodError
from cinegen.hexapod.elimination import SPATIAL_DEGREE, bezout
from cinegen.hexapod.tssm import TANGENTS

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_DEGREE = 16


def polynomial(tssm: TSSM, lengths: ArrayLike) -> Polynomial:
    """Return the polynomial of degree 16 in x = tan(p34 / 2) whose real roots belong to modes (equation 16).

    The angle p34 is that of the second largest circle (`TSSM.circles`). If the base points lie in one plane, only even
    powers of x occur. Its coefficients hold the roots badly: in 200 poses of the manipulator of Merlet's table 1, numpy
    found the real roots from them to 1e-13 (median), 1e-11 (one in ten is worse) and 5e-7 (the worst); with base points
    out of the plane, to 3e-12, 2e-8 and 5e-2.

    Args:
        tssm: the manipulator.
        lengths: (6,) of the legs, in the unit of the points.

    Raises:
        HexapodError: wrong shape, not finite or not positive; two legs can't meet.
    """
    equations = tssm.circles([lengths])[1][0]
    return _in_plane(equations) if tssm.plane else _in_space(equations)


def _resultant(i: list[Polynomial], h: list[Polynomial]) -> Polynomial:
    """Return equations 16 and 17: zero where i[0] z^2 + i[1] z + i[2] and h[0] z^2 + h[1] z + h[2] share a root."""

    def minor(a: int, b: int) -> Polynomial:
        return i[a] * h[b] - i[b] * h[a]

    return minor(0, 1) * minor(1, 2) - minor(0, 2) ** 2


def quadratics(equations: Array) -> list[Polynomial]:
    """Return I1, I2, I3 of equation 25 and H1, H2, H3 of equation 26, quadratics in x = cos p34.

    K and L are linear in sin p12 and cos p12, a sin p12 + b cos p12 + g = 0, and sin^2 + cos^2 = 1 gives (b g' - g
    b')^2 + (g a' - a g')^2 = (a b' - b a')^2, equation 23. It contains sin p34 and sin p56 as squares or as their
    product, for which M is substituted.

    Args:
        equations: (3, 3, 3) K, L, M, see `TSSM.circles`; of base points in one plane.
    """
    k, other, m = equations
    b, g, u, v = (Polynomial(row) for row in (k[1, :2], k[0, :2], m[:2, 1], m[:2, 0]))
    (l33, l32), (l22, l21) = other[0, :2], other[1, :2]
    k11, l11, m11 = k[2, 2], other[2, 2], m[2, 2]
    sine = Polynomial([1.0, 0.0, -1.0])  # squared, of p34
    high, low = b * l32 - g * l21, b * l33 - g * l22  # b g' - g b' = high cos p56 + low
    s, t = b * l21 - g * l32, b * l22 - g * l33  # b b' - g g' = s cos p56 + t
    # sin p34 sin p56 = -(u cos p56 + v) / M11
    ratio, square, gap = k11 * l11 / m11, k11**2 * sine, l11**2 * (g * g - b * b)
    first = [
        high * high - gap + square * (l32**2 - l21**2) - 2.0 * ratio * u * s,
        2.0 * (high * low + square * (l32 * l33 - l21 * l22) - ratio * (u * t + v * s)),
        low * low + gap + square * (l33**2 - l22**2) - 2.0 * ratio * v * t,
    ]
    second = [u * u + m11**2 * sine, 2.0 * u * v, v * v - m11**2 * sine]
    return [part / max(np.abs(q.coef).max() for q in three) for three in (first, second) for part in three]


def _in_plane(equations: Array) -> Polynomial:
    # cos p34 = (1 - u) / (1 + u) with u = x^2, times (1 + u)^2
    above, below = Polynomial([1.0, -1.0]), Polynomial([1.0, 1.0])
    powers = [below * below, above * below, above * above]
    rows = [row.coef for row in quadratics(equations)]
    factors = [sum((q * p for q, p in zip(row, powers, strict=False)), Polynomial([0.0])) for row in rows]
    in_u = _resultant(factors[:3], factors[3:])
    coefficients = np.zeros(_DEGREE + 1)
    coefficients[: 2 * len(in_u.coef) : 2] = in_u.coef
    return _scaled(coefficients)


def _in_space(equations: Array) -> Polynomial:
    """Return the determinant as a polynomial: times cos^16 (p34 / 2), it is a sum of cos(k p34) and sin(k p34), k up to
    8, which its values at 17 places determine."""
    blocks = bezout(TANGENTS @ equations @ TANGENTS.T)
    p = 2.0 * np.pi * np.arange(_DEGREE + 1) / (_DEGREE + 1)
    powers = [np.sin(0.5 * p) ** n * np.cos(0.5 * p) ** (SPATIAL_DEGREE - n) for n in range(SPATIAL_DEGREE + 1)]
    terms = np.fft.fft(np.linalg.det(np.einsum("np,nij->pij", powers, blocks))) / (_DEGREE + 1)
    half = _DEGREE // 2
    # exp(i p34) = (1 + i x) / (1 - i x), times (1 + x^2)^8
    up, down = Polynomial([1.0, 1.0j]), Polynomial([1.0, -1.0j])
    total = sum((terms[n] * up ** (half + n) * down ** (half - n) for n in range(-half, half + 1)), Polynomial([0.0]))
    return _scaled(np.real(total.coef))


def _scaled(coefficients: Array) -> Polynomial:
    largest = np.abs(coefficients).max()
    return Polynomial(coefficients / largest if largest > 0.0 else coefficients)


class SpinSurface:
    """A polynomial in X, Y, Z that vanishes where platform point 2 can be, its own legs removed and the others locked.

    Attributes:
        unit: the length that `value` counts in.
    """

    unit: float

    def __init__(self, tssm: TSSM, lengths: ArrayLike) -> None:
        """Compute the surface from the four other legs.

        Args:
            tssm: with base points in one plane.
            lengths: (6,) of the legs, of which those to point 2 do not count.

        Raises:
            HexapodError: the base points do not lie in one plane; lengths are not positive, or two legs can't meet.
        """
        circles, equations = tssm.circles([lengths])
        if not tssm.plane:
            raise HexapodError("equations 10-17 hold for base points in one plane, and these are not")
        points = circles.point[0]
        others = np.flatnonzero(points != 2)  # circles 0 and 1, 0 and 2, or 1 and 2, the larger first
        self._centre, self._e, self._radius = circles.centre[0, others], circles.e[0, others], circles.radius[0, others]
        self._k, self._normal, self._sides = equations[0, others.sum() - 1], tssm.up, tssm.sides[points[others] + 1]
        self.unit = float(max(*self._radius, *tssm.sides))

    def value(self, points: ArrayLike) -> Complex:
        """Return the determinant of equation 16 at points (..., 3), real or complex; (...,), dimensionless."""
        at = np.asarray(points, dtype=complex)
        (e1, e2, e3), (f1, f2, f3) = self._distance(0, at), self._distance(1, at)
        (k33, k32), (k22, k21), k11 = self._k[0, :2], self._k[1, :2], self._k[2, 2]
        # equation 12 with 10: (E1 g - b E3)^2 + (E3 a - g E2)^2 = (E2 b - a E1)^2, equation 13, with x = cos p34 and
        # a = K11 sin p34, b = K21 x + K22, g = K32 x + K33. It contains E2 sin p34, and E2 = F2 r12 / r34 (both are
        # proportional to the height of B), so that equation 11 takes sin p34 out of it without a division.
        ratio = self._radius[0] / self._radius[1]
        u1, u0 = e1 * k32 - k21 * e3, e1 * k33 - k22 * e3  # E1 g - b E3
        w1, w0 = e1 * k21 - e3 * k32, e1 * k22 - e3 * k33  # E1 b - E3 g
        square = k11**2 * (e3**2 - e1**2)  # of sin^2 p34
        i1 = u1**2 + e2**2 * (k32**2 - k21**2) - square - 2.0 * k11 * ratio * f1 * w1
        i2 = 2.0 * (u1 * u0 + e2**2 * (k32 * k33 - k21 * k22) - k11 * ratio * (f1 * w0 + f3 * w1))
        i3 = u0**2 + e2**2 * (k33**2 - k22**2) + square - 2.0 * k11 * ratio * f3 * w0
        h1, h2, h3 = f1**2 + f2**2, 2.0 * f1 * f3, f3**2 - f2**2  # equation 15
        return np.asarray((i1 * h2 - i2 * h1) * (i2 * h3 - i3 * h2) - (i1 * h3 - i3 * h1) ** 2)

    def _distance(self, k: int, points: Complex) -> tuple[Complex, Complex, Complex]:
        """Return the coefficients of cos p, sin p and 1 in the distance of B to a circle's point (equations 10, 11)."""
        r, away, square = self._radius[k], self._centre[k] - points, self.unit**2
        one = ((away**2).sum(axis=-1) + r * r - self._sides[k] ** 2) / square
        return 2.0 * r * (away @ self._e[k]) / square, 2.0 * r * (away @ self._normal) / square, one
