"""Rotations and frames: `raff2urdf.residual`'s log, swing and their derivatives, compiled.

A frame is (4, 3): its three axes, then its origin, in the order in which Pinocchio and Eigen keep a placement. The
axes alone, (3, 3), are the transpose of the rotation matrix. Results are written to arrays of the caller.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled, inlined


@compiled
def compose(a: Array, b: Array, out: Array) -> None:
    """out = a b, for the frame a and the frame or axes b, seen from a."""
    for c in range(out.shape[0]):
        for i in range(3):
            out[c, i] = b[c, 0] * a[0, i] + b[c, 1] * a[1, i] + b[c, 2] * a[2, i]
            if c == 3:
                out[c, i] += a[3, i]


@compiled
def relative(a: Array, b: Array, out: Array) -> None:
    """out (3, 3) = rotation matrix of axes b seen from axes a: out[i, j] = a_i . b_j."""
    for i in range(3):
        for j in range(3):
            out[i, j] = dot(a[i], b[j])


@compiled
def dot(a: Array, b: Array) -> float:
    """Scalar product of vectors (3,)."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@compiled
def cross(a: Array, b: Array, out: Array) -> None:
    """out (3,) = a x b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@compiled
def combine(weights: Array, vectors: Array, out: Array) -> None:
    """out (3,) = sum of weights (3,) times vectors (3, 3)."""
    for i in range(3):
        out[i] = weights[0] * vectors[0, i] + weights[1] * vectors[1, i] + weights[2] * vectors[2, i]


@inlined
def velocity_at(screw: Array, p: Array) -> tuple[float, float, float]:
    """Velocity v + omega x p of the point at p (3,), of a screw (v, omega) (6,)."""
    velocity, omega = screw, screw[3:6]
    return (
        velocity[0] + omega[1] * p[2] - omega[2] * p[1],
        velocity[1] + omega[2] * p[0] - omega[0] * p[2],
        velocity[2] + omega[0] * p[1] - omega[1] * p[0],
    )


@compiled
def log(r: Array, out: Array) -> None:
    """Rotation vector (3,) of a rotation matrix, its angle in [0, pi] (S. W. Shepperd, 1978)."""
    a, e, i = r[0, 0], r[1, 1], r[2, 2]
    s0, s1, s2, s3 = a + e + i, a - e - i, e - a - i, i - a - e
    if s0 >= s1 and s0 >= s2 and s0 >= s3:
        w, x, y, z = 1.0 + s0, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    elif s1 >= s2 and s1 >= s3:
        w, x, y, z = r[2, 1] - r[1, 2], 1.0 + s1, r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]
    elif s2 >= s3:
        w, x, y, z = r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1.0 + s2, r[1, 2] + r[2, 1]
    else:
        w, x, y, z = r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1.0 + s3
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 * math.atan2(sine, w) / sine if sine > 0.0 else 0.0
    out[0], out[1], out[2] = factor * x, factor * y, factor * z


@compiled
def turn(axes: Array, v: Array, s: float, c: float) -> None:
    """Rotate axes (3, 3) about a vector (3,) along them, by s = sin(t) / |v|, c = (1 - cos(t)) / |v|^2 (Rodrigues).

    With a vector in the world, rounding errors of the axes' lengths would grow from joint to joint.
    """
    x, y, z = v[0], v[1], v[2]
    rest = 1.0 - c * dot(v, v)
    for i in range(3):
        a0, a1, a2 = axes[0, i], axes[1, i], axes[2, i]
        along = c * (x * a0 + y * a1 + z * a2)
        axes[0, i] = rest * a0 + along * x + s * (z * a1 - y * a2)
        axes[1, i] = rest * a1 + along * y + s * (x * a2 - z * a0)
        axes[2, i] = rest * a2 + along * z + s * (y * a0 - x * a1)


@compiled
def sinc(square: float) -> tuple[float, float]:
    """sin(t) / t and (1 - cos(t)) / t^2, of t^2."""
    t = math.sqrt(square)
    if t < 1e-4:
        return 1.0 - square / 6.0, 0.5 - square / 24.0
    return math.sin(t) / t, (1.0 - math.cos(t)) / square


@compiled
def log_derivative(v: Array, out: Array) -> None:
    """(3, 3) derivative of `log` at log(R) = v by the angular velocity in the fixed axes."""
    x, y, z = v[0], v[1], v[2]
    t2 = x * x + y * y + z * z
    t = math.sqrt(t2)
    f = 1.0 / 12.0 + t2 / 720.0 if t < 1e-2 else 1.0 / t2 - 1.0 / (2.0 * t * math.tan(0.5 * t))
    out[0, 0], out[0, 1], out[0, 2] = 1.0 - f * (y * y + z * z), f * x * y + 0.5 * z, f * x * z - 0.5 * y
    out[1, 0], out[1, 1], out[1, 2] = f * x * y - 0.5 * z, 1.0 - f * (x * x + z * z), f * y * z + 0.5 * x
    out[2, 0], out[2, 1], out[2, 2] = f * x * z + 0.5 * y, f * y * z - 0.5 * x, 1.0 - f * (x * x + y * y)


@compiled
def swing(x: float, y: float, z: float, out: Array, by: Array) -> None:
    """Rotation vector (2,), about x and y, that brings z onto the axis (x, y, z), and its (2, 3) derivative."""
    s = math.sqrt(x * x + y * y)
    if s < 1e-4 and z < 0.0:  # opposed, or nearly
        turned = math.atan2(s, z) / s if s >= 1e-9 else 0.0
        out[0], out[1] = -turned * y if turned > 0.0 else math.pi, turned * x
        by[0, 0], by[0, 1], by[0, 2] = 1.0, 0.0, 0.0
        by[1, 0], by[1, 1], by[1, 2] = 0.0, 1.0, 0.0
        return
    ratio = math.atan2(s, z) / s if s > 1e-4 else 1.0 + s * s / 6.0
    slope = (z - ratio) / (s * s) if s > 1e-4 else -2.0 / 3.0
    out[0], out[1] = -ratio * y, ratio * x
    a, b, c = -y * slope * x, -y * slope * y - ratio, y  # by the axis
    d, e, f = x * slope * x + ratio, x * slope * y, -x
    by[0, 0], by[0, 1], by[0, 2] = c * y - b * z, a * z - c * x, b * x - a * y  # the axis moves by omega x axis
    by[1, 0], by[1, 1], by[1, 2] = f * y - e * z, d * z - f * x, e * x - d * y
