"""The gap of a loop: how far the two ends of a cut joint are apart, and how that changes.

A loop is a joint that was cut. With M the placement of its second end seen from the first, rotation R and
translation p, what must be zero is

    rigid      p and log(R)                                   6 rows
    prismatic  p_x, p_y and log(R): z is the common line       5 rows
    revolute   p and the swing of the second z axis            5 rows
    ball       p                                              3 rows

The swing is the rotation vector, in the first end's x and y, of the shortest turn that brings the first z
onto the second. It is 0 only where both z axes agree in direction, whatever the turn about them, so a hinge
may turn for ever. Every residual's derivative is exact where the loop stands open too, which lets
Gauss-Newton close a mechanism whose ends are far apart.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raff2urdf.document import LoopKind

Array = NDArray[np.float64]

ROWS = {LoopKind.RIGID: 6, LoopKind.PRISMATIC: 5, LoopKind.REVOLUTE: 5, LoopKind.BALL: 3}


_UNIT = np.eye(3)


def gap(kind: LoopKind, placement: Array, length: float) -> tuple[Array, Array]:
    """Residual of a loop and its derivative.

    Args:
        kind: the joint that was cut.
        placement: (4, 4), the second end seen from the first; metres.
        length: the characteristic length (m) that makes translations commensurable with angles.

    Returns:
        residual (rows,) without unit, and (rows, 6) its derivative by the twist (linear first, m/s and rad/s) of
        the second end relative to the first, in the first end's axes, taken at the first end's origin.
    """
    rotation, p = placement[:3, :3], placement[:3, 3]
    linear = 2 if kind is LoopKind.PRISMATIC else 3
    residual, derivative = np.empty(ROWS[kind]), np.zeros((ROWS[kind], 6))
    residual[:linear] = p[:linear] / length
    derivative[:linear, :3] = _UNIT[:linear] / length
    derivative[:linear, 3:] = skew(p)[:linear] / -length  # dp/dt = v + omega x p
    if kind is LoopKind.REVOLUTE:
        residual[3:], derivative[3:, 3:] = swing(rotation[:, 2])
    elif kind is not LoopKind.BALL:
        vector = log(rotation)
        residual[linear:], derivative[linear:, 3:] = vector, log_derivative(vector)
    return residual, derivative


def skew(v: Any) -> Array:
    """(3, 3) matrix of the cross product: skew(v) @ w == v x w."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def log(rotation: Array) -> Array:
    """(3,) rotation vector of a (3, 3) rotation, its angle in [0, pi]; exact to rounding near 0 and near pi.

    By way of the unit quaternion, taken from its largest component (S. W. Shepperd, "Quaternion from rotation
    matrix", Journal of Guidance and Control 1, 1978).
    """
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    squares = (a + e + i, a - e - i, e - a - i, i - a - e)  # 4 w^2 - 1, 4 x^2 - 1, ...
    largest = max(range(4), key=squares.__getitem__)
    if largest == 0:
        w, x, y, z = 1.0 + squares[0], h - f, c - g, d - b
    elif largest == 1:
        w, x, y, z = h - f, 1.0 + squares[1], b + d, c + g
    elif largest == 2:
        w, x, y, z = c - g, b + d, 1.0 + squares[2], f + h
    else:
        w, x, y, z = d - b, c + g, f + h, 1.0 + squares[3]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 * math.atan2(sine, w) / sine if sine > 0.0 else 0.0
    return np.array([factor * x, factor * y, factor * z])


def log_derivative(vector: Array) -> Array:
    """(3, 3) derivative of `log` by the angular velocity in the fixed axes, at log(R) = vector.

    The inverse of SO(3)'s left Jacobian: 1 - [v]/2 + (1/t^2 - cot(t/2)/(2 t)) [v]^2, with t = |v| (G. S.
    Chirikjian, "Stochastic models, information theory, and Lie groups", vol. 2, section 10.3).
    """
    t = math.sqrt(float(vector @ vector))
    cross = skew(vector)
    square = 1.0 / 12.0 + t * t / 720.0 if t < 1e-2 else 1.0 / (t * t) - 1.0 / (2.0 * t * math.tan(t / 2.0))
    return np.eye(3) - cross / 2.0 + square * (cross @ cross)


def swing(axis: Array) -> tuple[Array, Array]:
    """The turn (2,) about x and y that brings z onto `axis`, and its (2, 3) derivative by the angular velocity.

    With s = hypot(x, y) and the angle t = atan2(s, z), the swing is (t / s)(-y, x). Where the axes point against
    each other (s = 0, z < 0) any turn by pi will do; x is taken.
    """
    x, y, z = axis.tolist()
    s = math.hypot(x, y)
    t = math.atan2(s, z)
    if s < 1e-9 and z < 0.0:
        return np.array([math.pi, 0.0]), np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    ratio = t / s if s > 1e-4 else 1.0 + s * s / 6.0
    # t' = z s' - s z' and s s' = x x' + y y' give (t/s)' = slope (x x' + y y') - z'; slope is -1/2 + 1/6 at s = 0
    slope = (z - ratio) / (s * s) if s > 1e-4 else -2.0 / 3.0
    by_axis = np.array([[-y * slope * x, -y * slope * y - ratio, y], [x * slope * x + ratio, x * slope * y, -x]])
    return np.array([-ratio * y, ratio * x]), by_axis @ -skew(axis)
