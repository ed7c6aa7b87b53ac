"""The equations that a task of a frame adds, in plain form; kernels compute the same."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.ik._kernels.memory import TaskMemory
from cinegen.ik._kernels.tasks import FURTHEST
from cinegen.model import Mechanism
from raff2urdf.residual import log, log_derivative, swing


class ConstrainedAxes(NamedTuple):
    """The axes that a task constrains.

    Attributes:
        weights: (6,) of all axes.
        largest: of these, or 1.
        linear: translations that are constrained, 0 to 2.
        angular: rotations, 0 to 2; of two, the free axis makes them right-handed.
        axes: both, rotations as 3 to 5.
        parts: (rows,) weight of each, as a part of the largest.
        is_even: all rotations have the same weight.
    """

    weights: Array
    largest: float
    linear: list[int]
    angular: list[int]
    axes: list[int]
    parts: Array
    is_even: int

    @classmethod
    def of(cls, weights: Array) -> ConstrainedAxes:
        """Return the axes of weights (6,) that do not change."""
        largest, linear, angular = float(weights.max()) or 1.0, *(np.flatnonzero(some) for some in np.split(weights, 2))
        if len(angular) == 2 and angular[1] - angular[0] == 2:
            angular = angular[::-1]  # with the free axis they are right-handed: z, x, y
        axes = [*linear.tolist(), *(3 + angular).tolist()]
        is_even = int(len(set(weights[3:])) == 1)
        return cls(weights, largest, linear.tolist(), angular.tolist(), axes, weights[axes] / largest, is_even)


class FrameEquations:
    """Equations of a task of a frame."""

    __slots__ = ("_rows", "memory")

    node: str
    axes: str
    target: pin.SE3
    offset: pin.SE3
    memory: TaskMemory
    _rows: ConstrainedAxes

    def errors(self, placement: pin.SE3, axes: Array | None = None) -> tuple[Array, Array]:
        """Return the remaining error, (translation,) in m and (rotation,) in rad, along the constrained axes.

        Args:
            placement: pose of the frame that follows, in the world.
            axes: (3, 3) the task's axes in the world; the target's unless given.
        """
        axes = self.target.rotation if axes is None else axes
        linear, angular = self._rows.linear, self._rows.angular
        offset = axes.T @ (np.clip(self.target.translation, -FURTHEST, FURTHEST) - placement.translation)
        if not angular:
            return offset[linear], np.zeros(0)
        relative = self._relative(placement, axes)
        if len(angular) == 2:
            return offset[linear], -self._swing(relative)[0]
        return offset[linear], log(relative.T)[angular]

    def _swing(self, relative: Array) -> tuple[Array, Array]:
        """Return the swing (2,) of the axis whose rotation is free, and its derivative (2, 3) by that axis."""
        x, y = self._rows.angular
        triad = [x, y, 3 - x - y]
        swung, by = swing(relative[triad, 3 - x - y])
        derivative = np.zeros((2, 3))
        derivative[:, triad] = by
        return swung, derivative

    def distances(self, mechanism: Mechanism, q: Array) -> tuple[float, float]:
        """Return the remaining error at q (nq,) in the constrained directions: distance (m) and angle (rad)."""
        axes = None
        if self.axes != "target":
            axes = np.eye(3) if self.axes == "world" else mechanism.placement(q, self.axes).rotation
        linear, angular = self.errors(mechanism.placement(q, self.node) * self.offset, axes)
        return math.hypot(*linear), math.hypot(*angular)

    def equations(self, placement: pin.SE3, jacobian: Array, axes: Array | None = None) -> tuple[Array, Array]:
        """Return the remaining error and its Jacobian.

        Position and orientation are treated separately, so that the origin moves straight towards its target.

        Args:
            placement: pose of the frame that follows, in the world.
            jacobian: (6, nv) Jacobian of that frame, in its own axes.
            axes: (3, 3) the task's axes in the world; the target's unless given.

        Returns:
            error (rows,), m and rad, and J (rows, nv). To first order a joint step s with J s = error makes the error
            0, and error^T W^2 J is the exact gradient of half the squared error, weighted by W = diag(row_weights).
        """
        axes = self.target.rotation if axes is None else axes
        linear = axes.T @ placement.rotation @ jacobian[:3]
        angular = (self.target.rotation.T @ axes).T @ jacobian[3:]  # in the axes as the node carries them
        constrained, about = self._rows.linear, self._rows.angular
        relative = self._relative(placement, axes)
        if len(about) == 2:
            angular = self._swing(relative)[1] @ relative @ angular
        elif len(about) == 3 and self._rows.is_even:
            pass  # log's derivative times log is log: the gradient is exact with the angular velocity itself
        else:
            angular = (log_derivative(log(relative.T)) @ angular)[about]
        return np.concatenate(self.errors(placement, axes)), np.vstack([linear[constrained], angular])

    def _relative(self, placement: pin.SE3, axes: Array) -> Array:
        """Return the axes as the node carries them, relative to where they should be, (3, 3)."""
        return np.asarray(axes.T @ placement.rotation @ self.target.rotation.T @ axes)
