"""Kinds of tasks besides `FrameTask`, in Python: each is an example of the protocol `Task`.

Attributes may be set between two ticks; a value that can't be followed raises at once. `error` is the value minus what
it should be, and `jacobian` its derivative. A node's Jacobian is Pinocchio's: velocity of a point, then the angular
velocity, in the world's axes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin
from msgspec import Meta

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik.given_task import checked_weight
from cinegen.ik.state import State
from cinegen.ik.task import checked_priority
from cinegen.typed_json import Vector7
from raff2urdf.residual import log, log_derivative, skew, swing

Vector: TypeAlias = Any
"""Three numbers when it is set, an array (3,) when it is read."""

_ORIGIN = (0.0, 0.0, 0.0)
_Z = (0.0, 0.0, 1.0)


def _point(value: Any) -> Array:
    found = np.array(value, dtype=float).reshape(3)
    if not np.isfinite(found).all():
        raise ValueError
    found.flags.writeable = False
    return found


def _direction(value: Any) -> Array:
    found = np.array(value, dtype=float).reshape(3)
    largest = float(np.abs(found).max())
    if not 0.0 < largest < math.inf:
        raise ValueError
    return _point(found / largest / np.linalg.norm(found / largest))


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
    found = {str(joint): _number(number) for joint, number in dict(value).items()}
    if not found:
        raise ValueError
    return found


def _axes(value: Any) -> str:
    if not value or not isinstance(value, str) or set(value) - set("xyz") or len(set(value)) < len(value):
        raise ValueError
    return value


def _unit(value: Any) -> str | tuple[str, ...]:
    found = value if isinstance(value, str) else tuple(value)
    if set([found] if isinstance(found, str) else found) - {"m", "rad"}:
        raise ValueError
    return found


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


@dataclass(eq=False, repr=False)
class _Kind:
    """Base of the kinds: attributes that are checked when they are set."""

    priority: int = field(default=0, kw_only=True)
    weight: float = field(default=1.0, kw_only=True)

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self.__dataclass_fields__:
            known = ", ".join((*self._names(), "priority", "weight"))
            raise AttributeError(f"{type(self).__name__} has no attribute '{name}' that can be set; it has {known}")
        checked = FIELDS[name]
        try:
            object.__setattr__(self, name, checked.checked(value))
        except (AttributeError, TypeError, ValueError):
            raise CinegenError(f"{type(self).__name__}.{name} must be {checked.what}, not {value!r:.80}") from None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {', '.join(str(getattr(self, name)) for name in self._names()[:2])}>"

    def _names(self) -> list[str]:
        return [name for name in self.__dataclass_fields__ if name not in ("priority", "weight")]


def _placed(state: State, on: str | None, point: Array) -> tuple[Array, Array]:
    """Return a point (3,) in the world, and its Jacobian (3, nv): on a node, or of the world."""
    if on is None:
        return point, np.zeros((3, state.model.nv))
    return state.frame(on).act(point), state.point_jacobian(on, point)[:3]


def _turned(state: State, on: str | None, direction: Array) -> tuple[Array, Array]:
    """Return a direction (3,) in the world, and the angular velocity's Jacobian (3, nv) of what carries it."""
    if on is None:
        return direction, np.zeros((3, state.model.nv))
    return state.frame(on).rotation @ direction, state.jacobian(on)[3:]


def _across(axis: Array) -> Array:
    """Return a right-handed basis (3, 3) as rows, whose last is the axis."""
    return _basis(axis.tobytes())


@lru_cache(maxsize=256)  # of attributes, which ticks ask for again and again: `numpy.cross` takes longer than all else
def _basis(numbers: bytes) -> Array:
    axis = np.frombuffer(numbers)
    x = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    x /= np.linalg.norm(x)
    found = np.array([x, np.cross(axis, x), axis])
    found.flags.writeable = False
    return found


