"""`Hexapod`: all assembly modes of a Gough platform, up to 40, with an account of why these are all.

Two homotopies. The first moves the points of a start system to the platform's, with complex lengths that stay the same:
its ends are all solutions for general lengths, as many as this hexapod has: 40 at most (F. Ronga and T. Vust, 1992), 16
if legs meet in pairs at three points of the platform or of the base (C. Innocenti and V. Parenti-Castelli, "Direct
position analysis of the Stewart platform mechanism", Mechanism and Machine Theory 25, 1990). As general lengths are
regular values, a path that does not end in a regular solution there ends at infinity (where <c, c> = 0). The second
moves these lengths to those asked for, and is all that further lengths cost.

Both paths are straight. From complex points in general position they meet no singular point before their end, with
probability one (A. P. Morgan and A. J. Sommese, "Coefficient-parameter polynomial continuation", Applied Mathematics
and Computation 29, 1989).
"""

from __future__ import annotations

import numpy as np

from cinegen.arrays import Array, ArrayLike, Bools, Complex, Integers
from cinegen.hexapod import legs, study
from cinegen.hexapod._kernels import taylor
from cinegen.hexapod.legs import HexapodError, checked_lengths, checked_points, leg_lengths
from cinegen.hexapod.paths import PathEnd, TrackedPaths, follow_surely, lie_on_curve
from cinegen.hexapod.result import NearestPlacement, PlatformModes, SolutionCounts

_SAME = 1e-9  # parts of the hexapod's size: points that coincide, or lie in a line
_SINGULAR = 1e-9  # part of the largest singular value
_IN_PAIRS = 16  # solutions
_POSES = 3  # random ones, to see whether legs constrain the platform anywhere
_LOOSE = 1e-4  # imaginary part of what may be real
_REAL = 1e-8  # ... of what is, if Newton's method in the reals converges to it; of a multiple end _LOOSE
_CUTOFF = 1e-5  # part of the largest singular value: a multiple mode moves along where there is less
_COINCIDENT = 1e-6  # distance of modes that are reported as coincident
_STEPS, _STEP = 12, 0.05  # random steps from a multiple mode, and their length
_EXACT, _ELSEWHERE = 1e-12, 1e-3  # length error, and distance from all modes, of other points of a curve


