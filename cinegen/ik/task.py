"""A task: a frame on a node follows a pose or a twist (the paper's sensor constraint), and the equations it adds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from operator import index
from typing import Any, SupportsIndex

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.ik._kernels.memory import TaskMemory
from cinegen.ik._kernels.tasks import FURTHEST
from cinegen.ik.thresholds import ROTATION
from cinegen.jit.foreign import SE3_DISTANCE, address, frame_of
from cinegen.model import Mechanism
from raff2urdf.residual import log, log_derivative, swing

_TRANSLATIONS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0))
_ROTATIONS = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0))
"""Weights of the axes for a number of constrained translations or rotations."""

_TARGET = TaskMemory.fields["target"].slot

_WANTED = {
    "node": "the name of a base, link or frame",
    "axes": "target, world, or the name of a base, link or frame",
    "offset": "a point of three finite numbers (m) or a pinocchio.SE3",
    "target": "a pinocchio.SE3, or as a twist six finite numbers",
    "translation": "a number of constrained axes, 0 to 3",
    "rotation": "a number of constrained axes, 0 to 3",
    "weights": "six finite numbers of at least 0",
    "weight": "a positive, finite number",
}
"""What a task's value must be, by its name."""


class FrameTask:
    """A frame on a node follows a target; made by `Solver.add_task`.

    All may be set at any time between two ticks, and takes effect at the next one. A value that can't be followed (a
    target that is no SE3 or not finite, a `weight` of 0, a node that does not exist) is kept, and the task is left out
    until it is corrected: the status of each tick reports it.

    Args:
        node: name of a base, link or frame.
        target: pose in the world.
        translation: number of constrained translations, 0 to 3; see `translation`.
        rotation: number of constrained rotations, 0 to 3; see `rotation`.
        weight: see `weight`.
        axes: see `axes`.
        frame: Pinocchio's index of the node's frame, if it is known.
        offset: point (3,) or pose on the node, in the node's frame (m), that follows the target; the node's own frame
            unless given.
        weights: see `weights`; in place of `translation` and `rotation`.
        priority: see `priority`.

    Attributes:
        memory: the task's numbers, as kernels see them.

    Raises:
        CinegenError: offset is neither an SE3 nor three finite numbers.
        AttributeError: an attribute is set that a task does not have.
    """

    __slots__ = (
        "__weakref__", "_axes", "_constrained", "_frame", "_largest", "_node", "_offset", "_priority", "_special",
        "_target", "_weight", "_weights", "_words", "_wrong", "changed", "find_frame", "measure", "memory",
    )  # fmt: skip

    def __init__(
        self,
        node: str,
        target: Any,
        translation: int = 3,
        rotation: int = 3,
        weight: float = 1.0,
        axes: str = "target",
        frame: int = 0,
        offset: pin.SE3 | ArrayLike | None = None,
        weights: ArrayLike | None = None,
        priority: int = 0,
    ) -> None:
        self._priority = checked_priority(priority)
        self._node, self._axes, self._frame, self._offset = node, axes, frame, _pose(offset)
        self.memory = TaskMemory()
        self._words = self.memory.words
        self.changed: Callable[[], None] = _nothing  # called when the solver has to write the task again
        self.find_frame: Callable[[str], int] = _unknown_frame
        self.measure: Callable[[FrameTask], tuple[float, float]] = _no_solver
        self._wrong: dict[str, Any] = {}
        self._target = pin.SE3.Identity()
        self._special = False  # follows a twist, or has an invalid value
        self.target = target
        self._weight, self._largest, self._weights = 1.0, 1.0, np.zeros(6)
        self._constrained: tuple[list[int], list[int]] = ([], [])  # translations and rotations
        self.translation, self.rotation, self.weight = translation, rotation, weight
        if weights is not None:
            self.weights = weights

    def copy(self, frame: int | None = None) -> FrameTask:
        """Return a task of no solver with the same values; it follows a pose.

        Args:
            frame: Pinocchio's index of the node's frame; unchanged unless given.
        """
        frame = self.frame if frame is None else frame
        copied = FrameTask(
            self._node, self._target, weight=self._weight, axes=self._axes, frame=frame, offset=self._offset,
            weights=self._weights, priority=self._priority,
        )  # fmt: skip
        for name, value in self._wrong.items():
            copied._refuse(name, value)
        return copied

    def __repr__(self) -> str:
        follows = "twist" if self.twist is not None else "pose"
        return f"<FrameTask of {self.node}: {follows}, {self.translation} translations, {self.rotation} rotations>"

    @property
    def node(self) -> str:
        """Name of the node."""
        return str(self._wrong.get("node", self._node))

    @node.setter
    def node(self, node: str) -> None:
        try:
            self._frame = self.find_frame(node)
        except (UnknownNameError, TypeError):
            self._refuse("node", node)
            return
        self._node = node
        self._accept_frame("node")

    @property
    def frame(self) -> int:
        """Pinocchio's index of the node's frame."""
        return self._frame

    @property
    def axes(self) -> str:
        """Frame whose axes the rows are expressed in: "target", "world" or the name of a node."""
        return str(self._wrong.get("axes", self._axes))

    @axes.setter
    def axes(self, axes: str) -> None:
        try:
            if axes not in ("target", "world"):
                self.find_frame(axes)
        except (UnknownNameError, TypeError, ValueError):
            self._refuse("axes", axes)
            return
        self._axes = axes
        self._accept_frame("axes")

    @property
    def offset(self) -> pin.SE3:
        """Pose of the frame that follows, in the node's frame; a copy. It may be set to a point (3,), m, or a pose."""
        wrong = self._wrong.get("offset")
        return self._offset.copy() if wrong is None else wrong

    @offset.setter
    def offset(self, offset: pin.SE3 | ArrayLike) -> None:
        try:
            self._offset = _pose(offset)
        except CinegenError:
            self._refuse("offset", offset)
            return
        self._accept_frame("offset")

    @property
    def valid_axes_and_offset(self) -> tuple[str, pin.SE3]:
        """The last ones that were valid: a tick leaves out a task with others, and has a place for it."""
        return self._axes, self._offset

    def _accept_frame(self, name: str) -> None:
        """Let another frame follow, or be followed along other axes."""
        self.memory.is_followed = 0
        self._accept(name)
        self.changed()

    @property
    def target(self) -> pin.SE3:
        """Target pose in the world. It may be changed in place; assignment copies."""
        return self._wrong.get("target", self._target)

    @target.setter
    def target(self, target: pin.SE3) -> None:
        if type(target) is not pin.SE3:
            self._refuse("target", target)
            return
        copied = self._target = target.copy()
        if SE3_DISTANCE is None:
            self.read_target()
        else:
            self._words[_TARGET] = id(copied) + SE3_DISTANCE
        if self._special:
            self.memory.is_twist = 0
            self._accept("target")

    def read_target(self) -> None:
        """Copy the target into the task's memory, where its numbers can't be read in place."""
        self.memory.own_target[:] = frame_of(self._target)
        self.memory.target = address(self.memory.own_target)

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
        return self.memory.twist.copy() if self.memory.is_twist else None

    @twist.setter
    def twist(self, twist: Any) -> None:
        try:
            given = np.asarray(twist, dtype=float).reshape(6)
            if not np.isfinite(given).all():
                raise ValueError
        except (TypeError, ValueError):
            self._refuse("target", twist)
            return
        self.memory.twist[:], self.memory.is_twist = given, 1
        self._accept("target")
        self._special = True

    @property
    def translation(self) -> int:
        """Number of constrained translations: 3 all; 2 along x and y of the axes; 1 along x; 0 none.

        Setting it sets their `weights` to 1.
        """
        return int(self._wrong.get("translation", self.memory.translation))

    @translation.setter
    def translation(self, count: int) -> None:
        self._constrain("translation", count, slice(0, 3), _TRANSLATIONS)

    @property
    def rotation(self) -> int:
        """Number of constrained rotations: 3 all; 2 the direction of the z axis; 1 the rotation about it; 0 none.

        Setting it sets their `weights` to 1.
        """
        return int(self._wrong.get("rotation", self.memory.rotation))

    @rotation.setter
    def rotation(self, count: int) -> None:
        self._constrain("rotation", count, slice(3, 6), _ROTATIONS)

    @property
    def weights(self) -> Array:
        """(6,) weights of the translations along, then the rotations about, x, y and z of the axes; a copy.

        They multiply `weight`. An axis whose weight is 0 is not constrained. Two constrained rotations determine the
        direction of the third axis, as `rotation` = 2 does that of z.
        """
        return np.array(self._wrong.get("weights", self._weights))

    @weights.setter
    def weights(self, weights: ArrayLike) -> None:
        try:
            given = np.asarray(weights, dtype=float)
            good = given.shape == (6,) and bool(((given >= 0.0) & (given < np.inf)).all())
        except (TypeError, ValueError):
            good = False
        if not good:
            self._refuse("weights", weights)
            return
        self._weights[:] = given
        for name in ("weights", "translation", "rotation"):
            self._accept(name)
        self._write_rows()

    @property
    def weight(self) -> float:
        """Weight of the task where several tasks can't all be met; only proportions matter."""
        return float(self._wrong.get("weight", self._weight))

    @weight.setter
    def weight(self, weight: float) -> None:
        try:
            heaviest = weight * self._largest
            good = 0.0 < heaviest < np.inf
        except (TypeError, ValueError):
            good = False
        if good:
            self._weight, self.memory.weight = weight, heaviest
            self._accept("weight")
        else:
            self._refuse("weight", weight)

    @property
    def priority(self) -> int:
        """Level of the task: 0 is served first, larger numbers in the freedom that it leaves; tasks of equal priority
        are weighed against each other.

        Raises:
            CinegenError: set to what is no whole number of at least 0.
        """
        return self._priority

    @priority.setter
    def priority(self, priority: int) -> None:
        self._priority = checked_priority(priority)
        self.changed()

    def _constrain(self, name: str, count: Any, axes: slice, patterns: Sequence[Sequence[float]]) -> None:
        """Constrain so many axes, each with a weight of 1."""
        if is_count(count):
            self._weights[axes] = patterns[int(count)]
            self._accept(name)
            self._write_rows()
        else:
            self._refuse(name, count)

    def _write_rows(self) -> None:
        """Write the constrained axes into the task's memory."""
        memory, weights, before = self.memory, self._weights, self._constrained
        self._largest = float(weights.max()) or 1.0
        linear, angular = np.flatnonzero(weights[:3]), np.flatnonzero(weights[3:])
        if len(angular) == 2 and angular[1] - angular[0] == 2:
            angular = angular[::-1]  # with the free axis they are right-handed: z, x, y
        rows = np.concatenate([linear, 3 + angular])
        memory.translation, memory.rotation = len(linear), len(angular)
        memory.row_axis[: len(rows)], memory.row_weight[: len(rows)] = rows, weights[rows] / self._largest
        memory.is_even = int(len(set(weights[3:])) == 1)
        self._constrained = linear.tolist(), angular.tolist()
        if self._constrained != before:
            self.changed()
        self.weight = self._wrong.get("weight", self._weight)

    def _refuse(self, name: str, value: Any) -> None:
        self._wrong[name] = value
        self._special = True
        self.memory.is_valid = 0

    def _accept(self, name: str) -> None:
        self._wrong.pop(name, None)
        self._special = bool(self._wrong)
        self.memory.is_valid = 0 if self._wrong else 1

    @property
    def rows(self) -> int:
        """Number of equations."""
        return int(self.memory.translation + self.memory.rotation)

    @property
    def row_weights(self) -> Array:
        """(rows,) weight of each equation: `weight` times that of its axis."""
        return self.memory.weight * self.memory.row_weight[: self.rows]

    def is_valid(self) -> bool:
        """Return whether the target and all other values can be followed."""
        return not self.problem

    @property
    def problem(self) -> str:
        """The value with which ticks leave the task out, and what it must be; empty while it is valid."""
        for name, value in self._wrong.items():
            return f"{name} of the task of '{self._node}' is {value!r:.80}: give {_WANTED[name]}"
        target, which = self._target, f"target of the task of '{self._node}'"
        if not np.isfinite(target.translation).all():
            return f"{which} has the position {target.translation.tolist()}: give three finite numbers (m)"
        rotation = target.rotation
        with np.errstate(all="ignore"):  # where squares overflow, too
            off = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
            if off <= ROTATION and np.linalg.det(rotation) > 0.0:
                return ""
        why = "a reflection" if off <= ROTATION else f"no rotation, by {off:.2g}"
        return f"{which} has an orientation that is {why}: give an orthonormal matrix of determinant 1"

    # --- the equations, in plain form ------------------------------------------------------------------------------

    def errors(self, placement: pin.SE3, axes: Array | None = None) -> tuple[Array, Array]:
        """Return the remaining error, (translation,) in m and (rotation,) in rad, along the constrained axes.

        Args:
            placement: pose of the frame that follows, in the world.
            axes: (3, 3) the task's axes in the world; the target's unless given.
        """
        axes = self.target.rotation if axes is None else axes
        linear, angular = self._constrained
        offset = axes.T @ (np.clip(self.target.translation, -FURTHEST, FURTHEST) - placement.translation)
        if not angular:
            return offset[linear], np.zeros(0)
        relative = self._relative(placement, axes)
        if len(angular) == 2:
            return offset[linear], -self._swing(relative)[0]
        return offset[linear], log(relative.T)[angular]

    def _swing(self, relative: Array) -> tuple[Array, Array]:
        """Return the swing (2,) of the axis whose rotation is free, and its derivative (2, 3) by that axis."""
        x, y = self._constrained[1]
        triad = [x, y, 3 - x - y]
        found, by = swing(relative[triad, 3 - x - y])
        derivative = np.zeros((2, 3))
        derivative[:, triad] = by
        return found, derivative

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
        constrained, about = self._constrained
        relative = self._relative(placement, axes)
        if len(about) == 2:
            angular = self._swing(relative)[1] @ relative @ angular
        elif len(about) == 3 and self.memory.is_even:
            pass  # log's derivative times log is log: the gradient is exact with the angular velocity itself
        else:
            angular = (log_derivative(log(relative.T)) @ angular)[about]
        return np.concatenate(self.errors(placement, axes)), np.vstack([linear[constrained], angular])

    def _relative(self, placement: pin.SE3, axes: Array) -> Array:
        """Return the axes as the node carries them, relative to where they should be, (3, 3)."""
        return np.asarray(axes.T @ placement.rotation @ self.target.rotation.T @ axes)