@dataclass(eq=False, repr=False)
class RelativePose(_Kind):
    """A node keeps a pose relative to another one: both arms hold an object.

    Args:
        node: name of a node.
        other: name of the node that it is seen from.
        target: pose of `node` in the frame of `other`; `solver.state.frame(node, other)` is the present one.
        rotation: whether the orientation counts.
        priority: see `Task`.
        weight: see `Task`.

    Raises:
        CinegenError: target is no SE3, or not finite.
    """

    node: str
    other: str
    target: pin.SE3
    rotation: bool = True

    @property
    def unit(self) -> Sequence[str]:
        """Units of the rows."""
        return ("m", "m", "m", "rad", "rad", "rad") if self.rotation else ("m", "m", "m")

    def error(self, state: State) -> Array:
        """Return the distance and the rotation vector from the target, in the axes of `other`; m, rad."""
        pose, target = state.frame(self.node, self.other), self.target
        turn = log(pose.rotation @ target.rotation.T) if self.rotation else np.zeros(0)
        return np.concatenate([pose.translation - target.translation, turn])

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error."""
        pose, axes = state.frame(self.node, self.other), state.frame(self.other).rotation.T
        relative = state.jacobian(self.node) - state.point_jacobian(self.other, pose.translation)
        if not self.rotation:
            return np.asarray(axes @ relative[:3])
        turn = log(pose.rotation @ self.target.rotation.T)
        return np.vstack([axes @ relative[:3], log_derivative(turn) @ axes @ relative[3:]])


@dataclass(eq=False, repr=False)
class CenterOfMass(_Kind):
    """The centre of mass of the whole mechanism is at a position, or above it (`axes="xy"`).

    Args:
        position: (3,) in the world, m.
        axes: those of the world along which the position counts.
        priority: see `Task`.
        weight: see `Task`.

    Raises:
        CinegenError: position is not three finite numbers, or axes are not among x, y and z.
    """

    position: Vector
    axes: str = "xyz"

    @property
    def _rows(self) -> list[int]:
        return ["xyz".index(axis) for axis in self.axes]

    def error(self, state: State) -> Array:
        """Return the distance from the position along the axes, m."""
        centre = pin.centerOfMass(state.model, state.dynamics_data, state.q, False)
        if not np.isfinite(centre).all():
            raise CinegenError(f"{state.mechanism.name} has no masses, and no centre of mass: give its links masses")
        return np.asarray((centre - self.position)[self._rows])

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error: Pinocchio's Jacobian of the centre of mass."""
        found = pin.jacobianCenterOfMass(state.model, state.dynamics_data, state.q, False)
        return np.asarray(found.reshape(3, -1)[self._rows])


class Pointing(_Kind):
    """An axis of a node points along a direction: the swing (2,) of the direction seen from the node."""

    unit = "rad"
    axis: Vector
    node: str

    def _line(self, state: State) -> tuple[Array, Array]:
        """Return the direction (3,) in the world, and the Jacobian (3, nv) of its angular velocity."""
        raise NotImplementedError

    def axis_now(self, state: State) -> Array:
        """Return the axis (3,) of the node that points along the direction at a state."""
        return np.asarray(state.frame(self.node).rotation.T @ self._line(state)[0])

    def error(self, state: State) -> Array:
        """Return the rotation vector (2,), across the axis, from the axis to the direction; rad."""
        seen = _across(self.axis) @ state.frame(self.node).rotation.T
        return swing(seen @ self._line(state)[0])[0]

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error."""
        seen, (direction, turns) = _across(self.axis) @ state.frame(self.node).rotation.T, self._line(state)
        return np.asarray(swing(seen @ direction)[1] @ seen @ (turns - state.jacobian(self.node)[3:]))


@dataclass(eq=False, repr=False)
class LookAt(Pointing):
    """An axis of a node passes through a point: a camera looks at it.

    Args:
        node: name of a node.
        point: (3,) m, in the frame of `on`, or in the world.
        axis: (3,) of the node.
        offset: (3,) point on the node through which the axis passes, in its frame, m.
        on: node that carries the point; the world unless given.
        priority: see `Task`.
        weight: see `Task`.

    Raises:
        CinegenError: a point is not three finite numbers, or the axis is 0.
    """

    node: str
    point: Vector
    axis: Vector = _Z
    offset: Vector = _ORIGIN
    on: str | None = None

    def _line(self, state: State) -> tuple[Array, Array]:
        there, rates = _placed(state, self.on, self.point)
        here, own = _placed(state, self.node, self.offset)
        distance = float(np.linalg.norm(there - here))
        along = (there - here) / max(distance, 1e-9)
        return along, skew(along) @ (rates - own) / max(distance, 1e-9)


@dataclass(eq=False, repr=False)
class AxisAlong(Pointing):
    """An axis of a node is parallel to a direction; the rotation about it is free: a tool stays upright.

    Args:
        node: name of a node.
        direction: (3,) in the frame of `on`, or in the world.
        axis: (3,) of the node.
        on: node that carries the direction; the world unless given.
        priority: see `Task`.
        weight: see `Task`.

    Raises:
        CinegenError: direction or axis is not three finite numbers, or 0.
    """

    node: str
    direction: Vector = _Z
    axis: Vector = _Z
    on: str | None = None

    def _line(self, state: State) -> tuple[Array, Array]:
        return _turned(state, self.on, self.direction)


class _OfPoint(_Kind):
    """A point on a node keeps a distance to something in the world."""

    node: str
    offset: Vector

    def _here(self, state: State) -> Array:
        return np.asarray(state.frame(self.node).act(self.offset))

    def _rates(self, state: State) -> Array:
        return state.point_jacobian(self.node, self.offset)[:3]


@dataclass(eq=False, repr=False)
class PointOnLine(_OfPoint):
    """A point on a node stays on a line.

    Args:
        node: name of a node.
        through: (3,) point of the line in the world, m.
        direction: (3,) of the line.
        offset: (3,) point on the node, in its frame, m.
        priority: see `Task`.
        weight: see `Task`.

    Raises:
        CinegenError: a point is not three finite numbers, or the direction is 0.
    """

    node: str
    through: Vector
    direction: Vector
    offset: Vector = _ORIGIN

    def error(self, state: State) -> Array:
        """Return the distances (2,) from the line along two directions across it, m."""
        return np.asarray(_across(self.direction)[:2] @ (self._here(state) - self.through))

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error."""
        return np.asarray(_across(self.direction)[:2] @ self._rates(state))


