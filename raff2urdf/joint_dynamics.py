"""Numbers of a joint that count in forces only: the inertia of its rotors and its friction."""

from __future__ import annotations

from typing import NamedTuple


class JointDynamics(NamedTuple):
    """Inertia and friction of a joint itself; SI units and radians. To the torque (N m) or force (N) that moves it they
    add armature times acceleration, damping times velocity, and friction in the direction of the velocity.

    Attributes:
        armature: inertia of the rotors that it turns, as seen at the joint, kg m^2 or kg.
        damping: viscous friction, N m s/rad or N s/m.
        friction: Coulomb friction, N m or N.
    """

    armature: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
