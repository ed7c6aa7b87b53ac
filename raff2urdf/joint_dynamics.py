"""Numbers of a joint that count in forces only: the inertia of its rotors and its friction."""

from __future__ import annotations

from typing import NamedTuple


class JointDynamics(NamedTuple):
    """What a joint adds to the torque (N m) or force (N) that moves it: armature times its acceleration, damping times
    its velocity, and friction against the direction of its velocity. SI units and radians.

    Attributes:
        armature: inertia of the rotors that it turns, as seen at the joint, kg m^2 or kg.
        damping: viscous friction, N m s/rad or N s/m.
        friction: Coulomb friction, N m or N.
    """

    armature: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
