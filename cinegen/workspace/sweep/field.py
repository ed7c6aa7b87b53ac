"""`Field`: a mechanism led all over a box, from point to neighbouring point."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.crossing import Rows, of_node, of_passive_joints, turned
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.sweep.lattice import Lattice
from cinegen.workspace.sweep.ways import JUMP, Ways

Array = NDArray[np.float64]

_LOW = 0.1  # above it, neighbours that are near are on one branch


class Field:
    """Configurations at all points of a box, led from neighbour to neighbour, on one branch as far as that goes.

    Args:
        specification: of the map.
        lattice: the points.
        configurations: (cells along each axis.., nq) of the cells that the box touches, not a number where the map has
            none: their middles are not looked at.

    Attributes:
        q: (n, nq) at each point; not a number where it is not led to.
        parts: how many branches it is on, or parts of one with nothing between them.
        ways: between the points.
        end: how the node moves, singular at type 1.
        passive: of the passive joints, singular at type 2; None where there are none.
        redundant: whether the mechanism can be at a point in infinitely many ways.
    """

    def __init__(self, spec: MapSpecification, lattice: Lattice, configurations: Array) -> None:
        mechanism = spec.mechanism
        self.spec, self.lattice = spec, lattice
        self.ways = Ways(spec, np.concatenate([lattice.values, spec.region.values(lattice.cells)]))
        self.end = Rows(of_node(mechanism, spec.node, sum(spec.counted)), spec.rank)
        self.passive = of_passive_joints(mechanism) if mechanism.passive_rank else None
        self._barrier = self.passive if spec.of_motors else self.end  # what branches meet at
        self.redundant = not spec.of_motors and spec.freedoms > spec.rank
        self._given, self._open = self._known(configurations.reshape(-1, configurations.shape[-1]))
        self.q, self.parts = np.full_like(self._given, np.nan), 0
        self._lead()

    @property
    def reached(self) -> NDArray[np.bool_]:
        """(n,) whether each point is."""
        return np.isfinite(self.q[:, 0])

    def end_of(self, one: int, other: int) -> Array | None:
        """Where one point's configuration leads to at a neighbour: what is known there, unless the mechanism can go
        there in many ways; None where that is on another branch."""
        known: Array = self.q[other]
        if self.ways.away(self.q[one], known) <= JUMP:
            return known
        led = self.ways.onward(self.q[one], one, other, self._same_branch)
        if led is None or not (self.redundant or self.ways.same(led, known)):
            return None
        return led

    # --- leading -------------------------------------------------------------------------------------------------

    def _known(self, configurations: Array) -> tuple[Array, NDArray[np.bool_]]:
        """(n, nq) what the map knows, and (n,) which points may be led to: not what it knows not to be reached."""
        lattice = self.lattice
        known, may = np.full((lattice.size, configurations.shape[1]), np.nan), np.ones(lattice.size, dtype=bool)
        known[lattice.middles] = configurations
        reached = np.isfinite(configurations[:, 0])
        may[lattice.middles] = reached | lattice.cut
        for cell in np.flatnonzero(reached & lattice.cut).tolist():
            point = int(lattice.middles[cell])
            found = self.ways.onward(configurations[cell], lattice.size + cell, point, self._same_branch)
            known[point] = np.nan if found is None else found
        return known, may

    def _lead(self) -> None:
        """A configuration for each point that has one, led from its neighbour where that can be."""
        near: list[list[int]] = [[] for _ in self._given]
        for one, other in self.lattice.edges.tolist():
            near[one].append(other)
            near[other].append(one)
        for first in np.flatnonzero(np.isfinite(self._given[:, 0])).tolist():
            if np.isfinite(self.q[first, 0]):
                continue
            self.parts += 1
            self.q[first] = self._given[first]
            waiting = deque([first])
            while waiting:
                here = waiting.popleft()
                for there in near[here]:
                    if self._open[there] and not np.isfinite(self.q[there, 0]):
                        found = self._step(here, there)
                        if found is not None:
                            self.q[there] = found
                            waiting.append(there)

    def _step(self, one: int, other: int) -> Array | None:
        q: Array = self.q[one]
        known: Array = self._given[other]
        if np.isfinite(known[0]) and self.ways.away(q, known) <= JUMP and self._same_branch(q, known):
            return known
        return self.ways.onward(q, one, other, self._same_branch)

    def _same_branch(self, q: Array, other: Array) -> bool:
        if self._barrier is None:
            return True
        a, b = self._barrier.of(q), self._barrier.of(other)
        if self._barrier.sigma(np.array([a, b])).min() > _LOW:
            return True
        return not turned(self._barrier, a, b)
