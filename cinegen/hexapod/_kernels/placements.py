"""Placements of a platform triangle from the angles of its points on their circles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.jit.compiled import Array, Table, compiled, entry
from cinegen.jit.vectors import inner

Vector = tuple[float, float, float]


@entry
def write_placements(
    w: NDArray[np.complex128], of: Table, circles: Any, lengths: Array, base: Array, platform: Array, legs: Table,
    axes: Array, points: Array, placements: Array, errors: Array,
) -> None:  # fmt: skip
    """Write the placements that put platform points at angles on their circles.

    Args:
        w: (n, 3) exp(i p) of the angles.
        of: (n,) which set of lengths each belongs to.
        circles: `PlatformCircles` of m sets.
        lengths: (m, 6).
        base: (6, 3) base points.
        platform: (3, 3) platform points.
        legs: (6,) which platform point each leg leads to.
        axes: (3, 3) of the platform: along its first side, across it, normal.
        points: (n, 3, 3) the platform points in the base frame are written.
        placements: (n, 4, 4) are written.
        errors: (n,) the largest length error, relative to the longest leg, is written.
    """
    for k in range(len(w)):
        m, p, placement = of[k], points[k], placements[k]
        for circle in range(3):
            r, point = circles.radius[m, circle], circles.point[m, circle]
            c, s = r * w[k, circle].real, r * w[k, circle].imag
            for i in range(3):
                along = c * circles.e[m, circle, i] + s * circles.f[m, circle, i]
                p[point, i] = circles.centre[m, circle, i] + along
        x = _unit((p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[1, 2] - p[0, 2]))
        side = (p[2, 0] - p[0, 0], p[2, 1] - p[0, 1], p[2, 2] - p[0, 2])
        y = _unit(_cross(_cross(x, side), x))
        z = _cross(x, y)
        for i in range(3):
            placement[3, i], placement[i, 3] = 0.0, 0.0
            for j in range(3):
                placement[i, j] = x[i] * axes[0, j] + y[i] * axes[1, j] + z[i] * axes[2, j]
            for point in range(3):  # their middles coincide
                off = p[point, i] - inner(placement[i], platform[point], 3)
                placement[i, 3] += off / 3.0
        placement[3, 3] = 1.0
        worst = longest = 0.0
        for leg in range(6):
            square = 0.0
            for i in range(3):
                off = placement[i, 3] - base[leg, i] + inner(placement[i], platform[legs[leg]], 3)
                square += off * off
            worst, longest = max(worst, abs(math.sqrt(square) - lengths[m, leg])), max(longest, lengths[m, leg])
        errors[k] = worst / longest


@compiled
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _unit(a: Vector) -> Vector:
    length = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    return a[0] / length, a[1] / length, a[2] / length
