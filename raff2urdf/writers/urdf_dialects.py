"""Write the loops and couplings of a robot into its URDF, in the dialects that other programs read.

    json            nothing: they are in the constraints file
    constraint      <constraint> of ros/urdfdom_headers#108; couplings as <constraint type="coupling">
    urdf+           <loop> and <coupling> of URDF+ (Chignoli et al., arXiv:2411.19753), else <mimic>. A ball
                    gets the type spherical, which the parser of URDF+ refuses
    closing-frames  pairs of links closing_NAME_1 and closing_NAME_2 of onshape-to-robot and placo, whose origins
                    coincide: one pair for a ball; for a hinge another one on its axis, closing_NAME_1_z; for a rigid
                    loop two further pairs, of the loops NAME.x and NAME.y. Couplings as <mimic>
    mimic           <mimic> for couplings; no loops
    robot.yaml      pairs of frames in NAME.yaml (Gepetto's example-parallel-robots); a hinge is two points on its axis.
                    Couplings as <mimic>

Programs ignore elements that they don't know. No dialect has everything (home, actuated joints, sensors): that is in
the element `raff:robot`, the contents of the constraints file as JSON. Readers check that the dialect agrees with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from lxml import etree

from raff2urdf.arrays import Array
from raff2urdf.constraints import Constraints
from raff2urdf.coupling import Coupling, coupling_of
from raff2urdf.placement import roll_pitch_yaw, translation
from raff2urdf.writers.xml_text import numeral, numerals

if TYPE_CHECKING:  # takes half a second
    from yourdfpy import Joint


_CONSTRAINT_TYPES = {"rigid": "link", "prismatic": "prismatic", "revolute": "revolute", "ball": "spherical"}
_LOOP_TYPES = {"rigid": "fixed", "prismatic": "prismatic", "revolute": "revolute", "ball": "spherical"}
_POINTS: Mapping[str, Sequence[str]] = {"ball": "", "revolute": "z", "rigid": "xy"}
"""Axes of a loop on which further points must coincide."""


class UrdfDialectWriter:
    """Adds the loops and couplings of one robot to its URDF.

    Args:
        root: the URDF's root element; changed.
        joints: of the robot.
        values: contents of its constraints file.
        length: its characteristic length (m), at which points are placed on axes.

    Attributes:
        lost: loops and couplings for which the dialect has no notation.
        extended: loops whose type is not in the dialect, but obvious.
        yaml: the text of `robot.yaml`; empty in other dialects.
    """

    def __init__(self, root: Any, joints: Sequence[Joint], values: Constraints, length: float) -> None:
        self.root, self.values, self.length = root, values, length
        self.joints = {joint.name: joint for joint in joints}
        self.elements = {str(joint.get("name")): joint for joint in root.iterchildren("joint")}
        self.couplings = [coupling_of(entry) for entry in values.get("couplings", [])]
        self.lost: list[str] = []
        self.extended: list[str] = []
        self.yaml = ""
        self._mimics: dict[str, str] = {}  # leaders by their followers

    def write(self, dialect: str) -> None:
        """Add everything for which a dialect, other than json, has a notation, and what no dialect has."""
        loops = self.values["loops"]
        if dialect == "constraint":
            self._constraints()
        elif dialect == "urdf+":
            self._urdf_plus()
        elif dialect == "closing-frames":
            for loop in loops:
                self._closing_frames(loop)
        elif dialect == "robot.yaml":
            self._robot_yaml()
        else:
            self.lost += [f"loop '{loop['name']}'" for loop in loops]
        if dialect in ("closing-frames", "robot.yaml", "mimic"):
            self.lost += [f"coupling '{coupling.name}'" for coupling in self.couplings if not self._mimic(coupling)]

    # --- elements -----------------------------------------------------------------------------------------------

    def _constraints(self) -> None:
        for loop in self.values["loops"]:
            kind = _CONSTRAINT_TYPES[loop["kind"]]
            element = etree.SubElement(self.root, "constraint", name=loop["name"], type=kind)
            for word, which in (("parent", "first"), ("child", "second")):
                etree.SubElement(element, word, link=loop[which]["node"])
                etree.SubElement(element, f"{word}_origin", _origin(loop[which]))
                if kind in ("prismatic", "revolute"):
                    etree.SubElement(element, f"{word}_axis", xyz="0 0 1")  # in the axes of the origin above
        for coupling in self.couplings:
            element = etree.SubElement(self.root, "constraint", name=coupling.name, type="coupling")
            for joint, coefficients in coupling.terms.items():
                etree.SubElement(element, "term", joint=joint, coefficients=numerals(coefficients))
            etree.SubElement(element, "constant", value=numeral(coupling.constant))

    def _urdf_plus(self) -> None:
        for joint in self.values["joints"] if self.values["loops"] or self.couplings else ():
            self.elements[joint["name"]].set("independent", str(joint["actuated"]).lower())
        for loop in self.values["loops"]:
            element = etree.SubElement(self.root, "loop", name=loop["name"], type=_LOOP_TYPES[loop["kind"]])
            self.extended += [f"loop '{loop['name']}'"] if loop["kind"] == "ball" else []
            for word, which in (("predecessor", "first"), ("successor", "second")):
                end = etree.SubElement(element, word, link=loop[which]["node"])
                etree.SubElement(end, "origin", _origin(loop[which]))
            etree.SubElement(element, "axis", xyz="0 0 1")
        for coupling in self.couplings:
            ratio = self._ratio(coupling)
            if ratio is None:
                self.lost += [] if self._mimic(coupling) else [f"coupling '{coupling.name}'"]
                continue
            element = etree.SubElement(self.root, "coupling", name=coupling.name)
            for word, joint in zip(("successor", "predecessor"), coupling.terms, strict=True):
                etree.SubElement(element, word, link=self.joints[joint].child)
            element.append(element[0])  # the predecessor first
            etree.SubElement(element, "ratio", value=numeral(ratio))

    def _ratio(self, coupling: Coupling) -> float | None:
        """Return the ratio of two joints that move links of one body, as URDF+ couples them; None of others."""
        if len(coupling.terms) != 2 or not coupling.is_linear or coupling.constant != 0.0:
            return None
        (follower, (factor,)), (leader, (other,)) = coupling.terms.items()
        if self._carrier(self.joints[follower].parent) != self._carrier(self.joints[leader].parent):
            return None
        return -other / factor

    def _carrier(self, link: str) -> str:
        """Return the first link of the rigid body of a link."""
        above = {joint.child: joint for joint in self.joints.values()}
        while link in above and above[link].type == "fixed":
            link = above[link].parent
        return link

    def _mimic(self, coupling: Coupling) -> bool:
        """Add a `<mimic>`; return whether it can express the coupling."""
        if len(coupling.terms) != 2 or not coupling.is_linear:
            return False
        for follower, leader in (list(coupling.terms), list(coupling.terms)[::-1]):
            if follower in self._mimics or self._leads(follower, leader):
                continue
            self._mimics[follower] = leader
            factor = coupling.terms[follower][0]
            values = {"multiplier": -coupling.terms[leader][0] / factor, "offset": coupling.constant / factor}
            written = {word: numeral(value) for word, value in values.items()}
            etree.SubElement(self.elements[follower], "mimic", joint=leader, **written)
            return True
        return False

    def _leads(self, joint: str, other: str) -> bool:
        """Return whether a joint leads another one, directly or not."""
        while other in self._mimics:
            other = self._mimics[other]
        return other == joint

    # --- points that coincide -----------------------------------------------------------------------------------

    def _closing_frames(self, loop: Mapping[str, Any]) -> None:
        name, kind = loop["name"], loop["kind"]
        if kind not in _POINTS:
            self.lost.append(f"loop '{name}' ({kind})")
            return
        for number, which in enumerate(("first", "second"), 1):
            for axis in ("", *_POINTS[kind]):
                hinge = axis == "z"
                label = name if hinge or not axis else f"{name}.{axis}"
                self._add_frame(f"closing_{label}_{number}{'_z' if hinge else ''}", loop[which], axis)

    def _robot_yaml(self) -> None:
        pairs: list[list[str]] = []
        types: list[str] = []
        for loop in self.values["loops"]:
            name, kind = loop["name"], loop["kind"]
            if kind not in _POINTS:
                self.lost.append(f"loop '{name}' ({kind})")
                continue
            for axis in ("",) if kind == "rigid" else ("", *_POINTS[kind]):
                ends = [loop[which]["node"] for which in ("first", "second")]
                if axis:
                    ends = [self._add_frame(f"{name}.{which}", loop[which], axis) for which in ("first", "second")]
                pairs.append([self._frame_name(end) for end in ends])
                types.append("6d" if kind == "rigid" else "3d")
        actuated = [joint["name"] for joint in self.values["joints"] if joint["actuated"]]
        values = {"closed_loop": pairs, "type": types, "name_mot": actuated}
        self.yaml = yaml.safe_dump(values, default_flow_style=None, sort_keys=False, allow_unicode=True, width=120)

    def _frame_name(self, link: str) -> str:
        """Return a link's name; that of its joint if another joint has the link's name."""
        above = next((joint.name for joint in self.joints.values() if joint.child == link), link)
        return above if link in self.joints else link

    def _add_frame(self, name: str, end: Mapping[str, Any], axis: str) -> str:
        """Add a link that is fixed at the end of a loop, or on one of its axes; return its name."""
        offset = translation(self.length * np.eye(3)["xyz".index(axis)]) if axis else np.eye(4)
        placed = np.array(end["placement"], dtype=float) @ offset
        etree.SubElement(self.root, "link", name=name)
        joint = etree.SubElement(self.root, "joint", name=f"{name}_frame", type="fixed")
        etree.SubElement(joint, "parent", link=end["node"])
        etree.SubElement(joint, "child", link=name)
        etree.SubElement(joint, "origin", _origin({"placement": placed}))
        return name


def _origin(end: Mapping[str, Any]) -> dict[str, str]:
    placed: Array = np.array(end["placement"], dtype=float)
    return {"xyz": numerals(placed[:3, 3]), "rpy": numerals(roll_pitch_yaw(placed))}
