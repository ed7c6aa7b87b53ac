"""Values of joints and places as people read them: mm and degrees."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.model import Mechanism

Array = NDArray[np.float64]

_LONG = ("x", "y", "z", "radius", "way")


def shown(mechanism: Mechanism, joint: str, value: float) -> tuple[float, str]:
    """A joint's value in mm or degrees, and the unit.

    Raises:
        UnknownNameError: no such joint.
    """
    return (1e3 * value, "mm") if mechanism.slides(joint) else (math.degrees(value), "degrees")


def readable(mechanism: Mechanism, name: str) -> tuple[float, str]:
    """What a coordinate's SI value is multiplied by to be read, and the unit that makes: mm or °.

    Args:
        mechanism: whose joints there are.
        name: of a coordinate of a pose, a radius or a way, or of a joint; any other is an angle.
    """
    long = name in _LONG or (name in mechanism.joints and mechanism.slides(name))
    return (1e3, "mm") if long else (math.degrees(1.0), "°")


def said(mechanism: Mechanism, joint: str, value: float) -> str:
    """A joint's value with its unit, such as `21.741 mm`.

    Raises:
        UnknownNameError: no such joint.
    """
    number, unit = shown(mechanism, joint, value)
    return f"{quiet(number, 3):.3f} {unit}"


def place(placement: pin.SE3) -> Array:
    """(6,) x, y, z in mm, and roll, pitch, yaw in degrees as URDF counts them (R = Rz(yaw) Ry(pitch) Rx(roll))."""
    turned = np.degrees(pin.rpy.matrixToRpy(placement.rotation))
    return np.concatenate([1e3 * placement.translation, turned])


def quiet(number: float, digits: int) -> float:
    """Rounded, and never minus zero."""
    return round(number, digits) + 0.0
