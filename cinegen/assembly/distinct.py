"""`Distinct`: solutions that differ."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cinegen.assembly._kernels import Complex

SAME = 1e-6
"""Features (characteristic lengths, of their size where that is larger) closer than this are the same."""


class Distinct:
    """Solutions that differ in their features, in the order in which they were found.

    Args:
        features: (count, f) of solutions (count, k + 1).
    """

    def __init__(self, features: Callable[[Complex], Complex]) -> None:
        self._features = features
        self._known: Complex | None = None
        self.array: Complex = np.zeros((0, 0), dtype=complex)

    def __len__(self) -> int:
        return len(self.array)

    def add(self, solutions: Complex) -> int:
        """Takes those of solutions (count, k + 1) that are new; how many."""
        before = len(self)
        self.places(solutions)
        return len(self) - before

    def places(self, solutions: Complex) -> list[int]:
        """Takes what is new of solutions (count, k + 1); which of `array` each is, -1 for what is not finite."""
        if not len(solutions):
            return []
        features = self._features(solutions)
        if self._known is None:
            self._known = np.zeros((0, features.shape[1]), dtype=complex)
            self.array = np.zeros((0, solutions.shape[1]), dtype=complex)
        found = []
        for solution, its in zip(solutions, features, strict=True):
            if not np.isfinite(its).all():
                found.append(-1)
                continue
            known = np.flatnonzero(same(self._known, its))
            found.append(int(known[0]) if len(known) else len(self))
            if not len(known):
                self._known = np.vstack([self._known, its])
                self.array = np.vstack([self.array, solution])
        return found


def same(known: Complex, features: Complex) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """(count,) which of the features (count, f) are these (f,)."""
    if not len(known) or not known.shape[1]:
        return np.ones(len(known), dtype=bool)
    size = np.maximum(1.0, np.maximum(np.abs(known).max(axis=1), np.abs(features).max()))
    return np.asarray(np.abs(known - features).max(axis=1) < SAME * size)
