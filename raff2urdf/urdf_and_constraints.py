"""A robot as a URDF, and what that can't say beside it; its loops also in the URDF, if asked.

There is no standard for loops in a URDF. The elements are those of a proposal to ROS
(https://github.com/ros/urdfdom_headers/pull/108); whoever doesn't know them passes over them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from raff2urdf.constraints import dumps
from raff2urdf.formats import Described
from raff2urdf.placement import roll_pitch_yaw
from raff2urdf.readers.declared_loops import note
from raff2urdf.readers.sidecar import ENDING
from raff2urdf.xml_text import numerals, text_of

TYPES: Mapping[str, str] = {"rigid": "link", "prismatic": "prismatic", "revolute": "revolute", "ball": "spherical"}
"""The proposal's word for each kind of loop: what was cut. It also knows `universal`, which RAFF doesn't."""


def files(described: Described) -> dict[str, bytes]:
    """What is written: the robot's own file first."""
    text = described.urdf
    if described.constraint_elements:
        text = with_constraints(text, described.constraints)
    beside = f"{described.stem}{ENDING}"
    if described.constraints["loops"]:
        text = with_note(text, beside, len(described.constraints["loops"]))
    return {f"{described.stem}.urdf": text.encode(), beside: dumps(dict(described.constraints)).encode()}


def with_note(urdf: str, file: str, loops: int) -> str:
    """Return the text of a URDF with a comment that names the file with its loops.

    Args:
        urdf: its text.
        file: name of the file.
        loops: how many are in it.
    """
    root = etree.fromstring(urdf.encode(), etree.XMLParser(remove_blank_text=True))
    root.insert(0, note(file, loops))
    return text_of(root)


def with_constraints(urdf: str, constraints: Mapping[str, Any]) -> str:
    """The text of a URDF, with an element `constraint` for each loop."""
    root = etree.fromstring(urdf.encode(), etree.XMLParser(remove_blank_text=True))
    for loop in constraints["loops"]:
        kind = TYPES[loop["kind"]]
        element = etree.SubElement(root, "constraint", name=loop["name"], type=kind)
        for word, which in (("parent", "first"), ("child", "second")):
            placement: NDArray[np.float64] = np.array(loop[which]["placement"], dtype=float)
            etree.SubElement(element, word, link=loop[which]["node"])
            etree.SubElement(
                element,
                f"{word}_origin",
                xyz=numerals(placement[:3, 3]),
                rpy=numerals(roll_pitch_yaw(placement)),
            )
            if kind in ("prismatic", "revolute"):
                etree.SubElement(element, f"{word}_axis", xyz="0 0 1")  # in the axes of the origin above
    return text_of(root)
