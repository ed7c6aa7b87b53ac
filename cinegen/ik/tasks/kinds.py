"""Kinds of tasks besides `FrameTask`, in Python: each is an example of the protocol `Task`.

Attributes may be set between two ticks; a value that can't be followed raises at once. `error` is the value minus what
it should be, and `jacobian` its derivative. A node's Jacobian is Pinocchio's: velocity of a point, then the angular
velocity, in the world's axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik.state import State
from cinegen.ik.tasks.base import Kind, across, placed, turned
from cinegen.ik.tasks.fields import ORIGIN, Vector, Z
from raff2urdf.residual import log, log_derivative, skew, swing


@dataclass(eq=False, repr=False)
class RelativePose(Kind):
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
class CenterOfMass(Kind):
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
        rows = pin.jacobianCenterOfMass(state.model, state.dynamics_data, state.q, False)
        return np.asarray(rows.reshape(3, -1)[self._rows])


class Pointing(Kind):
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
        seen = across(self.axis) @ state.frame(self.node).rotation.T
        return swing(seen @ self._line(state)[0])[0]

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error."""
        seen, (direction, turns) = across(self.axis) @ state.frame(self.node).rotation.T, self._line(state)
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
    axis: Vector = Z
    offset: Vector = ORIGIN
    on: str | None = None

    def _line(self, state: State) -> tuple[Array, Array]:
        aim, rates = placed(state, self.on, self.point)
        origin, origin_rates = placed(state, self.node, self.offset)
        distance = float(np.linalg.norm(aim - origin))
        along = (aim - origin) / max(distance, 1e-9)
        return along, skew(along) @ (rates - origin_rates) / max(distance, 1e-9)


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
    direction: Vector = Z
    axis: Vector = Z
    on: str | None = None

    def _line(self, state: State) -> tuple[Array, Array]:
        return turned(state, self.on, self.direction)


class _OfPoint(Kind):
    """A point on a node keeps a distance to something in the world."""

    node: str
    offset: Vector

    def _xyz(self, state: State) -> Array:
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
    offset: Vector = ORIGIN

    def error(self, state: State) -> Array:
        """Return the distances (2,) from the line along two directions across it, m."""
        return np.asarray(across(self.direction)[:2] @ (self._xyz(state) - self.through))

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error."""
        return np.asarray(across(self.direction)[:2] @ self._rates(state))


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
    through: Vector = ORIGIN
    normal: Vector = Z
    offset: Vector = ORIGIN

    def error(self, state: State) -> Array:
        """Return the height (1,) above the plane, m."""
        return np.array([self.normal @ (self._xyz(state) - self.through)])

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
    offset: Vector = ORIGIN
    on: str | None = None

    def error(self, state: State) -> Array:
        """Return the distance beyond the wanted one (1,), m."""
        return np.array([np.linalg.norm(self._xyz(state) - placed(state, self.on, self.centre)[0]) - self.distance])

    def jacobian(self, state: State) -> Array:
        """Return the derivative of the error; 0 where the point is at the centre."""
        centre, rates = placed(state, self.on, self.centre)
        away = self._xyz(state) - centre
        away /= max(float(np.linalg.norm(away)), 1e-12)
        return np.asarray(away[None, :] @ (self._rates(state) - rates))


@dataclass(eq=False, repr=False)
class JointValues(Kind):
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
class JointEquality(Kind):
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
class Damping(Kind):
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
