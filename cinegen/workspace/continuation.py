"""`Continuation`: configurations at points of a map's region, each continued from one nearby; `flood` goes from point
to neighbouring point."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.errors import ClosureError
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.task import FrameTask
from cinegen.workspace.specification import MapSpecification

Array = NDArray[np.float64]

JUMP = 0.7
"""rad or characteristic lengths: a joint that moves further between neighbours may have changed branches."""

GOAL = 1e-10
"""rad or characteristic lengths: largest remaining error of a solution."""


def flood(starts: Iterable[int], neighbours: Sequence[Iterable[int]], reach: Callable[[int, int], bool]) -> None:
    """Go from points to their neighbours, breadth first, as far as these can be reached.

    Args:
        starts: numbers of the points to begin at.
        neighbours: of each point; negative numbers are skipped.
        reach: called with a point and a neighbour; returns whether to continue from the neighbour.
    """
    waiting = deque(starts)
    while waiting:
        here = waiting.popleft()
        waiting += [there for there in neighbours[here] if there >= 0 and reach(here, there)]


class Continuation:
    """Solves for configurations near given ones, within joint limits if the specification keeps to them.

    Args:
        spec: specification of the map.
    """

    def __init__(self, spec: MapSpecification) -> None:
        self.spec, self.mechanism = spec, spec.mechanism
        self.actuated = [spec.mechanism.q_index(name) for name in spec.mechanism.actuated]
        if not spec.over_joints:
            self._local = LocalIK(
                spec.mechanism, (FrameTask(spec.node, pin.SE3.Identity(), 3, spec.rotation),), spec.limits
            )

    def solve(self, target: pin.SE3, guess: Array) -> Array | None:
        """Return a configuration (nq,) near a guess (nq,) with the node at a target; None where there is none."""
        self._local.tasks[0].target = target
        return self._local.best if self._local.solve(guess, GOAL) else None

    def at(self, values: Array, guess: Array) -> Array | None:
        """Return a configuration (nq,) near a guess (nq,) at coordinates (axes,) of the region; None where there is
        none."""
        region = self.spec.region
        if not self.spec.over_joints:
            points, rotations = region.poses(self.spec.home, values[None])
            return self.solve(pin.SE3(rotations[0], points[0]), guess)
        start = guess.copy()
        start[self.actuated] = region.joint_values(self.mechanism, values[None])[0]
        try:
            found = np.asarray(self.mechanism.close(start, self.mechanism.actuated))
        except ClosureError:
            return None
        return None if self.spec.limits and not self.mechanism.limits.within(found) else found
