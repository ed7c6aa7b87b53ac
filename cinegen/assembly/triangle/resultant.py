"""The expanded polynomial of degree 16 (section 2.4): for study, not for finding its roots."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from cinegen.assembly.triangle._kernels.companion import ROWS
from cinegen.assembly.triangle._kernels.plane import write_quadratics
from cinegen.assembly.triangle._kernels.space import DEGREE, write_matrices

Array = NDArray[np.float64]

_DEGREE = 16


def of_quadratics(i: list[Polynomial], h: list[Polynomial]) -> Polynomial:
    """Equations 16 and 17: zero where i[0] z^2 + i[1] z + i[2] and h[0] z^2 + h[1] z + h[2] have a common root."""

    def minor(a: int, b: int) -> Polynomial:
        return i[a] * h[b] - i[b] * h[a]

    return minor(0, 1) * minor(1, 2) - minor(0, 2) ** 2


def in_plane(equations: Array) -> Polynomial:
    """In x = tan(p34 / 2), for base points in one plane: even powers only; the largest coefficient is 1."""
    quadratics = np.empty((6, 3))
    write_quadratics(equations, quadratics)
    # cos p34 = (1 - u) / (1 + u) with u = x^2, times (1 + u)^2
    above, below = Polynomial([1.0, -1.0]), Polynomial([1.0, 1.0])
    powers = [below * below, above * below, above * above]
    factors = [sum((q * p for q, p in zip(row, powers, strict=True)), Polynomial([0.0])) for row in quadratics]
    in_u = of_quadratics(factors[:3], factors[3:])
    coefficients = np.zeros(_DEGREE + 1)
    coefficients[: 2 * len(in_u.coef) : 2] = in_u.coef
    return _scaled(coefficients)


def in_space(equations: Array) -> Polynomial:
    """In x = tan(p34 / 2), for base points anywhere; the largest coefficient is 1.

    The determinant, times cos^16 (p34 / 2), is a sum of cos(k p34) and sin(k p34), k up to 8, which its values at 17
    places determine.
    """
    quadratics, blocks = np.empty((6, 3)), np.empty((DEGREE + 1, ROWS, ROWS))
    write_matrices(equations, 0.0, quadratics, blocks)
    p = 2.0 * np.pi * np.arange(_DEGREE + 1) / (_DEGREE + 1)
    powers = [np.sin(0.5 * p) ** n * np.cos(0.5 * p) ** (DEGREE - n) for n in range(DEGREE + 1)]
    terms = np.fft.fft(np.linalg.det(np.einsum("np,nij->pij", powers, blocks))) / (_DEGREE + 1)
    half = _DEGREE // 2
    # exp(i p34) = (1 + i x) / (1 - i x), times (1 + x^2)^8
    up, down = Polynomial([1.0, 1.0j]), Polynomial([1.0, -1.0j])
    total = sum((terms[n] * up ** (half + n) * down ** (half - n) for n in range(-half, half + 1)), Polynomial([0.0]))
    return _scaled(np.real(total.coef))


def _scaled(coefficients: Array) -> Polynomial:
    largest = np.abs(coefficients).max()
    return Polynomial(coefficients / largest if largest > 0.0 else coefficients)
