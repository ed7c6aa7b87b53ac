"""Complex assembly modes of a linkage at one general value of its motors, by monodromy, and the trace test of them.

Solutions that are led along a closed path of complex motor values come back permuted, and so one finds others (T. Duff,
C. Hill, A. Jensen, K. Lee, A. Leykin, J. Sommars, "Solving polynomial systems via homotopy continuation and monodromy",
IMA J. Numerical Analysis 39, 2019). Equations are real: what comes to the conjugate values is, conjugated, a solution
too, so half of a closed path does. Newton's method from random starts finds most of them sooner, and what no path leads
to from home, as another mode of operation; what it does not find, it knows nothing of. The trace test shows that
nothing is missing on the curves that were met. Neither excludes solutions on other curves, nor branches on which the
mechanism moves while its motors are held.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cinegen.assembly._kernels import ARRIVED, Complex
from cinegen.assembly.distinct import Distinct
from cinegen.assembly.linkage import Linkage
from cinegen.assembly.trace import Trace, Traced

_QUIET = 4  # closed paths that found nothing new, until it is believed that nothing is to be found
_QUIET_FEW = 24  # ... and paths of single solutions
_QUIET_BELOW = 40  # ... where it is known how many there can be, and there are fewer
_STARTS = 40  # of Newton's method, at a time
_SILENT = 4  # times that nothing new came of them
_BUDGET = 4e9  # multiplications: about half a minute
_TRACES = 3
_JOINS = 12  # ways round on which solutions may still turn out to be on one curve
_MOST = 1000  # solutions: there may be a curve of them
_TRIES = 20


@dataclass(frozen=True, eq=False)
class Fibre:
    """All solutions found at one general, complex value of the motors.

    Attributes:
        motors: (motors,) complex.
        solutions: (count, k + 1).
        complete: whether the trace test says that there are no others on the curves that were found.
        degree: of these curves: how many points the trace test led; 0 where it was not done.
        deviation: of the trace from an affine function, relative; NaN where the test was not done or did not close.
        quiet: how many monodromy loops in succession found nothing new at the end.
        parts: in how many sets they are that no closed path has joined: of as many curves, or of fewer.
        hits: how many random starts came to a solution.
        loose: how many came to where motors don't determine the mechanism.
        spent: whether it was ended because it took too long, or found too many.
    """

    motors: Complex
    solutions: Complex
    complete: bool
    degree: int
    deviation: float
    quiet: int
    parts: int
    hits: int
    loose: int
    spent: bool


class Monodromy:
    """Finds a fibre of a linkage: all solutions at one general value of its motors.

    Args:
        linkage: whose.
        bound: how many there are at most, where that is known: no more are looked for then.
        seed: of the random numbers.
        say: is told how far it is: a sentence.
        effort: how much may be done, 1 being about half a minute.
    """

    def __init__(
        self, linkage: Linkage, bound: int | None = None, seed: int = 0, say: Callable[[str], None] | None = None,
        effort: float = 1.0,
    ) -> None:  # fmt: skip
        self.linkage, self.bound, self._say = linkage, bound, say or (lambda _: None)
        self._rng = np.random.default_rng(seed)
        self._home = linkage.motor_values(linkage.mechanism.q_home)
        self._most = linkage.work + effort * _BUDGET
        self._full = False
        self._hits = self._loose = self._quiet = 0
        self._joined: dict[int, int] = {}  # a solution, and one on the same curve
        self.motors = self._general()

    def fibre(self, everywhere: bool = True) -> Fibre:
        """All solutions, and whether they are: the trace test is done unless there are as many as there can be.

        Args:
            everywhere: looks also for modes that no path leads to from home, by random starts.
        """
        found = self._begun()
        if everywhere:
            self._guess(found)
        self._follow_paths(found)
        while everywhere and self._guess(found):
            self._follow_paths(found)
        traced = Traced(False, 0, found.array[:0])
        parts = 1 if self._enough(found) else self._parts(found)
        if not self._enough(found) and self.linkage.leading.any():
            traced = self._traced(found)
        return Fibre(
            self.motors, found.array, traced.complete, traced.degree, traced.deviation, self._quiet, parts, self._hits,
            self._loose, self._spent(),
        )  # fmt: skip

    def _enough(self, found: Distinct) -> bool:
        return self.bound is not None and len(found) >= self.bound

    def _spent(self) -> bool:
        return self._full or self.linkage.work > self._most

    def _general(self) -> Complex:
        """(motors,) somewhere about home, and off the real axis; far enough to go round branch points."""
        real, imaginary = self._rng.normal(size=(2, len(self._home)))
        far = self._rng.choice([1.0, 3.0])
        turned, slid = 1.6 * real + 0.7j * far * imaginary, far * (real + 1j * imaginary)
        return np.asarray(self._home + np.where(self.linkage.turning, turned, slid) * self.linkage.leading)

    def _begun(self) -> Distinct:
        """What home, or else another closed configuration, becomes."""
        linkage = self.linkage
        for attempt in range(_TRIES):  # a path may fail, as home may be singular
            q = linkage.mechanism.samples[attempt % len(linkage.mechanism.samples)]
            found = Distinct(lambda solutions: linkage.features(solutions, self.motors))
            start = linkage.unknowns(q)[None]
            if found.add(linkage.lead(start, linkage.way(linkage.motor_values(q), self.motors)).arrived):
                return found
            self.motors = self._general()
        return found

    def _follow_paths(self, found: Distinct) -> None:
        """Goes round until nothing new comes of it."""
        self._quiet = 0
        while len(found) and self._quiet < self._patience(len(found)) and not (self._enough(found) or self._spent()):
            self._quiet = 0 if self._go_round(found) else self._quiet + 1
            self._say(f"{len(found)} modes found by closed paths")

    def _go_round(self, found: Distinct) -> int:
        """Leads all solutions to the conjugate motor values and conjugates them; how many are new."""
        linkage, away, before = self.linkage, self._general(), len(found)
        there = linkage.lead(found.array, linkage.way(self.motors, away))
        back = linkage.lead(there.solutions, linkage.way(away, self.motors.conj()))
        arrived = (there.ends == ARRIVED) & (back.ends == ARRIVED)
        for begun, came in zip(np.flatnonzero(arrived), found.places(back.solutions[arrived].conj()), strict=True):
            self._join(int(begun), came)
        self._full = len(found) > _MOST
        return len(found) - before

    def _parts(self, found: Distinct) -> int:
        """In how many sets the solutions are that going round, a few more times, does not join."""
        for attempt in range(_JOINS + 1):
            parts = len({self._curve(k) for k in range(len(found))})
            if parts < 2 or attempt == _JOINS or self._spent():
                break
            self._go_round(found)
        return parts

    def _patience(self, count: int) -> int:
        """How many closed paths may find nothing new."""
        return _QUIET_BELOW if self.bound is not None else max(_QUIET, _QUIET_FEW // count)

    def _curve(self, k: int) -> int:
        """One of the solutions that are on the same curve as solution k, as far as is known: the same of each."""
        while self._joined.get(k, k) != k:
            k = self._joined[k]
        return k

    def _join(self, first: int, second: int) -> None:
        self._joined[self._curve(first)] = self._curve(second)

    def _guess(self, found: Distinct) -> int:
        """Newton's method from random starts, until nothing new comes of it; how many are new. That costs little, but
        nothing is known of what it does not find."""
        linkage, before, silent = self.linkage, len(found), 0
        while silent < _SILENT and not (self._enough(found) or self._spent()):
            guessed, beside = linkage.settled(linkage.random(self._rng, _STARTS), linkage.at(self.motors))
            self._hits, self._loose = self._hits + len(guessed), self._loose + beside
            silent = 0 if found.add(guessed) else silent + 1
            self._full = len(found) > _MOST
        return len(found) - before

    def _traced(self, found: Distinct) -> Traced:
        """The trace test; solutions that it found are added."""
        linkage, traced = self.linkage, Traced(False, 0, found.array[:0])
        for _ in range(_TRACES):
            trace = Trace(linkage, self._home, self._rng, self._spent, self._say)
            traced = trace.test(linkage.lead(found.array, linkage.way(self.motors, trace.motors)).arrived)
            if traced.complete:
                found.add(linkage.lead(traced.solutions, linkage.way(trace.motors, self.motors)).arrived)
                traced = traced._replace(complete=len(found) == len(traced.solutions))
            if traced.complete or self._spent():
                break
        return traced
