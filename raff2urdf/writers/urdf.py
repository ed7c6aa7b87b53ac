"""Write a robot as URDF, and its constraints file.

Joint variables keep RAFF's own zero: the joint of a revolute link is placed at Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d)
Tz(r) and rotates by theta about its z; that of a prismatic link at Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d) Rz(theta) and
translates by r along it.

Loops and couplings are in the constraints file, and on request in the URDF too: see `urdf_dialects`.
"""

from __future__ import annotations

import math
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree
from yourdfpy import Collision, Dynamics, Joint, Limit, Link, Robot, Visual

from raff2urdf import constraints as constraints_file
from raff2urdf.bounds import UNLIMITED
from raff2urdf.errors import RaffWarning
from raff2urdf.files import GENERATED
from raff2urdf.graphics.bodies import BodyDrawing
from raff2urdf.graphics.body_shapes import Shape
from raff2urdf.graphics.meshes import Graphics
from raff2urdf.graphics.skeleton import MARK, SkeletonDrawing
from raff2urdf.raff.document import Document, JointType, RaffLink, RaffNode, RaffPart, RaffRobot
from raff2urdf.raff.kleinfinger import transform
from raff2urdf.raff.masses import RaffMasses
from raff2urdf.readers.loops.declared_loops import note
from raff2urdf.readers.loops.sidecar import ENDING
from raff2urdf.readers.urdf import hash_of
from raff2urdf.readers.xml_file import NAMESPACE
from raff2urdf.tree import BASE_JOINT, WORLD, effort, joint_dynamics, kleinfinger, limits, moved, velocity
from raff2urdf.writers.urdf_object import ExactUrdf, geometry, inertial, material_of
from raff2urdf.writers.xml_text import text_of

if TYPE_CHECKING:
    from raff2urdf.conversion import Translation
    from raff2urdf.writers import WriteOptions


def files(translation: Translation, stem: str, options: WriteOptions) -> dict[str, bytes]:
    """Return the URDF and the constraints file; of the dialect robot.yaml, that file too."""
    values, sidecar, more = translation.constraints, f"{stem}{ENDING}", dict[str, bytes]()
    root = translation.model.write_xml().getroot()
    root.insert(0, note(sidecar, len(values["loops"]), len(values.get("couplings", []))))
    if options.dialect != "json":
        more = _add_dialect(root, translation, stem, options.dialect)
    values = constraints_file.for_urdf(values, hash_of(root, f"{stem}.urdf"))
    if options.dialect != "json":
        element = etree.SubElement(root, f"{{{NAMESPACE}}}robot", nsmap={"raff": NAMESPACE})
        text = re.sub("[\ufffe\uffff]", lambda match: f"\\u{ord(match[0]):04x}", constraints_file.dumps(values))
        element.text = etree.CDATA("\n" + text)  # XML has not all characters
    text = constraints_file.dumps(values | {constraints_file.MARK: GENERATED})
    return {f"{stem}.urdf": text_of(root).encode(), sidecar: text.encode(), **more}


def _add_dialect(root: etree._Element, translation: Translation, stem: str, dialect: str) -> dict[str, bytes]:
    """Add loops and couplings in a dialect; return the content of the file that it needs, by name."""
    from raff2urdf.writers.urdf_dialects import UrdfDialectWriter

    joints = translation.model.robot.joints
    writer = UrdfDialectWriter(root, joints, translation.constraints, translation.analysis.length)
    writer.write(dialect)
    if writer.lost:
        what = f"{dialect} has no notation for {', '.join(writer.lost)}: only cinegen reads them, from raff:robot"
        warnings.warn(f"robot '{translation.robot.name}': {what}", RaffWarning, stacklevel=4)
    if writer.extended:
        what = f"URDF+ has no balls: {', '.join(writer.extended)} have the type spherical, which its own parser refuses"
        warnings.warn(f"robot '{translation.robot.name}': {what}", RaffWarning, stacklevel=4)
    return {f"{stem}.yaml": f"# {GENERATED}\n{writer.yaml}".encode()} if dialect == "robot.yaml" else {}


def tree(
    document: Document, robot: RaffRobot, graphics: Graphics, out: Path | None = None
) -> tuple[ExactUrdf, list[str]]:
    """Return the tree of a robot.

    Args:
        document: that holds the robot.
        robot: the robot.
        graphics: of the robot.
        out: the folder to which the URDF will be written, relative to which it names its meshes; absolute names if
            None.

    Returns:
        the tree, and what can't be shown: one line for each node that lacks some of its graphics.

    Raises:
        RaffError: a density without a volume.
    """
    missing: list[str] = []
    skeleton = SkeletonDrawing(document, robot)
    masses, bodies = RaffMasses(document, graphics, skeleton), BodyDrawing(document, robot)
    links, joints = [], []

    def body(node: RaffNode) -> Link:
        drawings, reasons = graphics.of(node)
        if reasons:
            missing.append(f"{node.node}: {', '.join(reasons)}")
        visuals = [drawing.visual(out, document.metres(1.0)) for drawing in drawings]
        collisions = []
        if not visuals and node.filenames != ():  # `filename { }` shows nothing
            visuals = [_visual(shape, graphics, out) for shape in bodies.of(node)]
            bars = enumerate(skeleton.draw(node))
            collisions = [Collision(f"{MARK} {i}", placed, shape) for i, (shape, placed) in bars]
        return Link(name=node.node, visuals=visuals, collisions=collisions, inertial=inertial(masses.of(node)))

    placement = transform(kleinfinger(document, robot.base.parameters))
    if robot.movable or not np.array_equal(placement, np.eye(4)):
        links.append(Link(name=WORLD))
        kind = "floating" if robot.movable else "fixed"
        joints.append(Joint(name=BASE_JOINT, type=kind, parent=WORLD, child="base", origin=placement))
    links.append(body(robot.base))
    for part in robot.parts:
        links.append(body(part))
        joints.append(_joint(document, robot, part))
    return ExactUrdf(Robot(robot.name, links, joints), folder=out or ""), missing


def _visual(shape: Shape, graphics: Graphics, out: Path | None) -> Visual:
    file = graphics.name_of(shape.recipe, out) if shape.recipe else ""
    name = "c" + "".join(f"{round(255 * channel):02x}" for channel in shape.colour)
    material = material_of(name, (*shape.colour, 1.0))
    return Visual(origin=shape.placement, geometry=geometry(shape.kind, shape.sizes, file), material=material)


def _joint(document: Document, robot: RaffRobot, part: RaffPart) -> Joint:
    parameters = kleinfinger(document, part.parameters)
    origin, parent = transform(moved(part, parameters, 0.0)), robot.nodes[part.pred].node
    joint = Joint(part.joint, type="fixed", parent=parent, child=part.node, origin=origin)
    if isinstance(part, RaffLink) and part.type is not JointType.FIXED:
        joint.axis = np.array([0.0, 0.0, 1.0])
        low, high = limits(document, part)
        joint.limit = Limit(min(effort(part), UNLIMITED), min(velocity(document, part), UNLIMITED))
        _, damping, friction = joint_dynamics(document, part)
        if damping or friction:
            joint.dynamics = Dynamics(damping, friction)
        joint.type = part.type.name.lower()
        if part.type is JointType.REVOLUTE and math.isinf(low):
            joint.type = "continuous"
        else:
            joint.limit.lower, joint.limit.upper = (min(max(x, -UNLIMITED), UNLIMITED) for x in (low, high))
    return joint
