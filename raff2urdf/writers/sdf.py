"""A robot as SDF, the format of Gazebo and others.

SDF places links where a simulation begins, and joint values count from there: there is no other zero. The file gives
closed home, so that a loop is what SDF has for it, one more joint between two links, and is closed from the first step
on. Limits are shifted to this zero. What SDF has no words for stands in one element of ours, `raff:robot`:

    <raff:joint name="joint1" home="0.87" actuated="true"/>    home: to be added to get the robot's own joint value
    <raff:loop name="a-b" kind="ball" first="a" second="b"/>   the joint of a loop, and which links or frames meet there

`called` in either is what the robot calls it, where SDF wants another name.

Links that are rigidly joined are one link, as SDF wants it, which bears the mass and the shapes of all; the others are
`frame`s on it. Version 1.7 is the oldest that knows frames, so that most programs can read it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import yourdfpy
from lxml import etree
from numpy.typing import NDArray

from raff2urdf.formats import Described
from raff2urdf.placement import roll_pitch_yaw
from raff2urdf.tree import BASE_JOINT
from raff2urdf.writers.bodies import FIXED, SLIDES, WORLD, TreeAtHome, axis, greatest, limits, unlike
from raff2urdf.writers.inertia import Inertia, Inertias, sum_of
from raff2urdf.xml_text import comment, numeral, numerals, text_of

Array = NDArray[np.float64]

VERSION = "1.7"

NAMESPACE = "urn:raff2urdf"
"""Of the elements that are not SDF's."""

_KINDS = {"rigid": "fixed", "prismatic": "prismatic", "revolute": "revolute", "ball": "ball"}
_ENDLESS = 1e16  # what SDF says of a joint without limits


def files(described: Described) -> dict[str, bytes]:
    """What is written: one file."""
    text = sdf(described.bodies, described.constraints, described.inertias)
    return {f"{described.stem}.sdf": text.encode()}


def sdf(bodies: TreeAtHome, constraints: Mapping[str, Any], inertias: Inertias) -> str:
    """The text of the file.

    Args:
        bodies: the robot's tree at closed home.
        constraints: its loops and motors, as in constraints.schema.json.
        inertias: of its links.

    Raises:
        RaffError: the tree, or a loop, holds what SDF can't say.
    """
    return text_of(_Writer(bodies, constraints, inertias).root())


@dataclass
class _Writer:
    bodies: TreeAtHome
    constraints: Mapping[str, Any]
    inertias: Inertias
    names: set[str] = field(default_factory=set)  # SDF has one list of names for links, frames and joints
    own: etree._Element = field(default_factory=lambda: etree.Element(f"{{{NAMESPACE}}}robot"))

    def root(self) -> etree._Element:
        self.names |= {WORLD, *self.bodies.link}
        root = etree.Element("sdf", version=VERSION, nsmap={"raff": NAMESPACE})
        root.append(comment(self._preface()))
        model = etree.SubElement(root, "model", name=self.bodies.model.name)
        for name in self.bodies.rigid:
            if name != WORLD:
                self._link(model, name)
        for joint in self.bodies.order:
            if self.bodies.bearers[joint.child][0] != joint.child:
                frame = etree.SubElement(model, "frame", name=joint.child, attached_to=joint.parent)
                pose(frame, self.bodies.placed(joint))
        if self.bodies.root != WORLD:
            self._joint(model, BASE_JOINT, "fixed", WORLD, self.bodies.root)
        for joint in self.bodies.order:
            if self.bodies.bearers[joint.child][0] == joint.child and joint.type != "floating":
                self._tree_joint(model, joint)
        for loop in self.constraints["loops"]:
            self._loop(model, loop)
        if len(self.own):
            model.append(self.own)
        return root

    def _preface(self) -> list[str]:
        return [
            "Links stand at home, and joint values count from there: home in raff:joint is to be added.",
            "Links that are rigidly joined are one link with frames on it.",
            self.inertias.sentence(),
        ]

    def _link(self, model: etree._Element, name: str) -> None:
        bodies = self.bodies
        link = etree.SubElement(model, "link", name=name)
        holding = bodies.holding.get(name)
        if holding is not None:
            pose(link, bodies.placed(holding), holding.parent if holding.parent != WORLD else None)
        parts = [(name, np.eye(4)), *bodies.rigid[name]]
        inertial(link, sum_of(self.inertias.links[part].seen_from(placement) for part, placement in parts))
        for part, placement in parts:
            source = bodies.link[part]
            for word, shapes in (("visual", source.visuals), ("collision", source.collisions)):
                for number, shape in enumerate(shapes, 1):
                    if shape.geometry is not None:
                        _shape(etree.SubElement(link, word, name=f"{part}_{word}{number}"), shape, placement)

    def _joint(self, model: etree._Element, name: str, kind: str, parent: str, child: str) -> etree._Element:
        called = unlike(name, self.names)
        self.names.add(called)
        joint = etree.SubElement(model, "joint", name=called, type=kind)
        etree.SubElement(joint, "parent").text = parent
        etree.SubElement(joint, "child").text = child
        return joint

    def _tree_joint(self, model: etree._Element, joint: yourdfpy.Joint) -> None:
        fixed = joint.type in FIXED
        kind = "fixed" if fixed else "prismatic" if joint.type in SLIDES else "revolute"
        parent = self.bodies.bearers[joint.parent][0]
        element = self._joint(model, joint.name, kind, parent, joint.child)
        if fixed:
            return
        home = self.bodies.value(joint)
        low, high = (end - home for end in limits(joint))
        along = _axis(element, axis(joint), low, high)
        if joint.limit is not None:
            for word in ("effort", "velocity"):
                most = greatest(getattr(joint.limit, word))
                if 0.0 < most < math.inf:
                    etree.SubElement(along, word).text = numeral(most)
        motors = {entry["name"]: entry.get("actuated", True) for entry in self.constraints["joints"]}
        actuated = str(bool(motors.get(joint.name, True))).lower()
        self._say("joint", element, joint.name, home=numeral(home), actuated=actuated)

    def _loop(self, model: etree._Element, loop: Mapping[str, Any]) -> None:
        """A joint between the two rigid bodies; its frame is the loop's second end."""
        ends = [self.bodies.end(loop[which]) for which in ("first", "second")]
        first, second = (self.bodies.bearers[node][0] for node, _ in ends)
        nodes = [
            self._end(model, f"{loop['name']}.{which}", *end)
            for which, end in zip(("first", "second"), ends, strict=True)
        ]
        floating = self.bodies.floating
        if second == WORLD or (floating is not None and second == floating.child):
            # The same joint, seen from its other end: a link without another parent would hang on the loop alone.
            first, second, nodes = second, first, nodes[::-1]
        joint = self._joint(model, loop["name"], _KINDS[loop["kind"]], first, second)
        if nodes[1] != second:
            place = etree.Element("pose", relative_to=nodes[1])
            place.text = "0 0 0 0 0 0"
            joint.insert(0, place)
        if loop["kind"] in ("prismatic", "revolute"):
            _axis(joint, np.array([0.0, 0.0, 1.0]), -math.inf, math.inf)
        self._say("loop", joint, loop["name"], kind=loop["kind"], first=nodes[0], second=nodes[1])

    def _say(self, word: str, joint: etree._Element, called: str, **said: str) -> None:
        """Says of a joint what SDF has no words for."""
        name = joint.get("name", "")
        other = {} if name == called else {"called": called}
        etree.SubElement(self.own, f"{{{NAMESPACE}}}{word}", name=name, **other, **said)

    def _end(self, model: etree._Element, name: str, node: str, placement: Array) -> str:
        """The frame of a loop's end: its link, or a frame of its own where it does not stand at the link's origin."""
        if np.array_equal(placement, np.eye(4)):
            return node
        called = unlike(name, self.names)
        self.names.add(called)
        pose(etree.SubElement(model, "frame", name=called, attached_to=node), placement)
        return called


