"""The formats to which a robot can be written: URDF, and those of simulators, with masses, at home, loops in elements.

Each is a module with a function `files(translation, stem, options)`, which returns the contents of the files by name,
relative to the folder to write to, the robot's own file first. A new format is a new module and one line here.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from raff2urdf.errors import RaffError, did_you_mean

if TYPE_CHECKING:  # a list of formats is available without importing these
    from raff2urdf.conversion import Translation

FORMATS: Mapping[str, str] = {
    "urdf": "raff2urdf.writers.urdf",
    "sdf": "raff2urdf.writers.sdf",
    "mjcf": "raff2urdf.writers.mjcf",
}

DIALECTS = ("json", "constraint", "urdf+", "closing-frames", "mimic", "robot.yaml")
"""How a URDF declares loops and couplings to other programs: see `raff2urdf.writers.urdf_dialects`."""

DENSITY = 1000.0
"""Density of links by default, kg/m3: that of water, and nearly that of plastics. A bar of it weighs as much as a tube
of aluminium whose wall is a fifth of its radius."""


@dataclass(frozen=True, slots=True)
class WriteOptions:
    """Options of the writers; each writer uses those that concern its format.

    Attributes:
        density: of the links, kg/m3; `DENSITY` if None.
        dialect: in which a URDF declares loops and couplings; one of `DIALECTS`.
    """

    density: float | None = None
    dialect: str = "json"


def files(format: str, translation: Translation, stem: str, options: WriteOptions) -> dict[str, bytes]:
    """Return the files of a robot in a format.

    Args:
        format: one of `FORMATS`.
        translation: the robot.
        stem: of the files' names.
        options: of the writer.

    Raises:
        RaffError: there is no such format, or it has no notation for something in the robot.
    """
    if format not in FORMATS:
        raise RaffError(f"there is no format '{format}'{did_you_mean(format, list(FORMATS))}")
    if options.dialect not in DIALECTS:
        raise RaffError(f"there is no dialect '{options.dialect}'{did_you_mean(options.dialect, list(DIALECTS))}")
    contents: dict[str, bytes] = importlib.import_module(FORMATS[format]).files(translation, stem, options)
    return contents
