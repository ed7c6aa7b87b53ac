"""A task: a frame on a node follows a pose or a twist (the paper's sensor constraint), and the equations it adds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.ik._kernels.memory import TaskMemory
from cinegen.ik.tasks.equations import FrameEquations
from cinegen.ik.tasks.values import ROTATIONS, TRANSLATIONS, WANTED, checked_priority, is_count, pose
from cinegen.ik.thresholds import ROTATION
from cinegen.jit.foreign import SE3_DISTANCE, address, frame_of

_TARGET = TaskMemory.fields["target"].slot


class FrameTask(FrameEquations):
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
        "__weakref__", "_axes", "_frame", "_largest", "_node", "_offset", "_priority", "_special",
        "_target", "_weight", "_weights", "_words", "_wrong", "changed", "find_frame", "measure",
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
        self._node, self._axes, self._frame, self._offset = node, axes, frame, pose(offset)
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
        self._constrained = [], []
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
            self._offset = pose(offset)
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
        self._constrain("translation", count, slice(0, 3), TRANSLATIONS)

    @property
    def rotation(self) -> int:
        """Number of constrained rotations: 3 all; 2 the direction of the z axis; 1 the rotation about it; 0 none.

        Setting it sets their `weights` to 1.
        """
        return int(self._wrong.get("rotation", self.memory.rotation))

    @rotation.setter
    def rotation(self, count: int) -> None:
        self._constrain("rotation", count, slice(3, 6), ROTATIONS)

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
        """Level of the task: 0 is served first, larger numbers in the motion that it leaves; tasks of equal priority
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
            return f"{name} of the task of '{self._node}' is {value!r:.80}: give {WANTED[name]}"
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


def _nothing() -> None:
    """Do nothing: no solver needs to know that the task changed."""


def _unknown_frame(node: str) -> int:
    """Return any index: a task of no solver is copied for a mechanism before its frame is used."""
    return 0


def _no_solver(task: FrameTask) -> tuple[float, float]:
    raise CinegenError(f"the task of '{task.node}' belongs to no solver: add it with solver.add_task")
