"""The legs of a hexapod as quadratic equations in Study's coordinates of its platform.

A pose is a dual quaternion x = (c, d), eight numbers up to a factor, with <c, d> = 0 (Study's quadric) and not
<c, c> = 0: it rotates b to c b c* / <c, c> and shifts it by d c* / <c, c>. That a point b of the platform is as far
from a point a of the base as its leg is long is, times <c, c>,

    s <c, c> + <d, d> + 2 <d, c b - a c> - 2 <a c, c b> = 0    with s = |a|^2 + |b|^2 - length^2

(M. L. Husty, "An algorithm for solving the direct kinematics of general Stewart-Gough platforms", Mechanism and Machine
Theory 31, 1996). For complex points and lengths too, as <,> is bilinear. The first leg's equation is subtracted from
the others, so that <d, d> stays in it alone.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cinegen.arrays import Array, Complex

SOLUTIONS = 40
"""Number of solutions of a general hexapod (F. Ronga and T. Vust, "Stewart platforms without computer?", 1992)."""

START_FILE = Path(__file__).with_name("start.npz")

_UPPER = np.triu_indices(4, 1)


class StartSystem(NamedTuple):
    """A hexapod with random complex points and lengths whose solutions are known (`examples/papers/hexapod_start.py`).

    Attributes:
        base: (6, 3) complex.
        platform: (6, 3) complex.
        s: (6,) what stands for its lengths, complex.
        x: (40, 8) its solutions, in Study's coordinates, of norm 1.
    """

    base: Complex
    platform: Complex
    s: Complex
    x: Complex


@cache
def start_system() -> StartSystem:
    """Load the start system that is shipped."""
    with np.load(START_FILE) as kept:
        return StartSystem(*(kept[name] for name in StartSystem._fields))


def coefficients(base: Complex, platform: Complex, s: Complex) -> Complex:
    """Return the coefficients (6, 16) of the products in the six equations, for points (6, 3) and s (6,)."""
    left, right = (side(np.hstack([np.zeros((6, 1)), p])) for side, p in ((_left, base), (_right, platform)))
    symmetric = -2.0 * np.swapaxes(left, 1, 2) @ right  # of c with c: left and right multiplication commute
    skew = right - left  # of d with c
    equations = np.empty((6, 16), dtype=complex)
    equations[:, :4] = np.diagonal(symmetric, axis1=1, axis2=2) + np.asarray(s)[:, None]
    equations[:, 4:10] = symmetric[:, *_UPPER]
    equations[:, 10:] = skew[:, *_UPPER]
    equations[1:] -= equations[0]
    return equations


def family(begin: Complex, end: Complex, middle: Complex | None = None) -> Complex:
    """Return the polynomial (3, 6, 16) of coefficients through these at parameters 0 and 1, and through `middle` at
    0.5; a straight line without it."""
    if middle is None:
        return np.array([begin, end - begin, np.zeros_like(begin)])
    curvature = 2.0 * (begin + end - 2.0 * middle)
    return np.array([begin, end - begin - curvature, curvature])


def squares(base: Complex, platform: Complex) -> Complex:
    """Return s (6,) for lengths 0."""
    return np.asarray((base * base + platform * platform).sum(axis=1))


def lengths_at(base: Complex, platform: Complex, x: Complex) -> Complex:
    """Return s (6,) for which a pose x (8,) on Study's quadric is a solution."""
    plain = coefficients(base, platform, np.zeros(6, dtype=complex))
    plain[1:] += plain[0]
    return np.asarray(-(plain @ _products(x[None])[0] + x[4:] @ x[4:]) / (x[:4] @ x[:4]))


def residual(equations: Complex, x: Complex) -> Array:
    """Return the largest left side (n,) of the seven equations at x (n, 8), for coefficients (6, 16)."""
    c, d = x[:, :4], x[:, 4:]
    sides = np.hstack([_products(x) @ equations.T, (c * d).sum(axis=1)[:, None]])
    sides[:, 0] += (d * d).sum(axis=1)
    return np.asarray(np.abs(sides).max(axis=1))


def placements(x: Array) -> Array:
    """Return the placements (n, 4, 4) of real poses x (n, 8)."""
    x = x / np.linalg.norm(x[:, :4], axis=1)[:, None]
    c, d = x[:, :4], x[:, 4:]
    back = _right(c * [1.0, -1.0, -1.0, -1.0])
    matrices = np.zeros((len(x), 4, 4))
    matrices[:, :3, :3] = (_left(c) @ back)[:, 1:, 1:]
    matrices[:, :3, 3] = np.einsum("nij,nj->ni", back, d)[:, 1:]
    matrices[:, 3, 3] = 1.0
    return matrices


def on_quadric(x: Any) -> Any:
    """Return x (n, 8) with d changed along c so that <c, d> = 0."""
    c, d = x[:, :4], x[:, 4:]
    return np.hstack([c, d - c * ((c * d).sum(axis=1) / (c * c).sum(axis=1))[:, None]])


def infinity(x: Complex) -> Array:
    """Return |<c, c>| (n,), which is 0 at infinity, for x (n, 8) of norm 1."""
    return np.asarray(np.abs((x[:, :4] ** 2).sum(axis=1)))


def distances(x: Complex, y: Complex) -> Array:
    """Return distances (n, m) of x (n, 8) and y (m, 8), of norm 1, up to factors of norm 1."""
    phase = x.conj() @ y.T
    phase /= np.maximum(np.abs(phase), 1e-300)
    return np.asarray(np.linalg.norm(x[:, None, :] * phase[:, :, None] - y[None, :, :], axis=2))


def _products(x: Complex) -> Complex:
    """Return the 16 products (n, 16) in which legs are linear, for x (n, 8)."""
    c, d = x[:, :4], x[:, 4:]
    i, j = _UPPER
    return np.hstack([c * c, 2.0 * c[:, i] * c[:, j], 2.0 * (d[:, i] * c[:, j] - d[:, j] * c[:, i])])


def _left(q: Any) -> Any:
    """Return the matrices (n, 4, 4) of multiplication by quaternions q (n, 4) from the left."""
    w, x, y, z = q.T
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]]).transpose(2, 0, 1)


def _right(q: Any) -> Any:
    """Return the matrices (n, 4, 4) of multiplication by quaternions q (n, 4) from the right."""
    w, x, y, z = q.T
    return np.array([[w, -x, -y, -z], [x, w, z, -y], [y, -z, w, x], [z, y, -x, w]]).transpose(2, 0, 1)
