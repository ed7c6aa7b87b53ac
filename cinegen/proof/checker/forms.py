"""Matrices over boxes: sums of products of eps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flint import arb_mat

from cinegen.proof.checker.balls import absolute, added, added_sizes


@dataclass
class Form:
    """A matrix over a box: C + sum_k G_k eta_k + [-R, R], eta the n eps_j and their products."""

    c: arb_mat
    g: list[arb_mat]
    r: arb_mat
    sums: tuple[arb_mat, arb_mat] | None = None

    def times(self, by: arb_mat) -> Form:
        """Return the product with a matrix."""
        return Form(self.c * by, [m * by for m in self.g], self.r * absolute(by))

    def less(self, other: Form) -> Form:
        """Return the difference."""
        return Form(self.c - other.c, [a - b for a, b in zip(self.g, other.g, strict=True)], self.r + other.r)

    def transposed(self) -> Form:
        """Return the transposed matrix."""
        return Form(self.c.transpose(), [m.transpose() for m in self.g], self.r.transpose())

    def sizes(self) -> arb_mat:
        """Return bounds of the sizes of numbers."""
        return added_sizes([self.c, *self.g, self.r])

    def by(self, right: Form, n: int) -> Form:
        """Return the product with another."""
        g = [self.c * m + a * right.c for m, a in zip(right.g, self.g, strict=True)]
        size = absolute(self.c) + added(self._sizes(n))
        whole = Form(self.c * right.c, g, self.cubic(right, n) + size * right.r)
        whole.add_products(self.g, right.g, n)
        return whole

    def add_products(self, left: Sequence[arb_mat], right: Sequence[arb_mat], n: int) -> None:
        """Add what products of the parts by eps_j are by eps_j eps_k."""
        pairs, self.sums = [(j, k) for j in range(n) for k in range(j, n)], None
        for q, (j, k) in enumerate(pairs, n):
            self.g[q] += left[j] * right[j] if j == k else left[j] * right[k] + left[k] * right[j]

    def cubic(self, right: Form, n: int) -> arb_mat:
        """Return a bound of what the product has beyond products of eps, but for the radius of the other."""
        (linear, squares), (on_right, beyond) = self._sizes(n), right._sizes(n)
        sizes = absolute(right.c) + on_right + beyond + right.r
        return self.r * sizes + linear * beyond + squares * (on_right + beyond)

    def _sizes(self, n: int) -> tuple[arb_mat, arb_mat]:
        """Return bounds of what the eps_j, and their products, change; kept, for it takes long."""
        self.sums = self.sums or (added_sizes(self.g[:n]), added_sizes(self.g[n:]))
        return self.sums
