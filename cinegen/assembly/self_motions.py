"""`SelfMotions`: the search for configurations among which a mechanism moves with its actuated joints locked.

Loops whose actuated joints are locked are a system of equations; its solutions are isolated points (modes) and
components of positive dimension (self-motions). A curve of solutions is known by its *witness set*: its points on a
general plane alpha . F = gamma, with the linkage's features F. The plane is moved along closed paths, which permute the
points of one irreducible curve. These are all of its points, and their number is its degree, if the sum of F over them
is an affine function of gamma: the trace test (A. Sommese, J. Verschelde, C. Wampler, "Numerical decomposition of the
solution sets of polynomial systems into irreducible components", SIAM J. Numerical Analysis 38, 2001). A real point is
on a curve if it moves to one of its witness points with the plane.

Points are found by Newton's method from random real starts, whose number is reported: a component that no start meets
is not excluded. Nor is a multiple one, as where a dyad stays stretched, to which Newton's method does not converge.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.assembly._kernels.tables import ARRIVED, LOST, SINGULAR, Complex, ParameterPath
from cinegen.assembly.distinct_solutions import DistinctSolutions
from cinegen.assembly.linkage import ACCURACY, Linkage
from cinegen.assembly.linkage_tables import Tracked
from cinegen.assembly.results import SelfMotion

STARTS = 64
"""Random starts of Newton's method, for each set of values."""

_NEAR = 1e-4  # features of solutions that are one mode
_MOST = 32  # points of self-motions that are examined
_WEAK = 1e-6  # part of the largest singular value: a direction that the loops don't constrain
_STEP = 0.05  # rad, characteristic lengths
_MOVES = 1e-6  # features move along a direction
_TRIES = 4
_LOOPS = 12  # closed paths of planes
_PLANES = (0.7 + 0.4j, -0.5 + 0.8j)  # changes of gamma
_AFFINE = 1e-7  # deviation of the sum of features from an affine function, relative to their sizes


class _Point(NamedTuple):
    """A general solution (k + 1,) on a component of a dimension: the loops' rank, and moving joints."""

    solution: Complex
    dimension: int
    rank: int
    moving: tuple[str, ...]

    @property
    def is_curve(self) -> bool:
        """True if it is on a curve."""
        return self.dimension == 1


