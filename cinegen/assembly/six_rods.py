"""`SixRods`: modes of a linkage whose platform is carried by six rods, from the platform's placements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cinegen.arrays import Array
from cinegen.assembly._kernels.tables import Complex
from cinegen.assembly.errors import ModesError
from cinegen.assembly.families import Family, RigidGroups, SixLegs
from cinegen.assembly.leg_assembly import LegAssembly, is_out_of_reach
from cinegen.assembly.linkage import Linkage
from cinegen.assembly.results import AssemblyModes, NearestConfiguration, SelfMotion
from cinegen.assembly.self_motions import SelfMotions
from cinegen.hexapod import Hexapod, HexapodError, NearestPlacement, SolutionCounts
from raff2urdf.closure import CLOSED
from raff2urdf.errors import raised_as

_SMALL = 1e-9  # characteristic lengths: a length error of no importance
_STARTS = 8


class SixRods:
    """Solves a linkage for one set of values of its locked joints after another.

    By homotopy from a platform whose 40 modes are known.

    Args:
        linkage: to solve.
        family: with six rods.
    """

    def __init__(self, linkage: Linkage, family: Family) -> None:
        self._linkage, self._family, self._groups = linkage, family, RigidGroups(linkage)
        self._platform: tuple[SixLegs, Hexapod] | None = None
        self._assembly: LegAssembly | None = None

    def check(self, locked: Array) -> None:
        """Check that rods can determine the platform's placement.

        Raises:
            ModesError: they are too special for that; the message names them.
        """
        self._solver(self._family.legs(self._groups, locked))

    def modes(self, asked: Array) -> AssemblyModes:
        """Return all modes with the locked joints as in q (nq,) `asked`.

        Raises:
            ModesError: the rods don't determine the platform's placement.
        """
        linkage, mechanism, locked = self._linkage, self._linkage.mechanism, self._linkage.locked_values(asked)
        legs = self._family.legs(self._groups, locked)
        with raised_as(ModesError, HexapodError, f"{mechanism.name}: "):
            modes = self._solver(legs).modes(legs.lengths * mechanism.length)
        placements = modes.placements.copy()
        placements[:, :3, 3] /= mechanism.length
        if self._assembly is None:
            self._assembly = LegAssembly(linkage, legs.member)
        configurations, coincident, lost, beyond = list[Array](), list[int](), 0, 0
        for placement, count in zip(placements, modes.coincident.tolist(), strict=True):
            solution = self._assembly.unknowns(placement, locked)
            q = None if solution is None else linkage.closed(linkage.configuration(solution, locked))
            if q is not None:
                configurations.append(q)
                coincident.append(max(count, 1))
            elif self._is_out_of_reach(placement, locked):
                beyond += 1
            else:
                lost += 1
        method = modes.method
        if beyond:
            method += f"; {beyond} of them out of reach of a universal joint"
        if lost:
            method += f"; the legs of {lost} were not assembled"
        closest, complete = None, modes.complete and lost == 0
        counts, real, missing = modes.counts, sum(coincident), modes.counts.lost + lost
        complex_ = counts.total - real - counts.infinite - missing
        counts = SolutionCounts(real, complex_, counts.infinite, counts.multiple, missing)
        if not configurations:
            closest = self._closest(modes.closest, locked)
            if closest.gap <= CLOSED:  # on a curve of configurations, which no root shows
                method += "; one was found by descent"
                configurations, coincident, complete, closest = [closest.q], [1], False, None
        self_motions, isolated = tuple[SelfMotion, ...](), [True] * len(configurations)
        if not modes.complete or not complete:
            search = SelfMotions(linkage, locked)
            dimensions = [search.dimension(linkage.unknowns(q)) for q in configurations]
            isolated = [dimension == 0 for dimension in dimensions]
            on = [q for q, dimension in zip(configurations, dimensions, strict=True) if dimension]
            regular, starts = search.random_solutions()
            if new := search.new(regular, [self._features(q, locked) for q in configurations]):
                method += f"; {len(new)} of these modes only random starts found"
                configurations += [q for q, _ in new]
                coincident += [1] * len(new)
                isolated += [True] * len(new)
                closest, counts = None, replace(counts, real=counts.real + len(new))
            self_motions = search.through([*(linkage.unknowns(q) for q in on), *starts])
        return AssemblyModes(
            mechanism, linkage.actuated_values(asked), tuple(configurations), tuple(coincident),
            complete and not self_motions, method, counts, closest, None, self_motions, tuple(isolated),
            almost_surely=complete and not self_motions and modes.almost_surely,
        )  # fmt: skip

    def _features(self, q: Array, locked: Array) -> Complex:
        return np.asarray(self._linkage.features(self._linkage.unknowns(q)[None], locked)[0])

    def _is_out_of_reach(self, placement: Array, locked: Array) -> bool:
        platform = self._family.platform
        return any(is_out_of_reach(self._groups, rod, platform, placement, locked) for rod in self._family.rods)

    def _solver(self, legs: SixLegs) -> Hexapod:
        length = self._linkage.mechanism.length
        if self._platform is not None:
            known, solver = self._platform
            if np.array_equal(known.base, legs.base) and np.array_equal(known.platform, legs.platform):
                return solver
        with raised_as(ModesError, HexapodError, f"{self._linkage.mechanism.name}: "):
            solver = Hexapod(length * legs.base, length * legs.platform)  # in metres, as its messages are
        self._platform = legs, solver
        return solver

    def _closest(self, nearest: NearestPlacement | None, locked: Array) -> NearestConfiguration:
        """Return what least squares reach, with the length errors of rods where these are least."""
        linkage, length = self._linkage, self._linkage.mechanism.length
        home, rng = linkage.unknowns(linkage.mechanism.q_home), np.random.default_rng(0)
        away = rng.uniform(-np.pi, np.pi, size=(_STARTS, len(home)))
        starts = [linkage.configuration(home + step, locked) for step in np.vstack([0.0 * home.real, away])]
        if nearest is None:
            return linkage.nearest(starts)
        missing = [
            f"{name} is {abs(error):.3g} m too {'long' if error < 0.0 else 'short'}"
            for name, error in zip(self._family.names, nearest.errors, strict=True)
            if abs(error) > _SMALL * length
        ]
        return linkage.nearest(starts, f"at the smallest length errors, {', '.join(missing)}")
