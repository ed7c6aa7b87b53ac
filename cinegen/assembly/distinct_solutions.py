"""Solutions that differ, collected along paths."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cinegen.assembly._kernels.tables import Complex

SAME = 1e-6
"""Features (characteristic lengths, relative to their size where that is larger) closer than this are the same."""


class DistinctSolutions:
    """Solutions that differ in their features, in the order in which they were found.

    Args:
        features: returns the features (count, f) of solutions (count, k + 1).
    """

    def __init__(self, features: Callable[[Complex], Complex]) -> None:
        self._features, self._known, self._solutions = features, list[Complex](), list[Complex]()

    def __len__(self) -> int:
        return len(self._solutions)

    @property
    def array(self) -> Complex:
        """The solutions (count, k + 1)."""
        return np.array(self._solutions) if self._solutions else np.zeros((0, 0), dtype=complex)

    def add(self, solutions: Complex) -> int:
        """Add those of solutions (count, k + 1) that are new; return how many."""
        before = len(self)
        self.indices(solutions)
        return len(self) - before

    def indices(self, solutions: Complex) -> list[int]:
        """Add those of solutions (count, k + 1) that are new; return where in `array` each is, -1 if it isn't
        finite."""
        indices = []
        for solution, its in zip(solutions, self._features(solutions) if len(solutions) else (), strict=True):
            if not np.isfinite(its).all():
                indices.append(-1)
                continue
            known = np.array(self._known).reshape(len(self), len(its))
            size = np.maximum(np.abs(known).max(axis=1, initial=1.0), np.abs(its).max(initial=1.0))
            same = np.flatnonzero(np.abs(known - its).max(axis=1, initial=0.0) < SAME * size)
            indices.append(int(same[0]) if len(same) else len(self))
            if not len(same):
                self._known.append(its)
                self._solutions.append(solution)
        return indices
