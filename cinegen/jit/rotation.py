"""Rotations: `raff2urdf.residual`'s log, swing and their derivatives, compiled; results go into given arrays."""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled


@compiled
def log(r: Array, out: Array) -> None:
    """Rotation vector (3,) of r (3, 3), its angle in [0, pi] (S. W. Shepperd, 1978)."""
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
def exp(v: Array, out: Array) -> None:
    """Rotation (3, 3) by a rotation vector (Rodrigues)."""
    x, y, z = v[0], v[1], v[2]
    t2 = x * x + y * y + z * z
    t = math.sqrt(t2)
    if t < 1e-4:
        s, c = 1.0 - t2 / 6.0, 0.5 - t2 / 24.0
    else:
        s, c = math.sin(t) / t, (1.0 - math.cos(t)) / t2
    out[0, 0], out[0, 1], out[0, 2] = 1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)


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
    """The turn (2,) about x and y that brings z onto the axis (x, y, z), and its (2, 3) derivative."""
    s = math.sqrt(x * x + y * y)
    if s < 1e-9 and z < 0.0:
        out[0], out[1] = math.pi, 0.0
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


@compiled
def times(a: Array, b: Array, out: Array) -> None:
    """a @ b, (3, 3) each."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@compiled
def transposed_times(a: Array, b: Array, out: Array) -> None:
    """a.T @ b, (3, 3) each."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[0, i] * b[0, j] + a[1, i] * b[1, j] + a[2, i] * b[2, j]


@compiled
def times_transposed(a: Array, b: Array, out: Array, rows: int) -> None:
    """a @ b.T, the first rows of it."""
    for i in range(rows):
        for j in range(3):
            out[i, j] = a[i, 0] * b[j, 0] + a[i, 1] * b[j, 1] + a[i, 2] * b[j, 2]
