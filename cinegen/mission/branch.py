"""Interpolation between two recorded configurations on their branch of the kinematics."""

from __future__ import annotations

import numpy as np

from cinegen.arrays import Array
from cinegen.errors import ClosureError
from cinegen.mission.file_format import MissionError
from cinegen.model import ForwardKinematics, Mechanism
from cinegen.tolerances import CLOSURE

_SAME = 1e-6  # rad or lengths: distance at which a configuration counts as reached
_JUMP = 0.5  # rad or lengths: a longer step that the actuated joints do not produce is a jump
_DETOUR = 0.25  # of the step: largest motion that closing the loops may add
_OPEN = 1e-3  # rad or lengths: a configuration that moves further when it is closed had open loops


class Branch:
    """Interpolates a recording of a mechanism on its branch (assembly mode).

    The actuated joints determine all others (`ForwardKinematics`), starting from each recorded configuration. If that
    does not reach the next configuration although it is near, the actuated joints do not determine the motion: it
    passes through a type 2 singularity, or the mechanism has uncontrolled DoF or redundant actuation. Then all joints
    are interpolated, and the loops closed.

    Args:
        mechanism: mechanism whose joints each have one number; ball joints have a quaternion.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._actuated = [mechanism.q_index(name) for name in mechanism.actuated]
        self._forward = ForwardKinematics(mechanism)

    def closed(self, q: Array) -> Array:
        """Return a recorded configuration (nq,) with closed loops, with unchanged actuated joints if possible.

        Raises:
            ClosureError: the recorded loops are open.
        """
        mechanism = self.mechanism
        if mechanism.closure(q) <= CLOSURE:
            return q
        try:
            closed = mechanism.close(q, mechanism.actuated)
        except ClosureError:
            closed = mechanism.close(q)
        if mechanism.distance(q, closed) > _OPEN:
            raise ClosureError(f"loops of {mechanism.name} are open by {mechanism.closure(q):.2g} (rad or lengths)")
        return closed

    def interpolate(self, first: Array, second: Array, along: Array) -> Array:
        """Return all joints between two recorded configurations.

        Args:
            first: (nq,) first configuration, closed.
            second: (nq,) second configuration, closed.
            along: (n, nq) interpolated joints without regard to loops; its actuated joints are kept.

        Returns:
            (n, nq) configurations with closed loops.

        Raises:
            MissionError: the second configuration is on another branch, and not near the first.
        """
        if not self.mechanism.is_constrained:
            return along
        try:
            self._forward.q = first
            configurations = [self._moved(q) for q in along]
            if self.mechanism.distance(self._moved(second), second) <= _SAME:
                return np.array(configurations).reshape(along.shape)
        except ClosureError:
            pass
        return self._interpolate_all(first, second, along)

    def _moved(self, q: Array) -> Array:
        values = zip(self.mechanism.actuated, q[self._actuated].tolist(), strict=True)
        return self._forward.move(dict(values))

    def _interpolate_all(self, first: Array, second: Array, along: Array) -> Array:
        step = self.mechanism.distance(first, second)
        middle = [self.mechanism.structure.normalized(first + x * (second - first)) for x in (0.25, 0.5, 0.75)]
        configurations = []
        for q in [*middle, *along]:
            try:
                closed = self.mechanism.close(q)
            except ClosureError:
                step = np.inf
                break
            if self.mechanism.distance(q, closed) > _DETOUR * step + _SAME:
                step = np.inf
                break
            configurations.append(closed)
        if step > _JUMP:
            raise MissionError("jumps to another branch, which its actuated joints can't reach")
        return np.array(configurations[len(middle) :]).reshape(along.shape)
