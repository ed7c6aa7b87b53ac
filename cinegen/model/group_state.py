"""Home of a URDF as an SRDF next to it states it, in a group state."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cinegen.errors import LoadError, warn
from cinegen.model.urdf import completed, simple
from raff2urdf.errors import RaffError, did_you_mean, raised_as
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.srdf import read_home
from raff2urdf.readers.urdf import joints
from raff2urdf.readers.urdf_file import parse

_ROUNDING = 1e-3  # rad or m: by which a home may exceed limits without a word


def with_home(
    urdf: str, constraints: Mapping[str, Any] | None, srdf: Path | None, name: str, options: ReadOptions
) -> tuple[Mapping[str, Any] | None, list[str]]:
    """Return constraints with the home of an SRDF, unless the robot's file states one, and notes.

    Raises:
        LoadError: the SRDF can't be read.
    """
    states = constraints is not None and "robot" in constraints  # a constraints file, SDF and MJCF
    with raised_as(LoadError, RaffError):
        home = None if srdf is None or states else read_home(srdf, options)
    if home is None:
        return constraints, []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # `build` warns
        tree = parse(urdf, name)
        fixed = {str(joint.get("name")) for joint in joints(tree)}
        declared = completed(simple(tree, name), constraints, name)["joints"]
    values, notes, beyond = dict(home.values), [f"home is {home.label}"], list[str]()
    for joint in declared:
        if joint["name"] in values and joint["limits"]:
            held = float(np.clip(values[joint["name"]], *joint["limits"]))
            beyond += [joint["name"]] if abs(held - values[joint["name"]]) > _ROUNDING else []
            values[joint["name"]] = held
    unknown = [key for key in values if key not in fixed and key not in {joint["name"] for joint in declared}]
    if beyond:
        warn(f"{srdf}: {home.label} is outside the limits of {', '.join(beyond)}: held within them")
    if unknown:
        near = did_you_mean(unknown[0], [joint["name"] for joint in declared])
        warn(f"{srdf}: {home.label} names what is no joint of the robot: {', '.join(unknown)}{near}")
    notes += [f"{home.label} places {', '.join(home.poses)}: not read"] if home.poses else []
    defaults = {joint["name"]: {"home": joint["home"]} if not constraints else {} for joint in declared}
    entries = (constraints or {}).get("joints", [{"name": joint["name"]} for joint in declared])
    moved = [
        {**defaults[entry["name"]], **entry, **({"home": values[entry["name"]]} if entry["name"] in values else {})}
        for entry in entries
    ]
    return {**(constraints or {"loops": []}), "joints": moved}, notes
