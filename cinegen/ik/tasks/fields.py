"""Attributes of tasks of all kinds: what they accept, how they are described and recorded."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin
from msgspec import Meta

from cinegen.arrays import Array
from cinegen.ik.given_task import checked_weight
from cinegen.ik.tasks.values import checked_priority
from cinegen.typed_json import Vector7

Vector: TypeAlias = Any
"""Three numbers when it is set, an array (3,) when it is read."""

ORIGIN = (0.0, 0.0, 0.0)
Z = (0.0, 0.0, 1.0)


def _point(value: Any) -> Array:
    point = np.array(value, dtype=float).reshape(3)
    if not np.isfinite(point).all():
        raise ValueError
    point.flags.writeable = False
    return point


def _direction(value: Any) -> Array:
    vector = np.array(value, dtype=float).reshape(3)
    largest = float(np.abs(vector).max())
    if not 0.0 < largest < math.inf:
        raise ValueError
    return _point(vector / largest / np.linalg.norm(vector / largest))


def _pose(value: Any) -> pin.SE3:
    if not np.isfinite(value.homogeneous).all():
        raise ValueError
    return value.copy()


def _length(value: Any) -> float:
    if not 0.0 <= float(value) < math.inf:
        raise ValueError
    return float(value)


def _number(value: Any) -> float:
    if not math.isfinite(value):
        raise ValueError
    return float(value)


def _values(value: Any) -> Mapping[str, float]:
    values = {str(joint): _number(number) for joint, number in dict(value).items()}
    if not values:
        raise ValueError
    return values


def _axes(value: Any) -> str:
    if not value or not isinstance(value, str) or set(value) - set("xyz") or len(set(value)) < len(value):
        raise ValueError
    return value


def _unit(value: Any) -> str | tuple[str, ...]:
    unit = value if isinstance(value, str) else tuple(value)
    if set([unit] if isinstance(unit, str) else unit) - {"m", "rad"}:
        raise ValueError
    return unit


def _flag(value: Any) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise TypeError
    return bool(value)


def _name(value: Any) -> str | None:
    if value is not None and not isinstance(value, str):
        raise TypeError
    return value


class TaskField(NamedTuple):
    """An attribute of tasks.

    Attributes:
        checked: returns a valid value, or raises.
        what: what it must be.
        form: its type in JSON.
    """

    checked: Callable[[Any], Any]
    what: str
    form: Any


_Number = Annotated[float, Meta(ge=-1e6, le=1e6)]
_Three = tuple[_Number, _Number, _Number]
_OwnUnit = Literal["m", "rad"]
_POINT = TaskField(_point, "three finite numbers (m)", _Three)
_DIRECTION = TaskField(_direction, "three finite numbers that are not all 0", _Three)
_BY_JOINT = dict[str, _Number]
FIELDS: Mapping[str, TaskField] = {
    "priority": TaskField(checked_priority, "", Annotated[int, Meta(ge=0, le=9)]),
    "weight": TaskField(checked_weight, "", Annotated[float, Meta(ge=0.01, le=100.0)]),
    "node": TaskField(_name, "the name of a node", str),
    "other": TaskField(_name, "the name of a node", str),
    "on": TaskField(_name, "the name of a node, or None for the world", str | None),
    "target": TaskField(_pose, "a pinocchio.SE3", Vector7),
    "position": _POINT,
    "point": _POINT,
    "offset": _POINT,
    "through": _POINT,
    "centre": _POINT,
    "distance": TaskField(_length, "a length of at least 0 (m)", Annotated[float, Meta(ge=0.0, le=1e6)]),
    "direction": _DIRECTION,
    "axis": _DIRECTION,
    "normal": _DIRECTION,
    "values": TaskField(_values, "numbers by the names of joints (rad, m)", _BY_JOINT),
    "coefficients": TaskField(_values, "numbers by the names of joints", _BY_JOINT),
    "axes": TaskField(_axes, "some of x, y and z", str),
    "unit": TaskField(_unit, "'m' or 'rad', or one of these for each row", _OwnUnit | tuple[_OwnUnit, ...]),
    "rotation": TaskField(_flag, "True or False", bool),
    "constant": TaskField(_number, "a finite number", _Number),
}
"""Attributes of tasks by name."""
