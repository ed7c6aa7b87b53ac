"""`RaffRobot` -> URDF, built with yourdfpy's classes and written by its writer.

Joint variables keep RAFF's own zero: the joint of a revolute link stands at Rz(gamma) Tz(epsilon) Rx(alpha)
Tx(d) Tz(r) and turns by theta about its z, that of a prismatic link at Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d)
Rz(theta) and slides by r along it.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import yourdfpy
from lxml import etree

from raff2urdf.document import Document, JointType, RaffFrame, RaffLink, RaffNode, RaffRobot
from raff2urdf.graphics.meshes import Graphics
from raff2urdf.graphics.skeleton import SkeletonDrawing
from raff2urdf.kleinfinger import transform
from raff2urdf.placement import roll_pitch_yaw
from raff2urdf.readers.urdf import UNLIMITED
from raff2urdf.tree import BASE_JOINT, kleinfinger, limits, velocity

_WORLD = "world"


def urdf(
    document: Document, robot: RaffRobot, beside: Path, out: Path | None = None, graphics: Graphics | None = None
) -> tuple[str, list[str]]:
    """The robot's tree as URDF text; see `tree` for arguments and what could not be shown."""
    model, missing = tree(document, robot, beside, out, graphics)
    return dumps(model), missing


def tree(
    document: Document, robot: RaffRobot, beside: Path, out: Path | None = None, graphics: Graphics | None = None
) -> tuple[yourdfpy.Robot, list[str]]:
    """The robot's tree as yourdfpy's classes.

    Args:
        document: that holds the robot.
        robot: which one.
        beside: the RAFF file's folder; graphics are looked for from there.
        out: the folder the URDF will stand in, from which it names its meshes; absolute names if there is none.
        graphics: takes the meshes that must be converted; unless said, they go to the user's cache.

    Returns:
        the tree, and what could not be shown: one line for each node without some of its graphics.
    """
    graphics = graphics or Graphics(robot, beside)
    missing: list[str] = []
    skeleton = SkeletonDrawing(document, robot)
    links, joints = [], []

    def body(part: RaffNode) -> yourdfpy.Link:
        drawings, reasons = graphics.of(part)
        if reasons:
            missing.append(f"{part.node}: {', '.join(reasons)}")
        visuals = [drawing.visual(out, document.metres(1.0)) for drawing in drawings]
        bare = part.filenames == ()  # nothing is to be seen there
        return yourdfpy.Link(name=part.node, visuals=visuals if visuals or bare else skeleton.draw(part))

    placement = transform(kleinfinger(document, robot.base))
    if robot.movable or not np.array_equal(placement, np.eye(4)):
        links.append(yourdfpy.Link(name=_WORLD))
        kind = "floating" if robot.movable else "fixed"
        joints.append(yourdfpy.Joint(name=BASE_JOINT, type=kind, parent=_WORLD, child="base", origin=placement))
    links.append(body(robot.base))
    for part in robot.parts:
        links.append(body(part))
        joints.append(_joint(document, robot, part))
    return yourdfpy.Robot(name=robot.name, links=links, joints=joints), missing


def dumps(model: yourdfpy.Robot) -> str:
    """The text of a URDF."""
    exact = _Exact(
        model,
        build_scene_graph=False,
        filename_handler=yourdfpy.filename_handler_null,  # mesh names are right as they stand
    )
    text: bytes = etree.tostring(exact.write_xml(), xml_declaration=True, encoding="utf-8", pretty_print=True)
    return text.decode()


def _joint(document: Document, robot: RaffRobot, part: RaffLink | RaffFrame) -> yourdfpy.Joint:
    parameters = kleinfinger(document, part)
    kind = part.type if isinstance(part, RaffLink) else JointType.FIXED
    if kind is JointType.REVOLUTE:
        parameters = parameters._replace(theta=0.0)
    elif kind is JointType.PRISMATIC:
        parameters = parameters._replace(r=0.0)
    joint = yourdfpy.Joint(
        name=part.joint,
        type="fixed",
        parent=robot.nodes[part.pred].node,
        child=part.node,
        origin=transform(parameters),
    )
    if isinstance(part, RaffLink) and kind is not JointType.FIXED:
        joint.axis = np.array([0.0, 0.0, 1.0])
        low, high = limits(document, part)
        speed = velocity(document, part)
        joint.limit = yourdfpy.Limit(effort=UNLIMITED, velocity=min(speed, UNLIMITED))
        joint.type = "revolute" if kind is JointType.REVOLUTE else "prismatic"
        if kind is JointType.REVOLUTE and math.isinf(low):
            joint.type = "continuous"
        else:
            joint.limit.lower, joint.limit.upper = (min(max(x, -UNLIMITED), UNLIMITED) for x in (low, high))
    return joint


class _Exact(yourdfpy.URDF):  # type: ignore[misc]
    """yourdfpy's writer, with angles that stay exact where its own lose nine digits (pitch near 90 degrees)."""

    def _write_origin(self, xml_parent: etree._Element, origin: np.ndarray | None) -> None:
        if origin is None:
            return
        xyz, rpy = origin[:3, 3].tolist(), roll_pitch_yaw(origin)
        etree.SubElement(xml_parent, "origin", xyz=" ".join(map(_number, xyz)), rpy=" ".join(map(_number, rpy)))


def _number(value: float) -> str:
    return repr(value + 0.0)  # no -0.0; the shortest text that reads back to the same double
