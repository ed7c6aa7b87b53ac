"""A task: a frame on a node follows a pose or a twist (the paper's sensor constraint), and the equations it adds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.ik._kernels.memory import TaskMemory
from cinegen.ik.tasks.equations import ConstrainedAxes, FrameEquations
from cinegen.ik.tasks.values import ROTATIONS, TRANSLATIONS, WANTED, checked_priority, fault_of, is_count, pose
from cinegen.jit.foreign import SE3_DISTANCE, address, frame_of
from cinegen.jit.one_thread import HasUser, OneThread

_TARGET = TaskMemory.fields["target"].slot
_NO_ROWS = ConstrainedAxes.of(np.zeros(6))


class FrameTask(FrameEquations):
    """A frame on a node follows a target; made by `Solver.add_task`.

    All may be set at any time, by any thread, and takes effect at the next tick; what is changed in place, as in
    `task.target.translation += ...`, only between two ticks. A value that can't be followed (a target that is no SE3 or
    not finite, a `weight` of 0, a node that does not exist) is kept, and the task is left out until it is corrected:
    the status of each tick reports it.

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
        "__weakref__", "_axes", "_frame", "_is_moved", "_node", "_offset", "_priority", "_read", "_special",
        "_target", "_twist", "_weight", "_words", "_written", "_wrong", "changed", "find_frame", "measure", "user",
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
        self.memory = TaskMemory(translation=0, rotation=0)
        self._words = self.memory.words
        self.user: HasUser = OneThread()  # its solver: nobody without one
        self.changed: Callable[[bool], None] | None = _nothing  # called with whether a solver has to bind the task anew
        self.find_frame: Callable[[str], int] = _unknown_frame
        self.measure: Callable[[FrameTask], tuple[float, float]] = _no_solver
        self._wrong: dict[str, Any] = {}
        self._target = self._read = pin.SE3.Identity()
        self._twist: Array | None = None
        self._special = self._is_moved = False  # follows a twist, or has an invalid value; another frame follows
        self._weight, self._rows, self._written = 1.0, _NO_ROWS, _NO_ROWS
        self.target = target
        self.translation, self.rotation, self.weight = translation, rotation, weight
        if weights is not None:
            self.weights = weights
        self.changed = None
        self.write()

    def copy(self, frame: int | None = None) -> FrameTask:
        """Return a task of no solver with the same values; it follows a pose.

        Args:
            frame: Pinocchio's index of the node's frame; unchanged unless given.
        """
        frame = self.frame if frame is None else frame
        copied = FrameTask(
            self._node, self._target, weight=self._weight, axes=self._axes, frame=frame, offset=self._offset,
            weights=self._rows.weights, priority=self._priority,
        )  # fmt: skip
        for name, value in self._wrong.items():
            copied._refuse(name, value)
        return copied

    def __repr__(self) -> str:
        follows = "pose" if self._twist is None else "twist"
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
        self._is_moved = True
        self._accept(name, True)

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
        place = id(copied) + (SE3_DISTANCE or 0)
        if self._special or self.user._user:  # a tick reads the one before, to its end
            self._twist = None
            self._accept("target")
        elif SE3_DISTANCE is None:
            self.read_target()
        else:
            self._words[_TARGET] = place  # no other thread comes in between, as in `Solver.step`
            self._read = copied

    def read_target(self) -> None:
        """Copy the target into the task's memory, where its numbers can't be read in place."""
        self.memory.own_target[:] = frame_of(self._target)
        self.memory.target = address(self.memory.own_target)

    def write(self) -> bool:
        """Write all that was set into the task's memory; only its user may, between two ticks. Return whether it has to
        be bound anew: other axes are constrained, or another frame follows."""
        memory, rows, before, twist, moved = self.memory, self._rows, self._written, self._twist, self._is_moved
        self._written, self._is_moved, target = rows, False, self._target
        memory.weight, memory.is_valid = self._weight * rows.largest, 0 if self._wrong else 1
        memory.is_twist = 0 if twist is None else 1
        if twist is not None:
            memory.twist[:] = twist
        if SE3_DISTANCE is None:
            self.read_target()
        else:
            self._words[_TARGET], self._read = id(target) + SE3_DISTANCE, target
        if moved:
            memory.is_followed = 0
        if rows is before:
            return moved
        memory.translation, memory.rotation, memory.is_even = len(rows.linear), len(rows.angular), rows.is_even
        memory.row_axis[: len(rows.axes)], memory.row_weight[: len(rows.axes)] = rows.axes, rows.parts
        return moved or rows.axes != before.axes

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
        return None if self._twist is None else self._twist.copy()

    @twist.setter
    def twist(self, twist: Any) -> None:
        try:
            numbers = np.array(twist, dtype=float).reshape(6)
            if not np.isfinite(numbers).all():
                raise ValueError
        except (TypeError, ValueError):
            self._refuse("target", twist)
            return
        self._twist = numbers
        self._accept("target")

    @property
    def translation(self) -> int:
        """Number of constrained translations: 3 all; 2 along x and y of the axes; 1 along x; 0 none.

        Setting it sets their `weights` to 1.
        """
        return int(self._wrong.get("translation", len(self._rows.linear)))

    @translation.setter
    def translation(self, count: int) -> None:
        self._constrain("translation", count, slice(0, 3), TRANSLATIONS)

    @property
    def rotation(self) -> int:
        """Number of constrained rotations: 3 all; 2 the direction of the z axis; 1 the rotation about it; 0 none.

        Setting it sets their `weights` to 1.
        """
        return int(self._wrong.get("rotation", len(self._rows.angular)))

    @rotation.setter
    def rotation(self, count: int) -> None:
        self._constrain("rotation", count, slice(3, 6), ROTATIONS)

    @property
    def weights(self) -> Array:
        """(6,) weights of the translations along, then the rotations about, x, y and z of the axes; a copy.

        They multiply `weight`. An axis whose weight is 0 is not constrained. Two constrained rotations determine the
        direction of the third axis, as `rotation` = 2 does that of z.
        """
        return np.array(self._wrong.get("weights", self._rows.weights))

    @weights.setter
    def weights(self, weights: ArrayLike) -> None:
        try:
            numbers = np.array(weights, dtype=float)
            good = numbers.shape == (6,) and bool(((numbers >= 0.0) & (numbers < np.inf)).all())
        except (TypeError, ValueError):
            good = False
        if not good:
            self._refuse("weights", weights)
            return
        for name in ("weights", "translation", "rotation"):
            self._wrong.pop(name, None)
        self._constrain_by(numbers)

    @property
    def weight(self) -> float:
        """Weight of the task where several tasks can't all be met; only proportions matter."""
        return float(self._wrong.get("weight", self._weight))

    @weight.setter
    def weight(self, weight: float) -> None:
        try:
            heaviest = weight * self._rows.largest
            good = 0.0 < heaviest < np.inf
        except (TypeError, ValueError):
            good = False
        if good:
            self._weight = weight
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
        self._change(True)

    def _constrain(self, name: str, count: Any, axes: slice, patterns: Sequence[Sequence[float]]) -> None:
        """Constrain so many axes, each with a weight of 1."""
        if is_count(count):
            weights = self._rows.weights.copy()
            weights[axes] = patterns[int(count)]
            self._wrong.pop(name, None)
            self._constrain_by(weights)
        else:
            self._refuse(name, count)

    def _constrain_by(self, weights: Array) -> None:
        """Constrain the axes (6,) whose weight is not 0."""
        before, self._rows = self._rows, ConstrainedAxes.of(weights)
        self._change(self._rows.axes != before.axes)
        self.weight = self._wrong.get("weight", self._weight)

    def _refuse(self, name: str, value: Any) -> None:
        self._wrong[name] = value
        self._special = True
        self._change(False)

    def _accept(self, name: str, binds: bool = False) -> None:
        self._wrong.pop(name, None)
        self._special = bool(self._wrong) or self._twist is not None
        self._change(binds)

    def _change(self, binds: bool) -> None:
        """Have what was set written: by the solver at its next tick, or at once."""
        if self.changed is None:
            self.write()
        else:
            self.changed(binds)

    @property
    def rows(self) -> int:
        """Number of equations."""
        return len(self._rows.axes)

    @property
    def row_weights(self) -> Array:
        """(rows,) weight of each equation: `weight` times that of its axis."""
        return self.heaviest * self._rows.parts

    @property
    def heaviest(self) -> float:
        """Weight of the heaviest equation."""
        return self._weight * self._rows.largest

    def is_valid(self) -> bool:
        """Return whether the target and all other values can be followed."""
        return not self.problem

    @property
    def problem(self) -> str:
        """The value with which ticks leave the task out, and what it must be; empty while it is valid."""
        for name, value in self._wrong.items():
            return f"{name} of the task of '{self._node}' is {value!r:.80}: give {WANTED[name]}"
        wrong = fault_of(self._target)
        return f"target of the task of '{self._node}' has {wrong}" if wrong else ""


def _nothing(binds: bool) -> None:
    """Do nothing: the task is being made."""


def _unknown_frame(node: str) -> int:
    """Return any index: a task of no solver is copied for a mechanism before its frame is used."""
    return 0


def _no_solver(task: FrameTask) -> tuple[float, float]:
    raise CinegenError(f"the task of '{task.node}' belongs to no solver: add it with solver.add_task")
