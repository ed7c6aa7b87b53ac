"""Complex assembly modes of a linkage at one general value of its locked joints, by monodromy, and their trace test.

Solutions that are continued along a closed path of complex joint values come back permuted, and so one finds others (T.
Duff, C. Hill, A. Jensen, K. Lee, A. Leykin, J. Sommars, "Solving polynomial systems via homotopy continuation and
monodromy", IMA J. Numerical Analysis 39, 2019). As the equations are real, the conjugate of a solution at the conjugate
values is a solution too, so half of a closed path suffices. Newton's method from random starts finds most of them
sooner, and what no path connects with home, as another mode of operation; of what it does not find, nothing is known.
The trace test shows that nothing is missing on the curves that were met. Neither excludes solutions on other curves,
nor branches on which the mechanism moves with its actuated joints locked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cinegen.assembly._kernels.tables import ARRIVED, SINGULAR, Complex
from cinegen.assembly.distinct_solutions import DistinctSolutions
from cinegen.assembly.linkage import Linkage
from cinegen.assembly.trace_test import TraceResult, TraceTest
from raff2urdf.errors import counted

_QUIET = 4  # closed paths without new solutions, after which none are expected
_QUIET_FEW = 24  # ... and paths of single solutions
_QUIET_BELOW = 40  # ... if it is known how many there can be, and there are fewer
_STARTS = 40  # of Newton's method, at a time
_SILENT = 4  # times without new solutions from these
_BUDGET = 4e9  # multiplications: about half a minute
_TRACES = 3
_JOINS = 12  # closed paths by which solutions may still turn out to be on one curve
_MOST = 1000  # solutions: there may be a curve of them
_ATTEMPTS = 20


@dataclass(frozen=True, eq=False)
class Fibre:
    """All solutions found at one general, complex value of the locked joints.

    Attributes:
        locked: (locked,) complex.
        solutions: (count, k + 1).
        traced: result of the trace test; of degree 0 if it was not done.
        quiet: number of monodromy loops in succession without new solutions, at the end.
        parts: number of sets of solutions that no closed path has joined: of as many curves, or of fewer.
        hits: number of random starts that converged to a solution.
        loose: number of random starts that converged to where locked joints don't determine the mechanism.
        spent: whether it was ended because it took too long, or found too many.
    """

    locked: Complex
    solutions: Complex
    traced: TraceResult
    quiet: int
    parts: int
    hits: int
    loose: int
    spent: bool


class Monodromy:
    """Finds a fibre of a linkage: all solutions at one general value of its locked joints.

    Args:
        linkage: to solve.
        bound: largest number of solutions, if known: no more are looked for then.
        seed: of the random numbers.
        report: called with a sentence on the progress.
        effort: how much may be done, 1 being about half a minute.
    """

    def __init__(
        self, linkage: Linkage, bound: int | None = None, seed: int = 0, report: Callable[[str], None] | None = None,
        effort: float = 1.0,
    ) -> None:  # fmt: skip
        self._linkage, self._bound, self._report = linkage, bound, report or (lambda _: None)
        self._rng = np.random.default_rng(seed)
        self._home = linkage.locked_values(linkage.mechanism.q_home)
        self._most = linkage.work + effort * _BUDGET
        self._full = False
        self._hits = self._loose = self._quiet = 0
        self._joined: dict[int, int] = {}  # a solution, and one on the same curve
        self._locked = self._general()

    def fibre(self, everywhere: bool = True) -> Fibre:
        """Find all solutions; do the trace test unless there are as many as there can be.

        Args:
            everywhere: looks also for modes that no path connects with home, by random starts.
        """
        modes = self._first()
        if everywhere:
            self._guess(modes)
        self._follow_loops(modes)
        while everywhere and self._guess(modes):
            self._follow_loops(modes)
        traced, enough = TraceResult(False, 0, modes.array[:0]), self._enough(modes)
        parts = 1 if enough else self._parts(modes)
        if not enough and self._linkage.driving.any():
            traced = self._trace(modes)
        return Fibre(self._locked, modes.array, traced, self._quiet, parts, self._hits, self._loose, self._spent())

    def _enough(self, modes: DistinctSolutions) -> bool:
        return self._bound is not None and len(modes) >= self._bound

    def _spent(self) -> bool:
        return self._full or self._linkage.work > self._most

    def _general(self) -> Complex:
        """Return values (locked,) about home, and off the real axis; far enough to go around branch points."""
        real, imaginary = self._rng.normal(size=(2, len(self._home)))
        far = self._rng.choice([1.0, 3.0])
        step = np.where(self._linkage.revolute, 1.6 * real + 0.7j * far * imaginary, far * (real + 1j * imaginary))
        return np.asarray(self._home + step * self._linkage.driving)

    def _first(self) -> DistinctSolutions:
        """Continue home, or else another closed configuration, to the general values."""
        linkage = self._linkage
        for attempt in range(_ATTEMPTS):  # a path may fail, as home may be singular
            q = linkage.mechanism.structure.samples[attempt % len(linkage.mechanism.structure.samples)]
            modes = DistinctSolutions(lambda solutions: linkage.features(solutions, self._locked))
            path = linkage.straight(linkage.locked_values(q), self._locked)
            if modes.add(linkage.track(linkage.unknowns(q)[None], path).arrived):
                return modes
            self._locked = self._general()
        return modes

    def _follow_loops(self, modes: DistinctSolutions) -> None:
        """Follow closed paths until they find nothing new."""
        self._quiet = 0
        while len(modes) and self._quiet < self._patience(len(modes)) and not (self._enough(modes) or self._spent()):
            self._quiet = 0 if self._follow_loop(modes) else self._quiet + 1
            self._report(f"{counted(len(modes), 'mode')} found by closed paths")

    def _patience(self, count: int) -> int:
        """Return how many closed paths may find nothing new."""
        return _QUIET_BELOW if self._bound is not None else max(_QUIET, _QUIET_FEW // count)

    def _follow_loop(self, modes: DistinctSolutions) -> int:
        """Continue all solutions to the conjugate values and conjugate them; return how many are new."""
        linkage, away, before = self._linkage, self._general(), len(modes)
        tracked = linkage.track(modes.array, linkage.straight(self._locked, away))
        back = linkage.track(tracked.solutions, linkage.straight(away, self._locked.conj()))
        arrived = (tracked.ends == ARRIVED) & (back.ends == ARRIVED)
        for begun, came in zip(np.flatnonzero(arrived), modes.indices(back.solutions[arrived].conj()), strict=True):
            self._joined[self._curve(int(begun))] = self._curve(came)
        self._full = len(modes) > _MOST
        return len(modes) - before

    def _parts(self, modes: DistinctSolutions) -> int:
        """Return in how many sets the solutions are that a few more closed paths don't join."""
        for attempt in range(_JOINS + 1):
            parts = len({self._curve(k) for k in range(len(modes))})
            if parts < 2 or attempt == _JOINS or self._spent():
                break
            self._follow_loop(modes)
        return parts

    def _curve(self, k: int) -> int:
        """Return one of the solutions known to be on the same curve as solution k: the same for each of them."""
        while self._joined.get(k, k) != k:
            k = self._joined[k]
        return k

    def _guess(self, modes: DistinctSolutions) -> int:
        """Apply Newton's method from random starts, until it finds nothing new; return how many are new."""
        linkage, before, silent = self._linkage, len(modes), 0
        while silent < _SILENT and not (self._enough(modes) or self._spent()):
            guesses, ends = linkage.newton(linkage.random_unknowns(self._rng, _STARTS, 0.5), self._locked)
            guessed, self._loose = guesses[ends == ARRIVED], self._loose + int((ends == SINGULAR).sum())
            self._hits += len(guessed)
            silent = 0 if modes.add(guessed) else silent + 1
            self._full = len(modes) > _MOST
        return len(modes) - before

    def _trace(self, modes: DistinctSolutions) -> TraceResult:
        """Do the trace test; add solutions that it finds."""
        linkage, traced = self._linkage, TraceResult(False, 0, modes.array[:0])
        for _ in range(_TRACES):
            test = TraceTest(linkage, self._home, self._rng, self._spent, self._report)
            tracked = linkage.track(modes.array, linkage.straight(self._locked, test.locked))
            traced = test.run(tracked.arrived)
            if traced.complete:
                back = linkage.track(traced.solutions, linkage.straight(test.locked, self._locked))
                modes.add(back.arrived)
                traced = traced._replace(complete=len(modes) == len(traced.solutions))
            if traced.complete or self._spent():
                break
        return traced
