"""Tasks as plain data, for messages, sessions and recordings.

Each kind of `cinegen.ik.tasks.kinds` has a Struct here, with the parameters of its constructor as fields: a kind that
is added there is one of messages, files and their documentation, too. Poses are x y z (m) and a quaternion x y z w.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Collection
from typing import TYPE_CHECKING, Any, Optional, TypeAlias, Union

import msgspec
import numpy as np
import pinocchio as pin
from msgspec import Struct

from cinegen.errors import CinegenError
from cinegen.ik.barrier import Range
from cinegen.ik.given_task import Task
from cinegen.ik.state import State
from cinegen.ik.tasks.fields import FIELDS
from cinegen.ik.tasks.kinds import KINDS, Pointing

_IN_WORLD = {"position": True, "point": True, "through": True, "centre": True, "direction": False, "normal": False}
"""Fields in the world, unless a node carries them: whether they are points, or directions."""

_PRESENT = ("target", "axis")  # null: what it is when the task is added
_SHARED = {"priority": "0 is served first", "weight": "among the tasks of its priority"}


class TaskDescription(Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", kw_only=True):
    """A task as plain data: one of the kinds, or a range of one."""

    def __post_init__(self) -> None:
        """Refuse a target that is no pose."""
        target = getattr(self, "target", None)
        if target is not None and not 0.9 < math.hypot(*target[3:]) < 1.1:
            raise ValueError("Expected in target a quaternion x y z w of length 1")


def _structure(kind: type) -> type[TaskDescription]:
    """Return the Struct of a kind."""
    fields: list[Any] = []
    for name, parameter in list(inspect.signature(kind).parameters.items()):
        form = Optional[FIELDS[name].form] if name in _PRESENT else FIELDS[name].form  # noqa: UP045
        default = None if parameter.default is parameter.empty and name in _PRESENT else parameter.default
        fields.append((name, form) if default is parameter.empty else (name, form, default))
    text = inspect.cleandoc(kind.__doc__ or "").partition("Raises:")[0].replace("Args:", "Attributes:")
    text = re.sub(r"(\w+): see `Task`", lambda match: f"{match[1]}: {_SHARED[match[1]]}", text)
    namespace = {"__doc__": text.strip()}
    tag = re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()
    made = msgspec.defstruct(
        kind.__name__, fields, bases=(TaskDescription,), module=__name__, namespace=namespace, tag=tag, frozen=True,
        forbid_unknown_fields=True, kw_only=True,
    )  # fmt: skip
    assert issubclass(made, TaskDescription)
    return made


_STRUCTURES = {_structure(kind): kind for kind in KINDS}
globals().update({struct.__name__: struct for struct in _STRUCTURES})  # where pickle finds them

if TYPE_CHECKING:
    KindDescription: TypeAlias = TaskDescription
else:
    KindDescription = Union[tuple(_STRUCTURES)]  # noqa: UP007


class RangeDescription(TaskDescription, frozen=True, tag="range"):
    """Values of a task stay in a range: no task leaves it, of whatever priority.

    Attributes:
        task: task whose error is the value: 0 is what the task by itself would reach.
        low: smallest value of each row, or one number for all; m or rad.
        high: largest.
        radius: largest length of all rows together, in place of low and high.
    """

    task: KindDescription
    low: float | tuple[float, ...] | None = None
    high: float | tuple[float, ...] | None = None
    radius: float | None = None


if TYPE_CHECKING:
    AnyDescription: TypeAlias = TaskDescription
else:
    AnyDescription = Union[(*_STRUCTURES, RangeDescription)]


def unknown_name(
    description: TaskDescription, nodes: Collection[str], joints: Collection[str]
) -> tuple[str, str, str] | None:
    """Return the first name in a description that does not exist: what it should name, the name, and the field."""
    if isinstance(description, RangeDescription):
        unknown = unknown_name(description.task, nodes, joints)
        return None if unknown is None else (*unknown[:2], f"task.{unknown[2]}")
    for field in description.__struct_fields__:
        value = getattr(description, field)
        if field in ("node", "other", "on") and value is not None and value not in nodes:
            return "node", value, field
        if field in ("values", "coefficients"):
            missing = next((joint for joint in value if joint not in joints), None)
            if missing is not None:
                return "joint", missing, field
    return None


def resolved(description: TaskDescription, state: State, base: pin.SE3) -> TaskDescription:
    """Return a description whose target or axis is the present one where it is null.

    Args:
        description: of a task, in a world.
        state: state of the solver.
        base: pose of the robot's own world in that world (m).

    Raises:
        CinegenError: a name does not exist, or a value can't be followed.
    """
    if isinstance(description, RangeDescription):
        return msgspec.structs.replace(description, task=resolved(description.task, state, base))
    values: dict[str, Any] = msgspec.structs.asdict(description)
    if values.get("target", ()) is None:
        pose = state.frame(values["node"], values["other"])
        return msgspec.structs.replace(description, target=tuple(pin.SE3ToXYZQUAT(pose).tolist()))
    if values.get("axis", ()) is None:
        pointing = task_of(msgspec.structs.replace(description, axis=(0.0, 0.0, 1.0)), base)
        assert isinstance(pointing, Pointing)
        return msgspec.structs.replace(description, axis=tuple(pointing.axis_now(state).tolist()))
    return description


def task_of(description: TaskDescription, base: pin.SE3) -> Task | Range:
    """Return a task of a description that is resolved.

    Args:
        description: of a task, in a world.
        base: pose of the robot's own world in that world (m).

    Raises:
        CinegenError: a value can't be followed.
    """
    if isinstance(description, RangeDescription):
        task = task_of(description.task, base)
        assert not isinstance(task, Range)
        return Range(task, description.low, description.high, description.radius)
    made: Task = _STRUCTURES[type(description)](**_attributes(description, base))
    return made


def move_base(task: Task | Range, description: TaskDescription, base: pin.SE3) -> None:
    """Let the points and directions of a task stay in the world, where its robot's own world moves (m)."""
    if isinstance(task, Range) and isinstance(description, RangeDescription):
        move_base(task.task, description.task, base)
        return
    for name, value in _attributes(description, base).items():
        if name in _IN_WORLD:
            setattr(task, name, value)


def _attributes(description: TaskDescription, base: pin.SE3) -> dict[str, Any]:
    """Return attributes of a kind, in the robot's own world."""
    values: dict[str, Any] = msgspec.structs.asdict(description)
    for name in values:
        if name == "target":
            numbers = np.array(values[name], dtype=float)
            numbers[3:] /= np.linalg.norm(numbers[3:])
            values[name] = pin.XYZQUATToSE3(numbers)
        elif name in _IN_WORLD and values.get("on") is None:
            value = np.array(values[name], dtype=float)
            values[name] = base.actInv(value) if _IN_WORLD[name] else base.rotation.T @ value
    return values


def check(task: Task | Range, state: State) -> None:
    """Check that a range can be evaluated; a solver checks tasks when they are added.

    Raises:
        CinegenError: it has another number of bounds than rows, or its task can't be evaluated.
    """
    if isinstance(task, Range):
        try:
            task.bounds(state)
        except ValueError:
            rows = len(np.atleast_1d(np.asarray(task.task.error(state))))
            raise CinegenError(f"low and high of a range are one number, or {rows}: one of each row") from None
