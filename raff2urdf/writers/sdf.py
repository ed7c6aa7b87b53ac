"""Write a robot as SDF, the format of Gazebo and others.

SDF places links at their initial poses, and joint values count from there: there is no other zero. The file gives
closed home, so that a loop is an ordinary SDF joint, one more between two links, and is closed from the first step on.
Limits are shifted to this zero. What SDF has no elements for is in one element of ours, `raff:robot`:

    <raff:joint name="joint1" home="0.87" actuated="true"      home: to be added to get the robot's own joint value
      armature="0.02"/>                                        inertia of its rotors, kg m2 or kg; 0 unless given
    gravity="0 0 -1.6" of raff:robot itself                    of the world around the model, unless that gives its own
    <raff:loop name="a-b" kind="ball" first="a" second="b"/>   the joint of a loop, and the links or frames it joins
    <raff:coupling name="w" constant="0">                      a coupling that is no mimic: of the robot's own values,
      <raff:term joint="joint1" coefficients="1 0.2"/>         the sum of all terms, 1 q + 0.2 q^2, is the constant
    </raff:coupling>

`raff_name` in the first two is the robot's own name, where SDF needs another one. A linear coupling of two joints is a
`mimic`; its `raff:name` is its name, unless that follows from the joints'.

Links that are rigidly joined are one link, as SDF requires, with the mass and the shapes of all; the others are
`frame`s on it. Version 1.7 is the oldest with frames, so that most programs can read it; 1.11 is the oldest with
`mimic`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from lxml import etree

from raff2urdf.arrays import Array
from raff2urdf.coupling import Coupling
from raff2urdf.errors import RaffWarning
from raff2urdf.escape import unique_name
from raff2urdf.inertia import Inertia, sum_of
from raff2urdf.placement import roll_pitch_yaw, translation
from raff2urdf.readers.urdf_file import SHAPES
from raff2urdf.readers.xml_file import NAMESPACE
from raff2urdf.tree import BASE_JOINT, WORLD
from raff2urdf.writers.inertia import Inertias, inertias
from raff2urdf.writers.tree_at_home import TreeAtHome, shape_of
from raff2urdf.writers.xml_text import comment, numeral, numerals, text_of

if TYPE_CHECKING:
    from yourdfpy import Joint

    from raff2urdf.conversion import Translation
    from raff2urdf.writers import WriteOptions


VERSION, MIMIC_VERSION = "1.7", "1.11"

_LOOP_TYPES = {"rigid": "fixed", "prismatic": "prismatic", "revolute": "revolute", "ball": "ball"}
_UNLIMITED = 1e16  # SDF's limit of a joint without limits


def files(translation: Translation, stem: str, options: WriteOptions) -> dict[str, bytes]:
    """Return the file."""
    tree = TreeAtHome(translation)
    masses = inertias(tree.model, options.density, translation.surface, tree.moving)
    return {f"{stem}.sdf": text_of(_Writer(tree, masses).root()).encode()}


@dataclass
class _Writer:
    tree: TreeAtHome
    inertias: Inertias
    names: set[str] = field(default_factory=set)  # SDF has one list of names for links, frames and joints
    raff_robot: etree._Element = field(default_factory=lambda: etree.Element(f"{{{NAMESPACE}}}robot"))
    axis: dict[str, etree._Element] = field(default_factory=dict)  # of joints that move

    def root(self) -> etree._Element:
        tree = self.tree
        self.names |= {WORLD, *tree.link}
        root = etree.Element("sdf", version=VERSION, nsmap={"raff": NAMESPACE})
        lines = [
            "Links are placed at home, and joint values count from there: add home of raff:joint.",
            "Links that are rigidly joined are one link with frames on it.",
            self.inertias.sentence(),
        ]
        root.append(comment(lines))
        model = etree.SubElement(root, "model", name=tree.model.name)
        for name in tree.rigid:
            if name != WORLD:
                self.add_link(model, name)
        for joint in tree.order:
            if tree.carriers[joint.child][0] != joint.child:
                frame = etree.SubElement(model, "frame", name=joint.child, attached_to=joint.parent)
                add_pose(frame, tree.placed(joint))
        if tree.root != WORLD:
            self.new_joint(model, BASE_JOINT, "fixed", WORLD, tree.root)
        for joint in tree.order:
            if tree.carriers[joint.child][0] == joint.child and joint.type != "floating":
                self.add_joint(model, joint)
        for loop in tree.loops:
            self.add_loop(model, loop)
        lost = [coupling.name for coupling in tree.couplings if not self.add_mimic(root, coupling)]
        if lost:
            message = f"SDF has no notation for {', '.join(lost)}: written as raff:coupling, which only cinegen reads"
            warnings.warn(f"robot '{tree.model.name}': {message}", RaffWarning, stacklevel=3)
        if tree.gravity is not None:
            self.raff_robot.set("gravity", numerals(tree.gravity))
        if len(self.raff_robot) or self.raff_robot.attrib:
            model.append(self.raff_robot)
        return root

    def add_link(self, model: etree._Element, name: str) -> None:
        tree = self.tree
        link = etree.SubElement(model, "link", name=name)
        joint = tree.joint_of.get(name)
        if joint is not None:
            add_pose(link, tree.placed(joint), joint.parent if joint.parent != WORLD else None)
        add_inertial(link, sum_of(self.inertias.links[part].in_frame(at) for part, at in tree.rigid[name]))
        for part, placement in tree.rigid[name]:
            for number, shape in enumerate(tree.link[part].visuals, 1):
                add_shape(etree.SubElement(link, "visual", name=f"{part}_visual{number}"), shape, placement)

    def new_joint(self, model: etree._Element, name: str, kind: str, parent: str, child: str) -> etree._Element:
        joint = etree.SubElement(model, "joint", name=unique_name(name, self.names), type=kind)
        self.names.add(joint.get("name", ""))
        etree.SubElement(joint, "parent").text = parent
        etree.SubElement(joint, "child").text = child
        return joint

    def add_joint(self, model: etree._Element, joint: Joint) -> None:
        entry = self.tree.entries.get(joint.name)  # none of a fixed joint
        kind = "fixed" if entry is None else entry["type"]
        element = self.new_joint(model, joint.name, kind, self.tree.carriers[joint.parent][0], joint.child)
        if entry is None:
            return
        home, (low, high) = self.tree.home[joint.name], entry["limits"] or (-math.inf, math.inf)
        limit = add_axis(element, low - home, high - home)
        for word in ("effort", "velocity"):
            if entry[word] is not None:
                etree.SubElement(limit, word).text = numeral(entry[word])
        axis = self.axis[joint.name] = element[-1]
        if entry["damping"] or entry["friction"]:
            dynamics = etree.SubElement(axis, "dynamics")
            for word in ("damping", "friction"):
                etree.SubElement(dynamics, word).text = numeral(entry[word])
        values = {"home": numeral(home), "actuated": str(entry["actuated"]).lower()}
        values |= {"armature": numeral(entry["armature"])} if "armature" in entry else {}
        self.add_entry("joint", element, joint.name, **values)

    def add_loop(self, model: etree._Element, loop: Mapping[str, Any]) -> None:
        """Add a joint between the two rigid bodies; its frame is the loop's second end."""
        kind = _LOOP_TYPES[loop["kind"]]
        nodes = [loop[which]["node"] for which in ("first", "second")]
        first, second = (self.tree.carriers[node][0] for node in nodes)
        floating = self.tree.floating
        if second == WORLD or (floating is not None and second == floating.child):
            # The same joint with its ends swapped: a joint's child needs another parent than the loop.
            first, second, nodes = second, first, nodes[::-1]
        joint = self.new_joint(model, loop["name"], kind, first, second)
        if nodes[1] != second:
            pose = etree.Element("pose", relative_to=nodes[1])
            pose.text = "0 0 0 0 0 0"
            joint.insert(0, pose)
        if kind in ("prismatic", "revolute"):
            add_axis(joint, -math.inf, math.inf)
        self.add_entry("loop", joint, loop["name"], kind=loop["kind"], first=nodes[0], second=nodes[1])

    def add_mimic(self, root: etree._Element, coupling: Coupling) -> bool:
        """Add a coupling, in SDF's values, which count from home; return whether other programs can read it."""
        free = [joint for joint in coupling.terms if self.axis[joint].find("mimic") is None]
        written = {joint: str(self.axis[joint].getparent().get("name")) for joint in coupling.terms}
        if len(coupling.terms) != 2 or not coupling.is_linear or not free:
            entry = etree.SubElement(self.raff_robot, f"{{{NAMESPACE}}}coupling", name=coupling.name)
            entry.set("constant", numeral(coupling.constant))
            for joint, coefficients in coupling.terms.items():
                values = {"joint": written[joint], "coefficients": numerals(coefficients)}
                etree.SubElement(entry, f"{{{NAMESPACE}}}term", **values)
            return False
        follower = free[0]
        (leader,) = coupling.terms.keys() - {follower}
        factor = coupling.terms[follower][0]
        offset = -coupling.evaluate(self.tree.home)[0] / factor
        mimic = etree.SubElement(self.axis[follower], "mimic", joint=written[leader])
        if coupling.name != f"{written[follower]}-{written[leader]}":
            mimic.set(f"{{{NAMESPACE}}}name", coupling.name)
        numbers = {"multiplier": -coupling.terms[leader][0] / factor, "offset": offset, "reference": 0.0}
        for word, number in numbers.items():
            etree.SubElement(mimic, word).text = numeral(number)
        root.set("version", MIMIC_VERSION)
        return True

    def add_entry(self, word: str, joint: etree._Element, name: str, **values: str) -> None:
        """Add an element of ours for a joint, for which SDF has none."""
        written = joint.get("name", "")
        other = {} if name == written else {"raff_name": name}
        etree.SubElement(self.raff_robot, f"{{{NAMESPACE}}}{word}", name=written, **other, **values)


