"""Values of joints and poses in mm and degrees, for users."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.model import Mechanism

if TYPE_CHECKING:
    from cinegen.workspace.extent import Extent

Array = NDArray[np.float64]

_ROUNDING = 1e-9  # of an extent
_LONG = ("x", "y", "z", "radius", "way")


def in_user_units(mechanism: Mechanism, joint: str, value: float) -> tuple[float, str]:
    """Return a joint's value in mm or degrees, and the unit.

    Raises:
        UnknownNameError: no such joint.
    """
    return (1e3 * value, "mm") if mechanism.is_prismatic(joint) else (math.degrees(value), "degrees")


def user_scale(mechanism: Mechanism, name: str) -> tuple[float, str]:
    """Return the factor from SI to mm or degrees of a coordinate, and the unit.

    Args:
        mechanism: mechanism of the joints.
        name: coordinate of a pose, radius, path length or joint; any other is an angle.
    """
    long = name in _LONG or (name in mechanism.joints and mechanism.is_prismatic(name))
    return (1e3, "mm") if long else (math.degrees(1.0), "°")


def coordinate_text(mechanism: Mechanism, name: str, si: float) -> str:
    """Return a coordinate (see `user_scale`) with its value, such as `x 21.74 mm` or `rz −90°`."""
    scale, unit = user_scale(mechanism, name)
    number = f"{rounded(si * scale, 6):.4g}".replace("-", "−")
    return f"{name} {number}{unit if unit == '°' else f' {unit}'}"


def raised(unit: str) -> str:
    """Return a unit with typographic powers: m² for m^2."""
    return re.sub(r"\^(\d)", lambda power: "⁰¹²³⁴⁵⁶⁷⁸⁹"[int(power[1])], unit)


def value_text(mechanism: Mechanism, joint: str, value: float) -> str:
    """Return a joint's value with its unit, such as `21.741 mm`.

    Raises:
        UnknownNameError: no such joint.
    """
    number, unit = in_user_units(mechanism, joint, value)
    return f"{rounded(number, 3):.3f} {unit}"


def pose_numbers(placement: pin.SE3) -> Array:
    """Return x, y, z (mm) and roll, pitch, yaw (degrees) of a pose, (6,), as URDF defines them (R = Rz(yaw) Ry(pitch)
    Rx(roll))."""
    turned = np.degrees(pin.rpy.matrixToRpy(placement.rotation))
    return np.concatenate([1e3 * placement.translation, turned])


def rounded(number: float, digits: int) -> float:
    """Return a rounded number, without negative zero."""
    return round(number, digits) + 0.0


def extent_text(extent: Extent) -> str:
    """Return an extent with its error, unless that is rounding, with typographic powers."""
    exact = extent.error <= _ROUNDING * extent.value
    return raised(str(replace(extent, low=extent.value, high=extent.value) if exact else extent))
