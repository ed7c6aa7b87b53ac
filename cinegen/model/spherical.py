"""Ball joints as spherical joints of Pinocchio, in the place of three successive revolute joints.

Three angles have a singularity that the ball joint does not have, gimbal lock, where the first and the third axis
coincide. The configuration of a spherical joint is a unit quaternion (x y z w), and its velocity is the angular
velocity in the moved body's axes: neither has a singularity. (With three angles as coordinates and an angular velocity
as velocity, a motion through gimbal lock would be regular too, but the angles themselves jump there: recordings, paths
between configurations and every call of Pinocchio would need exceptions.)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import LoadError
from cinegen.joints import axis, kinematic_data

_EXACT = 1e-9  # m, rad: error of axes that meet at right angles
_LOCKED = 1e-9  # cosine of the middle angle at gimbal lock


class SphericalJoints:
    """A model in which spherical joints replace successive revolute ones.

    Args:
        successive: the model with revolute joints.
        balls: the three joints, from the parent on, that each ball joint replaces, by its name. Their axes meet in one
            point, the origin of all three, at right angles.

    Attributes:
        model: the model with spherical joints; all other joints and all frames are those of `successive`, without
            frames between the three joints.
        names: of the ball joints.

    Raises:
        LoadError: three joints are no ball joint.
    """

    def __init__(self, successive: pin.Model, balls: Mapping[str, Sequence[str]]) -> None:
        self.successive, self.names = successive, tuple(balls)
        self._data = kinematic_data(successive)
        self._balls = {name: _Ball(successive, name, joints) for name, joints in balls.items()}
        last, inner = {}, set()
        for ball in self._balls.values():
            last[ball.joints[2]] = ball
            inner |= {*ball.joints[:2]}
        self.model = model = pin.Model()
        model.name, model.inertias[0] = successive.name, successive.inertias[0]  # of the links that do not move
        number = {0: 0}  # of each joint in the new model
        effort = [np.zeros(0)]
        for j in range(1, successive.njoints):
            if j in inner:
                continue
            joint, inertia = successive.joints[j], successive.inertias[j]
            if j in last:
                ball = last[j]
                parent, kind, name = successive.parents[ball.joints[0]], pin.JointModelSpherical(), ball.name
                effort.append(np.full(3, np.inf))
                placement = ball.placement
            else:
                parent, kind, name = successive.parents[j], joint, successive.names[j]
                effort.append(np.array(successive.upperEffortLimit[joint.idx_v : joint.idx_v + joint.nv]))
                placement = successive.jointPlacements[j]
            number[j] = model.addJoint(number[parent], kind, placement, name)
            model.inertias[number[j]] = inertia
        model.upperEffortLimit = np.concatenate(effort)
        self._add_frames(number, {j: ball.name for j, ball in last.items()})
        self._scalar = [
            (model.joints[new].idx_q, successive.joints[old].idx_q, model.joints[new].nq)
            for old, new in number.items()
            if old > 0 and old not in last
        ]

    def merged(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return names of joints of the successive model with the ball joints in place of those that they replace."""
        ball = {self.successive.names[j]: name for name, triple in self._balls.items() for j in triple.joints}
        return tuple(dict.fromkeys(ball.get(name, name) for name in names))

    @property
    def triples(self) -> list[list[str]]:
        """Names of the three successive joints that each ball joint replaces."""
        return [[self.successive.names[joint] for joint in ball.joints] for ball in self._balls.values()]

    def _add_frames(self, number: Mapping[int, int], names: Mapping[int, str]) -> None:
        """Add the frames of the successive model; joint frames of ball joints have their names."""
        frames = {0: 0}
        for i, frame in enumerate(self.successive.frames):
            if i == 0:
                continue
            parent = frames[frame.parentFrame]
            if frame.parentJoint not in number:
                frames[i] = parent
                continue
            is_joint = frame.type == pin.FrameType.JOINT
            name = names.get(frame.parentJoint, frame.name) if is_joint else frame.name
            made = pin.Frame(name, number[frame.parentJoint], parent, frame.placement, frame.type, frame.inertia)
            frames[i] = self.model.addFrame(made, False)

    def from_successive(self, q: Array) -> Array:
        """Return the configuration (nq,) of the model for one of the successive model."""
        configuration = np.array(pin.neutral(self.model))
        for new, old, count in self._scalar:
            configuration[new : new + count] = q[old : old + count]
        pin.forwardKinematics(self.successive, self._data, np.asarray(q, dtype=float))
        for name, ball in self._balls.items():
            parent = self._data.oMi[self.successive.parents[ball.joints[0]]] * ball.placement
            rotation = parent.rotation.T @ self._data.oMi[ball.joints[2]].rotation
            at = self.model.joints[self.model.getJointId(name)].idx_q
            configuration[at : at + 4] = pin.Quaternion(rotation).normalized().coeffs()
        return configuration

    def to_successive(self, q: Array) -> Array:
        """Return a configuration of the successive model for one (nq,) of the model; at gimbal lock the third angle of
        a ball joint is 0."""
        configuration = np.zeros(self.successive.nq)
        for new, old, count in self._scalar:
            configuration[old : old + count] = q[new : new + count]
        for name, ball in self._balls.items():
            at = self.model.joints[self.model.getJointId(name)].idx_q
            rotation = pin.Quaternion(np.array(q[at : at + 4])).normalized().matrix()
            for joint, angle in zip(ball.joints, ball.angles(rotation), strict=True):
                configuration[self.successive.joints[joint].idx_q] = angle
        return configuration


class _Ball:
    """Three revolute joints that are a ball joint; their axes at 0 are the columns of `axes`, in the last one's frame.

    Attributes:
        joints: their indices.
        placement: of the ball joint on their parent.
    """

    def __init__(self, model: pin.Model, name: str, joints: Sequence[str]) -> None:
        self.name = name
        self.joints = [model.getJointId(joint) for joint in joints]
        first, second, third = self.joints
        successive = model.parents[second] == first and model.parents[third] == second
        between = [model.jointPlacements[joint] for joint in (second, third)]
        to_last = [(between[0] * between[1]).rotation.T, between[1].rotation.T, np.eye(3)]
        self.axes = np.column_stack([at @ axis(model.joints[j]) for at, j in zip(to_last, self.joints, strict=True)])
        apart = max(float(np.abs(placement.translation).max()) for placement in between)
        if not successive or apart > _EXACT or np.abs(self.axes.T @ self.axes - np.eye(3)).max() > _EXACT:
            raise LoadError(
                f"ball joint '{name}': the joints {', '.join(joints)} are not successive joints with the same origin "
                "and axes at right angles: correct them, or remove the ball joint from 'balls'"
            )
        self.placement = model.jointPlacements[first] * between[0] * between[1]
        self.placement.translation = model.jointPlacements[first].translation

    def angles(self, rotation: Array) -> tuple[float, float, float]:
        """Return the three angles of a rotation."""
        r = self.axes.T @ rotation @ self.axes  # Rx(a) Ry(b) Rz(c); with left-handed axes, by negative angles
        sign = 1.0 if np.linalg.det(self.axes) > 0.0 else -1.0
        if np.hypot(r[0, 0], r[0, 1]) < _LOCKED:
            a, c = np.arctan2(r[2, 1], r[1, 1]), 0.0
        else:
            a, c = np.arctan2(-r[1, 2], r[2, 2]), np.arctan2(-r[0, 1], r[0, 0])
        b = np.arctan2(r[0, 2], np.hypot(r[0, 0], r[0, 1]))
        return sign * float(a), sign * float(b), sign * float(c)
