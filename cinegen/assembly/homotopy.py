"""`Homotopy`: modes of any linkage, from a fibre of solutions that is continued to the values asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.assembly._kernels.tables import ARRIVED, INFINITE, LOST, SINGULAR, Complex
from cinegen.assembly.distinct_solutions import SAME
from cinegen.assembly.endgame import PathEnds, path_ends
from cinegen.assembly.families import Family
from cinegen.assembly.linkage import Linkage
from cinegen.assembly.monodromy import Fibre, Monodromy
from cinegen.assembly.results import AssemblyModes, NearestConfiguration
from cinegen.assembly.self_motions import STARTS, SelfMotions
from cinegen.hexapod import SolutionCounts
from raff2urdf.closure import CLOSED
from raff2urdf.errors import counted

_ATTEMPTS = 4  # paths to the values asked for
_FAR = 1e-4  # closing a real solution moves features less
_GUESSES = 8  # complex solutions whose real parts may be nearest


class _Mode(NamedTuple):
    """A configuration (nq,), its features (3 f,), how many solutions are there, and whether one of them is singular."""

    q: Array
    features: Complex
    times: int
    singular: bool


class Homotopy:
    """Solves a linkage for one set of values of its locked joints after another.

    Args:
        linkage: to solve.
        family: that it was recognised as, if any.
    """

    def __init__(self, linkage: Linkage, family: Family | None) -> None:
        self._linkage, self._family = linkage, family
        self._fibre: Fibre | None = None
        self._effort = 0.0

    def modes(self, asked: Array, report: Callable[[str], None] | None, effort: float) -> AssemblyModes:
        """Return all modes with the locked joints as in q (nq,) `asked`; see `assembly_modes`."""
        linkage, fibre, locked = self._linkage, self._known(report, effort), self._linkage.locked_values(asked)
        paths = self._path_ends(fibre, locked)
        curve = any(linkage.can_move(solution, locked) for solution in paths.solutions[paths.ends == SINGULAR])
        modes, lost = self._real(paths, locked, curve)
        infinite, lost, multiple = paths.count(INFINITE), lost + paths.count(LOST), paths.count(SINGULAR)
        real = sum(mode.times for mode in modes)
        counts = SolutionCounts(real, len(paths.ends) - real - infinite - lost, infinite, multiple, lost)
        complete, trace_test, remarks = self._status(fibre, counts, curve)
        closest = None if modes else self._closest(paths, locked)
        if closest is not None and closest.gap <= CLOSED:  # a point of a curve, whose paths ended in complex points
            features = linkage.features(linkage.unknowns(closest.q)[None], locked)[0]
            modes, complete, closest = [_Mode(closest.q, features, 1, True)], False, None
            counts = replace(counts, real=1, complex=max(counts.complex - 1, 0))
            trace_test = None if trace_test is None else False
        search, by_bound = SelfMotions(linkage, locked), self._is_bound_reached(fibre)
        points = [linkage.unknowns(mode.q) for mode in modes if mode.singular]
        if not complete and (curve or not by_bound):
            regular, singular = search.random_solutions()
            points += list(singular)
            if new := [_Mode(q, its, 1, False) for q, its in search.new(regular, [mode.features for mode in modes])]:
                modes, closest, counts = modes + new, None, replace(counts, real=counts.real + len(new))
                remarks.append(f"{len(new)} of these modes only random starts found")
                trace_test = None if trace_test is None else False
        self_motions = search.through(points)
        if self_motions:
            remarks.append(f"{counted(len(self_motions), 'self-motion')} found")
        if not complete and not by_bound:
            remarks.append(f"not excluded: modes and self-motions that neither paths nor {STARTS} random starts met")
        isolated = [not mode.singular or not search.dimension(linkage.unknowns(mode.q)) for mode in modes]
        return AssemblyModes(
            linkage.mechanism, linkage.actuated_values(asked), tuple(mode.q for mode in modes),
            tuple(mode.times for mode in modes), complete and not self_motions, "; ".join(remarks), counts, closest,
            trace_test, self_motions, tuple(isolated),
        )  # fmt: skip

    def _is_bound_reached(self, fibre: Fibre) -> bool:
        return self._family is not None and len(fibre.solutions) >= self._family.bound

    def _known(self, report: Callable[[str], None] | None, effort: float) -> Fibre:
        """Return the fibre, found once; again if more may be done than when it was given up."""
        if self._fibre is None or (self._fibre.spent and effort > self._effort):
            bound = self._family.bound if self._family is not None else None
            everywhere = self._family is None or self._family.everywhere
            monodromy = Monodromy(self._linkage, bound, report=report, effort=effort)
            self._fibre, self._effort = monodromy.fibre(everywhere), effort
        return self._fibre

    # --- paths --------------------------------------------------------------------------------------------------------

    def _path_ends(self, fibre: Fibre, locked: Array) -> PathEnds:
        """Return the ends of all solutions of the fibre; if some are lost, another path is tried with all of them: a
        detour round branch points changes which one ends where."""
        linkage, rng = self._linkage, np.random.default_rng(1)
        best = path_ends(linkage, fibre.solutions, fibre.locked, locked)
        for _ in range(_ATTEMPTS - 1):
            if not best.count(LOST):
                break
            detour = fibre.locked + 0.2 * (rng.normal(size=len(locked)) + 1j * rng.normal(size=len(locked)))
            path = linkage.straight(fibre.locked, detour)._replace(accuracy=1e-6)
            tracked = linkage.track(fibre.solutions, path)
            if (tracked.ends == ARRIVED).all():
                again = path_ends(linkage, tracked.solutions, detour, locked)
                best = again if again.count(LOST) < best.count(LOST) else best
        return best

    def _real(self, paths: PathEnds, locked: Array, curve: bool) -> tuple[list[_Mode], int]:
        """Return the real configurations among all ends, and how many ends should be real and were closed to others.

        An end that does not close is not real, as near as it may come: there least squares end in a minimum.
        """
        linkage = self._linkage
        modes, lost = list[_Mode](), 0
        for end, solution, features in zip(*paths, strict=True):
            if end not in (ARRIVED, SINGULAR) or np.abs(features.imag).max(initial=0.0) > SAME:
                continue
            known = [k for k, mode in enumerate(modes) if np.abs(mode.features - features).max(initial=0.0) < SAME]
            if known:
                mode = modes[known[0]]
                modes[known[0]] = mode._replace(times=mode.times + 1, singular=mode.singular or end == SINGULAR)
                continue
            q = linkage.closed(linkage.configuration(solution, locked))
            if q is None:
                continue
            closed = linkage.features(linkage.unknowns(q)[None], locked)[0]
            if np.abs(closed - features).max(initial=0.0) < _FAR or (curve and end == SINGULAR):
                modes.append(_Mode(q, features, 1, end == SINGULAR))
            else:
                lost += 1
        return modes, lost

    # --- remarks ------------------------------------------------------------------------------------------------------

    def _status(self, fibre: Fibre, counts: SolutionCounts, curve: bool) -> tuple[bool, bool | None, list[str]]:
        """Return whether it is proved that these are all modes, the result of the trace test, and remarks.

        A family's bound proves it if as many solutions end at isolated points. With solutions at infinity it does so
        for two bodies only, where the solutions are those of a quadratic equation.
        """
        count, family = len(fibre.solutions), self._family
        solutions = counted(count, "complex solution")
        followed = counts.lost == 0 and not curve
        remarks = [f"{counts.lost} of {count} paths were lost"] if counts.lost else []
        if curve:
            remarks.append("these values leave it a curve of configurations, of which some points are listed")
        if fibre.loose:
            remarks.append("there are other configurations too, in which its actuated joints don't determine it")
        if family is not None and self._is_bound_reached(fibre):
            if not family.everywhere:
                method = f"{counted(count, 'mode')}, proved" if followed else solutions
                others = "modes in which it has rotated are not among them"
                return False, None, [f"{family.description}: {method}; {others}", *remarks]
            if counts.infinite and family.name != "dyad":
                remarks.append(f"{counts.infinite} are at infinity, and curves of configurations are not excluded")
                followed = False
            method = f"{family.description}: {solutions}, as many as there can be"
            return followed and not fibre.loose, None, [method, *remarks]
        if not self._linkage.passive:
            return True, None, ["there are no passive joints in its loops"]
        if not self._linkage.driving.any():
            start = f"no actuated joint moves its loops: {counted(count, 'solution')}, from {fibre.hits} random starts"
            return False, None, [start, *remarks]
        apart = f" in {fibre.parts} sets that no closed path has joined" if fibre.parts > 1 else ""
        done = [f"monodromy: {solutions}{apart}"]
        if fibre.quiet:
            done.append(f"the last {fibre.quiet} monodromy loops found no more")
        if fibre.traced.complete:
            done.append(f"trace test satisfied to {fibre.traced.deviation:.0e} (degree {fibre.traced.degree})")
        else:
            done.append("given up after the work that effort allows" if fibre.spent else "the trace test did not close")
        return False, fibre.traced.complete and followed, [*done, *remarks]

    def _closest(self, paths: PathEnds, locked: Array) -> NearestConfiguration:
        linkage = self._linkage
        home = linkage.unknowns(linkage.mechanism.q_home)
        starts = [home, *paths.solutions[paths.ends == ARRIVED][:_GUESSES]]
        return linkage.nearest([linkage.configuration(start, locked) for start in starts])
