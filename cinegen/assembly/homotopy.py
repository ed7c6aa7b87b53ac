"""`Homotopy`: modes of any linkage, from a fibre of solutions that are led to the values asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cinegen.assembly._kernels import ARRIVED, INFINITE, LOST, SINGULAR, Complex
from cinegen.assembly.distinct import SAME
from cinegen.assembly.endgame import Ends, ends
from cinegen.assembly.families import Family
from cinegen.assembly.found import Approach, Found, Paths, closed, nearest
from cinegen.assembly.linkage import Array, Linkage
from cinegen.assembly.monodromy import Fibre, Monodromy
from raff2urdf.closure import CLOSED

_TRIES = 4  # ways to the values asked for
_FAR = 1e-4  # closing what is real moves features less
_GUESSES = 8  # complex solutions whose real parts may come near


class _Mode(NamedTuple):
    """A configuration (nq,), its features (3 f,), and how many solutions are there."""

    q: Array
    features: Complex
    times: int


class Homotopy:
    """Solves a linkage for one set of values of its motors after another.

    Args:
        linkage: whose.
        family: what it was recognised as, if anything.
    """

    def __init__(self, linkage: Linkage, family: Family | None) -> None:
        self._linkage, self._family = linkage, family
        self._fibre: Fibre | None = None
        self._effort = 0.0

    def modes(self, motors: Array, say: Callable[[str], None] | None, effort: float) -> Found:
        """All modes with the motors at (motors,), without unit."""
        fibre = self._known(say, effort)
        led = self._led(fibre, motors)
        curve = any(self._linkage.can_move(solution, motors) for solution in led.solutions[led.kinds == SINGULAR])
        modes, lost = self._real(led, motors, curve)
        real = sum(mode.times for mode in modes)
        infinite, missing = led.count(INFINITE), led.count(LOST) + lost
        paths = Paths(
            real=real,
            complex=len(led.kinds) - real - infinite - missing,
            infinite=infinite,
            multiple=led.count(SINGULAR),
            lost=missing,
        )
        complete, trace_test, words = self._status(fibre, paths, curve)
        closest = None if modes else self._closest(led, motors)
        if closest is not None and closest.gap <= CLOSED:  # a point of a curve, whose paths ended in complex points
            return Found((closest.q,), (1,), False, words, paths, None, None if trace_test is None else False)
        configurations = tuple(mode.q for mode in modes)
        times = tuple(mode.times for mode in modes)
        return Found(configurations, times, complete, words, paths, closest, trace_test)

    def _known(self, say: Callable[[str], None] | None, effort: float) -> Fibre:
        """The fibre, found once; again where more may be done than when it was given up."""
        if self._fibre is None or (self._fibre.spent and effort > self._effort):
            bound = self._family.bound if self._family is not None else None
            everywhere = self._family is None or self._family.everywhere
            monodromy = Monodromy(self._linkage, bound, say=say, effort=effort)
            self._fibre, self._effort = monodromy.fibre(everywhere), effort
        return self._fibre

    # --- paths ---------------------------------------------------------------------------------------------------

    def _led(self, fibre: Fibre, motors: Array) -> Ends:
        """How all solutions of the fibre end; where some are lost, another way is gone with all of them: a way round
        branch points changes which one ends where."""
        linkage, rng = self._linkage, np.random.default_rng(1)
        best = ends(linkage, fibre.solutions, fibre.motors, motors)
        for _ in range(_TRIES - 1):
            if not best.count(LOST):
                break
            detour = fibre.motors + 0.2 * (rng.normal(size=len(motors)) + 1j * rng.normal(size=len(motors)))
            way = linkage.way(fibre.motors, detour)._replace(accuracy=1e-6)
            led = linkage.lead(fibre.solutions, way)
            if not (led.ends == ARRIVED).all():
                continue
            again = ends(linkage, led.solutions, detour, motors)
            if again.count(LOST) < best.count(LOST):
                best = again
        return best

    def _real(self, led: Ends, motors: Array, curve: bool) -> tuple[list[_Mode], int]:
        """The real configurations among all ends, and how many ends should be real and were closed to others.

        What does not close is not real, as near as it may come: there least squares come to a minimum.
        """
        linkage = self._linkage
        modes, lost = list[_Mode](), 0
        for kind, solution, features in zip(*led, strict=True):
            if kind not in (ARRIVED, SINGULAR) or np.abs(features.imag).max(initial=0.0) > SAME:
                continue
            known = [k for k, mode in enumerate(modes) if np.abs(mode.features - features).max(initial=0.0) < SAME]
            if known:
                modes[known[0]] = modes[known[0]]._replace(times=modes[known[0]].times + 1)
                continue
            q = closed(linkage, linkage.configuration(solution, motors))
            if q is None:
                continue
            there = linkage.features(linkage.unknowns(q)[None], motors)[0]
            if np.abs(there - features).max(initial=0.0) < _FAR or (curve and kind == SINGULAR):
                modes.append(_Mode(q, features, 1))
            else:
                lost += 1
        return modes, lost

    # --- words ---------------------------------------------------------------------------------------------------

    def _status(self, fibre: Fibre, paths: Paths, curve: bool) -> tuple[bool, bool | None, str]:
        """Return whether it is proved that these are all modes, what the trace test says, and a message.

        A family's bound proves it where as many solutions end at isolated points. With solutions at infinity it does
        so for two bodies only, where the solutions are those of a quadratic equation.
        """
        count, family = len(fibre.solutions), self._family
        followed = paths.lost == 0 and not curve
        beside = [f"; {paths.lost} of {count} paths were lost"] if paths.lost else []
        if curve:
            beside.append("; these values leave it a curve of configurations, of which some points are listed")
        if fibre.loose:
            beside.append("; there are other configurations too, in which its motors don't determine it")
        rest = "".join(beside)
        if family is not None and count >= family.bound:
            if not family.everywhere:
                words = f"{count} modes, proved; modes in which it has turned are not among them"
                return False, None, f"{family.words}: {words}{rest}"
            if paths.infinite and family.name != "dyad":
                rest += f"; {paths.infinite} are at infinity, and curves of configurations are not excluded"
                followed = False
            words = f"{count} complex solutions, as many as there can be"
            return followed and not fibre.loose, None, f"{family.words}: {words}{rest}"
        if not self._linkage.passive:
            return True, None, "there is nothing but motors to move"
        if not self._linkage.leading.any():
            return False, None, f"no motor moves its loops: {count} solutions, from {fibre.hits} random starts{rest}"
        apart = f" in {fibre.parts} sets that no closed path has joined" if fibre.parts > 1 else ""
        done = [f"monodromy: {count} complex solutions{apart}"]
        if fibre.quiet:
            done.append(f"the last {fibre.quiet} monodromy loops found no more")
        if fibre.complete:
            done.append(f"trace test satisfied to {fibre.deviation:.0e} (degree {fibre.degree})")
        else:
            done.append("given up after the work that effort allows" if fibre.spent else "the trace test did not close")
        done.append("not excluded: solutions on curves that nothing met, and branches of free motion")
        return False, fibre.complete and followed, "; ".join(done) + rest

    def _closest(self, led: Ends, motors: Array) -> Approach:
        linkage = self._linkage
        home = linkage.unknowns(linkage.mechanism.q_home)
        starts = [home, *led.solutions[led.kinds == ARRIVED][:_GUESSES]]
        return nearest(linkage, [linkage.configuration(start, motors) for start in starts])
