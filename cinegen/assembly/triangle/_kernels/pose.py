"""Platform placements from the three angles, and Newton's method on the six leg lengths themselves."""

from __future__ import annotations

import math
from typing import Any

from cinegen.assembly.triangle._kernels.circles import CENTRE, PAIR, RADIUS, E, F
from cinegen.assembly.triangle._kernels.elimination import reduce
from cinegen.jit.compiled import Array, Table, compiled

LEGS = 6
_STEPS = 4
_EXACT = 2e-14  # of the longest leg: what the lengths may be off without a step


@compiled
def write_points(circles: Array, w: Any, points: Array) -> None:
    """Equations 7 and 8: the three platform points (3, 3) for exp(i p) (3,), in the order of the pairs."""
    for k in range(3):
        r, pair = circles[k, RADIUS], int(circles[k, PAIR])
        for i in range(3):
            along = w[k].real * circles[k, E + i] + w[k].imag * circles[k, F + i]
            points[pair, i] = circles[k, CENTRE + i] + r * along


@compiled
def write_axes(points: Array, axes: Array) -> None:
    """Rows of axes (3, 3): along the side from the first point to the second, across it to the third, normal."""
    for i in range(3):
        axes[0, i] = points[1, i] - points[0, i]
        axes[1, i] = points[2, i] - points[0, i]
    _normalise(axes, 0)
    dot = axes[0, 0] * axes[1, 0] + axes[0, 1] * axes[1, 1] + axes[0, 2] * axes[1, 2]
    for i in range(3):
        axes[1, i] -= dot * axes[0, i]
    _normalise(axes, 1)
    dot = axes[0, 0] * axes[1, 0] + axes[0, 1] * axes[1, 1] + axes[0, 2] * axes[1, 2]
    for i in range(3):  # again: of a thin triangle little was left
        axes[1, i] -= dot * axes[0, i]
    _normalise(axes, 1)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        axes[2, i] = axes[0, j] * axes[1, k] - axes[0, k] * axes[1, j]


@compiled
def _normalise(axes: Array, row: int) -> None:
    length = math.sqrt(axes[row, 0] * axes[row, 0] + axes[row, 1] * axes[row, 1] + axes[row, 2] * axes[row, 2])
    for i in range(3):
        axes[row, i] /= length


@compiled
def write_placement(points: Array, platform: Array, own: Array, axes: Array, placement: Array) -> None:
    """The placement (4, 4) that brings the platform points (3, 3), whose axes are `own`, to these; axes is scratch."""
    write_axes(points, axes)
    for i in range(3):
        for j in range(3):
            placement[i, j] = axes[0, i] * own[0, j] + axes[1, i] * own[1, j] + axes[2, i] * own[2, j]
        placement[3, i] = 0.0
    for i in range(3):  # their middles coincide
        s = 0.0
        for k in range(3):
            s += points[k, i]
            for j in range(3):
                s -= placement[i, j] * platform[k, j]
        placement[i, 3] = s / 3.0
    placement[3, 3] = 1.0


@compiled
def polish(base: Array, platform: Array, legs: Table, lengths: Array, placement: Array, work: Array) -> float:
    """Improves a placement until the legs have their lengths; returns how far the worst is off, of the longest.

    work: (10, 7) scratch.
    """
    longest = 0.0
    for leg in range(LEGS):
        longest = max(longest, lengths[leg])
    best = 1e300
    for step in range(_STEPS + 1):
        worst = _write_steps(base, platform, legs, lengths, placement, work) / longest
        if not worst < best:  # near a singularity a step may lead away
            for i in range(3):
                for j in range(4):
                    placement[i, j] = work[LEGS + i, j]
            break
        best = worst
        if best <= _EXACT or step == _STEPS or not reduce(work, LEGS, LEGS + 1) > 0.0:
            break
        for i in range(3):
            for j in range(4):
                work[LEGS + i, j] = placement[i, j]
        _move(work[3, 6], work[4, 6], work[5, 6], work[0, 6], work[1, 6], work[2, 6], placement)
    return best


@compiled
def _write_steps(base: Array, platform: Array, legs: Table, lengths: Array, placement: Array, work: Array) -> float:
    """Rows of the equations for a velocity (3) and a rotation (3) about the platform's origin; the worst length."""
    worst = 0.0
    for leg in range(LEGS):
        k, square = legs[leg], 0.0
        for i in range(3):
            arm = 0.0
            for j in range(3):
                arm += placement[i, j] * platform[k, j]
            work[leg, 3 + i] = arm
            work[leg, i] = arm + placement[i, 3] - base[leg, i]
            square += work[leg, i] * work[leg, i]
        length = math.sqrt(square)
        off = lengths[leg] - length
        x, y, z = work[leg, 0] / length, work[leg, 1] / length, work[leg, 2] / length
        a, b, c = work[leg, 3], work[leg, 4], work[leg, 5]
        work[leg, 0], work[leg, 1], work[leg, 2] = x, y, z
        work[leg, 3], work[leg, 4], work[leg, 5] = b * z - c * y, c * x - a * z, a * y - b * x
        work[leg, 6] = off
        if not abs(off) <= worst:
            worst = abs(off)
    return worst


@compiled
def _move(a: float, b: float, c: float, x: float, y: float, z: float, placement: Array) -> None:
    """Turns by the vector (a, b, c), of small length, and shifts by (x, y, z)."""
    square = 0.25 * (a * a + b * b + c * c)  # Cayley's rotation, of tangents of half the angle
    f = 1.0 / (1.0 + square)
    for j in range(3):
        u, v, w = placement[0, j], placement[1, j], placement[2, j]
        du, dv, dw = b * w - c * v, c * u - a * w, a * v - b * u
        placement[0, j] += f * (du + 0.5 * (b * dw - c * dv))
        placement[1, j] += f * (dv + 0.5 * (c * du - a * dw))
        placement[2, j] += f * (dw + 0.5 * (a * dv - b * du))
    placement[0, 3] += x
    placement[1, 3] += y
    placement[2, 3] += z
