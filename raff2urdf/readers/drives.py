"""Joints that a URDF or an SDF names as driven: by transmissions, ros2_control, and plugins that control joints.

Such a list may be incomplete, or hold joints that depend on each other: it states which joints are actuated only where
the robot has loops or couplings, and only as far as it determines the motion (`cinegen.model.build.build`). In a tree
every joint is actuated.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from typing import TYPE_CHECKING, Any

from raff2urdf.errors import first_of
from raff2urdf.readers.loops.declaration import local

if TYPE_CHECKING:
    from raff2urdf.readers import Description

_CONTROLS = re.compile(r"control|drive|steer|ackermann|mecanum|motor|actuat|trajectory|joint_?force|thruster", re.I)
_OTHERS = re.compile(r"publish|sensor|mimic", re.I)
_MOST = 8  # joints that a note lists


def of_urdf(root: Any) -> list[tuple[str, Any]]:
    """Return the joints that transmissions, command interfaces and plugins of a URDF name, each with the element that
    is read for it."""
    driven: list[tuple[str, Any]] = []
    for element in root.iterchildren("transmission"):
        words = ((local(inner), inner.get("name")) for inner in element.iterchildren("*"))
        driven += [(name, element) for word, name in words if name and word.endswith("joint") and "passive" not in word]
    for joint in root.iterfind("ros2_control/joint"):
        mimics = any(param.get("name") == "mimic" for param in joint.iterchildren("param"))
        if joint.find("command_interface") is not None and not mimics:
            driven.append((joint.get("name", ""), joint))
    for element in root.iterchildren("gazebo"):
        driven += [(name, plugin) for name, _, plugin in of_plugins(element)]
    return driven


def of_plugins(around: Any) -> Iterator[tuple[str, int, Any]]:
    """Yield the joints that the plugins in an element name, if they control joints; which axis of each, 0 or 1; and the
    plugin."""
    for plugin in around.iterchildren("plugin"):
        label = f"{plugin.get('filename', '')} {plugin.get('name', '')}"
        if not _CONTROLS.search(label) or _OTHERS.search(label):
            continue
        axis = int(plugin.findtext("joint_index", "0").strip() == "1")
        for element in plugin.iter("*"):
            if "joint" in local(element):
                yield from ((name, axis, plugin) for name in (element.text or "").replace(",", " ").split())


def declared(robot: Description, driven: Collection[str], moving: Iterable[str] = ()) -> Description:
    """Return a robot whose actuated joints are those that its file names as driven, unless the file states them.

    Args:
        robot: as read.
        driven: what the file names.
        moving: the joints that move, of a robot without constraints.
    """
    values = robot.constraints
    entries = [{"name": joint} for joint in moving] if values is None else values["joints"]
    named = [entry["name"] for entry in entries if entry["name"] in driven]
    if not named or any(entry.get("actuated") for entry in entries):
        return robot
    if values is None or not (values["loops"] or values.get("couplings")):
        others = [entry["name"] for entry in entries if entry["name"] not in driven]
        note = f"nothing in the file drives {first_of(others, _MOST)}: actuated all the same"
        return robot._replace(notes=(*robot.notes, note)) if others else robot
    stated = [
        entry | {"actuated": entry["name"] in driven} if entry.get("actuated") is None else entry for entry in entries
    ]
    return robot._replace(constraints={**values, "joints": stated}, is_driven=True)