class Hexapod:
    """A Gough platform: six legs of variable length between points of a base and of a platform.

    Attributes:
        base: (6, 3) points in the base frame.
        platform: (6, 3) points in the platform frame.
        bound: largest number of complex placements of such a geometry: 40, or 16 if legs meet in pairs.
        degree: number of complex placements for general lengths: the bound, or fewer in special geometry.
        steps: of all paths from the start system to this geometry.
    """

    base: Array
    platform: Array
    bound: int
    degree: int
    steps: int

    def __init__(self, base: ArrayLike, platform: ArrayLike) -> None:
        """Follow the start system's solutions to this geometry, and compile what is not compiled yet.

        Args:
            base: (6, 3) where legs begin, in any unit of length.
            platform: (6, 3) where they end, in the same unit.

        Raises:
            HexapodError: wrong shape, not finite, or so that the platform moves with its legs locked.
        """
        self.base, self.platform = checked_points("base", base), checked_points("platform", platform)
        self._centre = self.base.mean(axis=0), self.platform.mean(axis=0)
        a, b = self.base - self._centre[0], self.platform - self._centre[1]
        self._unit = float(np.sqrt(((a**2).sum() + (b**2).sum()) / 12.0))
        self._a, self._b = a / self._unit, b / self._unit
        _check_geometry(self._a, self._b)
        taylor.prepare_tracking()
        paths = self._general()
        self._x = paths.x[paths.end == PathEnd.REGULAR]
        self.degree = len(self._x)
        self.bound = _IN_PAIRS if _meet_in_pairs(self._a) or _meet_in_pairs(self._b) else study.SOLUTIONS
        lost = study.SOLUTIONS - self.degree - paths.count(PathEnd.INFINITE)
        twice = max(0, self.degree - self.bound)  # a path that jumped to another one's end
        self._lost = twice or min(lost, self.bound - self.degree)
        self._infinite = max(0, self.bound - self.degree - self._lost)
        self.steps = int(paths.steps.sum())

    def modes(self, lengths: ArrayLike) -> PlatformModes:
        """Return all placements at which the legs have these lengths.

        Args:
            lengths: (6,) of the legs, in the unit of the points.

        Raises:
            HexapodError: wrong shape, not finite or not positive.
        """
        asked = checked_lengths(lengths) / self._unit
        return self._account(asked, *self._paths(asked))

    # --- paths --------------------------------------------------------------------------------------------------------

    def _general(self) -> TrackedPaths:
        """Follow paths from the start system to this geometry, at the start system's lengths."""
        start = study.start_system()
        begin = study.coefficients(start.base, start.platform, start.s)
        end = study.coefficients(self._a, self._b, start.s)

        def path(detour: np.random.Generator | None) -> Complex:
            base, platform = 0.5 * (start.base + self._a), 0.5 * (start.platform + self._b)
            if detour is not None:
                base, platform = base + _random(detour, 6, 3), platform + _random(detour, 6, 3)
            return study.family(begin, end, study.coefficients(base, platform, start.s))

        return follow_surely(path, start.x, False)

    def _paths(self, asked: Array) -> tuple[TrackedPaths, bool]:
        """Follow paths to these lengths; return also whether they meet a curve of configurations."""
        # legs may be far longer than the hexapod is wide: in units of their length, no part of x is small
        far = max(1.0, float(np.sqrt((asked**2).mean())))
        a, b = self._a / far, self._b / far
        x = self._x / np.repeat([1.0, far], 4)
        x /= np.linalg.norm(x, axis=1)[:, None]
        begin = study.coefficients(a, b, study.start_system().s / far**2)
        end = study.coefficients(a, b, study.squares(a, b) - (asked / far) ** 2)

        def path(detour: np.random.Generator | None) -> Complex:
            if detour is None:
                return study.family(begin, end)
            aside = study.coefficients(0.0 * a, 0.0 * b, _random(detour, 6))
            return study.family(begin, end, 0.5 * (begin + end) + aside)

        paths = follow_surely(path, x, True)
        curve = lie_on_curve(path, x, paths)
        paths.x[:, 4:] *= far
        paths.x /= np.linalg.norm(paths.x, axis=1)[:, None]
        return paths, curve

    # --- results ------------------------------------------------------------------------------------------------------

    def _account(self, asked: Array, paths: TrackedPaths, curve: bool) -> PlatformModes:
        went, lost = paths.count(PathEnd.INFINITE), self._lost + paths.count(PathEnd.FAILED)
        regular, multiple = paths.end == PathEnd.REGULAR, paths.end == PathEnd.MULTIPLE
        placements, is_real = self._real(asked, paths)
        kept, coincident = _merged(placements)
        curve = curve or self._moves(asked, placements, multiple[is_real])
        remarks = ["a curve of configurations: the platform moves with its legs locked"] if curve else []
        if int((regular & ~is_real).sum()) % 2:  # what is not real is conjugate to another
            remarks.append("a real solution could not be distinguished from a complex one")
        if went:
            remarks.append("solutions went to infinity at these lengths: curves of configurations are not excluded")
        closest = None
        if not len(kept) and not lost:
            placement, errors = self._closest(asked, paths.x[regular | multiple])
            if np.abs(errors).max() <= _REAL:
                kept, coincident = placement[None], np.ones(1, dtype=np.int64)
                remarks.append("no path ended in a mode, one was found by descent")
            else:
                closest = NearestPlacement(self._restored(placement[None])[0], errors * self._unit)
        real, infinite, many = int(is_real.sum()), self._infinite + went, int(multiple.sum())
        counts = SolutionCounts(real, int((regular | multiple).sum()) - real, infinite, many, lost)
        method = _method(self.bound, int(regular.sum()), int((regular & is_real).sum()), infinite, many, lost, remarks)
        complete = not lost and not remarks
        by_chance = complete and self._infinite > 0  # fewer than a theorem allows: as many as the random start has
        return PlatformModes(
            self._restored(kept), coincident, counts, complete, method, closest, almost_surely=by_chance
        )

    def _real(self, asked: Array, paths: TrackedPaths) -> tuple[Array, Bools]:
        """Return the placements (n, 4, 4) of real ends, and which ends are real (.,)."""
        multiple = paths.end == PathEnd.MULTIPLE
        finite = multiple | (paths.end == PathEnd.REGULAR)
        x = paths.x / np.where(finite, np.sqrt((paths.x[:, :4] ** 2).sum(axis=1)), 1.0)[:, None]
        imaginary = np.linalg.norm(x.imag, axis=1) / np.linalg.norm(x, axis=1)
        rows = np.flatnonzero(finite & (imaginary <= _LOOSE))
        first = study.placements(x[rows].real)
        refined, last = legs.refine(self._a, self._b, asked, first, np.where(multiple[rows], _CUTOFF, 0.0))
        moved = imaginary[rows] + np.abs(refined - first).max(axis=(1, 2), initial=0.0) / (1.0 + asked.max())
        short = np.abs(leg_lengths(self._a, self._b, refined) - asked).max(axis=1, initial=0.0) <= _REAL
        sure = short & (last <= _REAL) & (moved <= np.where(multiple[rows], _LOOSE, _REAL))
        real = np.zeros(len(x), dtype=bool)
        real[rows[sure]] = True
        return refined[sure], real

    def _moves(self, asked: Array, placements: Array, multiple: Bools) -> bool:
        """Return whether a multiple mode lies on a curve of configurations: Newton's method from a step along what legs
        do not constrain ends at none of the modes."""
        rng, modes = np.random.default_rng(0), placements[multiple]
        sigma, vt = np.linalg.svd(legs.leg_jacobian(self._a, self._b, modes))[1:]
        weights = rng.normal(size=(_STEPS, *sigma.shape)) * (sigma <= _CUTOFF * sigma[:, :1])
        free = np.einsum("nkj,snk->snj", vt, weights)
        steps = _STEP * free / np.maximum(np.linalg.norm(free, axis=2, keepdims=True), _SAME)
        starts = legs.moved_by(np.tile(modes, (_STEPS, 1, 1)), steps.reshape(-1, 6))
        ends = legs.refine(self._a, self._b, asked, starts, np.full(len(starts), _CUTOFF))[0]
        errors = np.abs(leg_lengths(self._a, self._b, ends) - asked).max(axis=1, initial=0.0)
        reached = errors <= _EXACT * max(1.0, asked.max())
        apart = np.abs(ends[reached, None] - placements).max(axis=(2, 3)).min(axis=1, initial=np.inf)
        return bool((apart > _ELSEWHERE).any())

    def _closest(self, asked: Array, x: Complex) -> tuple[Array, Array]:
        """Return the nearest placement (4, 4) that descent from the real parts of solutions finds, and its length
        errors (6,)."""
        x = x / np.sqrt((x[:, :4] ** 2).sum(axis=1))[:, None]
        x = np.where((np.linalg.norm(x.real, axis=1) < np.linalg.norm(x.imag, axis=1))[:, None], x.imag, x.real)
        starts = np.vstack([study.placements(x[np.linalg.norm(x[:, :4], axis=1) > _SAME]), np.eye(4)[None]])
        placement = legs.nearest(self._a, self._b, asked, starts)
        return placement, leg_lengths(self._a, self._b, placement) - asked

    def _restored(self, placements: Array) -> Array:
        """Return placements (n, 4, 4) in the frames and the unit that were given."""
        restored = placements.copy()
        shift = self._unit * placements[:, :3, 3] - placements[:, :3, :3] @ self._centre[1]
        restored[:, :3, 3] = self._centre[0] + shift
        return restored


