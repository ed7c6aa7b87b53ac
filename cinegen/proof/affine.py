"""Affine arithmetic with outward rounding, many boxes at a time.

A form is the set of values c + sum_j g_j eps_j + [-r, r], |eps_j| <= 1, so that what depends on the same eps cancels
(J. Stolfi and L. H. de Figueiredo, "Self-validated numerical methods and applications", 1997). Of a product,

    (sum_i a_i eps_i) (sum_j b_j eps_j) = 1/2 sum_j a_j b_j + [-1, 1] (S_a S_b - 1/2 sum_j |a_j b_j|),    S = sum_j |.|

as eps_j^2 lies in [0, 1]. With T = S + r of an angle c + t, |t| <= T, and 0 <= t^2 <= T^2,

    sin(c + t) = sin c + t cos c - t^2/2 sin c + [-1, 1] T^3/6

and likewise of the cosine. Each operation adds to r what rounding may have done to c, g and r: a small multiple of the
largest absolute value of all terms together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cinegen.arrays import Array

_ROUNDING = 128 * 2.0**-53
"""Bound of the relative error of an operation with at most 60 terms, libm's sine and cosine included."""


class Form:
    """An array of forms.

    Attributes:
        a: (1 + n, boxes, ...) c, and g_1 ... g_n.
        r: (boxes, ...) r.
    """

    __slots__ = ("a", "r")

    def __init__(self, a: Array, r: Array) -> None:
        self.a, self.r = a, r

    @property
    def most(self) -> Array:
        """Largest absolute value."""
        return np.asarray(np.abs(self.a).sum(axis=0) + self.r)

    @property
    def spread(self) -> Array:
        """Largest distance from c."""
        return np.asarray(np.abs(self.a[1:]).sum(axis=0) + self.r)

    def __getitem__(self, key: Any) -> Form:
        """Return a part of the array, by indices of the dimensions behind the boxes."""
        key = key if isinstance(key, tuple) else (key,)
        return Form(self.a[:, :, *key], self.r[:, *key])

    def __add__(self, other: Form) -> Form:
        a = self.a + other.a
        return Form(a, self.r + other.r + _ROUNDING * (np.abs(a).sum(axis=0) + self.r + other.r))

    def __sub__(self, other: Form) -> Form:
        return self + Form(-other.a, other.r)

    def __mul__(self, other: Form) -> Form:
        a, b, n = self.a, other.a, len(self.a)
        s, t = np.abs(a[1:]).sum(axis=0), np.abs(b[1:]).sum(axis=0)
        x, y = np.abs(a[0]), np.abs(b[0])
        product = a[:1] * b
        r = s * t + (x + s) * other.r + self.r * (y + t + other.r)
        if n > 1:
            product[1:] += a[1:] * b[:1]
            halves = 0.5 * a[1:] * b[1:]
            product[0] += halves.sum(axis=0)
            r = r - np.abs(halves).sum(axis=0)
        return Form(product, r + _ROUNDING * (x + s + self.r) * (y + t + other.r))

    def scaled(self, factor: Array) -> Form:
        """Return these times numbers (...) or (boxes, ...)."""
        a = self.a * factor
        return Form(a, np.abs(factor) * self.r + _ROUNDING * np.abs(a).sum(axis=0))

    def widened(self, radius: Array) -> Form:
        """Return these and what is within a radius of them."""
        return Form(self.a, self.r + radius)

    def sum(self, axis: int) -> Form:
        """Return the sums along an axis, counted from the last."""
        return Form(self.a.sum(axis=axis), self.r.sum(axis=axis) + _ROUNDING * self.most.sum(axis=axis))

    def sin_cos(self) -> tuple[Form, Form]:
        """Return sine and cosine."""
        t, s, c = self.spread, np.sin(self.a[0]), np.cos(self.a[0])
        more = np.where((t == 0.0) & (self.a[0] == 0.0), 0.0, t**3 / 6.0 + _ROUNDING * (1.0 + t) ** 3)
        found = []
        for value, slope in ((s, c), (c, -s)):
            a, quarter = self.a * slope, 0.25 * value * t**2
            a[0] = value - quarter
            found.append(Form(a, np.abs(slope) * self.r + np.abs(quarter) + more))
        return found[0], found[1]

    def placed(self, rotation: Array, radius: float) -> Form:
        """Return rows (..., 3) times a constant matrix (3, k) whose numbers have a radius, but for 0, 1 and -1."""
        exact = (rotation == 0.0) | (np.abs(rotation) == 1.0) if radius else np.ones(rotation.shape, dtype=bool)
        wide = np.abs(rotation) * _ROUNDING + np.where(exact, 0.0, radius)
        return Form(self.a @ rotation, self.r @ np.abs(rotation) + self.most @ wide)

    def left(self, matrix: Array) -> Form:
        """Return matrices (boxes, m, k) times these (boxes, k, j)."""
        size = np.abs(matrix)
        return Form(matrix @ self.a, size @ (self.r + _ROUNDING * self.most))

    def minus_one(self) -> Form:
        """Return square matrices minus the identity."""
        a = self.a.copy()
        a[0] -= np.eye(a.shape[-1])
        return Form(a, self.r)


def cross(u: Form, v: Form) -> Form:
    """Return cross products along the last dimension."""
    one, two = [1, 2, 0], [2, 0, 1]
    return u[..., one] * v[..., two] - u[..., two] * v[..., one]


def stacked(forms: Sequence[Form], axis: int = -1) -> Form:
    """Return forms side by side, along a new dimension counted from the last."""
    wide = _broadcast(forms)
    return Form(np.stack([one.a for one in wide], axis=axis), np.stack([one.r for one in wide], axis=axis))


def _broadcast(forms: Sequence[Form]) -> list[Form]:
    """Return forms for the same number of boxes."""
    boxes = max(len(one.r) for one in forms)
    return [
        Form(
            np.broadcast_to(one.a, (len(one.a), boxes, *one.a.shape[2:])),
            np.broadcast_to(one.r, (boxes, *one.r.shape[1:])),
        )
        for one in forms
    ]
