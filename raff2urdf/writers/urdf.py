"""Write a robot as URDF, and its constraints file.

Joint variables keep RAFF's own zero: the joint of a revolute link is placed at Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d)
Tz(r) and rotates by theta about its z; that of a prismatic link at Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d) Rz(theta) and
translates by r along it.

URDF has no standard element for loops. Those written on request are of a proposal to ROS
(ros/urdfdom_headers#108); programs that don't know them ignore them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from raff2urdf import constraints as constraints_file
from raff2urdf.document import Document, JointType, RaffLink, RaffNode, RaffPart, RaffRobot
from raff2urdf.graphics.meshes import Graphics
from raff2urdf.graphics.skeleton import SkeletonDrawing
from raff2urdf.kleinfinger import transform
from raff2urdf.placement import roll_pitch_yaw
from raff2urdf.readers.declared_loops import note
from raff2urdf.readers.sidecar import ENDING
from raff2urdf.readers.urdf import UNLIMITED
from raff2urdf.tree import BASE_JOINT, WORLD, kleinfinger, limits, moved, velocity
from raff2urdf.urdf_model import UrdfJoint, UrdfLimit, UrdfLink, UrdfRobot, to_xml
from raff2urdf.writers.xml_text import numerals, text_of

if TYPE_CHECKING:
    from raff2urdf.conversion import Translation
    from raff2urdf.writers import WriteOptions

_LOOP_TYPES = {"rigid": "link", "prismatic": "prismatic", "revolute": "revolute", "ball": "spherical"}
"""The proposal's name for each kind of loop: the joint that was cut."""


def files(translation: Translation, stem: str, options: WriteOptions) -> dict[str, bytes]:
    """Return the URDF and the constraints file."""
    values, sidecar = translation.constraints, f"{stem}{ENDING}"
    text = translation.urdf
    if values["loops"]:
        root = etree.fromstring(text.encode(), etree.XMLParser(remove_blank_text=True))
        root.insert(0, note(sidecar, len(values["loops"])))
        if options.constraint_elements:
            add_constraints(root, values)
        text = text_of(root)
    return {f"{stem}.urdf": text.encode(), sidecar: constraints_file.dumps(values).encode()}


def add_constraints(root: etree._Element, values: Mapping[str, Any]) -> None:
    """Append an element `constraint` for each loop to the root of a URDF."""
    for loop in values["loops"]:
        kind = _LOOP_TYPES[loop["kind"]]
        element = etree.SubElement(root, "constraint", name=loop["name"], type=kind)
        for word, which in (("parent", "first"), ("child", "second")):
            placement: NDArray[np.float64] = np.array(loop[which]["placement"], dtype=float)
            xyz, rpy = numerals(placement[:3, 3]), numerals(roll_pitch_yaw(placement))
            etree.SubElement(element, word, link=loop[which]["node"])
            etree.SubElement(element, f"{word}_origin", xyz=xyz, rpy=rpy)
            if kind in ("prismatic", "revolute"):
                etree.SubElement(element, f"{word}_axis", xyz="0 0 1")  # in the axes of the origin above


def tree(
    document: Document, robot: RaffRobot, graphics: Graphics, out: Path | None = None
) -> tuple[UrdfRobot, list[str]]:
    """Return the tree of a robot.

    Args:
        document: that holds the robot.
        robot: the robot.
        graphics: of the robot.
        out: the folder to which the URDF will be written, relative to which it names its meshes; absolute names if
            None.

    Returns:
        the tree, and what can't be shown: one line for each node that lacks some of its graphics.
    """
    missing: list[str] = []
    skeleton = SkeletonDrawing(document, robot)
    links, joints = [], []

    def body(node: RaffNode) -> UrdfLink:
        drawings, reasons = graphics.of(node)
        if reasons:
            missing.append(f"{node.node}: {', '.join(reasons)}")
        visuals = [drawing.visual(out, document.metres(1.0)) for drawing in drawings]
        if not visuals and node.filenames != ():  # `filename { }` shows nothing
            visuals = skeleton.draw(node)
        return UrdfLink(name=node.node, visuals=visuals)

    placement = transform(kleinfinger(document, robot.base.parameters))
    if robot.movable or not np.array_equal(placement, np.eye(4)):
        links.append(UrdfLink(name=WORLD))
        kind = "floating" if robot.movable else "fixed"
        joints.append(UrdfJoint(name=BASE_JOINT, type=kind, parent=WORLD, child="base", origin=placement))
    links.append(body(robot.base))
    for part in robot.parts:
        links.append(body(part))
        joints.append(_joint(document, robot, part))
    return UrdfRobot(name=robot.name, links=links, joints=joints), missing


def dumps(model: UrdfRobot) -> str:
    """Return the text of a URDF."""
    return text_of(to_xml(model))


def _joint(document: Document, robot: RaffRobot, part: RaffPart) -> UrdfJoint:
    parameters = kleinfinger(document, part.parameters)
    origin, parent = transform(moved(part, parameters, 0.0)), robot.nodes[part.pred].node
    joint = UrdfJoint(part.joint, type="fixed", parent=parent, child=part.node, origin=origin)
    if isinstance(part, RaffLink) and part.type is not JointType.FIXED:
        joint.axis = np.array([0.0, 0.0, 1.0])
        low, high = limits(document, part)
        joint.limit = UrdfLimit(effort=UNLIMITED, velocity=min(velocity(document, part), UNLIMITED))
        joint.type = part.type.name.lower()
        if part.type is JointType.REVOLUTE and math.isinf(low):
            joint.type = "continuous"
        else:
            joint.limit.lower, joint.limit.upper = (min(max(x, -UNLIMITED), UNLIMITED) for x in (low, high))
    return joint