@dataclass(eq=False, repr=False)
class PointInPlane(_OfPoint):
    """A point on a node stays in a plane.

    Args:
        node: name of a node.
        through: (3,) point of the plane in the world, m.
        normal: (3,) of the plane.
        offset: (3,) point on the node, in its frame, m.
        priority: see `Task`.
        weight: see `Task`.

    Raises:
        CinegenError: a point is not three finite numbers, or the normal is 0.
    """

    node: str
    through: Vector = _ORIGIN
    normal: Vector = _Z
    offset: Vector = _ORIGIN

    def error(self, state: State) -> Array:
        """Return the height (1,) above the plane, m."""
        return np.array([self.normal @ (self._here(state) - self.through)])

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error."""
        return np.asarray(self.normal[None, :] @ self._rates(state))


@dataclass(eq=False, repr=False)
class PointAtDistance(_OfPoint):
    """A point on a node stays at a distance from a centre.

    Args:
        node: name of a node.
        centre: (3,) m, in the frame of `on`, or in the world.
        distance: m.
        offset: (3,) point on the node, in its frame, m.
        on: node that carries the centre; the world unless given.
        priority: see `Task`.
        weight: see `Task`.

    Raises:
        CinegenError: a point is not three finite numbers, or the distance is negative.
    """

    node: str
    centre: Vector
    distance: float
    offset: Vector = _ORIGIN
    on: str | None = None

    def error(self, state: State) -> Array:
        """Return the distance beyond the wanted one (1,), m."""
        return np.array([np.linalg.norm(self._here(state) - _placed(state, self.on, self.centre)[0]) - self.distance])

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error; 0 where the point is at the centre."""
        centre, rates = _placed(state, self.on, self.centre)
        away = self._here(state) - centre
        away /= max(float(np.linalg.norm(away)), 1e-12)
        return np.asarray(away[None, :] @ (self._rates(state) - rates))


@dataclass(eq=False, repr=False)
class JointValues(_Kind):
    """Joints take values.

    Args:
        values: by joint name, rad or m.
        unit: "rad" or "m" for all of them, or one of these for each.
        priority: see `Task`.
        weight: see `Task`.

    Raises:
        CinegenError: values are not finite numbers by the names of joints.
    """

    values: Mapping[str, float]
    unit: str | Sequence[str] = "rad"

    def error(self, state: State) -> Array:
        """Return the distance of each joint from its value, rad or m."""
        mechanism = state.mechanism
        at, units = [mechanism.q_index(joint) for joint in self.values], [self.unit] * len(self.values)
        needed = ["m" if mechanism.is_prismatic(joint) else "rad" for joint in self.values]
        if needed != (units if isinstance(self.unit, str) else list(self.unit)):
            raise CinegenError(f"JointValues: give unit={needed}, the units of {', '.join(self.values)}")
        return np.asarray(state.q[at] - np.array(list(self.values.values())))

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error."""
        return np.eye(state.model.nv)[[state.mechanism.v_index(joint) for joint in self.values]]


@dataclass(eq=False, repr=False)
class JointEquality(_Kind):
    """A sum of multiples of joints is constant: sum_j c_j q_j = constant.

    Args:
        coefficients: c_j by joint name; {"left": 1, "right": -1} keeps two joints equal.
        constant: rad or m.
        unit: "rad" or "m".
        priority: see `Task`.
        weight: see `Task`.

    Raises:
        CinegenError: coefficients are not finite numbers by the names of joints.
    """

    coefficients: Mapping[str, float]
    constant: float = 0.0
    unit: str = "rad"

    def error(self, state: State) -> Array:
        """Return the sum (1,) beyond the constant, rad or m."""
        terms = self.coefficients.items()
        return np.array([sum(c * state.q[state.mechanism.q_index(joint)] for joint, c in terms) - self.constant])

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error."""
        row = np.zeros((1, state.model.nv))
        for joint, c in self.coefficients.items():
            row[0, state.mechanism.v_index(joint)] = c
        return row


@dataclass(eq=False, repr=False)
class Damping(_Kind):
    """All joints resist motion, as much as the weight demands: the least motion that serves the other tasks of its
    priority.

    Args:
        priority: see `Task`.
        weight: see `Task`.
    """

    unit = "rad"
    weight: float = field(default=0.1, kw_only=True)

    def error(self, state: State) -> Array:
        """Return zeros (nv,): the joints are where they should be."""
        return np.zeros(state.model.nv)

    def jacobian(self, state: State) -> Array:
        """Return the velocities of the joints, dimensionless."""
        return np.diag(1.0 / state.mechanism.scale)


KINDS = (
    RelativePose, CenterOfMass, LookAt, AxisAlong, PointOnLine, PointInPlane, PointAtDistance, JointValues,
    JointEquality, Damping,
)  # fmt: skip
"""All kinds."""
