"""Matrices over boxes: M_0 + sum_k M_k eta_k + [-R, R], |eta_k| <= 1: eta are the eps_j, and then their products."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cinegen.arrays import Array


class Matrices(NamedTuple):
    """A matrix over boxes.

    Attributes:
        c: (boxes, rows, columns) at the centre.
        g: (boxes, n, rows, columns) its change by eta.
        r: (boxes, rows, columns) radius.
    """

    c: Array
    g: Array
    r: Array

    def part(self, rows: Any, columns: Any) -> Matrices:
        """Return some rows and columns."""
        down, across = np.asarray(rows, dtype=np.intp)[:, None], np.asarray(columns, dtype=np.intp)
        return Matrices(*(m[..., down, across] for m in self))

    def times(self, right: Array) -> Matrices:
        """Return the product with constants (boxes, columns, .)."""
        return Matrices(self.c @ right, self.g @ right[:, None], self.r @ np.abs(right))

    def by(self, right: Matrices, n: int) -> Matrices:
        """Return the product with others; n is the number of eps."""
        g = self.c[:, None] @ right.g + self.g @ right.c[:, None]
        g[:, n:] += products(self.g, right.g, n)
        rest = self.cubic(right, n) + (np.abs(self.c) + np.abs(self.g).sum(axis=1)) @ right.r
        return Matrices(self.c @ right.c, g, rest)

    def cubic(self, right: Matrices, n: int) -> Array:
        """Return a bound of what the product has beyond products of eps, but for the radius of the other."""
        (linear, squares), (on_right, beyond) = (
            (np.abs(m.g[:, :n]).sum(axis=1), np.abs(m.g[:, n:]).sum(axis=1)) for m in (self, right)
        )
        sizes = np.abs(right.c) + on_right + beyond + right.r
        return np.asarray(self.r @ sizes + linear @ beyond + squares @ (on_right + beyond))

    def beside(self, right: Array) -> Matrices:
        """Return the matrix, and constants (boxes, rows, .) to the right of it."""
        none = np.zeros((*self.g.shape[:2], *right.shape[1:]))
        return Matrices(*(np.concatenate(pair, axis=-1) for pair in zip(self, (right, none, none[:, 0]), strict=True)))


def products(left: Array, right: Array, n: int) -> Array:
    """Return what products of the parts by eps_j, of both, are by eps_j eps_k, j <= k."""
    j, k = np.triu_indices(n)
    mixed = left[:, j] @ right[:, k] + left[:, k] @ right[:, j]
    return np.asarray(mixed * np.where(j == k, 0.5, 1.0)[:, None, None])
