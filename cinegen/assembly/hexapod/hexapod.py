"""`Hexapod`: the assembly modes of a Gough platform, all of them, with an account of why these are all.

Two homotopies. The first moves the points of the start system to those asked for, its complex lengths at rest: what
comes of that are all solutions for lengths in general, as many as this hexapod has (40; 16 where legs meet in pairs at
three points). As general lengths are regular values, a path that does not end in a regular solution there ends at
infinity (where <c, c> = 0). The second moves these lengths to those asked for, and is all that further lengths cost.

Both ways are straight, which from complex points in general position meets no singular point before its end, with
probability one (A. P. Morgan and A. J. Sommese, "Coefficient-parameter polynomial continuation", Applied Mathematics
and Computation 29, 1989).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.assembly.hexapod import _kernels as kernel
from cinegen.assembly.hexapod.equations import Array, Complex, coefficients, moving, placements, squares
from cinegen.assembly.hexapod.legs import jacobian, lengths, nearest, refine
from cinegen.assembly.hexapod.paths import Ends, Kind, lie_on_curve, settle
from cinegen.assembly.hexapod.start import COUNT, Start, load
from cinegen.errors import CinegenError

_SAME = 1e-9  # parts of the hexapod's size: points that coincide, or lie in a line
_SINGULAR = 1e-9  # part of the largest singular value
_POSES = 3  # at random, to see whether legs ever hold the platform
_LOOSE = 1e-4  # imaginary part of what may be real
_REAL = 1e-8  # ... of what is, if Newton's method in the reals comes to it too; of a multiple end _LOOSE
_HELD = 1e-5  # part of the largest singular value: a multiple mode moves along where there is less
_TOGETHER = 1e-6  # distance of modes that are said to coincide


class HexapodError(CinegenError):
    """A hexapod or lengths that have no assembly modes to be found; says why."""


@dataclass(frozen=True, eq=False)
class Approach:
    """How near a platform comes to lengths that it can't be assembled with.

    Attributes:
        placement: (4, 4) where the sum of squares of what legs miss is smallest, of all minima found.
        misses: (6,) how much longer each leg is there than it should be.
    """

    placement: Array
    misses: Array


@dataclass(frozen=True, eq=False)
class Modes:
    """All placements of the platform in the base's frame, for six lengths; 40 complex solutions are accounted for.

    Where legs let the platform move, on a curve of configurations, placements are those of its points that were met.

    Attributes:
        placements: (n, 4, 4).
        coincident: (n,) how many solutions meet in each (within 1e-6 of the hexapod's size): 1 where it is alone.
        real: regular solutions that are real.
        complex: regular solutions that are not.
        infinite: paths that ended at infinity.
        multiple: paths that ended in points where solutions meet, real or not.
        lost: paths that could not be followed to an end.
        complete: whether these are all modes: no path was lost, none ended on a curve of configurations, and none that
            ends at finite points for general lengths went to infinity for these. Then as many solutions as there are
            for general lengths are at isolated points, and there can be no curve besides.
        method: how they were found, in words.
        closest: what comes nearest, where there is no mode.
    """

    placements: Array
    coincident: NDArray[np.int64]
    real: int
    complex: int
    infinite: int
    multiple: int
    lost: int
    complete: bool
    method: str
    closest: Approach | None = None

    @property
    def total(self) -> int:
        """How many complex solutions are accounted for: 40."""
        return self.real + self.complex + self.infinite + self.multiple + self.lost


class Hexapod:
    """A Gough platform: six rods between points of a base and of a platform, of lengths that are driven.

    Attributes:
        base: (6, 3) points in the base's frame.
        platform: (6, 3) points in the platform's frame.
        degree: how many complex placements there are for lengths in general: 40, or fewer in special geometry.
        steps: of all paths from the start system to this geometry.
    """

    base: Array
    platform: Array
    degree: int
    steps: int

    def __init__(self, base: ArrayLike, platform: ArrayLike) -> None:
        """Follows the start system's solutions to this geometry, and compiles what is not compiled yet.

        Args:
            base: (6, 3) where rods begin.
            platform: (6, 3) where they end, in the same unit.

        Raises:
            HexapodError: of wrong shape, not finite, or so that the platform moves while its legs rest.
        """
        self.base, self.platform = _points("base", base), _points("platform", platform)
        self._centre = self.base.mean(axis=0), self.platform.mean(axis=0)
        a, b = self.base - self._centre[0], self.platform - self._centre[1]
        self._unit = float(np.sqrt(((a**2).sum() + (b**2).sum()) / 12.0))
        self._check(a, b)
        self._a, self._b = a / self._unit, b / self._unit
        kernel.prepare_paths()
        ends = self._general(load())
        self._x = ends.x[ends.kind == Kind.REGULAR]
        self.degree = len(self._x)
        self._infinite = ends.count(Kind.INFINITE)
        self._lost = COUNT - self.degree - self._infinite
        self.steps = int(ends.steps.sum())

    def modes(self, lengths: ArrayLike) -> Modes:
        """All placements at which the legs have these lengths.

        Args:
            lengths: (6,) of the rods, in the unit of the points.

        Raises:
            HexapodError: of wrong shape, not finite or not positive.
        """
        asked = _lengths(lengths) / self._unit
        return self._account(asked, *self._ends(asked))

    # --- paths ------------------------------------------------------------------------------------------------------

    def _general(self, start: Start) -> Ends:
        """To this geometry, the start system's lengths at rest."""
        begin = coefficients(start.base, start.platform, start.s)
        end = coefficients(self._a, self._b, start.s)

        def way(detour: np.random.Generator | None) -> Complex:
            base, platform = 0.5 * (start.base + self._a), 0.5 * (start.platform + self._b)
            if detour is not None:
                base, platform = base + _random(detour, 6, 3), platform + _random(detour, 6, 3)
            return moving(begin, end, coefficients(base, platform, start.s))

        return settle(way, start.x, False)

    def _ends(self, asked: Array) -> tuple[Ends, bool]:
        """To these lengths; and whether a curve of configurations was met."""
        # rods may be far longer than the hexapod is wide: in their unit, x has no part that is small
        far = max(1.0, float(np.sqrt((asked**2).mean())))
        a, b = self._a / far, self._b / far
        s = load().s / far**2
        x = self._x / np.repeat([1.0, far], 4)
        x /= np.linalg.norm(x, axis=1)[:, None]
        begin, end = coefficients(a, b, s), coefficients(a, b, squares(a, b) - (asked / far) ** 2)

        def way(detour: np.random.Generator | None) -> Complex:
            if detour is None:
                return moving(begin, end)
            between = 0.5 * (begin + end)
            between += coefficients(0.0 * a, 0.0 * b, _random(detour, 6))
            return moving(begin, end, between)

        ends = settle(way, x, True)
        curve = lie_on_curve(way, x, ends)
        ends.x[:, 4:] *= far
        ends.x /= np.linalg.norm(ends.x, axis=1)[:, None]
        return ends, curve

    # --- what they say ----------------------------------------------------------------------------------------------

    def _account(self, asked: Array, ends: Ends, curve: bool) -> Modes:
        infinite, lost = self._infinite + ends.count(Kind.INFINITE), self._lost + ends.count(Kind.FAILED)
        regular, multiple = ends.kind == Kind.REGULAR, ends.kind == Kind.MULTIPLE
        found, real = self._real(asked, ends)
        count = int((real & regular).sum())
        kept, coincident = _together(found)
        remarks = ["a curve of configurations: the platform moves while its legs rest"] if curve else []
        if (int(regular.sum()) - count) % 2:  # what is not real is conjugate to another
            remarks.append("a real solution could not be told from a complex one")
        if ends.count(Kind.INFINITE):
            remarks.append("solutions went to infinity at these lengths: curves of configurations are not excluded")
        closest = None
        if not len(kept) and not lost:
            here, misses = self._closest(asked, ends.x[regular | multiple])
            if np.abs(misses).max() <= _REAL:
                kept, coincident = here[None], np.ones(1, dtype=np.int64)
                remarks.append("no path came to a mode, one was found by descent")
            else:
                closest = Approach(self._back(here[None])[0], misses * self._unit)
        return Modes(
            self._back(kept),
            coincident,
            count,
            int(regular.sum()) - count,
            infinite,
            int(multiple.sum()),
            lost,
            not lost and not remarks,
            _method(int(regular.sum()), count, infinite, int(multiple.sum()), lost, remarks),
            closest,
        )

    def _real(self, asked: Array, ends: Ends) -> tuple[Array, NDArray[np.bool_]]:
        """(n, 4, 4) what is real of the ends, and (.,) of which ends that is so."""
        multiple = ends.kind == Kind.MULTIPLE
        finite = multiple | (ends.kind == Kind.REGULAR)
        x = ends.x / np.where(finite, np.sqrt((ends.x[:, :4] ** 2).sum(axis=1)), 1.0)[:, None]
        imaginary = np.linalg.norm(x.imag, axis=1) / np.linalg.norm(x, axis=1)
        rows = np.flatnonzero(finite & (imaginary <= _LOOSE))
        first = placements(x[rows].real)
        found, last = refine(self._a, self._b, asked, first, np.where(multiple[rows], _HELD, 0.0))
        way = imaginary[rows] + np.abs(found - first).max(axis=(1, 2), initial=0.0) / (1.0 + asked.max())
        short = np.abs(lengths(self._a, self._b, found) - asked).max(axis=1, initial=0.0) <= _REAL
        sure = short & (last <= _REAL) & (way <= np.where(multiple[rows], _LOOSE, _REAL))
        real = np.zeros(len(x), dtype=bool)
        real[rows[sure]] = True
        return found[sure], real

    def _closest(self, asked: Array, x: Complex) -> tuple[Array, Array]:
        """(4, 4) what comes nearest, begun from the real parts of solutions, and (6,) what legs miss there."""
        x = x / np.sqrt((x[:, :4] ** 2).sum(axis=1))[:, None]
        x = np.where((np.linalg.norm(x.real, axis=1) < np.linalg.norm(x.imag, axis=1))[:, None], x.imag, x.real)
        starts = np.vstack([placements(x[np.linalg.norm(x[:, :4], axis=1) > _SAME]), np.eye(4)[None]])
        here = nearest(self._a, self._b, asked, starts)
        return here, lengths(self._a, self._b, here[None])[0] - asked

    def _back(self, found: Array) -> Array:
        """(n, 4, 4) in the frames and the unit that were given."""
        back = found.copy()
        back[:, :3, 3] = self._centre[0] + self._unit * found[:, :3, 3] - found[:, :3, :3] @ self._centre[1]
        return back

    def _check(self, a: Array, b: Array) -> None:
        for name, points in (("base", a), ("platform", b)):
            sigma = np.linalg.svd(points, compute_uv=False)
            if sigma[0] <= _SAME * self._unit:
                raise HexapodError(f"all six points of the {name} are one: a rod needs a point of its own at each end")
            if sigma[1] <= _SAME * self._unit:
                raise HexapodError(
                    f"the points of the {name} lie in a line, about which it can turn: move one out of it"
                )
        for i in range(6):
            for j in range(i):
                if max(np.abs(a[i] - a[j]).max(), np.abs(b[i] - b[j]).max()) <= _SAME * self._unit:
                    raise HexapodError(f"legs {j + 1} and {i + 1} are the same rod: move an end of one")
        rng = np.random.default_rng(0)
        poses = placements(_on_quadric(rng.normal(size=(_POSES, 8))))
        sigma = np.linalg.svd(jacobian(a / self._unit, b / self._unit, poses), compute_uv=False)
        if (sigma[:, -1] <= _SINGULAR * sigma[:, 0]).all():
            raise HexapodError(
                "the six legs hold the platform nowhere (its geometry is architecturally singular): where it can be "
                "assembled at all, there is a curve of configurations; move a point of the base or the platform"
            )


def _points(name: str, given: ArrayLike) -> Array:
    points = np.array(given, dtype=float)
    if points.shape != (6, 3):
        raise HexapodError(f"the {name} must be (6, 3), a point for each leg, not {points.shape}")
    if not np.isfinite(points).all():
        raise HexapodError(f"a point of the {name} is not finite")
    points.setflags(write=False)
    return points


def _lengths(given: ArrayLike) -> Array:
    asked = np.array(given, dtype=float)
    if asked.shape != (6,):
        raise HexapodError(f"lengths must be (6,), one for each leg, not {asked.shape}")
    if not np.isfinite(asked).all():
        raise HexapodError(f"length {int(np.argmin(np.isfinite(asked))) + 1} is not finite")
    if not (asked > 0.0).all():
        raise HexapodError(f"length {int(np.argmin(asked)) + 1} must be positive, it is {asked.min():g}")
    return asked


def _random(rng: np.random.Generator, *shape: int) -> Complex:
    return np.asarray(rng.normal(size=shape) + 1j * rng.normal(size=shape))


def _on_quadric(x: Array) -> Array:
    c, d = x[:, :4], x[:, 4:]
    return np.hstack([c, d - c * ((c * d).sum(axis=1) / (c * c).sum(axis=1))[:, None]])


def _together(found: Array) -> tuple[Array, NDArray[np.int64]]:
    """One of all placements that coincide, and how many do."""
    kept: list[int] = []
    counts: list[int] = []
    for i, placement in enumerate(found):
        for k, j in enumerate(kept):
            if np.abs(placement - found[j]).max() <= _TOGETHER:
                counts[k] += 1
                break
        else:
            kept.append(i)
            counts.append(1)
    return found[kept], np.array(counts, dtype=np.int64)


def _method(regular: int, real: int, infinite: int, multiple: int, lost: int, remarks: list[str]) -> str:
    said = [f"{regular} of {COUNT} distinct regular solutions, {real} of them real"]
    said += [
        f"{count} {'path' if count == 1 else 'paths'} {what}"
        for count, what in (
            (infinite, "ended at infinity"),
            (multiple, "ended at multiple points"),
            (lost, "could not be followed"),
        )
        if count
    ]
    return "homotopy in Study's coordinates: " + "; ".join([*said, *remarks])