class SelfMotions:
    """Finds the self-motions of a linkage for given real values of its locked joints.

    Args:
        linkage: to examine.
        locked: (locked,) values.
    """

    def __init__(self, linkage: Linkage, locked: Array) -> None:
        self._linkage, self._locked, self._rng = linkage, locked, np.random.default_rng(2)

    def random_solutions(self) -> tuple[Complex, Complex]:
        """Return the real solutions (count, k + 1) that Newton's method reaches from random starts: regular ones, and
        singular ones."""
        solutions, ends = self._linkage.newton(self._linkage.random_unknowns(self._rng, STARTS, 0.0), self._locked)
        return solutions[ends == ARRIVED], solutions[ends == SINGULAR]

    def new(self, solutions: Complex, known: Sequence[Complex]) -> list[tuple[Array, Complex]]:
        """Return the modes q (nq,) and their features (3 f,) among real solutions (count, k + 1), without those whose
        features are known."""
        linkage, known, fresh = self._linkage, list(known), list[tuple[Array, Complex]]()
        for solution, features in zip(solutions, linkage.features(solutions, self._locked), strict=True):
            if min((np.abs(each - features).max(initial=0.0) for each in known), default=np.inf) < _NEAR:
                continue
            q = linkage.closed(linkage.configuration(solution, self._locked))
            if q is not None:
                known.append(features)
                fresh.append((q, features))
        return fresh

    def dimension(self, solution: Complex) -> int:
        """Return the number of DoF of the self-motion that a solution (k + 1,) lies on: 0 if it is isolated."""
        point = self._point(solution)
        return 0 if point is None else point.dimension

    def through(self, solutions: Sequence[Complex]) -> tuple[SelfMotion, ...]:
        """Return the self-motions that real solutions (k + 1,) lie on: each curve, and of those of more DoF the largest
        on which the same joints move."""
        points = [point for solution in solutions[:_MOST] if (point := self._point(solution)) is not None]
        motions = list[SelfMotion]()
        for rank in sorted({point.rank for point in points if point.is_curve}, reverse=True):
            motions += self._curves([point for point in points if point.is_curve and point.rank == rank])
        others = dict[tuple[str, ...], _Point]()
        for point in sorted((p for p in points if not p.is_curve), key=lambda point: point.dimension):
            others[point.moving] = point
        for point in others.values():
            motions += self._made([point], None)
        return tuple(motions)

    # --- one point ----------------------------------------------------------------------------------------------------

    def _point(self, solution: Complex) -> _Point | None:
        """Return a general point of the component that a real solution (k + 1,) lies on; None if it is isolated.

        The rank r of the loops' Jacobian is largest, on a component, at its general points. There its null space has
        the dimension of the component, and Newton's method stays on it after a step in any direction of the null space.

        - Steps stay, all of them or those that are short enough, and none leads to a larger rank: the point is general.
        - A step leads to a larger rank: the point is special, as where components meet; go on from there.
        """
        for _ in range(_TRIES):
            rank, tangents = self._tangents(solution)
            dimension = tangents.shape[1]
            if not dimension:
                return None
            steps = (tangents @ self._rng.normal(size=(dimension, dimension + 1))).T
            moved = [point for step in steps if (point := self._moved(solution, step, rank)) is not None]
            if len(moved) < len(steps) or max(self._tangents(point)[0] for point in moved) > rank:
                general_rank = self._linkage.tables.rank - 1
                steps = np.vstack([tangents.T, -tangents.T, (tangents @ self._rng.normal(size=(dimension, _TRIES))).T])
                moved += [point for step in steps if (point := self._moved(solution, step, general_rank)) is not None]
            if not moved:
                return None
            most_general = max(moved, key=lambda point: self._tangents(point)[0])
            if self._tangents(most_general)[0] == rank:
                return _Point(solution, dimension, rank, self._moving(tangents.T))
            solution = most_general
        return None

    def _moving(self, motions: Array) -> tuple[str, ...]:
        """Return the names of the joints that move in motions (count, k)."""
        sizes = np.abs(motions).max(axis=0)
        return tuple(n for n, s in zip(self._linkage.passive, sizes, strict=True) if s > _MOVES * sizes.max())

    def _tangents(self, solution: Complex) -> tuple[int, Array]:
        """Return the loops' rank at a real solution (k + 1,), and directions (k, dimension) that move features.

        These are the directions in the null space Z of the loops' Jacobian that change the features F to first order:
        the right singular vectors of (dF/dx) Z. Derivatives are complex steps, Im F(x + i h z) / h, which have no
        cancellation (J. N. Lyness and C. B. Moler, "Numerical differentiation of analytic functions", 1967).
        """
        linkage = self._linkage
        _, sigma, vh = np.linalg.svd(linkage.jacobian(solution, self._locked).real)
        rank = int((sigma > _WEAK * sigma[0]).sum())
        free = vh[rank:]
        ahead = np.array([solution] * len(free), dtype=complex).reshape(len(free), len(solution))
        ahead[:, :-1] += 1e-30j * free
        rates = linkage.features(ahead, self._locked).imag / 1e-30
        u, values, _ = np.linalg.svd(rates, full_matrices=False)
        return rank, free.T @ u[:, values > _MOVES]

    def _moved(self, solution: Complex, direction: Array, rank: int) -> Complex | None:
        """Return the solution that Newton's method reaches from a step along a direction; None if it goes back."""
        linkage, ahead = self._linkage, solution.copy()
        ahead[:-1] += _STEP * direction / np.abs(direction).max()
        reached, ends = linkage.newton(ahead[None], self._locked, rank)
        start, meant, moved = linkage.features(np.array([solution, ahead, reached[0]]), self._locked)
        far = float(np.abs(meant - start).max(initial=0.0))
        went = float(np.abs(moved - start).max(initial=0.0))
        return reached[0] if ends[0] != LOST and 0.5 * far < went < 2.0 * far else None

    # --- result -------------------------------------------------------------------------------------------------------

    def _curves(self, points: list[_Point]) -> list[SelfMotion]:
        """Return the curves that points lie on, all of one rank of the loops."""
        solutions = np.array([point.solution for point in points])
        witnesses = _WitnessPoints(self._linkage, self._locked, self._rng, points[0].rank, solutions)
        on = [witnesses.add(solution) for solution in solutions]
        motions = list[SelfMotion]()
        for members, is_whole in witnesses.curves():
            on_curve = [point for point, index in zip(points, on, strict=True) if index in members]
            motions += self._made(on_curve, len(members) if is_whole else None)
        return motions or self._made(points, None)

    def _made(self, points: list[_Point], degree: int | None) -> list[SelfMotion]:
        """Return the self-motion of these points, at the first of them that closes; none if none does."""
        for point in points:
            q = self._linkage.closed(self._linkage.configuration(point.solution, self._locked))
            if q is not None:
                moving = sorted({name for p in points for name in p.moving}, key=self._linkage.passive.index)
                return [SelfMotion(point.dimension, degree, q, tuple(moving))]
        return []


