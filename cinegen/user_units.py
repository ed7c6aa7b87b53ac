"""Values of joints, poses and extents in the units that users see: m or another unit of length, and degrees."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.model import Mechanism
from raff2urdf.quantities import ANGLE, LENGTH, Dimension, shown_scale

if TYPE_CHECKING:
    from cinegen.workspace.extent import Extent


_ROUNDING = 1e-9  # of an extent
_LONG = ("x", "y", "z", "radius", "distance")
_STEP = 1e-6  # m: what texts of lengths resolve


def dimension_of_joint(mechanism: Mechanism, joint: str) -> Dimension:
    """Return whether a joint's value is a length or an angle.

    Raises:
        UnknownNameError: no such joint.
    """
    return LENGTH if mechanism.is_prismatic(joint) else ANGLE


def in_user_units(mechanism: Mechanism, joint: str, value: float) -> tuple[float, str]:
    """Return a joint's value in the user's unit of length or in degrees, and the unit.

    Raises:
        UnknownNameError: no such joint.
    """
    scale, unit = shown_scale(dimension_of_joint(mechanism, joint))
    return scale * value, unit


def user_scale(mechanism: Mechanism, name: str) -> tuple[float, str]:
    """Return the factor from SI to the user's unit of length or degrees of a coordinate, and the unit.

    Args:
        mechanism: mechanism of the joints.
        name: coordinate of a pose, radius, path length or joint; any other is an angle.
    """
    long = name in _LONG or (name in mechanism.joints and mechanism.is_prismatic(name))
    return shown_scale(LENGTH) if long else (math.degrees(1.0), "°")


def coordinate_text(mechanism: Mechanism, name: str, si: float) -> str:
    """Return a coordinate (see `user_scale`) with its value, such as `x 0.02174 m` or `rz −90°`."""
    scale, unit = user_scale(mechanism, name)
    number = f"{rounded(si * scale, 6):.4g}".replace("-", "−")
    return f"{name} {number}{unit if unit == '°' else f' {unit}'}"


def raised(unit: str) -> str:
    """Return a unit with typographic powers: m² for m^2."""
    return re.sub(r"\^(\d)", lambda power: "⁰¹²³⁴⁵⁶⁷⁸⁹"[int(power[1])], unit)


def length_digits() -> int:
    """Return the number of decimals with which lengths are shown: 6 in m, 3 in mm."""
    return max(0, round(-math.log10(_STEP * shown_scale(LENGTH)[0])))


def value_text(mechanism: Mechanism, joint: str, value: float) -> str:
    """Return a joint's value with its unit, such as `0.021741 m`.

    Raises:
        UnknownNameError: no such joint.
    """
    number, unit = in_user_units(mechanism, joint, value)
    digits = length_digits() if mechanism.is_prismatic(joint) else 3
    return f"{rounded(number, digits):.{digits}f} {unit}"


def pose_numbers(placement: pin.SE3) -> Array:
    """Return x, y, z (in the user's unit of length) and roll, pitch, yaw (degrees) of a pose, (6,), as URDF defines
    them (R = Rz(yaw) Ry(pitch) Rx(roll))."""
    turned = np.degrees(pin.rpy.matrixToRpy(placement.rotation))
    return np.concatenate([shown_scale(LENGTH)[0] * placement.translation, turned])


def rounded(number: float, digits: int) -> float:
    """Return a rounded number, without negative zero."""
    return round(number, digits) + 0.0


def extent_text(extent: Extent) -> str:
    """Return an extent with its error, unless that is rounding, with typographic powers."""
    exact = extent.error <= _ROUNDING * extent.value
    return raised(str(replace(extent, low=extent.value, high=extent.value) if exact else extent))
