"""`SixRods`: modes of a linkage whose platform stands on six rods, from the platform's placements."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from cinegen.assembly.assembly import Assembly
from cinegen.assembly.families import Family, Groups, Legs
from cinegen.assembly.found import Approach, Found, Paths, closed, nearest
from cinegen.assembly.linkage import Array, Linkage, ModesError
from cinegen.assembly.reach import is_out_of_reach
from cinegen.hexapod import TSSM, Hexapod, HexapodError, NearestPlacement, PlatformModes
from raff2urdf.closure import CLOSED

_ONE = 1e-9  # characteristic lengths: points that are one
_SMALL = 1e-9  # ... and what a rod may miss
_STARTS = 8


class _Solver(Protocol):
    """What knows all modes of six rods."""

    def modes(self, lengths: Array) -> PlatformModes: ...


class SixRods:
    """Solves a linkage for one set of values of its motors after another.

    By J.-P. Merlet's polynomial where the rods' ends meet in pairs on the platform or on the base, else by homotopy
    from a platform whose 40 modes are known.

    Args:
        linkage: whose.
        family: with six rods.
    """

    def __init__(self, linkage: Linkage, family: Family) -> None:
        self._linkage, self._family, self._groups = linkage, family, Groups(linkage)
        self._platform: tuple[Legs, _Solver] | None = None
        self._assembly: Assembly | None = None

    def check(self, motors: Array) -> None:
        """Whether rods can determine where the platform is.

        Raises:
            ModesError: they are too special for that; says how.
        """
        self._solver(self._family.legs(self._groups, motors))

    def modes(self, motors: Array) -> Found:
        """All modes with the motors at (motors,), without unit.

        Raises:
            ModesError: the rods don't determine where the platform is, or are none.
        """
        legs = self._family.legs(self._groups, motors)
        solver = self._solver(legs)
        try:
            found = solver.modes(legs.lengths * self._linkage.mechanism.length)
        except HexapodError as error:
            raise ModesError(f"{self._linkage.mechanism.name}: {error}") from None
        words = found.method
        placements = found.placements.copy()
        placements[:, :3, 3] /= self._linkage.mechanism.length
        if self._assembly is None:
            self._assembly = Assembly(self._linkage, legs.member)
        configurations, coincident, lost, beyond = list[Array](), list[int](), 0, 0
        platform = self._family.platform
        for placement, count in zip(placements, found.coincident, strict=True):
            solution = self._assembly.unknowns(placement, motors)
            q = None if solution is None else closed(self._linkage, self._linkage.configuration(solution, motors))
            if q is None:
                out = any(is_out_of_reach(self._groups, rod, platform, placement, motors) for rod in self._family.rods)
                beyond, lost = beyond + out, lost + (not out)
                continue
            configurations.append(q)
            coincident.append(max(int(count), 1))
        if beyond:
            words += f"; {beyond} of them out of reach of a universal joint"
        if lost:
            words += f"; the legs of {lost} were not assembled"
        closest = None if configurations else self._closest(found.closest, motors)
        counts, real = found.counts, sum(coincident)
        missing = counts.lost + lost
        paths = Paths(
            real=real,
            complex=counts.total - real - counts.infinite - missing,
            infinite=counts.infinite,
            multiple=counts.multiple,
            lost=missing,
        )
        complete = found.complete and lost == 0
        if closest is not None and closest.gap <= CLOSED:  # on a curve of configurations, of which no root tells
            return Found((closest.q,), (1,), False, f"{words}; one was found by descent", paths)
        return Found(tuple(configurations), tuple(coincident), complete, words, paths, closest)

    def _solver(self, legs: Legs) -> _Solver:
        if self._platform is not None:
            known, solver = self._platform
            if np.array_equal(known.base, legs.base) and np.array_equal(known.platform, legs.platform):
                return solver
        try:
            solver = _solver_of(legs, self._linkage.mechanism.length)
        except HexapodError as error:
            raise ModesError(f"{self._linkage.mechanism.name}: {error}") from None
        self._platform = legs, solver
        return solver

    def _closest(self, approach: NearestPlacement | None, motors: Array) -> Approach:
        """What least squares come to, and which rods miss their lengths by how much where that is least of all."""
        linkage, length = self._linkage, self._linkage.mechanism.length
        home, rng = linkage.unknowns(linkage.mechanism.q_home), np.random.default_rng(0)
        away = rng.uniform(-np.pi, np.pi, size=(_STARTS, len(home)))
        starts = [linkage.configuration(home + way, motors) for way in np.vstack([0.0 * home.real, away])]
        if approach is None:
            return nearest(linkage, starts)
        missing = [
            f"{name} is {abs(miss):.3g} m too {'long' if miss < 0.0 else 'short'}"
            for name, miss in zip(self._family.names, approach.errors, strict=True)
            if abs(miss) > _SMALL * length
        ]
        return nearest(linkage, starts, f"where they miss least, {', '.join(missing)}")


def _solver_of(legs: Legs, length: float) -> _Solver:
    """In metres, so that what it says is in metres."""
    for points, others in ((legs.platform, legs.base), (legs.base, legs.platform)):
        apart = np.linalg.norm(points[:, None] - points[None], axis=2) < _ONE
        groups = [tuple(np.flatnonzero(row)) for row in apart]
        if sorted(map(len, groups)) == [2] * 6:
            first = sorted({group[0] for group in groups})
            which = np.array([first.index(group[0]) for group in groups])
            try:
                solver = TSSM(length * others, length * points[first], which)
            except HexapodError:
                break
            return solver if points is legs.platform else _Inverted(solver)
    return Hexapod(length * legs.base, length * legs.platform)


class _Inverted:
    """Modes of a platform whose rods meet in pairs on the base: those of the base, seen from the platform."""

    def __init__(self, solver: TSSM) -> None:
        self._solver = solver

    def modes(self, lengths: Array) -> PlatformModes:
        """All modes for lengths (6,)."""
        found = self._solver.modes(lengths)
        closest = found.closest
        if closest is not None:
            closest = replace(closest, placement=np.asarray(np.linalg.inv(closest.placement), dtype=float))
        return replace(found, placements=np.asarray(np.linalg.inv(found.placements), dtype=float), closest=closest)
