"""A task: a frame on a node follows a pose or a twist (the paper's sensor constraint), and the equations it adds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.errors import CinegenError
from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.memory import TARGET, address_of_copy
from cinegen.ik._kernels.pulls import FURTHEST
from raff2urdf.residual import log, log_derivative, swing

Array = NDArray[np.float64]


class FrameTask:
    """A frame on a node follows a target; made by `Solver.add_task`.

    All but `node`, `offset` and `axes` may be set at any time between two ticks. A value that can't be followed (a
    target that is no SE3 or not finite, a weight of 0) is kept, and the task is left out until it is corrected: the
    status of each tick reports it.

    Attributes:
        node: name of the node.
        offset: pose of the frame that follows, in the node's frame.
        axes: frame whose axes the rows are expressed in: "target", "world" or the name of a node.
        frame: Pinocchio's index of the node's frame.
    """

    def __init__(
        self,
        node: str,
        target: Any,
        translation: int = 3,
        rotation: int = 3,
        weight: float = 1.0,
        axes: str = "target",
        frame: int = 0,
        offset: pin.SE3 | None = None,
    ) -> None:
        self.node, self.axes, self.frame = node, axes, frame
        self.offset = pin.SE3.Identity() if offset is None else offset.copy()
        self.row: Array = np.zeros(m.PULL_WIDTH)  # a row of the solver's table once the solver has made it
        self.changed: Callable[[], None] = _nothing  # called when the number of rows changes
        self.measure: Callable[[FrameTask], tuple[float, float]] = _no_solver
        self._wrong: dict[str, Any] = {}
        self._target = pin.SE3.Identity()
        self._special = False  # follows a twist, or has an invalid value
        self.row[m.VALID] = 1.0
        self.target = target
        self.translation, self.rotation, self.weight = translation, rotation, weight

    def __repr__(self) -> str:
        follows = "twist" if self.twist is not None else "pose"
        return f"<FrameTask of {self.node}: {follows}, {self.translation} translations, {self.rotation} rotations>"

    @property
    def target(self) -> pin.SE3:
        """Target pose in the world. It may be changed in place; assignment copies."""
        return self._wrong.get("target", self._target)

    @target.setter
    def target(self, target: pin.SE3) -> None:
        if type(target) is not pin.SE3:
            self._refuse("target", target)
            return
        self._target = target.copy()
        self.row[TARGET] = address_of_copy(self._target)
        if self._special:
            self.row[m.IS_TWIST] = 0.0
            self._accept("target")

    @property
    def error(self) -> tuple[float, float]:
        """Distance (m) and angle (rad) to the target in the constrained directions, after the last tick.

        Raises:
            CinegenError: the task was not made by a solver.
        """
        return self.measure(self)

    @property
    def twist(self) -> Array | None:
        """(6,) target velocity along `axes` ("target" means the node's own): linear m/s, then angular rad/s.

        None while the task follows a pose; setting one ends the other. Directions of zero velocity do not drift.
        """
        return self.row[m.TWIST : m.TWIST + 6].copy() if self.row[m.IS_TWIST] else None

    @twist.setter
    def twist(self, twist: Any) -> None:
        try:
            given = np.asarray(twist, dtype=float).reshape(6)
            if not np.isfinite(given).all():
                raise ValueError
        except (TypeError, ValueError):
            self._refuse("target", twist)
            return
        self.row[m.TWIST : m.TWIST + 6] = given
        self.row[m.IS_TWIST] = 1.0
        self._accept("target")
        self._special = True

    @property
    def translation(self) -> int:
        """Number of constrained translations: 3 all; 2 along x and y of the axes; 1 along x; 0 none."""
        return int(self._wrong.get("translation", self.row[m.TRANSLATION]))

    @translation.setter
    def translation(self, count: int) -> None:
        self._set("translation", m.TRANSLATION, count, _is_count)
        self.changed()

    @property
    def rotation(self) -> int:
        """Number of constrained rotations: 3 all; 2 the direction of the z axis; 1 the rotation about it; 0 none."""
        return int(self._wrong.get("rotation", self.row[m.ROTATION]))

    @rotation.setter
    def rotation(self, count: int) -> None:
        self._set("rotation", m.ROTATION, count, _is_count)
        self.changed()

    @property
    def weight(self) -> float:
        """Weight of the task where several tasks can't all be met; only proportions matter."""
        return float(self._wrong.get("weight", self.row[m.WEIGHT]))

    @weight.setter
    def weight(self, weight: float) -> None:
        self._set("weight", m.WEIGHT, weight, _is_weight)

    def _set(self, name: str, where: int, value: Any, is_valid: Callable[[Any], bool]) -> None:
        try:
            good = is_valid(value)
        except (TypeError, ValueError):
            good = False
        if good:
            self.row[where] = value
            self._accept(name)
        else:
            self._refuse(name, value)

    def _refuse(self, name: str, value: Any) -> None:
        self._wrong[name] = value
        self._special = True
        self.row[m.VALID] = 0.0

    def _accept(self, name: str) -> None:
        self._wrong.pop(name, None)
        self._special = bool(self._wrong)
        self.row[m.VALID] = 0.0 if self._wrong else 1.0

    def move_to(self, row: Array) -> None:
        """Move the task's numbers into a row of a table."""
        row[:] = self.row
        self.row = row

    @property
    def rows(self) -> int:
        """Number of equations."""
        return self.translation + self.rotation

    def is_valid(self) -> bool:
        """Return whether the target and all other values can be followed."""
        return bool(self.row[m.VALID]) and bool(np.isfinite(self.target.homogeneous).all())

    # --- the equations, in plain form ------------------------------------------------------------------------------

    def errors(self, placement: pin.SE3, axes: Array | None = None) -> tuple[Array, Array]:
        """Return the remaining error, (translation,) in m and (rotation,) in rad, in the task's axes.

        Args:
            placement: pose of the frame that follows, in the world.
            axes: (3, 3) the task's axes in the world; the target's unless given.
        """
        axes = self.target.rotation if axes is None else axes
        offset = np.clip(self.target.translation, -FURTHEST, FURTHEST) - placement.translation
        linear = axes.T @ offset
        if self.rotation == 2:
            return linear[: self.translation], -swing(self._relative(placement, axes)[:, 2])[0]
        angular = log(self._relative(placement, axes).T) if self.rotation else np.zeros(3)
        return linear[: self.translation], angular[3 - self.rotation :]

    def equations(self, placement: pin.SE3, jacobian: Array, axes: Array | None = None) -> tuple[Array, Array]:
        """Return the remaining error and its Jacobian.

        Position and orientation are treated separately, so that the origin moves straight towards its target.

        Args:
            placement: pose of the frame that follows, in the world.
            jacobian: (6, nv) Jacobian of that frame, in its own axes.
            axes: (3, 3) the task's axes in the world; the target's unless given.

        Returns:
            error (rows,), m and rad, and J (rows, nv). To first order a joint step s with J s = error makes the error
            0, and error^T J is the exact gradient of half the squared error.
        """
        axes = self.target.rotation if axes is None else axes
        linear = axes.T @ placement.rotation @ jacobian[:3]
        angular = (self.target.rotation.T @ axes).T @ jacobian[3:]  # in the axes as the node carries them
        if self.rotation == 2:
            relative = self._relative(placement, axes)
            angular = swing(relative[:, 2])[1] @ relative @ angular
        elif self.rotation == 1:
            angular = log_derivative(log(self._relative(placement, axes).T)) @ angular
        errors = self.errors(placement, axes)
        rows = np.vstack([linear[: self.translation], angular[len(angular) - self.rotation :]])
        return np.concatenate(errors), rows

    def _relative(self, placement: pin.SE3, axes: Array) -> Array:
        """Return the axes as the node carries them, relative to where they should be, (3, 3)."""
        return np.asarray(axes.T @ placement.rotation @ self.target.rotation.T @ axes)


def _nothing() -> None:
    """Do nothing: no solver is to be told that the number of rows changed."""


def _no_solver(task: FrameTask) -> tuple[float, float]:
    raise CinegenError(f"the task of '{task.node}' belongs to no solver: add it with solver.add_task")


def _is_count(value: Any) -> bool:
    return value in range(4)


def _is_weight(value: Any) -> bool:
    return bool(0.0 < value < np.inf)
