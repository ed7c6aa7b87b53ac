"""Home of a URDF as an SRDF next to it states it, in a group state."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cinegen.errors import LoadError, warn
from cinegen.model.urdf import declared_joints, with_joints
from raff2urdf.errors import RaffError, did_you_mean, raised_as
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.srdf import read_home
from raff2urdf.readers.urdf import joints
from raff2urdf.readers.urdf_file import parse

_ROUNDING = 1e-3  # rad or m: by which a home may exceed limits without a word


def with_home(
    urdf: str, constraints: Mapping[str, Any] | None, srdf: Path, name: str, options: ReadOptions
) -> tuple[Mapping[str, Any] | None, list[str]]:
    """Return constraints with the home of an SRDF, unless the robot's file states one, and notes.

    Raises:
        LoadError: the SRDF can't be read.
    """
    states = constraints is not None and "robot" in constraints  # a constraints file, SDF and MJCF
    with raised_as(LoadError, RaffError):
        home = None if states else read_home(srdf, options)
    if home is None:
        return constraints, []
    declared = declared_joints(urdf, constraints, name)
    values, notes, beyond = dict(home.values), [f"home is {home.label}"], list[str]()
    for joint, value in home.values.items():
        if joint in declared and declared[joint]["limits"]:
            values[joint] = float(np.clip(value, *declared[joint]["limits"]))
            beyond += [joint] if abs(values[joint] - value) > _ROUNDING else []
    fixed = {joint.get("name") for joint in joints(parse(urdf, name))}
    unknown = [joint for joint in values if joint not in fixed and joint not in declared]
    if beyond:
        warn(f"{srdf}: {home.label} is outside the limits of {', '.join(beyond)}: held within them")
    if unknown:
        near = did_you_mean(unknown[0], list(declared))
        warn(f"{srdf}: {home.label} names what is no joint of the robot: {', '.join(unknown)}{near}")
    notes += [f"{home.label} places {', '.join(home.poses)}: not read"] if home.poses else []
    return with_joints(constraints, declared, {joint: {"home": value} for joint, value in values.items()}), notes
