"""The residual of a loop: how far the two ends of a cut joint are apart, and its exact derivative.

A loop is closed by a joint that was cut. Let the placement M = (R, p) be that of its second end seen from its first,
L the characteristic length of the mechanism. The residual c, dimensionless, is zero where the ends fit:

    kind       residual                     rows   the joint leaves free
    rigid      p / L, log R                  6     nothing
    prismatic  p_x / L, p_y / L, log R       5     a translation along z
    revolute   p / L, swing(R z)             5     a rotation about z
    ball       p / L                         3     all rotations

log R is the rotation vector of R. The swing of the second z axis a = R z is the rotation vector, in the first end's x
and y, of the shortest rotation that takes the first z axis to a. It does not depend on the rotation about a, so a hinge
may make any number of revolutions, and it is zero only where both z axes agree in direction.

Let v, w be the linear and angular velocity of the second end relative to the first, in the first end's axes and at its
origin. Then

    dp/dt = v + w x p,    d(log R)/dt = J(log R) w,    da/dt = w x a,

where J is the inverse of SO(3)'s left Jacobian (`log_derivative`). These hold where a loop is open, too: Gauss-Newton
steps with the exact derivative close a mechanism whose ends are far apart (`raff2urdf.closure`).

This is the reference: `cinegen.loops._kernels` compiles the same equations and is tested against it on every robot.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.raff.document import LoopKind

ROWS = {LoopKind.RIGID: 6, LoopKind.PRISMATIC: 5, LoopKind.REVOLUTE: 5, LoopKind.BALL: 3}
"""Number of equations of a loop, by its kind."""

_UNIT = np.eye(3)


def loop_residual(kind: LoopKind, placement: Array, length: float) -> tuple[Array, Array]:
    """Return the residual of a loop and its derivative, as the module's docstring derives them.

    Args:
        kind: of the joint that was cut.
        placement: (4, 4) of the second end in the first; metres.
        length: characteristic length, m.

    Returns:
        (rows,) residual, dimensionless, and (rows, 6) its derivative by the twist (v, w) of the second end relative to
        the first: m/s and rad/s, in the first end's axes and at its origin.
    """
    rotation, p = placement[:3, :3], placement[:3, 3]
    linear = 2 if kind is LoopKind.PRISMATIC else 3
    c, derivative = np.empty(ROWS[kind]), np.zeros((ROWS[kind], 6))
    c[:linear] = p[:linear] / length
    derivative[:linear, :3] = _UNIT[:linear] / length
    derivative[:linear, 3:] = skew(p)[:linear] / -length  # w x p = -p x w
    if kind is LoopKind.REVOLUTE:
        c[3:], derivative[3:, 3:] = swing(rotation[:, 2])
    elif kind is not LoopKind.BALL:
        vector = log(rotation)
        c[linear:], derivative[linear:, 3:] = vector, log_derivative(vector)
    return c, derivative


def skew(v: Any) -> Array:
    """Return the (3, 3) matrix of the cross product: skew(v) @ w == v x w."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def log(rotation: Array) -> Array:
    """Return the rotation vector (3,) of a (3, 3) rotation, its angle in [0, pi]; exact to rounding near 0 and near pi.

    By the unit quaternion, computed from its largest component (S. W. Shepperd, "Quaternion from rotation matrix",
    Journal of Guidance and Control 1, 1978).
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
    """Return the (3, 3) derivative of `log` by the angular velocity in the fixed axes, at log R = vector.

    The inverse of SO(3)'s left Jacobian: 1 - [v]/2 + (1/t^2 - cot(t/2)/(2 t)) [v]^2, with t = |v| (G. S. Chirikjian,
    "Stochastic models, information theory, and Lie groups", vol. 2, section 10.3).
    """
    t = math.sqrt(float(vector @ vector))
    cross = skew(vector)
    square = 1.0 / 12.0 + t * t / 720.0 if t < 1e-2 else 1.0 / (t * t) - 1.0 / (2.0 * t * math.tan(t / 2.0))
    return np.eye(3) - cross / 2.0 + square * (cross @ cross)


def swing(axis: Array) -> tuple[Array, Array]:
    """Return the rotation (2,) about x and y that takes z to `axis`, and its (2, 3) derivative by the angular velocity.

    With s = hypot(x, y) and the angle t = atan2(s, z), the swing is (t / s) (-y, x). Where the axes are opposed (s = 0,
    z < 0) any rotation by pi does; the one about x is returned. Nearly there the derivative, which has no bound, is
    that of a rotation about the swing itself in all directions.
    """
    x, y, z = axis.tolist()
    s = math.hypot(x, y)
    t = math.atan2(s, z)
    if s < 1e-4 and z < 0.0:
        swung = [math.pi, 0.0] if s < 1e-9 else [-t / s * y, t / s * x]
        return np.array(swung), np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    ratio = t / s if s > 1e-4 else 1.0 + s * s / 6.0
    # t' = z s' - s z' and s s' = x x' + y y' give (t/s)' = slope (x x' + y y') - z'; slope is -1/2 + 1/6 at s = 0
    slope = (z - ratio) / (s * s) if s > 1e-4 else -2.0 / 3.0
    by_axis = np.array([[-y * slope * x, -y * slope * y - ratio, y], [x * slope * x + ratio, x * slope * y, -x]])
    return np.array([-ratio * y, ratio * x]), by_axis @ -skew(axis)
