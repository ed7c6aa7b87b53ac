"""Titles of a map's picture: robot, fixed coordinates, size of the workspace."""

from __future__ import annotations

from dataclasses import replace

from cinegen.plotting.units import rounded, user_scale
from cinegen.singularities.slice import POSE
from cinegen.workspace.extent import Extent
from cinegen.workspace.region import SPHERICAL
from cinegen.workspace.specification import MapSpecification

_POWERS = {"^2": "²", "^3": "³", "^4": "⁴", "^5": "⁵", "^6": "⁶"}
_ROUNDING = 1e-9
_TURNED = {0: "any orientation", 2: "direction of its z given", 3: "orientation given"}


def heading(spec: MapSpecification, name: str | None = None) -> str:
    """Return the first title: robot and subject."""
    robot = name or spec.mechanism.name
    return f"{robot}: over {', '.join(spec.region.names)}" if spec.over_joints else f"{robot}: reach of {spec.node}"


def given(spec: MapSpecification, words: str) -> str:
    """Return the fixed coordinates, followed by a text."""
    region = spec.region
    parts = [value(spec, name, number) for name, number in region.at.items()]
    if any(name in SPHERICAL for name in (*region.names, *region.at)):
        centre = (value(spec, name, number) for name, number in zip("xyz", region.centre or (0.0,) * 3, strict=True))
        parts.append(f"seen from {', '.join(centre)}")
    if not spec.over_joints and not (spec.rotation == 3 and any(name in POSE[3:] for name in spec.region.at)):
        parts.append(_TURNED[spec.rotation])
    if not spec.limits:
        parts.append("joint limits left out")
    return "; ".join([*parts, words])


def value(spec: MapSpecification, name: str, si: float) -> str:
    """Return a coordinate with its value in mm or degrees."""
    scale, unit = user_scale(spec.mechanism, name)
    number = f"{rounded(si * scale, 6):.4g}".replace("-", "−")
    return f"{name} {number} mm" if unit == "mm" else f"{name} {number}°"


def size_words(spec: MapSpecification, extent: Extent) -> str:
    """Return the size of the workspace."""
    return f"{'possible' if spec.over_joints else 'reached'}: {printed(extent)}"


def printed(extent: Extent) -> str:
    """Return an extent with its error, unless that is rounding, with typographic powers."""
    exact = extent.error <= _ROUNDING * extent.value
    words = str(replace(extent, low=extent.value, high=extent.value) if exact else extent)
    for typed, letter in _POWERS.items():
        words = words.replace(typed, letter)
    return words
