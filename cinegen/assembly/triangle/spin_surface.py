"""The RSSR spin surface (section 2.2): where the third platform point can be when its two legs are taken off.

Its order is 16 and it contains the imaginary spherical circle eight times (equation 18), which is why there are no more
than 16 assembly modes: a circle meets it in 32 points, 16 of which are at infinity.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.assembly.triangle._kernels.circles import C1, C2, CC, CENTRE, ONE, RADIUS, SS, E
from cinegen.assembly.triangle.tssm import TSSM, TSSMError

Array = NDArray[np.float64]
Values = NDArray[np.complex128]


class SpinSurface:
    """A polynomial in X, Y, Z that vanishes where platform point 2 can be, its own legs off and the others at rest.

    Attributes:
        unit: the length that `value` counts in.
    """

    unit: float

    def __init__(self, tssm: TSSM, lengths: ArrayLike) -> None:
        """Of the legs that lead to platform points 0 and 1.

        Args:
            tssm: with base points in one plane.
            lengths: (6,) of the legs, of which those to point 2 do not count.

        Raises:
            TSSMError: the base points do not lie in one plane; lengths are no lengths, or two legs can't meet.
        """
        self._circles, equations = tssm.circles(lengths)
        if not tssm.plane:
            raise TSSMError("the spin surface is that of base points in one plane (equations 10-17), and these are not")
        self._k, self._normal = equations[0], tssm.up
        self._sides = tssm.sides[1:]
        self.unit = float(max(*self._circles[:2, RADIUS], *tssm.sides))

    def value(self, points: ArrayLike) -> Values:
        """The determinant of equation 16 at points (..., 3), real or complex; (...,), without unit."""
        at = np.asarray(points, dtype=complex)
        (e1, e2, e3), (f1, f2, f3) = self._distance(0, at), self._distance(1, at)
        k11, k21, k22, k32, k33 = self._k[SS], self._k[CC], self._k[C1], self._k[C2], self._k[ONE]
        # equation 12 with 10: (E1 g - b E3)^2 + (E3 a - g E2)^2 = (E2 b - a E1)^2, equation 13, with x = cos p34 and
        # a = K11 sin p34, b = K21 x + K22, g = K32 x + K33. It holds E2 sin p34, and E2 = F2 r12 / r34 (both are
        # proportional to the height of B), so that equation 11 takes sin p34 out of it without a division.
        ratio = self._circles[0, RADIUS] / self._circles[1, RADIUS]
        u1, u0 = e1 * k32 - k21 * e3, e1 * k33 - k22 * e3  # E1 g - b E3
        w1, w0 = e1 * k21 - e3 * k32, e1 * k22 - e3 * k33  # E1 b - E3 g
        square = k11**2 * (e3**2 - e1**2)  # of sin^2 p34
        i1 = u1**2 + e2**2 * (k32**2 - k21**2) - square - 2.0 * k11 * ratio * f1 * w1
        i2 = 2.0 * (u1 * u0 + e2**2 * (k32 * k33 - k21 * k22) - k11 * ratio * (f1 * w0 + f3 * w1))
        i3 = u0**2 + e2**2 * (k33**2 - k22**2) + square - 2.0 * k11 * ratio * f3 * w0
        h1, h2, h3 = f1**2 + f2**2, 2.0 * f1 * f3, f3**2 - f2**2  # equation 15
        return np.asarray((i1 * h2 - i2 * h1) * (i2 * h3 - i3 * h2) - (i1 * h3 - i3 * h1) ** 2)

    def _distance(self, k: int, points: Values) -> tuple[Values, Values, Values]:
        """Equations 10 and 11: factors of cos p, sin p and 1 in what B misses of its distance to platform point k."""
        circle = self._circles[k]
        r, away = circle[RADIUS], circle[CENTRE : CENTRE + 3] - points
        square = self.unit**2
        one = ((away**2).sum(axis=-1) + r * r - self._sides[k] ** 2) / square
        return 2.0 * r * (away @ circle[E : E + 3]) / square, 2.0 * r * (away @ self._normal) / square, one
