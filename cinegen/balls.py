"""Vectors and frames whose numbers are balls (python-flint's `arb`): lists of three, and 4x4 matrices."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock

from flint import arb, arb_mat, ctx

from cinegen.arrays import Array

_BITS = 128  # of midpoints
_LOCK = RLock()


@contextmanager
def precise(bits: int = _BITS) -> Iterator[None]:
    """Compute with midpoints of so many bits, one thread at a time: the precision is one for the whole process. Balls
    are right with any, but wider with less."""
    with _LOCK, ctx.workprec(bits):
        yield


def frame(rotation: Array, translation: Array) -> arb_mat:
    """Return a placement (4, 4) whose rotation is exactly one: its third axis made a unit vector, and then the first at
    a right angle to it. An exact 0 or 1 stays one."""
    x, _, z = ([arb(float(a)) for a in column] for column in rotation.T)
    z = unit(z)
    along = dot(x, z)
    x = unit([a - along * b for a, b in zip(x, z, strict=True)])
    y = cross(z, x)
    rows = [[x[i], y[i], z[i], arb(float(translation[i]))] for i in range(3)]
    return arb_mat([*rows, [0, 0, 0, 1]])


def axes_and_origin(placement: arb_mat) -> tuple[list[list[arb]], list[arb]]:
    """Return the three axes and the origin of a placement (4, 4)."""
    e = placement.entries()
    x, y, z, p = (e[k:12:4] for k in range(4))
    return [x, y, z], p


def combined(axes: list[list[arb]], local: list[arb]) -> list[arb]:
    """Return the sum of three axes times coordinates along them."""
    x, y, z = local
    return [a * x + b * y + c * z for a, b, c in zip(*axes, strict=True)]


def minus(u: list[arb], v: list[arb]) -> list[arb]:
    """Return the difference of two vectors."""
    return [u[0] - v[0], u[1] - v[1], u[2] - v[2]]


def unit(v: list[arb]) -> list[arb]:
    """Return a vector of length 1 along another."""
    size = dot(v, v).sqrt()
    return [x / size for x in v]


def dot(u: list[arb], v: list[arb]) -> arb:
    """Return the scalar product of two vectors."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: list[arb], v: list[arb]) -> list[arb]:
    """Return the cross product of two vectors."""
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
