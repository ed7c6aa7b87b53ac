"""An obstacle as a mechanism: a body that can be moved freely, or in the plane of a robot that moves in one;
half-spaces can't be moved. So obstacles are picked, dragged, pinned, undone, recorded and shown as robots are."""

from __future__ import annotations

from typing import Any

from lxml import etree

from cinegen.collision import Obstacle
from cinegen.model import Mechanism
from cinegen.model.load import build
from cinegen.session.looks import Looks
from cinegen.session.solids import KEY, said
from raff2urdf.readers.urdf import UNLIMITED

IS_ONE = "obstacle"
"""In the constraints of a mechanism that is one."""

_SLIDES = (("x", "prismatic", "1 0 0"), ("y", "prismatic", "0 1 0"), ("turn", "revolute", "0 0 1"))


def is_obstacle(mechanism: Mechanism) -> bool:
    """Whether a mechanism stands for an obstacle."""
    return bool((mechanism.source.constraints or {}).get(IS_ONE, False))


def mechanism_of(obstacle: Obstacle, name: str, looks: Looks) -> Mechanism:
    """An obstacle as a mechanism, whose world is the obstacle's own frame where the scene has it.

    Args:
        obstacle: of a scene.
        name: of its only node.
        looks: how the scene is drawn.
    """
    robot = etree.Element("robot", name=name)
    joints: list[dict[str, Any]] = []
    floating = None
    if obstacle.kind in ("half_space", "half_plane"):
        etree.SubElement(robot, "link", name=name)
    elif looks.flat is None:
        floating = f"{name} is free"
        _joint(robot, floating, "floating", f"place of {name}", name)
    else:
        parent = f"place of {name}"
        for word, kind, axis in _SLIDES:
            child = name if word == "turn" else f"{word} of {name}"
            _joint(robot, word, kind, parent, child, axis)
            joints.append(
                {"name": word, "type": kind, "home": 0.0, "limits": None, "velocity": None, "actuated": True}
            )  # fmt: skip
            parent = child
    beside = {"robot": name, "nodes": [name], "floating": floating, "joints": joints, "loops": []}
    drawn = said(looks.solids(obstacle))
    return build(etree.tostring(robot, encoding="unicode"), {**beside, IS_ONE: True, KEY: drawn}, name=name)


def _joint(robot: Any, name: str, kind: str, parent: str, child: str, axis: str = "0 0 1") -> None:
    for link in (parent, child):
        if all(known.get("name") != link for known in robot.iterchildren("link")):
            etree.SubElement(robot, "link", name=link)
    joint = etree.SubElement(robot, "joint", name=name, type=kind)
    etree.SubElement(joint, "parent", link=parent)
    etree.SubElement(joint, "child", link=child)
    etree.SubElement(joint, "axis", xyz=axis)
    limits = {"lower": repr(-UNLIMITED), "upper": repr(UNLIMITED), "effort": "0", "velocity": "0"}
    etree.SubElement(joint, "limit", limits)
