"""The Klein form on spans of Pluecker vectors: what is reciprocal to them, and which real lines lie in them.

The form of x = (d, m) is x.K.x = 2 d.m; a vector is a line where it vanishes. It has three positive and three negative
eigenvalues (F. Klein, "Zur Theorie der Liniencomplexe des ersten und zweiten Grades", Math. Annalen 2, 1870).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KLEIN = np.kron([[0.0, 1.0], [1.0, 0.0]], np.eye(3))
"""(6, 6) K, with x.K.y the mutual moment of x and y."""
KLEIN.setflags(write=False)


class Span(NamedTuple):
    """What some Pluecker vectors span, to a rank that is given.

    Attributes:
        basis: (rank, 6) orthonormal rows.
        values: (rank,) the singular values that do not vanish, largest first.
        vanishing: the largest of those that do, 0 where there is none.
        reciprocal: (6 - rank, 6) orthonormal rows: all screws reciprocal to it.
    """

    basis: Array
    values: Array
    vanishing: float
    reciprocal: Array

    def known(self, accuracy: float) -> float:
        """How well the span is known where the vectors are to `accuracy`, rad; at most 0.01, above which it is not."""
        return float(min(accuracy / self.values[-1], _UNKNOWN))

    def holds_line(self, screw: Array, accuracy: float) -> bool:
        """Whether a screw (6,) of unit size, reciprocal to the span, is a line as far as can be told.

        To add t_j K b_j to it, with the basis b_j, makes it work on the vectors by |s_j t_j|, together, with the
        singular values s_j; and changes its form, at first, by 2 t_j b_j.x. So the form may be off by 2 |b_j.x / s_j|
        times the accuracy.
        """
        slack = 2.0 * accuracy * float(np.linalg.norm(self.basis @ screw / self.values))
        return abs(float(screw @ KLEIN @ screw)) <= max(slack, accuracy)


_UNKNOWN = 1e-2


def span(vectors: Array, rank: int) -> Span:
    """What vectors (n, 6) span, to a rank."""
    _, sigma, vt = np.linalg.svd(vectors)
    vanishing = float(sigma[rank]) if rank < len(sigma) else 0.0
    return Span(vt[:rank], sigma[:rank], vanishing, vt[rank:] @ KLEIN)


class Pencil(NamedTuple):
    """The real lines among all combinations of two screws.

    Attributes:
        lines: (k, 6) unit vectors, k = 0, 1 or 2; none where all are.
        all: whether every combination is a line: a flat pencil.
    """

    lines: Array
    all: bool


def directors(spanned: Span, accuracy: float) -> Pencil:
    """The real lines that meet all lines of a span of rank 4.

    Among the combinations of two reciprocal screws, with eigenvectors e, f of the form on them and eigenvalues a and b,
    it is a s^2 + b t^2: the lines are sqrt(|b|) e +- sqrt(|a|) f for opposite signs, one where b is 0 as far as can be
    told, none for like signs.
    """
    values, vectors = np.linalg.eigh(spanned.reciprocal @ KLEIN @ spanned.reciprocal.T)
    screws = vectors.T @ spanned.reciprocal
    lines = np.array([spanned.holds_line(screw, accuracy) for screw in screws])
    if lines.all():
        return Pencil(np.zeros((0, 6)), True)
    if lines.any():
        return Pencil(screws[lines], False)
    if values.prod() > 0.0:
        return Pencil(np.zeros((0, 6)), False)
    e, f = np.sqrt(np.abs(values[::-1]))[:, None] * screws
    found = np.array([e + f, e - f])
    return Pencil(found / np.linalg.norm(found, axis=1, keepdims=True), False)
