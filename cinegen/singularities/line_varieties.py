"""Varieties of lines: the span of some lines on Klein's quadric, its Grassmann class, and its geometry."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from itertools import combinations
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.singularities.pluecker import KLEIN, fit_plane, fit_point
from cinegen.singularities.screw_system import ScrewSystem

DEPENDENT = 1e-7
"""Lines whose smallest singular value is at most this are dependent."""

MARGIN = 10.0  # lines may each be off by some multiple of their singular value
UNKNOWN = 1e-2  # inaccuracy of a span above which it is not known


class GrassmannClass(Enum):
    """A class of varieties by its number in Merlet's paper. A pair of skew lines (2a) contains no third line: lines are
    dependent in it only if two of them are one."""

    ONE_LINE = "1"
    SKEW_LINES = "2a"
    FLAT_PENCIL = "2b"
    REGULUS = "3a"
    TWO_PENCILS = "3b"
    BUNDLE = "3c"
    PLANE = "3d"
    ELLIPTIC_CONGRUENCE = "4a"
    HYPERBOLIC_CONGRUENCE = "4b"
    PARABOLIC_CONGRUENCE = "4c"
    DEGENERATE_CONGRUENCE = "4d"
    GENERAL_COMPLEX = "5a"
    SPECIAL_COMPLEX = "5b"

    @property
    def rank(self) -> int:
        """The largest number of independent lines."""
        return int(self.value[0])

    @property
    def title(self) -> str:
        """Its name and number, such as `flat pencil (2b)`."""
        return f"{self.name.lower().replace('_', ' ')} ({self.value})"


_CONGRUENCES = (
    GrassmannClass.ELLIPTIC_CONGRUENCE, GrassmannClass.PARABOLIC_CONGRUENCE, GrassmannClass.HYPERBOLIC_CONGRUENCE
)  # fmt: skip
"""Congruences that are not degenerate, by their number of directors."""


class KleinSpan(NamedTuple):
    """The span of some Pluecker vectors, to a rank that is given.

    Attributes:
        basis: (rank, 6) orthonormal rows.
        values: (rank,) the singular values that do not vanish, largest first.
        vanishing: the largest of those that do, 0 if there is none.
        reciprocal: (6 - rank, 6) orthonormal rows: all screws reciprocal to it.
    """

    basis: Array
    values: Array
    vanishing: float
    reciprocal: Array

    def known(self, accuracy: float) -> float:
        """Return how well the span is known for vectors known to `accuracy`, rad; at most 0.01, above which it is
        not."""
        return float(min(accuracy / self.values[-1], UNKNOWN))

    def contains_line(self, screw: Array, accuracy: float) -> bool:
        """Return whether a screw (6,) of unit size, reciprocal to the span, is a line within the accuracy.

        To add t_j K b_j to it, with the basis b_j, makes it work on the vectors by |s_j t_j|, together, with the
        singular values s_j; and changes its form, to first order, by 2 t_j b_j.x. So the form may be off by 2 |b_j.x /
        s_j| times the accuracy.
        """
        slack = 2.0 * accuracy * float(np.linalg.norm(self.basis @ screw / self.values))
        return abs(float(screw @ KLEIN @ screw)) <= max(slack, accuracy)

    def directors(self, accuracy: float) -> Array | None:
        """Return the real lines (k, 6), k = 0, 1 or 2, that meet all lines of this span of rank 4; None if every
        combination of the two reciprocal screws is one, a flat pencil.

        Among the combinations of these screws, with eigenvectors e, f of the form on them and eigenvalues a and b, it
        is a s^2 + b t^2: the lines are sqrt(|b|) e +- sqrt(|a|) f for opposite signs, one if b is 0 within the
        accuracy, none for like signs.
        """
        values, vectors = np.linalg.eigh(self.reciprocal @ KLEIN @ self.reciprocal.T)
        screws = vectors.T @ self.reciprocal
        lines = np.array([self.contains_line(screw, accuracy) for screw in screws])
        if lines.any():
            return None if lines.all() else screws[lines]
        if values.prod() > 0.0:
            return np.zeros((0, 6))
        e, f = np.sqrt(np.abs(values[::-1]))[:, None] * screws
        directors = np.array([e + f, e - f])
        return np.asarray(directors / np.linalg.norm(directors, axis=1, keepdims=True))


def span(vectors: Array, rank: int) -> KleinSpan:
    """Return the span of vectors (n, 6), to a rank."""
    _, sigma, vt = np.linalg.svd(vectors)
    vanishing = float(sigma[rank]) if rank < len(sigma) else 0.0
    return KleinSpan(vt[:rank], sigma[:rank], vanishing, vt[rank:] @ KLEIN)


def class_of_wrenches(wrenches: ScrewSystem) -> GrassmannClass | None:
    """Return the class of the lines along which forces span a system of wrenches; None if forces alone do not span it,
    and for all wrenches or none."""
    if not 1 <= wrenches.order <= 5 or np.abs(wrenches.vectors[:, :3]).max() <= wrenches.known:
        return None
    spanned = span(wrenches.vectors, wrenches.order)
    values = np.linalg.eigvalsh(spanned.basis @ KLEIN @ spanned.basis.T)
    signs = np.sign(values[np.abs(values) > 2.0 * wrenches.known])
    # forms that vanish, or have both signs, have lines that span them; others at most those of their radical
    return class_of_span(spanned, wrenches.known) if len(signs) == 0 or len(set(signs)) == 2 else None


def class_of_span(spanned: KleinSpan, accuracy: float) -> GrassmannClass:
    """Return the class of a span of rank 1 to 5 of lines.

    A Pluecker vector x is a line if x^T K x = 0, with the Klein form K. In the span B^T y this is y^T (B K B^T) y = 0:
    the zero eigenvalues of B K B^T distinguish classes of one rank. Of rank 4, the number of lines that meet all lines
    of the span does; of rank 5, whether the one screw that is reciprocal to it is a line. The classes are those
    of Merlet's paper, see `cinegen.singularities.grassmann`.

    Args:
        spanned: the span, B its basis (rank, 6).
        accuracy: of the lines, rad.
    """
    rank = len(spanned.basis)
    values = np.linalg.eigvalsh(spanned.basis @ KLEIN @ spanned.basis.T)
    zeros = int((np.abs(values) <= 2.0 * spanned.known(accuracy)).sum())
    if rank == 1:
        return GrassmannClass.ONE_LINE
    if rank == 2:
        return GrassmannClass.FLAT_PENCIL if zeros == 2 else GrassmannClass.SKEW_LINES
    if rank == 3:
        if zeros == 3:
            meet = fit_point(spanned.basis).residual <= fit_plane(spanned.basis).residual
            return GrassmannClass.BUNDLE if meet else GrassmannClass.PLANE
        return GrassmannClass.TWO_PENCILS if zeros else GrassmannClass.REGULUS
    if rank == 4:
        directors = spanned.directors(accuracy)
        return GrassmannClass.DEGENERATE_CONGRUENCE if directors is None else _CONGRUENCES[len(directors)]
    special = spanned.contains_line(spanned.reciprocal[0], accuracy)
    return GrassmannClass.SPECIAL_COMPLEX if special else GrassmannClass.GENERAL_COMPLEX


class LineVariety(NamedTuple):
    """A variety and what defines it, in the coordinates of the lines.

    Attributes:
        grassmann_class: of the variety.
        points: homogeneous (4,): a vertex for each pencil or bundle.
        planes: homogeneous (4,): for each pencil or plane.
        directors: (6,) the line itself, the line that two pencils share, the lines that all meet.
        groups: positions of the lines that go through a point or lie in a plane apart from the others.
    """

    grassmann_class: GrassmannClass
    points: tuple[Array, ...] = ()
    planes: tuple[Array, ...] = ()
    directors: tuple[Array, ...] = ()
    groups: tuple[tuple[int, ...], ...] = ()


def variety(lines: Array, rank: int, accuracy: float) -> LineVariety:
    """Return the variety of rank `rank` that lines (n, 6) span, of which every `rank` are independent, n > rank.

    Of several that fit, the most special one: lines of that variety exist within `accuracy` of the given ones.
    """
    if rank == 1:
        return LineVariety(GrassmannClass.ONE_LINE, directors=(span(lines, 1).basis[0],))
    if rank == 2:
        points, planes = (fit_point(lines).homogeneous,), (fit_plane(lines).homogeneous,)
        return LineVariety(GrassmannClass.FLAT_PENCIL, points, planes)
    if rank == 5:
        spanned = span(lines, 5)
        screw = spanned.reciprocal[0]
        if spanned.contains_line(screw, accuracy):
            return LineVariety(GrassmannClass.SPECIAL_COMPLEX, directors=(screw,))
        return LineVariety(GrassmannClass.GENERAL_COMPLEX)
    return _of_three(lines, accuracy) if rank == 3 else _of_four(lines, accuracy)


def _of_three(lines: Array, accuracy: float) -> LineVariety:
    point, plane = fit_point(lines), fit_plane(lines)
    if min(point.residual, plane.residual) <= accuracy:
        if point.residual <= plane.residual:
            return LineVariety(GrassmannClass.BUNDLE, points=(point.homogeneous,))
        return LineVariety(GrassmannClass.PLANE, planes=(plane.homogeneous,))
    if len(lines) == 4:  # of five, three would be in one of two pencils
        moments = np.abs(lines @ KLEIN @ lines.T)
        groups = min(
            (((0, i), _others(4, (0, i))) for i in (1, 2, 3)), key=lambda pair: max(moments[pair[0]], moments[pair[1]])
        )
        if max(moments[groups[0]], moments[groups[1]]) <= accuracy:
            return _two_pencils(lines, *groups)
    return LineVariety(GrassmannClass.REGULUS)


def _two_pencils(lines: Array, first: tuple[int, ...], second: tuple[int, ...]) -> LineVariety:
    pairs = [lines[list(group)] for group in (first, second)]
    coefficients = np.linalg.svd(lines.T)[2][-1]
    shared = coefficients[list(first)] @ pairs[0]  # and the opposite of the same sum over the second
    points, planes = (tuple(fit(pair).homogeneous for pair in pairs) for fit in (fit_point, fit_plane))
    directors = (shared / np.linalg.norm(shared),)
    return LineVariety(GrassmannClass.TWO_PENCILS, points, planes, directors, (first, second))


def _of_four(lines: Array, accuracy: float) -> LineVariety:
    fits = [fit for fit in _degenerate(lines) if fit[0] <= accuracy]
    if fits:
        return min(fits, key=lambda fit: fit[0])[1]
    spanned = span(lines, 4)
    real = spanned.directors(accuracy)
    if real is None:  # W is next to a flat pencil, but no three lines show it
        real = spanned.directors(0.0)
    directors = () if real is None else tuple(real)
    return LineVariety(_CONGRUENCES[len(directors)], directors=directors)


def _degenerate(lines: Array) -> Iterator[tuple[float, LineVariety]]:
    """Return all partitions of the lines into three through one point, or in one plane, and the others in one plane, or
    through one point, with the point in the plane; each with the distance of the lines from it."""
    for three in combinations(range(len(lines)), 3):
        others = _others(len(lines), three)
        for through, inside in ((three, others), (others, three)):
            point, plane = fit_point(lines[list(through)]), fit_plane(lines[list(inside)])
            x, n = point.homogeneous, plane.homogeneous
            off = abs(float(x[:3] @ n[:3] - x[3] * n[3]))  # of the point from the plane
            congruence = LineVariety(GrassmannClass.DEGENERATE_CONGRUENCE, (x,), (n,), groups=(through, inside))
            yield max(point.residual, plane.residual, off), congruence


def _others(count: int, some: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(i for i in range(count) if i not in some)
