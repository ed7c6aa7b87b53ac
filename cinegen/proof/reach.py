"""Boxes of poses without a configuration: a closed polygon of rods has none that is longer than all others together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.proof.equations import Equations

_MARGIN = 1e-9  # of the sum of lengths: for the checker


class _Rod(NamedTuple):
    """A part of a chain between two unknown rotations: its steps, and the placement of its end."""

    steps: list[list[int]]
    end: int


class ReachTest:
    """Tests whether there is any configuration: equation 8 of docs/proof.md.

    Args:
        equations: of a document.
        document: its JSON values.
    """

    def __init__(self, equations: Equations, document: Mapping[str, Any]) -> None:
        self._equations, variables = equations, document["variables"]
        slides = {k: i for i, k in enumerate(equations.unknown) if variables[k]["prismatic"]}
        self._turning = {*equations.unknown} - {*slides}
        is_limited = document["bounds"]["limits"]
        ends = {k: np.array([equations.lower[i], equations.upper[i]]) * equations.units[i] for k, i in slides.items()}
        self._ends = {k: pair for k, pair in ends.items() if is_limited and np.isfinite(pair).all()}
        endless = {*slides} - {*self._ends}
        self._polygons = [
            [self._rods(closure, side) for side in ("first", "second")]
            for closure in document["closures"]
            if len(closure["translations"]) == 3
            and not any(k in endless for side in ("first", "second") for _, k in closure[side])
        ]

    def _rods(self, closure: Mapping[str, Any], side: str) -> list[_Rod]:
        rods, steps = list[_Rod](), list[list[int]]()
        for index, k in closure[side]:
            if k in self._turning:
                rods.append(_Rod(steps, index))
                steps = []
            else:
                steps.append([index, k])
        return [*rods, _Rod(steps, closure[f"{side}_end"])]

    def excludes(self, low: Array, high: Array) -> Bools:
        """Return in which boxes (boxes,) no pose has a configuration.

        Args:
            low: (boxes, parameters) lower ends, m and rad.
            high: (boxes, parameters) upper ends.
        """
        e, excluded = self._equations, np.zeros(len(low), dtype=bool)
        values = e.values(np.tile(e.start, (len(low), 1)), 0.5 * (low + high))
        radius = np.zeros(values.shape)
        radius[:, e.over] = 0.5 * (high - low)
        for k, pair in self._ends.items():
            values[:, k], radius[:, k] = pair.mean(), 0.5 * np.ptp(pair)
        for sides in self._polygons:
            (a, *first), (b, *second) = ([e.placed(*rod, values, radius) for rod in side] for side in sides)
            rods = [(a[0] - b[0], a[1] + b[1]), *first, *second]
            shortest = np.array([np.linalg.norm(np.maximum(np.abs(m) - r, 0.0), axis=1) for m, r in rods])
            longest = np.array([np.linalg.norm(np.abs(m) + r, axis=1) for m, r in rods])
            excluded |= (shortest + longest).max(axis=0) > (1.0 + _MARGIN) * longest.sum(axis=0)
        return excluded
