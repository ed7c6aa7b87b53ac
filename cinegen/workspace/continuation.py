"""`Continuation`: configurations at points of a map's region, each continued from one nearby."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import ClosureError
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.task import FrameTask
from cinegen.singularities.branch import BranchTracker
from cinegen.singularities.crossing import Rows, of_node
from cinegen.workspace.specification import MapSpecification

GOAL = 1e-10
"""rad or characteristic lengths: largest remaining error of a solution."""


class Continuation(BranchTracker):
    """Solves for configurations near given ones, within joint limits if the specification keeps to them.

    Args:
        spec: specification of the map.
    """

    def __init__(self, spec: MapSpecification) -> None:
        end = Rows(of_node(spec.mechanism, spec.node, sum(spec.counted)), spec.rank)
        super().__init__(spec.mechanism, end, spec.over_joints)
        self.spec = spec
        self.actuated = [spec.mechanism.q_index(name) for name in spec.mechanism.actuated]
        if not spec.over_joints:
            self._local = LocalIK(
                spec.mechanism, (FrameTask(spec.node, pin.SE3.Identity(), 3, spec.rotation),), spec.limits, True
            )

    def solve(self, target: pin.SE3, guess: Array) -> Array | None:
        """Return a configuration (nq,) near a guess (nq,) with the node at a target; None where there is none."""
        self._local.tasks[0].target = target
        return self._local.best if self._local.solve(guess, GOAL) else None

    def configuration(self, values: Array, guess: Array) -> Array | None:
        """Return a configuration (nq,) near a guess (nq,) at coordinates (axes,) of the region, m or rad; None
        where there is none."""
        region = self.spec.region
        if not self.spec.over_joints:
            points, rotations = region.poses(self.spec.home, values[None])
            return self.solve(pin.SE3(rotations[0], points[0]), guess)
        start = guess.copy()
        start[self.actuated] = region.joint_values(self.mechanism, values[None])[0]
        try:
            q = np.asarray(self.mechanism.close(start, self.mechanism.actuated))
        except ClosureError:
            return None
        return None if self.spec.limits and not self.mechanism.limits.within(q) else q
