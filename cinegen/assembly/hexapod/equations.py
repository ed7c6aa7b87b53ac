"""A hexapod's legs as quadratic equations in Study's coordinates of its platform.

A pose is a dual quaternion x = (c, d), eight numbers up to a factor, with <c, d> = 0 (Study's quadric) and not
<c, c> = 0: it turns b to c b c* / <c, c> and moves it by d c* / <c, c>. That a point b of the platform is as far from
a point a of the base as its leg is long is, times <c, c>,

    s <c, c> + <d, d> + 2 <d, c b - a c> - 2 <a c, c b> = 0    with s = |a|^2 + |b|^2 - length^2

(M. L. Husty, "An algorithm for solving the direct kinematics of general Stewart-Gough platforms", Mechanism and Machine
Theory 31, 1996). For complex points and lengths too, as <,> is bilinear. The first leg's equation is taken from the
others, so that <d, d> stays in it alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_UPPER = np.triu_indices(4, 1)


def coefficients(base: Complex, platform: Complex, s: Complex) -> Complex:
    """(6, 16) of the six equations, as the kernel's products want them, for points (6, 3) and s (6,)."""
    left, right = _left(base), _right(platform)
    symmetric = -2.0 * np.swapaxes(left, 1, 2) @ right  # of c with c: left and right multiplication commute
    skew = right - left  # of d with c
    found = np.empty((6, 16), dtype=complex)
    found[:, :4] = np.diagonal(symmetric, axis1=1, axis2=2) + np.asarray(s)[:, None]
    found[:, 4:10] = symmetric[:, *_UPPER]
    found[:, 10:] = skew[:, *_UPPER]
    found[1:] -= found[0]
    return found


def moving(begin: Complex, end: Complex, between: Complex | None = None) -> Complex:
    """(3, 6, 16) the parabola of coefficients through these at parameter 0 and 1, and at a half; or a straight line."""
    if between is None:
        return np.array([begin, end - begin, np.zeros_like(begin)])
    bend = 2.0 * (begin + end - 2.0 * between)
    return np.array([begin, end - begin - bend, bend])


def squares(base: Complex, platform: Complex) -> Complex:
    """(6,) s where the lengths are 0."""
    return np.asarray((base * base + platform * platform).sum(axis=1))


def lengths_at(base: Complex, platform: Complex, x: Complex) -> Complex:
    """(6,) s that makes a pose x (8,) on Study's quadric one of the solutions."""
    rest = coefficients(base, platform, np.zeros(6, dtype=complex))
    rest[1:] += rest[0]
    c, d = x[:4], x[4:]
    first, second = _UPPER
    products = np.concatenate([c * c, 2.0 * c[first] * c[second], 2.0 * (d[first] * c[second] - d[second] * c[first])])
    return np.asarray(-(rest @ products + d @ d) / (c @ c))


def placements(x: Array) -> Array:
    """(n, 4, 4) of real poses x (n, 8)."""
    c, d = x[:, :4], x[:, 4:]
    c, d = c / np.linalg.norm(c, axis=1)[:, None], d / np.linalg.norm(c, axis=1)[:, None]
    found = np.zeros((len(x), 4, 4))
    back = c * [1.0, -1.0, -1.0, -1.0]
    turn = _left_of(c) @ _right_of(back)
    found[:, :3, :3] = turn[:, 1:, 1:]
    found[:, :3, 3] = np.einsum("nij,nj->ni", _right_of(back), d)[:, 1:]
    found[:, 3, 3] = 1.0
    return found


def _left(points: Complex) -> Complex:
    """(n, 4, 4) what multiplies a quaternion by points (n, 3) from the left."""
    return np.asarray(_left_of(np.hstack([np.zeros((len(points), 1)), points])))


def _right(points: Complex) -> Complex:
    return np.asarray(_right_of(np.hstack([np.zeros((len(points), 1)), points])))


def _left_of(q: Any) -> Any:
    w, x, y, z = q.T
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]]).transpose(2, 0, 1)


def _right_of(q: Any) -> Any:
    w, x, y, z = q.T
    return np.array([[w, -x, -y, -z], [x, w, z, -y], [y, -z, w, x], [z, y, -x, w]]).transpose(2, 0, 1)