def pose(element: etree._Element, placement: Array, seen_from: str | None = None) -> None:
    """Adds a placement (4, 4), seen from a link or frame, or from what SDF takes if none is named."""
    place = etree.SubElement(element, "pose")
    if seen_from is not None:
        place.set("relative_to", seen_from)
    place.text = numerals((*placement[:3, 3], *roll_pitch_yaw(placement)))


def inertial(link: etree._Element, body: Inertia) -> None:
    """Adds mass and inertia, of a body that has some."""
    if body.mass <= 0.0:
        return
    element = etree.SubElement(link, "inertial")
    centre = np.eye(4)
    centre[:3, 3] = body.centre
    pose(element, centre)
    etree.SubElement(element, "mass").text = numeral(body.mass)
    inertia = etree.SubElement(element, "inertia")
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        etree.SubElement(inertia, f"i{'xyz'[i]}{'xyz'[j]}").text = numeral(body.matrix[i, j])


def _axis(joint: etree._Element, direction: Array, low: float, high: float) -> etree._Element:
    """Adds an axis in the joint's own frame; returns its limits."""
    element = etree.SubElement(joint, "axis")
    etree.SubElement(element, "xyz").text = numerals(direction)
    limit = etree.SubElement(element, "limit")
    etree.SubElement(limit, "lower").text = numeral(max(low, -_ENDLESS))
    etree.SubElement(limit, "upper").text = numeral(min(high, _ENDLESS))
    return limit


def _shape(element: etree._Element, shape: Any, placement: Array) -> None:
    pose(element, placement if shape.origin is None else placement @ shape.origin)
    geometry = etree.SubElement(element, "geometry")
    given = shape.geometry
    if given.box is not None:
        etree.SubElement(etree.SubElement(geometry, "box"), "size").text = numerals(given.box.size)
    elif given.cylinder is not None:
        cylinder = etree.SubElement(geometry, "cylinder")
        etree.SubElement(cylinder, "radius").text = numeral(given.cylinder.radius)
        etree.SubElement(cylinder, "length").text = numeral(given.cylinder.length)
    elif given.sphere is not None:
        etree.SubElement(etree.SubElement(geometry, "sphere"), "radius").text = numeral(given.sphere.radius)
    elif given.mesh is not None:
        mesh = etree.SubElement(geometry, "mesh")
        etree.SubElement(mesh, "uri").text = given.mesh.filename
        scale = np.broadcast_to(1.0 if given.mesh.scale is None else given.mesh.scale, 3)
        etree.SubElement(mesh, "scale").text = numerals(scale)
    material = getattr(shape, "material", None)
    if material is not None and material.color is not None:
        painted = etree.SubElement(element, "material")
        for light in ("ambient", "diffuse"):
            etree.SubElement(painted, light).text = numerals(material.color.rgba)