class _WitnessPoints:
    """The points of curves of solutions on a general plane, for values (locked,) of the locked joints.

    Args:
        linkage: whose solutions they are.
        locked: (locked,) values.
        rng: draws planes.
        rank: of the loops on the curves.
        known: (count, k + 1) solutions on the curves, near which planes are drawn.
    """

    def __init__(self, linkage: Linkage, locked: Array, rng: np.random.Generator, rank: int, known: Complex) -> None:
        self._linkage, self._locked, self._rng, self._rank = linkage, locked, rng, rank
        self._known = self._features(known)
        self._first = self._plane()
        self._points = DistinctSolutions(self._features)

    def add(self, solution: Complex) -> int:
        """Move the plane from a solution (k + 1,) of a curve to where it belongs; return which point comes there, -1 if
        the path is lost."""
        plane = self._first.copy()
        plane[-1] = plane[:-2] @ self._features(solution[None])[0]
        tracked = self._track(solution[None], plane, self._first)
        return self._points.indices(tracked.arrived)[0] if len(tracked.arrived) else -1

    def curves(self) -> list[tuple[list[int], bool]]:
        """Return for each curve which points are on it, and whether none is missing, so that it is irreducible."""
        joined, components = dict[int, int](), list[tuple[list[int], bool]]()

        def curve(k: int) -> int:
            while joined.get(k, k) != k:
                k = joined[k]
            return k

        for _ in range(_LOOPS if len(self._points) else 0):
            for begun, end in self._follow_loop():
                joined[curve(begun)] = curve(end)
            points, sets = self._points.array, dict[int, list[int]]()
            for k in range(len(points)):
                sets.setdefault(curve(k), []).append(k)
            components = [(members, self._is_whole(points[members])) for members in sets.values()]
            if all(is_whole for _, is_whole in components):
                break
        return components

    def _follow_loop(self) -> list[tuple[int, int]]:
        """Move all points with the plane along a closed path; return which points come where."""
        solutions, begun = self._points.array, np.arange(len(self._points))
        for before, after in pairwise([self._first, self._plane(), self._plane(), self._first]):
            tracked = self._track(solutions, before, after)
            solutions, begun = tracked.arrived, begun[tracked.ends == ARRIVED]
        return [(k, end) for k, end in zip(begun.tolist(), self._points.indices(solutions), strict=True) if end >= 0]

    def _features(self, solutions: Complex) -> Complex:
        return self._linkage.features(solutions, self._locked)

    def _plane(self) -> Complex:
        """Return general alpha and gamma, with beta = 0 (3 f + 2,).

        The plane passes a curve at a distance of about its extent, that of two of its points. To a plane far away all
        branch points are one, about which closed paths permute nothing.
        """
        count = len(self._linkage.zero_slice)
        cut = np.asarray(self._rng.normal(size=count) + 1j * self._rng.normal(size=count))
        first, second = cut[:-2] @ self._known[self._rng.integers(len(self._known), size=2)].T
        cut[-2:] = 0.0, first + cut[-1] * (abs(second - first) or 1.0)
        return cut

    def _track(self, solutions: Complex, before: Complex, after: Complex) -> Tracked:
        lines = self._linkage.fixed(self._locked).lines
        return self._linkage.track(
            solutions, ParameterPath(lines, np.array([before, after]), False, ACCURACY), self._rank
        )

    def _is_whole(self, points: Complex) -> bool:
        """Return whether the sum of features over points is an affine function of gamma."""
        features = [self._features(points)]
        for step in _PLANES:
            moved = self._first.copy()
            moved[-1] += step
            tracked = self._track(points, self._first, moved).arrived
            if len(tracked) < len(points):
                return False
            features.append(self._features(tracked))
        first, second, third = (part.sum(axis=0) for part in features)
        off = (second - first) / _PLANES[0] - (third - first) / _PLANES[1]
        return float(np.abs(off).max()) < _AFFINE * max(float(np.abs(part).sum(axis=0).max()) for part in features)
