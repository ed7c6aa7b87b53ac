"""`BranchTracker`: configurations over coordinates, continued from point to point on one branch, and the singularities
between two points; `flood` goes from point to neighbouring point of a grid."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.model import Mechanism
from cinegen.singularities.crossing import Crossing, Rows, crossings, of_passive_joints, turned

JUMP = 0.7
"""rad or characteristic lengths: a joint that moves further between neighbours may have changed branches."""

SINGULAR = 1e-4
"""A singular value up to this is 0, at a point or where its sign changes."""

_STEPS = (1, 4, 16)  # between two points, in as few as suffice


class BranchTracker(ABC):
    """Continues configurations of a mechanism along straight lines between points, given by coordinates in m and rad.

    Args:
        mechanism: with the coordinates.
        end: the motions of the node, singular at type 1.
        over_joints: whether the coordinates are actuated joints (else they are of a pose).

    Attributes:
        passive: the passive joints, singular at type 2; None where there are none.
    """

    def __init__(self, mechanism: Mechanism, end: Rows, over_joints: bool) -> None:
        self.mechanism, self.end, self.over_joints = mechanism, end, over_joints
        self.passive = of_passive_joints(mechanism) if mechanism.structure.passive_rank else None
        self._barrier = self.passive if over_joints else end  # branches meet where it is singular
        self._compared = np.ones(mechanism.model.nv, dtype=bool)  # joints whose step may be a jump
        if over_joints:
            self._compared[[mechanism.v_index(name) for name in mechanism.actuated]] = False

    @abstractmethod
    def configuration(self, values: Array, guess: Array) -> Array | None:
        """Return a configuration (nq,) near a guess (nq,) at coordinates (k,), m or rad; None where there is none."""

    def linked(self, q: Array, other: Array) -> bool:
        """Return whether no joint jumps between two configurations of neighbours; actuated joints that are coordinates
        don't count."""
        gaps = np.abs(self.mechanism.scaled_difference(q, other))
        return bool(gaps[self._compared].max(initial=0.0) <= JUMP)

    def same_branch(self, q: Array, other: Array) -> bool:
        """Return whether two configurations of neighbours count as one branch: no joint jumps, and no singular value
        of the coordinates (type 1 for a pose, type 2 for joints), where branches meet, changes its sign in between."""
        barrier = self._barrier
        return self.linked(q, other) and (barrier is None or not turned(barrier, barrier.of(q), barrier.of(other)))

    def near(self, values: Array, q: Array) -> Array | None:
        """Return the configuration (nq,) at coordinates (k,) to which no joint jumps from q (nq,); None without one."""
        end = self.configuration(values, q)
        return end if end is not None and self.linked(q, end) else None

    def step(self, values: Array, q: Array) -> Array | None:
        """Return the configuration (nq,) at coordinates (k,) on the branch of q (nq,); None without one."""
        end = self.configuration(values, q)
        return end if end is not None and self.same_branch(q, end) else None

    def onward(self, start: Array, goal: Array, q: Array) -> Array | None:
        """Return the configuration (nq,) at a neighbour's coordinates (k,), continued from q (nq,) at the start's in
        one step or in several; None if the branch ends."""
        for steps in _STEPS:
            current: Array | None = q
            for x in np.linspace(0.0, 1.0, steps + 1)[1:]:
                current = self.step(start + x * (goal - start), current) if current is not None else None
            if current is not None:
                return current
        return None

    def crossings(self, rows: Rows, start: Array, goal: Array, ends: tuple[Array, Array]) -> Iterator[Crossing]:
        """Find where a singular value changes its sign between two points (`crossing.crossings`).

        Args:
            rows: the matrix.
            start: (k,) coordinates of the first point, m or rad.
            goal: (k,) of the second.
            ends: configurations (nq,) at both.
        """

        def path(x: float) -> Array:
            if x in (0.0, 1.0):
                return ends[int(x)]
            middle = self.near(start + x * (goal - start), self.mechanism.interpolate(*ends, x))
            return middle if middle is not None else ends[x >= 0.5]

        return crossings(rows, path)

    def is_singular(self, rows: Rows, crossing: Crossing, ends: tuple[Array, Array]) -> bool:
        """Return whether the mechanism is singular at a crossing between two configurations: it is not where nothing
        closes between them, as where both types meet."""
        missing = crossing.x > 0.0 and any(crossing.q is q for q in ends)
        return not missing and bool(rows.sigma(rows.of(crossing.q)[None])[0] <= SINGULAR)


def flood(starts: Iterable[int], neighbours: Sequence[Iterable[int]], reach: Callable[[int, int], bool]) -> None:
    """Go from points to their neighbours, breadth first, as far as these can be reached.

    Args:
        starts: numbers of the points to begin at.
        neighbours: of each point; negative numbers are skipped.
        reach: called with a point and a neighbour; returns whether to continue from the neighbour.
    """
    waiting = deque(starts)
    while waiting:
        point = waiting.popleft()
        waiting += [neighbour for neighbour in neighbours[point] if neighbour >= 0 and reach(point, neighbour)]


def neighbours(shape: Sequence[int]) -> Indices:
    """Return (n, 2 axes) the numbers of the points next to each one of a grid, last axis fastest; -1 at the edge."""
    padded = np.pad(np.arange(math.prod(shape)).reshape(shape), 1, constant_values=-1)
    inner = (slice(1, -1),) * len(shape)
    return np.column_stack(
        [np.roll(padded, step, axis)[inner].ravel() for axis in range(len(shape)) for step in (1, -1)]
    )