def add_pose(element: etree._Element, placement: Array, relative_to: str | None = None) -> None:
    """Add a placement (4, 4), relative to a link or frame, or to SDF's default if none is named."""
    pose = etree.SubElement(element, "pose")
    if relative_to is not None:
        pose.set("relative_to", relative_to)
    pose.text = numerals((*placement[:3, 3], *roll_pitch_yaw(placement)))


def add_inertial(link: etree._Element, inertia: Inertia) -> None:
    """Add mass and inertia, unless the mass is 0."""
    if inertia.mass <= 0.0:
        return
    element = etree.SubElement(link, "inertial")
    add_pose(element, translation(inertia.centre))
    etree.SubElement(element, "mass").text = numeral(inertia.mass)
    moments = etree.SubElement(element, "inertia")
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        etree.SubElement(moments, f"i{'xyz'[i]}{'xyz'[j]}").text = numeral(inertia.matrix[i, j])


def add_axis(joint: etree._Element, low: float, high: float) -> etree._Element:
    """Add the axis z of the joint's own frame; return the element of its limits."""
    element = etree.SubElement(joint, "axis")
    etree.SubElement(element, "xyz").text = "0 0 1"
    limit = etree.SubElement(element, "limit")
    etree.SubElement(limit, "lower").text = numeral(max(low, -_UNLIMITED))
    etree.SubElement(limit, "upper").text = numeral(min(high, _UNLIMITED))
    return limit


def add_shape(element: etree._Element, shape: Any, placement: Array) -> None:
    """Add pose, geometry and colour of a URDF's visual shape, whose link is at `placement`."""
    add_pose(element, placement if shape.origin is None else placement @ shape.origin)
    kind, size, file = shape_of(shape.geometry)
    solid = etree.SubElement(etree.SubElement(element, "geometry"), kind)
    if kind == "mesh":
        etree.SubElement(solid, "uri").text = file
    for word, value in zip(SHAPES[kind], size.reshape(len(SHAPES[kind]), -1), strict=True):
        etree.SubElement(solid, word).text = numerals(value)
    if shape.material is not None:
        painted = etree.SubElement(element, "material")
        for light in ("ambient", "diffuse"):
            etree.SubElement(painted, light).text = numerals(shape.material.color.rgba)
