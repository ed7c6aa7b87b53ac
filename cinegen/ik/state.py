"""State of a solver, for tasks in Python, objectives and barriers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.joints import kinematic_data
from cinegen.model import Mechanism
from raff2urdf.residual import skew

_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_CROSS = -np.stack([skew(axis) for axis in np.eye(3)], axis=-1)
"""(_CROSS @ r) @ w = w x r."""


class State:
    """Configuration at which a task, an objective or a barrier is evaluated: that of a tick, or one that it tries.

    Args:
        mechanism: mechanism that moves.
        q: (nq,) configuration.
        dt: period of the tick, s.
        tasks: tasks of the solver.
        data: Pinocchio's data to use; new data unless given.

    Attributes:
        mechanism: mechanism that moves.
        q: (nq,) configuration.
        dt: period of the tick, s.
        tasks: tasks of the solver.
    """

    __slots__ = ("_data", "_is_evaluated", "dt", "mechanism", "q", "tasks")

    def __init__(
        self, mechanism: Mechanism, q: Array, dt: float, tasks: Sequence[Any] = (), data: pin.Data | None = None
    ) -> None:
        self.mechanism, self.q, self.dt = mechanism, q, dt
        self.tasks = tasks
        self._data, self._is_evaluated = data, False

    @property
    def model(self) -> pin.Model:
        """Pinocchio's model."""
        return self.mechanism.model

    @property
    def data(self) -> pin.Data:
        """Pinocchio's data, with placements (`oMi`) and Jacobian (`J`) of all joints at q; frames are not updated.

        With more than 100 degrees of freedom it has what kinematics needs, and nothing else.
        """
        if not self._is_evaluated:
            if self._data is None:
                self._data = kinematic_data(self.model)
            pin.computeJointJacobians(self.model, self._data, self.q)
            self._is_evaluated = True
        return self._data

    @property
    def dynamics_data(self) -> pin.Data:
        """The same, complete: for centres of mass and other functions of dynamics. It is `data` unless the model is
        large, and then made anew."""
        data = self.data
        if not len(data.com):
            data = self.model.createData()
            pin.computeJointJacobians(self.model, data, self.q)
        return data

    def frame(self, node: str, seen_from: str | None = None) -> pin.SE3:
        """Return the pose of a node, a copy.

        Args:
            node: name of the node.
            seen_from: node in whose frame it is expressed; the world unless given.

        Raises:
            UnknownNameError: no such node.
        """
        pose = pin.updateFramePlacement(self.model, self.data, self.mechanism.frame_id(node)).copy()
        return pose if seen_from is None else self.frame(seen_from).actInv(pose)

    def jacobian(self, node: str) -> Array:
        """Return the Jacobian (6, nv) of a node: velocity of its origin, then angular velocity, in the world's axes.

        Raises:
            UnknownNameError: no such node.
        """
        return self.point_jacobian(node, None)

    def point_jacobian(self, node: str, point: ArrayLike | None = None) -> Array:
        """Return the Jacobian (6, nv) of a point on a node: its velocity, then the node's angular velocity, in the
        world's axes.

        Args:
            node: name of the node.
            point: (3,) in the node's frame, m; its origin unless given.

        Raises:
            UnknownNameError: no such node.
        """
        mechanism, data = self.mechanism, self.data
        model, frame = mechanism.model, mechanism.frame_id(node)
        if not model.nv:
            return np.zeros((6, 0))
        placement = pin.updateFramePlacement(model, data, frame)
        rows: Array = pin.getFrameJacobian(model, data, frame, _ALIGNED).reshape(6, model.nv)  # (6,) if nv is 1
        if point is not None:
            rows[:3] += _CROSS @ (placement.rotation @ point) @ rows[3:]
        return rows