def _pose(offset: pin.SE3 | ArrayLike | None) -> pin.SE3:
    """Return an offset as a pose in the node's frame, a copy.

    Raises:
        CinegenError: it is neither an SE3 nor three finite numbers.
    """
    if offset is None:
        return pin.SE3.Identity()
    try:
        if isinstance(offset, pin.SE3):
            pose = offset.copy()
        else:
            pose = pin.SE3(np.eye(3), np.asarray(offset, dtype=float).reshape(3))
    except (TypeError, ValueError):
        pose = None
    if pose is None or not np.isfinite(pose.homogeneous).all():
        raise CinegenError("offset must be a point of three finite numbers (m) or a pinocchio.SE3")
    return pose


def checked_priority(priority: Any) -> int:
    """Return a valid priority.

    Raises:
        CinegenError: it is no whole number of at least 0.
    """
    if isinstance(priority, bool) or not isinstance(priority, int | np.integer) or priority < 0:
        raise CinegenError(f"a task's priority is a whole number, 0 or more (0 is served first), not {priority!r:.80}")
    return int(priority)


def is_count(count: object) -> bool:
    """Return whether this is a number of constrained axes, 0 to 3; True and False are none."""
    return isinstance(count, SupportsIndex) and not isinstance(count, bool | np.bool_) and 0 <= index(count) < 4


def _nothing() -> None:
    """Do nothing: no solver needs to know that the task changed."""


def _unknown_frame(node: str) -> int:
    """Return any index: a task of no solver is copied for a mechanism before its frame is used."""
    return 0


def _no_solver(task: FrameTask) -> tuple[float, float]:
    raise CinegenError(f"the task of '{task.node}' belongs to no solver: add it with solver.add_task")
