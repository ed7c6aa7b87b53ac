"""`MotionGroup`: the group of displacements that a node's motions generate, and joints that move a frame likewise.

Motions in a plane, about a point, or without rotation never leave their group: a Lie subgroup of all displacements (J.
M. Herve, "The Lie group of rigid body displacements, a fundamental tool for mechanism design", Mechanism and Machine
Theory 34, 1999). It is found as the smallest Lie algebra that contains the node's twists.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array

_RANK = 1e-7  # part of the largest singular value


@dataclass(frozen=True, eq=False)
class MotionGroup:
    """A group of displacements: translations, then rotations about none, one or three axes through a point.

    Attributes:
        rotations: 0, 1 or 3.
        axis: (3,) unit vector of the only axis of rotation; of no use otherwise.
        point: (3,) on the axes, m.
        directions: (n, 3) orthonormal directions of its translations.
    """

    rotations: int
    axis: Array
    point: Array
    directions: Array

    @property
    def dimension(self) -> int:
        """Number of its DoF."""
        return self.rotations + len(self.directions)

    @property
    def description(self) -> str:
        """A part of a sentence: `in a plane`, `about a point`."""
        if self.rotations == 0:
            return "without rotation"
        if self.rotations == 3:
            return "about a point" if not len(self.directions) else "in space"
        flat = len(self.directions) == 2
        return "in a plane" if flat else f"with rotations about {np.round(self.axis, 3).tolist()} only"

    @property
    def origin(self) -> Array:
        """(3,) where the frame of its last joint is when all are at 0; m."""
        return self.point if self.rotations else np.zeros(3)

    def joints(self) -> list[tuple[object, pin.SE3]]:
        """Return joints in series that move a frame so, each with its placement in the one before."""
        steps: list[tuple[object, pin.SE3]] = [
            (pin.JointModelPrismaticUnaligned(direction), pin.SE3.Identity()) for direction in self.directions
        ]
        axes = np.eye(3)[::-1] if self.rotations == 3 else [self.axis] * self.rotations
        places = [pin.SE3(np.eye(3), self.point), pin.SE3.Identity(), pin.SE3.Identity()]
        return steps + [(pin.JointModelRevoluteUnaligned(a), at) for a, at in zip(axes, places, strict=False)]

    def coordinates(self, displacement: pin.SE3) -> tuple[Array, pin.SE3]:
        """Return the values (dimension,) of these joints, m and rad, that make a displacement, or what is next to it;
        and the displacement that they make."""
        angles = self._angles(displacement.rotation)
        rotation = _rotation(self.axis, angles)
        rest = displacement.translation - (self.point - rotation @ self.point)
        along = self.directions @ rest
        made = pin.SE3(rotation, self.directions.T @ along + self.point - rotation @ self.point)
        return np.concatenate([along, angles]), made

    def _angles(self, rotation: Array) -> Array:
        if self.rotations == 3:
            return np.array(pin.rpy.matrixToRpy(rotation)[::-1])
        if self.rotations == 0:
            return np.zeros(0)
        side = np.linalg.svd(self.axis[None])[2][1]
        turned = rotation @ side
        return np.array([np.arctan2(np.cross(side, turned) @ self.axis, side @ turned)])


def _rotation(axis: Array, angles: Array) -> Array:
    if len(angles) == 3:
        return np.asarray(pin.rpy.rpyToMatrix(*angles[::-1]))
    return np.asarray(pin.exp3(axis * angles[0])) if len(angles) else np.eye(3)


def generated(twists: Array, length: float, near: Array) -> MotionGroup:
    """Return the group that a node's twists generate.

    Groups with helical motions are returned as all displacements.

    Args:
        twists: (6, n) linear velocity of the origin above angular velocity, m and rad.
        length: characteristic length, m.
        near: (3,) its axes are as near to this point as they can be, m.
    """
    basis = _span(twists / np.repeat([length, 1.0], 3)[:, None])
    while True:
        brackets = [_bracket(a, b) for k, a in enumerate(basis.T) for b in basis.T[:k]]
        larger = _span(np.column_stack([basis, *brackets]))
        if larger.shape[1] == basis.shape[1]:
            break
        basis = larger
    turning, values, mixed = np.linalg.svd(basis[3:])
    rotations = int((values > _RANK).sum())
    directions = _span(basis[:3] @ mixed[rotations:].T).T
    axis, point = np.array([0.0, 0.0, 1.0]), near / length
    if rotations == 1:
        axis, velocity = turning[:, 0], basis[:3] @ mixed[0] / values[0]
        centre = np.cross(axis, velocity)
        pitch = velocity + np.cross(axis, centre)
        if np.abs(pitch - directions.T @ (directions @ pitch)).max() > _RANK:
            return MotionGroup(3, axis, near, np.eye(3))
        free = np.vstack([directions, axis])
        point = centre + np.linalg.pinv(free) @ (free @ (point - centre))
    elif rotations == 3 and not len(directions):
        crosses = np.vstack([pin.skew(twist[3:]) for twist in basis.T])
        point = np.linalg.lstsq(crosses, -basis[:3].T.ravel(), rcond=None)[0]  # v + w x c = 0
    return MotionGroup(rotations, axis, length * point, directions)


def _span(columns: Array) -> Array:
    """Return an orthonormal basis (m, rank) of what columns (m, n) span."""
    u, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(u[:, values > _RANK * max(float(values.max(initial=0.0)), 1e-300)])


def _bracket(a: Array, b: Array) -> Array:
    return np.concatenate([np.cross(a[3:], b[:3]) + np.cross(a[:3], b[3:]), np.cross(a[3:], b[3:])])
