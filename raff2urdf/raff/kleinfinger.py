"""Kleinfinger's six parameters and the homogeneous transform that they define.

W. Khalil and J.-F. Kleinfinger, "A new geometric notation for open and closed-loop robots", IEEE conf. on
Robotics and Automation, 1986. From parent to link:

    T = Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d) Rz(theta) Tz(r)

Everything here is in metres and radians.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from raff2urdf.arrays import Array, ArrayLike


class Kleinfinger(NamedTuple):
    """The six parameters: gamma, alpha, theta in rad; epsilon, d, r in m."""

    gamma: float
    epsilon: float
    alpha: float
    d: float
    theta: float
    r: float


def transform(parameters: Kleinfinger) -> Array:
    """Return the (4, 4) transform of the parameters."""
    gamma, epsilon, alpha, d, theta, r = parameters
    cg, sg = math.cos(gamma), math.sin(gamma)
    ca, sa = math.cos(alpha), math.sin(alpha)
    ct, st = math.cos(theta), math.sin(theta)
    return np.array(
        [
            [cg * ct - sg * ca * st, -cg * st - sg * ca * ct, sg * sa, d * cg + r * sg * sa],
            [sg * ct + cg * ca * st, -sg * st + cg * ca * ct, -cg * sa, d * sg - r * cg * sa],
            [sa * st, sa * ct, ca, epsilon + r * ca],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def parameters(placement: ArrayLike) -> Kleinfinger:
    """Return six parameters of a (4, 4) rigid transform, the inverse of `transform`.

    The rotation is Rz(gamma) Rx(alpha) Rz(theta) with alpha in [0, pi]; the translation is epsilon along the parent's
    z, d along the common perpendicular and r along the new z. If both z axes are parallel, gamma and theta are
    rotations about the same line, and epsilon and r are translations along it: then gamma points at the new origin,
    theta is the remainder of the rotation, and r = 0.

    Raises:
        ValueError: not a (4, 4) array of finite numbers whose rotation is orthonormal to 1e-6 and whose last row is
            0 0 0 1.
    """
    m = np.asarray(placement, dtype=float)
    if m.shape != (4, 4) or not np.isfinite(m).all():
        raise ValueError("a placement must be a (4, 4) array of finite numbers")
    if not np.array_equal(m[3], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError("the last row of a placement must be 0 0 0 1")
    rotation = m[:3, :3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
        raise ValueError("the rotation of a placement must be orthonormal and right-handed")
    skew = _by_common_normal(m)
    if skew is None:
        return _by_parallel_axes(m)
    if math.hypot(rotation[0, 2], rotation[1, 2]) > _CLEAR:
        return skew
    return min(skew, _by_parallel_axes(m), key=lambda solution: float(np.abs(transform(solution) - m).max()))


def completed(placement: Array, gamma: float, alpha: float, r: float) -> Kleinfinger:
    """Return the parameters of a placement (4, 4) with the given gamma, alpha (rad) and r (m): theta, epsilon and d
    follow."""
    (x, _, _, px), (y, _, _, py), (z, _, _, pz), _ = placement.tolist()
    cg, sg, ca, sa = math.cos(gamma), math.sin(gamma), math.cos(alpha), math.sin(alpha)
    theta = math.atan2(ca * (cg * y - sg * x) + sa * z, cg * x + sg * y)
    return Kleinfinger(gamma, pz - r * ca, alpha, cg * px + sg * py, theta, r)


_CLEAR = 1e-3
"""Sine of an angle between two z axes above which they are certainly not parallel. Below, to write the angle may cost
more precision than to leave it out: r grows without bound as the angle shrinks, and with r the rounding of the
position."""


def _by_common_normal(m: Array) -> Kleinfinger | None:
    """Return parameters for z axes with one common perpendicular; None if they are exactly parallel."""
    sa = math.hypot(m[0, 2], m[1, 2])
    if sa <= 4.0 * np.finfo(float).eps:  # rounding of sin(pi) and its like
        return None
    gamma = math.atan2(m[0, 2], -m[1, 2])
    r = (math.sin(gamma) * m[0, 3] - math.cos(gamma) * m[1, 3]) / sa
    return completed(m, gamma, math.atan2(sa, m[2, 2]), float(r))


def _by_parallel_axes(m: Array) -> Kleinfinger:
    """Return parameters for z axes that are parallel, or treated as such."""
    gamma = math.atan2(m[1, 3], m[0, 3]) if m[:2, 3].any() else 0.0
    return completed(m, gamma, 0.0 if m[2, 2] > 0 else math.pi, 0.0)
