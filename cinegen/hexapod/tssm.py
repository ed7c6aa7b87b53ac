"""`TSSM`: all assembly modes of a platform with three points on six legs ("6-3"), by Merlet's elimination."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import boolean, complex128, float64, int64, typeof

from cinegen.arrays import Array, ArrayLike, Bools, Complex, Integers
from cinegen.hexapod._kernels import roots as kernel
from cinegen.hexapod._kernels.placements import write_placements
from cinegen.hexapod.elimination import SOLUTIONS, eigen_directions
from cinegen.hexapod.legs import HexapodError, checked_lengths, checked_points, leg_lengths, nearest, refine
from cinegen.hexapod.platform_modes import NearestPlacement, PlatformModes, SolutionCounts
from cinegen.hexapod.tssm_geometry import PlatformCircles, check_geometry, checked_legs, dot, normal_part, points_of
from cinegen.jit.compiled import prepare, together

_FLAT = 1e-12  # of the base's size: height of points that are in one plane
_MEETS = 1e-14  # of the squared length: a squared radius above minus this is one that rounding made negative
_LEAST = 1e-15  # ... and is increased to this, which lengthens legs that lie in a line by less than rounding
_NEARLY_REAL = 1e-2  # | |w|^2 - 1 | of a root that rounding of the lengths may have made complex
_EXACT = 2e-14  # of the longest leg: length error below which a placement is not refined
_OFF = 1e-12  # of the longest leg: length error above which a placement is none
_AGAIN = ((_OFF, 1e-4), (_OFF, 0.0), (_OFF, 1e-4), (_OFF, 0.0), (_OFF, 1e-4))  # errors that are refined, and cutoffs
_LEVEL = 1e-9  # of the longest leg: coordinates closer than this are equal where placements are sorted
_COINCIDENT = 1e-5  # of the longest leg: modes this close are reported as coincident
_NEAR = 1e-6  # of the manipulator's size: a point on an axis
_DESCENTS, _STARTS = 4, 24  # to find the nearest placement
_FIRST, _SECOND = [0, 0, 1], [1, 2, 2]  # circles of the three distances K, L, M

TANGENTS = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 2.0], [1.0, -1.0, 0.0]])
"""(3, 3) coefficients of 1, t, t^2 from those of 1, cos p, sin p, times 1 + t^2, with t = tan(p / 2)."""


class _Solved(NamedTuple):
    """Placements (n, 4, 4) of m sets of lengths, their sets (n,) and multiplicities (n,); counts (m, 4) of real,
    complex, infinite and lost solutions; outcomes (m,)."""

    placements: Array
    of: Integers
    times: Integers
    counts: Integers
    outcomes: Integers
    circles: PlatformCircles


class TSSM:
    """A platform with three points, to each of which lead two of six legs from the base: every "6-3" manipulator.

    It is named after the Triangular Symmetric Simplified Manipulator of J-P. Merlet, "Symbolic computation for the
    determination of the minimal direct kinematics polynomial and the singular configurations of parallel manipulators",
    whose base points lie symmetrically in one plane; here they may lie anywhere. If they lie in one plane, modes are
    pairs of mirror images. At most 16 modes exist.

    Attributes:
        base: (6, 3) points in the base frame.
        platform: (3, 3) points in the platform frame.
        legs: (6,) which platform point each leg leads to.
        up: (3,) unit vector normal to the base's plane, or mean plane; its largest component is positive.
        plane: whether the base points lie in one plane.
        sides: (3,) of the platform: distances of its points 0 and 1, 0 and 2, 1 and 2.
    """

    base: Array
    platform: Array
    legs: Integers
    up: Array
    plane: bool
    sides: Array

    def __init__(self, base: ArrayLike, platform: ArrayLike, legs: ArrayLike = (0, 0, 1, 1, 2, 2)) -> None:
        """Check the geometry, and compile what is not compiled yet.

        Args:
            base: (6, 3) where legs begin, in one plane or not, in any unit of length.
            platform: (3, 3) where they meet in pairs, in the same unit.
            legs: (6,) which platform point (0, 1, 2) each leads to.

        Raises:
            HexapodError: wrong shape, not finite, or degenerate; names the points.
        """
        self.base, self.platform = checked_points("base", base, 6), checked_points("platform", platform, 3)
        self.legs = checked_legs(legs)
        check_geometry(self.base, self.platform, self.legs)
        sigma, normals = np.linalg.svd(self.base - self.base.mean(axis=0))[1:]
        self.plane = bool(sigma[2] <= _FLAT * sigma[0])
        self.up = normals[2] * (1.0 if normals[2][np.argmax(np.abs(normals[2]))] > 0.0 else -1.0)
        a, b, c = self.platform
        self.sides = np.linalg.norm([b - a, c - a, c - b], axis=1)
        self._pairs = np.argsort(self.legs, kind="stable").reshape(3, 2)
        along = self.base[self._pairs[:, 1]] - self.base[self._pairs[:, 0]]
        self._apart = np.linalg.norm(along, axis=1)
        self._u = along / self._apart[:, None]
        self._f = np.array([self.up if self.plane else normal_part(self.up, u) for u in self._u])
        x, side = (b - a) / self.sides[0], c - a
        y = np.cross(np.cross(x, side), x)
        y /= np.linalg.norm(y)
        frame = np.array([x, y, np.cross(x, y)])
        self._arrays = (
            self.base.copy(),
            self.platform.copy(),
            self.legs.copy(),
            frame,
        )  # which kernels take as writeable
        vectors, point = np.empty((1, 3, 3)), np.empty((1, 3), dtype=np.int64)
        circles = typeof(PlatformCircles(vectors, vectors, vectors, vectors[0], point))
        rows, blocks, table = float64[:, ::1], float64[:, :, ::1], int64[:, ::1]
        numbers, complex_rows = int64[::1], complex128[:, ::1]
        with together():
            asked = float64[:, :, :, ::1], complex_rows, rows, boolean
            prepare(kernel.find_roots, *asked, complex128[:, :, ::1], table, table, complex_rows, complex_rows)
            arguments = complex_rows, numbers, circles, rows, rows, rows, numbers, rows
            prepare(write_placements, *arguments, blocks, blocks, float64[::1])

    def modes(self, lengths: ArrayLike) -> PlatformModes:
        """Return all placements at which the legs have these lengths.

        They are sorted, the highest first: by the height of the middle of the platform points along `up`, then (where
        that is equal, to 1e-9 of the longest leg) by x, y, z of platform point 0, of 1, of 2, the largest first. Modes
        more than 3e-7 of the longest leg apart are listed each, closer ones as one; `coincident` counts solutions
        within 1e-5.

        Args:
            lengths: (6,) of the legs, in the unit of the points.

        Raises:
            HexapodError: wrong shape, not finite or not positive.
        """
        asked = checked_lengths(lengths)
        solved = self._solve(asked[None])
        placements, (real, complex_, infinite, lost) = solved.placements, solved.counts[0].tolist()
        points = points_of(self.platform, placements)
        gaps = np.abs(points[:, None] - points[None]).max(axis=(2, 3), initial=0.0)
        coincident = np.asarray((gaps <= _COINCIDENT * float(asked.max())) @ solved.times, dtype=np.int64)
        moves = solved.outcomes[0] == kernel.SOLVED and self._may_move(solved.circles)
        complete = lost == 0 and not moves
        method = self._method(asked, solved)
        if moves:
            method += "; platform points are on others' axes, so that a curve of configurations is not excluded"
        counts = SolutionCounts(real, complex_, infinite, int(solved.times[coincident > 1].sum()), lost)
        closest = self._closest(asked) if complete and not len(placements) else None
        return PlatformModes(placements, coincident, counts, complete, method, closest)

    def batch(self, lengths: ArrayLike) -> tuple[Array, Integers]:
        """Return all placements for many sets of lengths.

        Args:
            lengths: (m, 6), in the unit of the points.

        Returns:
            placements (m, 16, 4, 4), those of each set first, in the order of `modes`, then NaN; and their numbers
            (m,), -1 where a solution was lost and only `modes` has a message.

        Raises:
            HexapodError: wrong shape, not finite or not positive.
        """
        asked = checked_lengths(lengths, 2)
        solved = self._solve(asked)
        placements = np.full((len(asked), SOLUTIONS, 4, 4), np.nan)
        numbers = np.bincount(solved.of, minlength=len(asked))
        starts = np.concatenate([[0], np.cumsum(numbers)])
        placements[solved.of, np.arange(len(solved.of)) - starts[solved.of]] = solved.placements
        return placements, np.where(solved.counts[:, 3] > 0, -1, numbers)

    def lengths(self, placements: ArrayLike) -> Array:
        """Return the leg lengths (..., 6) at placements (..., 4, 4): inverse kinematics."""
        return leg_lengths(self.base, self.platform[self.legs], np.asarray(placements, dtype=float))

    def circles(self, lengths: ArrayLike) -> tuple[PlatformCircles, Array]:
        """Return the circles of the platform points, and the equations of their distances.

        Args:
            lengths: (m, 6) of the legs, in the unit of the points.

        Returns:
            the circles; and (m, 3, 3, 3) the coefficients of equations 20, 21, 22 (K, L, M) in 1, cos p, sin p (rows)
            and 1, cos q, sin q (columns), where p and q are p12 and p34, p12 and p56, p34 and p56: angles on the first,
            second and third circle. The largest coefficient of each equation is 1.

        Raises:
            HexapodError: wrong shape, not finite or not positive; two legs can't meet.
        """
        asked = checked_lengths(lengths, 2)
        circles, meets = self._circles(asked)
        if not meets.all():
            raise HexapodError(self._gap(asked[np.argmin(meets)]))
        return circles, self._equations(circles)

    def complex_solutions(self, lengths: ArrayLike) -> Complex:
        """Return exp(i p) (n, 3) for p12, p34, p56 of every distinct finite solution for lengths (6,), real or complex;
        with base points in one plane one of each pair of mirror images.

        Raises:
            HexapodError: as `modes`.
        """
        _, _, roots, _, counts = self._roots(checked_lengths(lengths)[None])
        return roots[0, : counts[0, kernel.KNOWN]]

    # --- from lengths to placements -----------------------------------------------------------------------------------

    def _circles(self, lengths: Array) -> tuple[PlatformCircles, Bools]:
        """Return the circles, and whether the legs of each pair meet, (m,): equations 1-9.

        The largest circle comes first: equations 20-26 hold whichever point is called 12, 34 or 56, but where a small
        circle is eliminated in favour of a large one, whose angle then hardly varies, all digits may be lost.
        """
        first, second = lengths[:, self._pairs[:, 0]], lengths[:, self._pairs[:, 1]]
        along = 0.5 * (self._apart + (first - second) * (first + second) / self._apart)
        square, longest = (first - along) * (first + along), np.maximum(first, second) ** 2
        radius = np.sqrt(np.maximum(square, _LEAST * longest))
        point = np.argsort(-radius, axis=1, kind="stable")
        centre = self.base[self._pairs[:, 0]] + along[..., None] * self._u
        centre = np.take_along_axis(centre, point[..., None], axis=1)
        radius, f = np.take_along_axis(radius, point, axis=1), self._f[point]
        circles = PlatformCircles(centre, np.cross(self._u[point], f), f, radius, point)
        return circles, (square >= -_MEETS * longest).all(axis=1)

    def _equations(self, circles: PlatformCircles) -> Array:
        """Return the distances' coefficients (m, 3, 3, 3): |B_i - B_j|^2 = side^2 written out."""
        (c, e, f, r, point), i, j = circles, _FIRST, _SECOND
        d, ri, rj = c[:, i] - c[:, j], 2.0 * r[:, i], 2.0 * r[:, j]
        side = self.sides[point[:, i] + point[:, j] - 1]
        constant = 0.25 * (ri * ri + rj * rj) - side * side + dot(d, d)
        rows = [[constant, *(-rj * dot(d, x[:, j]) for x in (e, f))]]
        rows += [[ri * dot(d, x[:, i]), *(-0.5 * ri * rj * dot(x[:, i], y[:, j]) for y in (e, f))] for x in (e, f)]
        equations = np.moveaxis(np.array(rows), (0, 1), (2, 3))
        return np.asarray(equations / np.abs(equations).max(axis=(2, 3), keepdims=True), order="C")

    def _roots(self, lengths: Array) -> tuple[PlatformCircles, Bools, Complex, Integers, Integers]:
        """Return the circles; whether legs meet (m,); the distinct roots (m, 17, 3), with base points in one plane one
        of each pair of mirror images, their multiplicities (m, 17) and counts (m, kernel.COUNTS_WIDTH)."""
        circles, meets = self._circles(lengths)
        shape, scratch = (len(lengths), SOLUTIONS + 1), [np.empty((rows, 3), dtype=complex) for rows in (5, 6)]
        equations, extents = self._equations(circles), circles.radius / lengths.max(axis=1)[:, None]
        roots, times = np.empty((*shape, 3), dtype=complex), np.empty(shape, dtype=np.int64)
        counts = np.zeros((len(lengths), kernel.COUNTS_WIDTH), dtype=np.int64)
        directions, vanishes = eigen_directions(TANGENTS @ equations @ TANGENTS.T, self.plane)
        counts[np.isnan(directions).all(axis=1), kernel.OUTCOME] = kernel.DIVERGED
        counts[vanishes, kernel.OUTCOME] = kernel.CURVE
        kernel.find_roots(equations, directions, extents, self.plane, roots, times, counts, *scratch)
        counts[~meets] = 0
        return circles, meets, roots, times, counts

    def _solve(self, lengths: Array) -> _Solved:
        """Return all placements for lengths (m, 6), with an account of all solutions."""
        circles, meets, roots, times, counts = self._roots(lengths)
        m, longest, each = len(lengths), lengths.max(axis=1), 2 if self.plane else 1
        of, which = np.nonzero(np.arange(SOLUTIONS + 1) < counts[:, kernel.KNOWN, None])
        w, times = roots[of, which], times[of, which]
        off = np.abs(w.real**2 + w.imag**2 - 1.0).max(axis=1, initial=0.0)
        maybe = off < _NEARLY_REAL
        complex_ = np.where(meets, np.bincount(of[~maybe], each * times[~maybe], m), SOLUTIONS)
        of, w, times, sure = of[maybe], w[maybe], times[maybe], off[maybe] < 2.0 * kernel.ON_CIRCLE
        w = np.where(sure[:, None], w, w / np.abs(w))
        symmetric = (2.0 * circles.radius[of] * np.abs(w.imag)).max(axis=1, initial=0.0) <= kernel.SAME * longest[of]
        times = np.where(symmetric, each, 1) * times
        mirrored = ~symmetric & self.plane
        of, times, sure = (np.concatenate([part, part[mirrored]]) for part in (of, times, sure))
        w = np.concatenate([w, w[mirrored].conj()])
        points, placements, error = np.empty((len(of), 3, 3)), np.empty((len(of), 4, 4)), np.empty(len(of))
        write_placements(w, of, circles, lengths, *self._arrays, points, placements, error)
        self._refine(placements, error, lengths[of], longest[of])
        good = error <= _OFF
        if not sure.all():
            complex_ = complex_ + np.bincount(of[~good & ~sure], times[~good & ~sure], m)
            good, times = self._merged(good, sure, placements, of, times, longest)
        lost = np.where(counts[:, kernel.OUTCOME] == kernel.SOLVED, each * counts[:, kernel.LOST], SOLUTIONS)
        lost = lost + np.bincount(of[~good & sure], times[~good & sure], m)
        account = np.bincount(of[good], times[good], m), complex_, each * counts[:, kernel.INFINITE], lost
        order = np.flatnonzero(good)[self._order(points[good], of[good], longest)]
        ordered = placements[order], of[order], times[order], np.stack(account, axis=1).astype(np.int64)
        return _Solved(*ordered, counts[:, kernel.OUTCOME], circles)

    def _merged(
        self, good: Bools, sure: Bools, placements: Array, of: Integers, times: Integers,
        longest: Array,
    ) -> tuple[Bools, Integers]:  # fmt: skip
        """Return which placements are kept, and how many solutions each stands for, if those that are not surely real
        but have the lengths asked for are one with others next to them."""
        good, times, points = good.copy(), times.copy(), points_of(self.platform, placements)
        for k in np.flatnonzero(good & ~sure):
            others = np.flatnonzero(good & (of == of[k]) & (sure | (np.arange(len(good)) < k)))
            apart = np.abs(points[others] - points[k]).max(axis=(1, 2), initial=0.0)
            if len(others) and apart.min() <= _COINCIDENT * longest[of[k]]:
                times[others[apart.argmin()]] += times[k]
                good[k] = False
        return good, times

    def _refine(self, placements: Array, error: Array, lengths: Array, longest: Array) -> None:
        """Refine placements whose length errors are above rounding, in place. Where modes coincide Newton's method
        converges slowly: it is applied again, also along those directions alone that the legs constrain."""
        for limit, cutoff in ((_EXACT, 0.0), *_AGAIN):
            rough = np.flatnonzero(error > limit)
            if not len(rough):
                break
            legs = self.base, self.platform[self.legs], lengths[rough]
            refined = refine(*legs, placements[rough], np.full(len(rough), cutoff))[0]
            off = np.abs(self.lengths(refined) - legs[2]).max(axis=1) / longest[rough]
            better = off < error[rough]
            placements[rough[better]], error[rough[better]] = refined[better], off[better]

    def _order(self, points: Array, of: Integers, longest: Array) -> Integers:
        """Return the order of placements by set, then as `modes` has them."""
        cell = -_LEVEL * longest[of]
        height = np.round((points @ self.up).sum(axis=1) / (3.0 * cell))
        key = of * (1.0 + 2.0 * np.abs(height).max(initial=0.0)) + height
        order = np.argsort(key, kind="stable")
        if not (np.diff(key[order]) == 0.0).any():
            return order
        rest = np.round(points.reshape(-1, 9) / cell[:, None])
        return np.lexsort((*rest.T[::-1], key))

    # --- remarks ------------------------------------------------------------------------------------------------------

    def _may_move(self, circles: PlatformCircles) -> bool:
        """Return whether the platform may move along a curve on which the eliminated angle is constant.

        A curve along which that angle varies makes the determinant vanish identically, which the elimination notices.
        The other kind needs a distance that holds for every value of an angle, that is, a platform point on the axis of
        another one's circle. There are two cases: one point is on the axes of both others, which then move on their
        circles at their distance; or two points are on the axis of the third, about which the platform rotates.
        """
        centre, e, f, radius, point = (part[0] for part in circles)
        axis = np.cross(e, f)
        reach = np.ptp(centre, axis=0).max()
        tolerance = _NEAR * float(max(reach, radius.max(), self.sides.max()))
        # where the axis of circle k meets the sphere about the centre of circle i through it: on circle i?
        away = centre[None] - centre[:, None]
        middle = -dot(away, axis)
        half = np.sqrt(np.maximum(middle**2 - dot(away, away) + radius[:, None] ** 2, 0.0))
        meeting = centre[None] + (middle + np.array([half, -half]))[..., None] * axis
        off = meeting - centre[:, None]
        miss = np.maximum(np.abs(np.linalg.norm(off, axis=-1) - radius[:, None]), np.abs(dot(off, axis[:, None])))
        on = (miss <= tolerance) & ~np.eye(3, dtype=bool)
        for i, j, k in ((0, 1, 2), (1, 0, 2), (2, 0, 1)):
            first, second = meeting[on[:, i, j], i, j], meeting[on[:, i, k], i, k]
            if (np.linalg.norm(first[:, None] - second, axis=-1) <= tolerance).any():
                return True
            first, second = meeting[on[:, j, i], j, i], meeting[on[:, k, i], k, i]
            side = self.sides[point[j] + point[k] - 1]
            if (np.abs(np.linalg.norm(first[:, None] - second, axis=-1) - side) <= tolerance).any():
                return True
        return False

    def _method(self, asked: Array, solved: _Solved) -> str:
        real, complex_, infinite, lost = solved.counts[0].tolist()
        if not real + infinite + lost and (gap := self._gap(asked)):
            return gap
        if solved.outcomes[0] == kernel.CURVE:
            return "the determinant vanishes identically: legs of these lengths leave the platform a curve, or nothing"
        if solved.outcomes[0] == kernel.DIVERGED:
            return "the eigenvalues did not converge"
        counted = f"{real} real, {complex_} complex, {infinite} at infinity"
        text = f"elimination to a polynomial of degree 16, as an eigenvalue problem: {counted}"
        return text if lost == 0 else f"{text}; {lost} could not be followed, near a multiple root"

    def _gap(self, asked: Array) -> str:
        """Return a message if the legs of a pair can't meet."""
        for (first, second), apart in zip(self._pairs.tolist(), self._apart.tolist(), strict=True):
            a, b = float(asked[first]), float(asked[second])
            legs = f"legs {first + 1} and {second + 1} ({a:g} and {b:g}) can't meet, as their base points are {apart:g}"
            if a + b < apart:
                return f"{legs} apart, {apart - a - b:.3g} too far"
            if abs(a - b) > apart:
                return f"{legs} apart, {abs(a - b) - apart:.3g} too near"
        return ""

    def _closest(self, asked: Array) -> NearestPlacement:
        middle = self.base.mean(axis=0)
        unit = float(max(asked.max(), np.abs(self.base - middle).max()))
        starts = np.tile(np.eye(4), (_STARTS, 1, 1))
        rotations = np.linalg.qr(np.random.default_rng(0).normal(size=(_STARTS, 3, 3)))[0]
        starts[:, :3, :3] = rotations * np.linalg.det(rotations)[:, None, None]
        middles = middle + float(asked.mean()) * self.up * np.linspace(-1.0, 1.0, _STARTS)[:, None]
        starts[:, :3, 3] = (middles - starts[:, :3, :3] @ self.platform.mean(axis=0)) / unit
        for _ in range(_DESCENTS):  # if placements end in a plane, descent is slow at last
            placement = nearest(self.base / unit, self.platform[self.legs] / unit, asked / unit, starts)
            starts = placement[None]
        placement[:3, 3] *= unit
        return NearestPlacement(placement, self.lengths(placement) - asked)
