"""What stands above a map's picture: which robot, what is held, how much is reached."""

from __future__ import annotations

from dataclasses import replace

from cinegen.plotting.words import quiet, readable
from cinegen.singularities.slice import POSE
from cinegen.workspace.extent import Extent
from cinegen.workspace.region import AROUND
from cinegen.workspace.survey import Survey

_POWERS = {"^2": "²", "^3": "³", "^4": "⁴", "^5": "⁵", "^6": "⁶"}
_ROUNDING = 1e-9
_TURNED = {0: "any orientation", 2: "direction of its z given", 3: "orientation given"}


def heading(survey: Survey, name: str | None = None) -> str:
    """Whose map of what it is."""
    robot = name or survey.mechanism.name
    return f"{robot}: over {', '.join(survey.region.names)}" if survey.of_motors else f"{robot}: reach of {survey.node}"


def given(survey: Survey, words: str) -> str:
    """What is held, and more."""
    region = survey.region
    parts = [value(survey, name, number) for name, number in region.at.items()]
    if any(name in AROUND for name in (*region.names, *region.at)):
        centre = (value(survey, name, number) for name, number in zip("xyz", region.centre or (0.0,) * 3, strict=True))
        parts.append(f"seen from {', '.join(centre)}")
    if not survey.of_motors and not (survey.rotation == 3 and any(name in POSE[3:] for name in survey.region.at)):
        parts.append(_TURNED[survey.rotation])
    if not survey.limits:
        parts.append("joint limits left out")
    return "; ".join([*parts, words])


def value(survey: Survey, name: str, si: float) -> str:
    """Of a coordinate, in mm or degrees."""
    scale, unit = readable(survey.mechanism, name)
    number = f"{quiet(si * scale, 6):.4g}".replace("-", "−")
    return f"{name} {number} mm" if unit == "mm" else f"{name} {number}°"


def size_words(survey: Survey, extent: Extent) -> str:
    """How much is reached."""
    return f"{'possible' if survey.of_motors else 'reached'}: {printed(extent)}"


def printed(extent: Extent) -> str:
    """An extent and its error, unless that is rounding, in letters for paper."""
    exact = extent.error <= _ROUNDING * extent.value
    words = str(replace(extent, low=extent.value, high=extent.value) if exact else extent)
    for typed, letter in _POWERS.items():
        words = words.replace(typed, letter)
    return words
