"""`TSSM`: all assembly modes of a manipulator of six legs whose platform is a triangle, from one eigenproblem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import typeof
from numpy.typing import ArrayLike, NDArray

from cinegen.assembly.hexapod import Approach
from cinegen.assembly.hexapod.legs import nearest
from cinegen.assembly.triangle import resultant
from cinegen.assembly.triangle._kernels import circles as c
from cinegen.assembly.triangle._kernels import modes as k
from cinegen.assembly.triangle.curves import may_move
from cinegen.errors import CinegenError
from cinegen.jit.compiled import prepare, together

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Counts = NDArray[np.int64]

_FLAT = 1e-12  # of the base's size: height of points that are in one plane
_THIN = 1e-9  # of their size: points that lie in a line, or are one
_TOGETHER = 1e-5  # of the longest leg: modes so near each other are said to coincide
_DESCENTS = 4
_STARTS = 24  # poses from which the nearest approach is looked for


class TSSMError(CinegenError):
    """A manipulator or leg lengths that have no assembly modes to be found; says why."""


@dataclass(frozen=True, eq=False)
class Modes:
    """All placements of the platform in the base's frame, for six lengths; 16 complex solutions are accounted for.

    Attributes:
        placements: (n, 4, 4) the highest first: by the height of the middle of the platform points along `TSSM.up`,
            then (where that is equal, to 1e-9 of the longest leg) by x, y, z of platform point 0, of 1, of 2, the
            largest first.
        coincident: (n,) how many solutions meet in each, within 1e-5 of the longest leg: 1 where it is alone. Modes
            that are farther apart than 3e-7 are listed each, nearer ones (which rounding can't tell apart) as one.
        real: solutions that are placements, each as often as it is a root.
        complex: solutions that are not real.
        infinite: solutions at infinity.
        multiple: how many of the real ones are in modes that are not alone.
        lost: of the 16, those of which nothing is known.
        complete: whether these are all modes: nothing was lost, and no curve of configurations is possible.
        method: how they were found, or what hinders, in words.
        angles: (16 or fewer, 3) complex: p12, p34, p56 of every distinct finite solution, of two that are mirror
            images one, the real ones among them.
        closest: what comes nearest, where there is no mode at all.
    """

    placements: Array
    coincident: Counts
    real: int
    complex: int
    infinite: int
    multiple: int
    lost: int
    complete: bool
    method: str
    angles: Complex
    closest: Approach | None = None

    @property
    def total(self) -> int:
        """How many complex solutions are accounted for: 16."""
        return self.real + self.complex + self.infinite + self.lost


class TSSM:
    """A platform with three points, to each of which lead two of six legs from the base: every "6-3" manipulator.

    It is named after Merlet's Triangular Symmetric Simplified Manipulator, whose base points lie in one plane,
    symmetrically; here they may lie anywhere. Where they lie in one plane, modes are pairs of mirror images.

    Attributes:
        base: (6, 3) points in the base's frame.
        platform: (3, 3) points in the platform's frame.
        legs: (6,) which platform point each leg leads to.
        up: (3,) unit vector across the base's plane, or mean plane; its largest component is positive.
        plane: whether the base points lie in one plane.
        sides: (3,) of the platform: distances of its points 0 and 1, 0 and 2, 1 and 2.
    """

    base: Array
    platform: Array
    legs: Counts
    up: Array
    plane: bool
    sides: Array

    def __init__(self, base: ArrayLike, platform: ArrayLike, legs: ArrayLike = (0, 0, 1, 1, 2, 2)) -> None:
        """Checks the geometry, and compiles what is not compiled yet.

        Args:
            base: (6, 3) where legs begin, in one plane or not.
            platform: (3, 3) where they meet, two by two.
            legs: (6,) which platform point (0, 1, 2) each leads to.

        Raises:
            TSSMError: of wrong shape, not finite, or degenerate; says which points.
        """
        self.base, self.platform, self.legs = _points("base", base, 6), _points("platform", platform, 3), _legs(legs)
        _check(self.base, self.platform, self.legs)
        middle = self.base.mean(axis=0)
        sigma, across = np.linalg.svd(self.base - middle)[1:]
        self.plane = bool(sigma[2] <= _FLAT * sigma[0])
        self.up = across[2] * (1.0 if across[2][np.argmax(np.abs(across[2]))] > 0.0 else -1.0)
        one, two, three = self.platform
        self.sides = np.linalg.norm([two - one, three - one, three - two], axis=1)
        self._robot = self._write_robot()
        self._eliminate = k.eliminate_in_plane if self.plane else k.eliminate_in_space
        self._prepare()

    def modes(self, lengths: ArrayLike) -> Modes:
        """All placements at which the legs have these lengths.

        Args:
            lengths: (6,) of the legs, in the unit of the points.

        Raises:
            TSSMError: of wrong shape, not finite or not positive.
        """
        asked = _lengths(lengths, (6,))
        room = k.scratch()
        placements, times, counts, circles = self._solve(asked[None], room)
        n, real, complex_, infinite, lost, outcome = counts[0].tolist()
        found, often = placements[0, :n].copy(), times[0, :n]
        coincident = _together(found @ np.vstack([self.platform.T, np.ones(3)]), often, float(asked.max()))
        moves = outcome == k.SOLVED and may_move(circles[0], self.sides)
        complete = lost == 0 and not moves
        method = self._method(asked, counts[0])
        if moves:
            method += "; platform points are on others' axes, so that a curve of configurations is not excluded"
        return Modes(
            found,
            coincident,
            real,
            complex_,
            infinite,
            int(often[coincident > 1].sum()),
            lost,
            complete,
            method,
            _angles(room, circles[0]) if outcome == k.SOLVED else np.empty((0, 3), dtype=complex),
            self._closest(asked) if complete and n == 0 else None,
        )

    def batch(self, lengths: ArrayLike) -> tuple[Array, Counts]:
        """All placements for many sets of lengths.

        Args:
            lengths: (m, 6), in the unit of the points.

        Returns:
            placements (m, 16, 4, 4), those of each set first, in the order of `Modes`, and then not numbers; and how
            many there are (m,), -1 where something was lost and only `modes` says what.

        Raises:
            TSSMError: of wrong shape, not finite or not positive.
        """
        asked = _lengths(lengths, (-1, 6))
        placements, _, counts, _ = self._solve(asked, k.scratch())
        return placements, np.where(counts[:, k.LOSTS] > 0, -1, counts[:, k.PLACEMENTS])

    def polynomial(self, lengths: ArrayLike) -> np.polynomial.Polynomial:
        """The polynomial of degree 16 in x = tan(p34 / 2) whose real roots belong to modes (equation 16).

        For study: modes are not found with it. Where the base points lie in one plane, only even powers of x occur.
        Its coefficients hold the roots badly: in 200 poses of the manipulator of Merlet's table 1, numpy found the real
        roots from them to 1e-13 (median), 1e-11 (one in ten is worse) and 5e-7 (the worst); with base points out of the
        plane, to 3e-12, 2e-8 and 5e-2.

        Args:
            lengths: (6,) of the legs, in the unit of the points.

        Raises:
            TSSMError: of wrong shape, not finite or not positive; two legs can't meet.
        """
        equations = self.circles(lengths)[1]
        return resultant.in_plane(equations) if self.plane else resultant.in_space(equations)

    def circles(self, lengths: ArrayLike) -> tuple[Array, Array]:
        """The circles of the platform points, and the equations of their distances, for study.

        Args:
            lengths: (6,) of the legs, in the unit of the points.

        Returns:
            a circle (3, 11) for each platform point: centre, e, f (see `angles`), radius, which point it is; and
            (3, 9) the factors of 1, cos p, sin p, cos q, sin q, cos p cos q, cos p sin q, sin p cos q, sin p sin q in
            equations 20, 21, 22, where p and q are p12 and p34, p12 and p56, p34 and p56. The largest of each
            equation is 1.

        Raises:
            TSSMError: of wrong shape, not finite or not positive; two legs can't meet.
        """
        asked = _lengths(lengths, (6,))
        circles, equations = np.empty((3, c.CIRCLES_WIDTH)), np.empty((3, c.EQUATION_WIDTH))
        if not c.find_circles(self._robot.geometry, self._robot.pairs, asked, circles):
            raise TSSMError(self._apart(asked))
        c.write_equations(circles, self.sides, equations)
        return circles, equations

    def lengths(self, placements: ArrayLike) -> Array:
        """(..., 6) of the legs, at placements (..., 4, 4): inverse kinematics."""
        there = np.asarray(placements, dtype=float)
        points = self.platform @ np.swapaxes(there[..., :3, :3], -1, -2) + there[..., None, :3, 3]
        return np.asarray(np.linalg.norm(points[..., self.legs, :] - self.base, axis=-1))

    def angles(self, placements: ArrayLike) -> Array:
        """(..., 3) p12, p34, p56 at placements (..., 4, 4), rad.

        Each is that of the platform point about the line through its two base points, from e = u x f towards f; u
        goes from the base point of the leg with the lower number to the other, f is `up` as far as it is normal to u.
        """
        there = np.asarray(placements, dtype=float)
        points = self.platform @ np.swapaxes(there[..., :3, :3], -1, -2) + there[..., None, :3, 3]
        g = self._robot.geometry
        away = points - g[:, c.POINT : c.POINT + 3]
        x = (away * g[:, c.DIRECTION : c.DIRECTION + 3]).sum(axis=-1)
        return np.asarray(np.arctan2((away * g[:, c.ACROSS : c.ACROSS + 3]).sum(axis=-1), x))

    # --- kernels ----------------------------------------------------------------------------------------------------

    def _write_robot(self) -> k.Robot:
        pairs = np.argsort(self.legs, kind="stable")
        geometry = np.zeros((3, c.GEOMETRY_WIDTH))
        for row, (first, second) in zip(geometry, pairs.reshape(3, 2), strict=True):
            along = self.base[second] - self.base[first]
            apart = np.linalg.norm(along)
            u = along / apart
            f = self.up if self.plane else _across(self.up, u)
            row[c.POINT : c.POINT + 3], row[c.AXIS : c.AXIS + 3] = self.base[first], u
            row[c.DIRECTION : c.DIRECTION + 3], row[c.ACROSS : c.ACROSS + 3] = np.cross(u, f), f
            row[c.APART] = apart
        own, plane = _axes(self.platform), np.array([int(self.plane)])
        base, platform = self.base.copy(), self.platform.copy()
        return k.Robot(geometry, pairs, self.sides, base, platform, own, self.legs.copy(), self.up.copy(), plane)

    def _prepare(self) -> None:
        room, lengths, circles = k.scratch(), np.empty((1, 6)), np.empty((1, 3, c.CIRCLES_WIDTH))
        found, counts = np.empty((1, 2, k.MODES)), np.empty((1, k.COUNTS_WIDTH), dtype=np.int64)
        begun = [typeof(item) for item in (self._robot, lengths, room, circles, circles, found)]
        placements, times = np.empty((1, k.MODES, 4, 4)), np.empty((1, k.MODES), dtype=np.int64)
        with together():
            prepare(self._eliminate, *begun, typeof(counts))
            prepare(k.find_placements, *begun, typeof(placements), typeof(times), typeof(counts))

    def _solve(self, lengths: Array, room: k.Scratch) -> tuple[Array, Counts, Counts, Array]:
        """Placements, how many roots each is, counts, circles: for each of the lengths (m, 6)."""
        found = self._pass(self._robot, self._eliminate, lengths, room)
        counts = found[2]
        lost = np.flatnonzero(counts[:, k.LOSTS] > 0)
        if self.plane and len(lost):  # another elimination has other difficulties: that two legs lie in a line, say
            robot = self._robot._replace(plane=np.zeros(1, dtype=np.int64))
            other = self._pass(robot, k.eliminate_in_space, lengths[lost], room)
            for all_of, theirs in zip(found, other, strict=True):
                all_of[lost] = theirs
        return found

    @staticmethod
    def _pass(
        robot: k.Robot, eliminate: Callable[..., None], lengths: Array, room: k.Scratch
    ) -> tuple[Array, Counts, Counts, Array]:
        m = len(lengths)
        circles, equations = np.empty((m, 3, c.CIRCLES_WIDTH)), np.empty((m, 3, c.EQUATION_WIDTH))
        found, counts = np.empty((m, 2, k.MODES)), np.empty((m, k.COUNTS_WIDTH), dtype=np.int64)
        placements, times = np.full((m, k.MODES, 4, 4), np.nan), np.zeros((m, k.MODES), dtype=np.int64)
        eliminate(robot, lengths, room, circles, equations, found, counts)
        k.find_placements(robot, lengths, room, circles, equations, found, placements, times, counts)
        return placements, times, counts, circles

    # --- what they say ----------------------------------------------------------------------------------------------

    def _method(self, asked: Array, counts: Counts) -> str:
        _, real, complex_, infinite, lost, outcome = counts.tolist()
        if outcome == k.APART:
            return self._apart(asked)
        if outcome == k.CURVE:
            return "the determinant is zero everywhere: legs of these lengths leave the platform a curve, or nothing"
        if outcome == k.UNSETTLED:
            return "the eigenvalues did not converge"
        counted = f"{real} real, {complex_} complex, {infinite} at infinity"
        found = f"elimination to a polynomial of degree 16, as an eigenvalue problem: {counted}"
        return found if lost == 0 else f"{found}; {lost} could not be followed, near a multiple root"

    def _apart(self, asked: Array) -> str:
        for first, second in self._robot.pairs.reshape(3, 2).tolist():
            apart = float(np.linalg.norm(self.base[second] - self.base[first]))
            a, b = float(asked[first]), float(asked[second])
            legs = f"legs {first + 1} and {second + 1} ({a:g} and {b:g}) can't meet, as their base points are {apart:g}"
            if a + b < apart:
                return f"{legs} apart, {apart - a - b:.3g} too far"
            if abs(a - b) > apart:
                return f"{legs} apart, {abs(a - b) - apart:.3g} too near"
        raise AssertionError("all pairs meet")

    def _closest(self, asked: Array) -> Approach:
        unit = float(max(asked.max(), np.abs(self.base - self.base.mean(axis=0)).max()))
        rng, far = np.random.default_rng(0), float(asked.mean())
        starts = np.tile(np.eye(4), (_STARTS, 1, 1))
        turns = np.linalg.qr(rng.normal(size=(_STARTS, 3, 3)))[0]
        starts[:, :3, :3] = turns * np.linalg.det(turns)[:, None, None]
        heights = far * self.up * np.linspace(-1.0, 1.0, _STARTS)[:, None]
        middle = self.base.mean(axis=0) + heights
        starts[:, :3, 3] = (middle - starts[:, :3, :3] @ self.platform.mean(axis=0)) / unit
        for _ in range(_DESCENTS):  # where placements end in a plane, the last part of the way is long
            there = nearest(self.base / unit, self.platform[self.legs] / unit, asked / unit, starts)
            starts = there[None]
        there[:3, 3] *= unit
        return Approach(there, self.lengths(there) - asked)


def _angles(room: k.Scratch, circles: Array) -> Complex:
    """(n, 3) p12, p34, p56 of the roots that are left there."""
    found = -1j * np.log(room.roots[: room.known[0]])
    return np.asarray(found[:, np.argsort(circles[:, c.PAIR])])


def _together(points: Array, times: Counts, longest: float) -> Counts:
    """(n,) how many roots, of so many each (n,), are near each mode, whose platform points are (n, 4, 3)."""
    gaps = np.abs(points[:, None] - points[None]).max(axis=(2, 3), initial=0.0)
    return np.asarray((gaps <= _TOGETHER * longest) @ times, dtype=np.int64)


def _axes(points: Array) -> Array:
    """Rows (3, 3): along the side from the first point to the second, across it to the third, normal."""
    x = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    z = np.cross(x, points[2] - points[0])
    z /= np.linalg.norm(z)
    return np.array([x, np.cross(z, x), z])


def _across(up: Array, u: Array) -> Array:
    """A unit vector normal to u, as much along `up` as may be."""
    f = up - (up @ u) * u
    if np.linalg.norm(f) < 1e-3:
        other = np.eye(3)[np.argmin(np.abs(u))]
        f = other - (other @ u) * u
    return np.asarray(f / np.linalg.norm(f))


# --- what is given --------------------------------------------------------------------------------------------------


def _points(name: str, given: ArrayLike, count: int) -> Array:
    points = np.array(given, dtype=float)
    if points.shape != (count, 3):
        raise TSSMError(f"the {name} must be ({count}, 3), a point in each row, not {points.shape}")
    if not np.isfinite(points).all():
        raise TSSMError(f"a point of the {name} is not finite")
    points.setflags(write=False)
    return points


def _legs(given: ArrayLike) -> Counts:
    legs = np.array(given)
    if legs.shape != (6,) or sorted(legs.tolist()) != [0, 0, 1, 1, 2, 2]:
        raise TSSMError(f"legs are {given!r}; give the platform point of each of six, and 0, 1 and 2 twice each")
    legs = legs.astype(np.int64)
    legs.setflags(write=False)
    return legs


def _lengths(given: ArrayLike, shape: tuple[int, ...]) -> Array:
    lengths = np.array(given, dtype=float, order="C")
    if lengths.ndim != len(shape) or lengths.shape[-1] != 6:
        wanted = "(6,)" if len(shape) == 1 else "(m, 6)"
        raise TSSMError(f"lengths are {lengths.shape}, and must be {wanted}: one for each leg")
    wrong = np.argwhere(~(np.isfinite(lengths) & (lengths > 0.0)))
    if len(wrong):
        at = tuple(wrong[0])
        row = f" in row {at[0]}" if len(at) == 2 else ""
        raise TSSMError(f"the length of leg {at[-1] + 1}{row} is {lengths[at]:g}, which is no positive number")
    return lengths


def _check(base: Array, platform: Array, legs: Counts) -> None:
    size = float(np.abs(platform - platform.mean(axis=0)).max())
    for i, j in ((0, 1), (0, 2), (1, 2)):
        if np.linalg.norm(platform[j] - platform[i]) <= _THIN * size:
            raise TSSMError(f"platform points {i} and {j} are the same: move one of them")
    if np.linalg.svd(platform - platform.mean(axis=0), compute_uv=False)[1] <= _THIN * size:
        raise TSSMError("the platform points lie in a line, about which it can turn: move one out of it")
    sigma = np.linalg.svd(base - base.mean(axis=0), compute_uv=False)
    for point in range(3):
        first, second = np.flatnonzero(legs == point)
        if np.linalg.norm(base[second] - base[first]) <= _THIN * sigma[0]:
            raise TSSMError(
                f"legs {first + 1} and {second + 1}, both to platform point {point}, begin at the same base point: "
                "move one of them"
            )
    if sigma[1] <= _THIN * sigma[0]:
        raise TSSMError("the base points lie in a line, about which the platform can turn: move one out of it")
