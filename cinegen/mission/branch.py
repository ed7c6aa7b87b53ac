"""Between two recorded configurations: where all joints are while the motors go from the one to the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cinegen.errors import ClosureError
from cinegen.mission.file_format import MissionError
from cinegen.model import ForwardKinematics, Mechanism
from raff2urdf.closure import CLOSED

Array = NDArray[np.float64]

_SAME = 1e-6  # rad or lengths: motors that lead this near to a configuration lead to it
_LEAP = 0.5  # rad or lengths: what moves further from one sample to the next, and not by its motors, has leapt
_ASTRAY = 0.25  # part of the way that closing the loops may add
_OPEN = 1e-3  # rad or lengths: what moves further when its loops are closed was open


class Branch:
    """Leads a mechanism along a recording, on the branch that the recording is on: its assembly mode.

    The motors tell where all joints are (`ForwardKinematics`), beginning at each recorded configuration anew. Where
    that does not lead to the next one, though it is near, the motors alone don't determine the motion: it passes
    through a type 2 singularity there, or the mechanism has joints or motors in excess. Then all joints go the shortest
    way that the loops allow.

    Args:
        mechanism: each of whose joints is one number.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._motors = [mechanism.q_index(name) for name in mechanism.actuated]
        self._forward = ForwardKinematics(mechanism)
        self._scale = np.ones(mechanism.model.nq)
        for name in mechanism.joints:
            self._scale[mechanism.q_index(name)] = mechanism.scale[mechanism.v_index(name)]

    def far(self, first: Array, second: Array) -> float:
        """How far two configurations (nq,) are apart, in rad or characteristic lengths of one joint."""
        return float((np.abs(second - first) / self._scale).max(initial=0.0))

    def closed(self, q: Array) -> Array:
        """(nq,) a recorded configuration with its loops as closed as can be, the motors where they are if they can.

        Raises:
            ClosureError: its loops are open.
        """
        mechanism = self.mechanism
        if mechanism.closure(q) <= CLOSED:
            return q
        try:
            closed = mechanism.close(q, mechanism.actuated)
        except ClosureError:
            closed = mechanism.close(q)
        if self.far(q, closed) > _OPEN:
            raise ClosureError(f"loops of {mechanism.name} stand open by {mechanism.closure(q):.2g} (rad or lengths)")
        return closed

    def lead(self, first: Array, second: Array, along: Array) -> Array:
        """All joints on the way from one recorded configuration to the next.

        Args:
            first: (nq,) loops closed.
            second: (nq,) loops closed.
            along: (n, nq) where the joints would be if there were no loops; what it says of motors holds.

        Returns:
            (n, nq) loops closed.

        Raises:
            MissionError: the second is on another branch, and not beside the first.
        """
        if not self.mechanism.loops:
            return along
        try:
            self._forward.q = first
            found = [self._moved(q) for q in along]
            if self.far(self._moved(second), second) <= _SAME:
                return np.array(found).reshape(along.shape)
        except ClosureError:
            pass
        return self._beside(first, second, along)

    def _moved(self, q: Array) -> Array:
        motors = zip(self.mechanism.actuated, q[self._motors].tolist(), strict=True)
        return self._forward.move(dict(motors))

    def _beside(self, first: Array, second: Array, along: Array) -> Array:
        way = self.far(first, second)
        middle = [first + x * (second - first) for x in (0.25, 0.5, 0.75)]
        found = []
        for q in [*middle, *along]:
            try:
                closed = self.mechanism.close(q)
            except ClosureError:
                way = np.inf
                break
            if self.far(q, closed) > _ASTRAY * way + _SAME:
                way = np.inf
                break
            found.append(closed)
        if way > _LEAP:
            raise MissionError("leaps to another branch, where its motors can't lead it")
        return np.array(found[len(middle) :]).reshape(along.shape)