def _check_geometry(a: Array, b: Array) -> None:
    for name, points in (("base", a), ("platform", b)):
        sigma = np.linalg.svd(points, compute_uv=False)
        if sigma[0] <= _SAME:
            raise HexapodError(f"all six points of the {name} are one: a leg needs a point of its own at each end")
        if sigma[1] <= _SAME:
            raise HexapodError(f"the points of the {name} lie in a line, about which it can rotate: move one out of it")
    for i in range(6):
        for j in range(i):
            if max(np.abs(a[i] - a[j]).max(), np.abs(b[i] - b[j]).max()) <= _SAME:
                raise HexapodError(f"legs {j + 1} and {i + 1} are the same line: move an end of one")
    poses = study.placements(study.on_quadric(np.random.default_rng(0).normal(size=(_POSES, 8))))
    sigma = np.linalg.svd(legs.leg_jacobian(a, b, poses), compute_uv=False)
    if (sigma[:, -1] <= _SINGULAR * sigma[:, 0]).all():
        raise HexapodError(
            "the six legs constrain the platform nowhere (its geometry is architecturally singular): where it can be "
            "assembled at all, there is a curve of configurations; move a point of the base or the platform"
        )


def _meet_in_pairs(points: Array) -> bool:
    """Return whether six points (6, 3) are three, each twice."""
    together = np.abs(points[:, None] - points).max(axis=2) <= _SAME
    return bool((together.sum(axis=1) == 2).all())


def _random(rng: np.random.Generator, *shape: int) -> Complex:
    return np.asarray(rng.normal(size=shape) + 1j * rng.normal(size=shape))


def _merged(placements: Array) -> tuple[Array, Integers]:
    """Return one of all placements that coincide, and how many do."""
    close = np.abs(placements[:, None] - placements).max(axis=(2, 3), initial=0.0) <= _COINCIDENT
    firsts = np.array([row.argmax() for row in close], dtype=np.int64)  # the first that each coincides with
    kept, counts = np.unique(firsts, return_counts=True)
    return placements[kept], counts.astype(np.int64)


def _method(bound: int, regular: int, real: int, infinite: int, multiple: int, lost: int, remarks: list[str]) -> str:
    ends = (infinite, "ended at infinity"), (multiple, "ended at multiple points"), (lost, "could not be followed")
    parts = [f"{regular} of {bound} distinct regular solutions, {real} of them real"]
    parts += [f"{count} {'path' if count == 1 else 'paths'} {what}" for count, what in ends if count]
    return "homotopy in Study's coordinates: " + "; ".join([*parts, *remarks])
