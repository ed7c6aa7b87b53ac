"""Merlet's polynomial of degree 16 and the RSSR spin surface: equations 7-26, expanded and evaluated as printed.

J-P. Merlet, "Symbolic computation for the determination of the minimal direct kinematics polynomial and the singular
configurations of parallel manipulators". The library never expands the polynomial: `cinegen.hexapod.Hexapod` follows
solutions by homotopy. Here it is, to be compared with that.

The spin surface (section 2.2) is where the third platform point can be with its two legs removed. Its order is 16 and
it contains the imaginary spherical circle eight times (equation 18), which is why there are no more than 16 assembly
modes: a circle meets it in 32 points, 16 of which are at infinity.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_UP = np.array([0.0, 0.0, 1.0])


class Triangle:
    """A platform triangle on six legs from base points in the plane z = 0: Merlet's TSSM, at some leg lengths.

    Two legs leave their platform point a circle, centre + radius (cos p e + sin p up): equations 7 to 9. The angles are
    called p12, p34 and p56.

    Attributes:
        centre: (3, 3).
        e: (3, 3) unit vectors.
        radius: (3,).
        sides: (3,) distances of the platform points 0 and 1, 0 and 2, 1 and 2.
        equations: (3, 3, 3) K, L and M, equations 20 to 22: the coefficients of these distances in 1, cos p, sin p
            (rows) and 1, cos q, sin q (columns), (p, q) = (p12, p34), (p12, p56), (p34, p56).
    """

    def __init__(self, base: ArrayLike, platform: ArrayLike, lengths: ArrayLike) -> None:
        """Compute the circles, and the equations.

        Args:
            base: (6, 3) points; the legs from points 2 k and 2 k + 1 lead to platform point k.
            platform: (3, 3) points, in the same unit.
            lengths: (6,) of legs, of which those of a pair meet.
        """
        first, second = np.reshape(np.asarray(base, dtype=float), (3, 2, 3)).swapaxes(0, 1)
        left, right = np.reshape(np.asarray(lengths, dtype=float), (3, 2)).T
        apart = np.linalg.norm(second - first, axis=1)
        u = (second - first) / apart[:, None]
        along = 0.5 * (apart + (left**2 - right**2) / apart)
        a, b, c = np.asarray(platform, dtype=float)
        self.centre, self.e, self.radius = first + along[:, None] * u, np.cross(u, _UP), np.sqrt(left**2 - along**2)
        self.sides = np.linalg.norm([b - a, c - a, c - b], axis=1)
        pairs = zip(((0, 1), (0, 2), (1, 2)), self.sides, strict=True)
        self.equations = np.array([self._distance(i, j, side) for (i, j), side in pairs])

    def _distance(self, i: int, j: int, side: float) -> Array:
        d, r, s = self.centre[i] - self.centre[j], self.radius[i], self.radius[j]
        matrix = np.zeros((3, 3))
        matrix[0] = r * r + s * s + d @ d - side * side, -2.0 * s * d @ self.e[j], 0.0
        matrix[1] = 2.0 * r * d @ self.e[i], -2.0 * r * s * self.e[i] @ self.e[j], 0.0
        matrix[2, 2] = -2.0 * r * s
        return matrix / np.abs(matrix).max()


def polynomial(triangle: Triangle) -> Polynomial:
    """Return the polynomial of degree 16 in x = tan(p34 / 2) whose real roots belong to modes (equation 16).

    Only even powers of x occur. Its coefficients hold the roots badly: in 200 poses of the manipulator of Merlet's
    table 1, numpy found the real roots from them to 1e-13 (median), 1e-11 (one in ten is worse) and 5e-7 (the worst).
    """
    # cos p34 = (1 - u) / (1 + u) with u = x^2, times (1 + u)^2
    above, below = Polynomial([1.0, -1.0]), Polynomial([1.0, 1.0])
    powers = [below * below, above * below, above * above]
    rows = [row.coef for row in quadratics(triangle.equations)]
    factors = [sum((q * p for q, p in zip(row, powers, strict=False)), Polynomial([0.0])) for row in rows]
    in_u = _resultant(factors[:3], factors[3:]).coef
    coefficients = np.zeros(17)
    coefficients[: 2 * len(in_u) : 2] = in_u / np.abs(in_u).max()
    return Polynomial(coefficients)


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
        equations: (3, 3, 3) K, L, M, see `Triangle`.
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


class SpinSurface:
    """A polynomial in X, Y, Z that vanishes where platform point 2 can be, its own legs removed and the others locked.

    Attributes:
        unit: the length that `value` counts in.
    """

    unit: float

    def __init__(self, triangle: Triangle) -> None:
        """Compute the surface from the four other legs."""
        self._triangle, self._k = triangle, triangle.equations[0]
        self.unit = float(max(*triangle.radius[:2], *triangle.sides))

    def value(self, points: ArrayLike) -> Complex:
        """Return the determinant of equation 16 at points (..., 3), real or complex; (...,), dimensionless."""
        at = np.asarray(points, dtype=complex)
        (e1, e2, e3), (f1, f2, f3) = self._distance(0, at), self._distance(1, at)
        (k33, k32), (k22, k21), k11 = self._k[0, :2], self._k[1, :2], self._k[2, 2]
        # equation 12 with 10: (E1 g - b E3)^2 + (E3 a - g E2)^2 = (E2 b - a E1)^2, equation 13, with x = cos p34 and
        # a = K11 sin p34, b = K21 x + K22, g = K32 x + K33. It contains E2 sin p34, and E2 = F2 r12 / r34 (both are
        # proportional to the height of B), so that equation 11 takes sin p34 out of it without a division.
        ratio = self._triangle.radius[0] / self._triangle.radius[1]
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
        t, square = self._triangle, self.unit**2
        r, away = t.radius[k], t.centre[k] - points
        constant = ((away**2).sum(axis=-1) + r * r - t.sides[k + 1] ** 2) / square
        return 2.0 * r * (away @ t.e[k]) / square, 2.0 * r * (away @ _UP) / square, constant
