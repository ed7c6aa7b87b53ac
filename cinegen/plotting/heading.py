"""Titles of a map's picture: robot, fixed coordinates, extent of the workspace."""

from __future__ import annotations

from dataclasses import replace

from cinegen.plotting.units import coordinate_text, raised
from cinegen.singularities.slice import POSE
from cinegen.workspace.extent import Extent
from cinegen.workspace.region import SPHERICAL
from cinegen.workspace.specification import MapSpecification

_ROUNDING = 1e-9
_ROTATIONS = {0: "any orientation", 2: "direction of its z given", 3: "orientation given"}


def heading(spec: MapSpecification, name: str | None = None) -> str:
    """Return the first title: robot and subject."""
    robot = name or spec.mechanism.name
    return f"{robot}: over {', '.join(spec.region.names)}" if spec.over_joints else f"{robot}: reach of {spec.node}"


def given(spec: MapSpecification, text: str) -> str:
    """Return the fixed coordinates, followed by a text."""
    region = spec.region
    parts = [coordinate_text(spec.mechanism, *one) for one in region.at.items()]
    if any(name in SPHERICAL for name in (*region.names, *region.at)):
        centre = zip("xyz", region.centre or (0.0,) * 3, strict=True)
        parts.append(f"seen from {', '.join(coordinate_text(spec.mechanism, *one) for one in centre)}")
    if not spec.over_joints and not (spec.rotation == 3 and any(name in POSE[3:] for name in region.at)):
        parts.append(_ROTATIONS[spec.rotation])
    if not spec.limits:
        parts.append("joint limits left out")
    return "; ".join([*parts, text])


def printed(extent: Extent) -> str:
    """Return an extent with its error, unless that is rounding, with typographic powers."""
    exact = extent.error <= _ROUNDING * extent.value
    return raised(str(replace(extent, low=extent.value, high=extent.value) if exact else extent))
