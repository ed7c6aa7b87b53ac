"""Replace joints of several degrees of freedom by successive joints of one each.

    planar      two translations in the plane, then a rotation about its normal
    spherical   rotations about x, y and z
    floating    translations along x, y and z, then rotations about them
    universal   rotations about two axes

The motions are exactly the same; but three successive rotations are singular where the middle one is 90 degrees.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from lxml import etree

from raff2urdf.placement import with_z
from raff2urdf.readers.urdf import MOMENTS, axis, joints, links, remove
from raff2urdf.readers.urdf_file import parse
from raff2urdf.readers.xml_file import error_at

Step = tuple[str, str, Sequence[float]]
"""Suffix of a joint's name, the joint's type, and its axis."""

_AXES: Mapping[str, Sequence[float]] = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
ROTATIONS: Mapping[str, Step] = {letter: (letter, "continuous", vector) for letter, vector in _AXES.items()}
TRANSLATIONS: tuple[Step, ...] = tuple((f"T{letter}", "prismatic", vector) for letter, vector in _AXES.items())
SPHERICAL: tuple[Step, ...] = tuple(ROTATIONS.values())

_FAR = "1e9"  # limit of a prismatic joint without limits in a URDF


def moving(text: str, name: str) -> dict[str, str]:
    """Return the types of a URDF's moving joints, revolute or prismatic, by name, once each has one variable.

    Raises:
        RaffError: not a URDF.
    """
    tree = parse(text, name)
    replace_compound(tree, name, keep_root=True)
    return {
        str(joint.get("name")): str(joint.get("type")).replace("continuous", "revolute")
        for joint in joints(tree)
        if joint.get("type") not in ("fixed", "floating")
    }


def replace_compound(tree: Any, name: str, keep_root: bool) -> dict[str, list[str]]:
    """Replace all planar, spherical and floating joints of a URDF.

    Args:
        tree: the URDF's root; changed.
        name: of the file, in errors.
        keep_root: leave a floating joint that lets the whole robot move: the only one at its root.

    Returns:
        the joints that were replaced, each with the names of the joints that replace it.
    """
    replaced: dict[str, list[str]] = {}
    for joint in joints(tree):
        kind = joint.get("type")
        if kind == "planar":
            normal = axis(joint, name)
            x, y, z = with_z(normal / np.linalg.norm(normal)).T.tolist()
            steps: Sequence[Step] = (("TX", "prismatic", x), ("TY", "prismatic", y), ("Z", "continuous", z))
        elif kind == "spherical":
            steps = SPHERICAL
        elif kind == "floating" and not (keep_root and is_root(tree, joint)):
            steps = (*TRANSLATIONS, *SPHERICAL)
        else:
            continue
        replaced[str(joint.get("name"))] = replace(tree, joint, steps, name)
    return replaced


def is_root(tree: Any, joint: Any) -> bool:
    """Return whether a joint is the only one at a link without a parent."""
    parent = joint.find("parent").get("link")
    others = [other for other in joints(tree) if other is not joint]
    return all(parent not in (other.find("parent").get("link"), other.find("child").get("link")) for other in others)


def replace(tree: Any, joint: Any, steps: Sequence[Step], file: str) -> list[str]:
    """Replace a joint by successive ones, each named after it, with links without mass between them.

    Args:
        tree: the URDF's root; changed.
        joint: an element of it.
        steps: the joints, from the parent on.
        file: name of the URDF, in errors.

    Returns:
        names of the successive joints.

    Raises:
        RaffError: a name is taken.
    """
    old = str(joint.get("name"))
    names = [f"{old}_{suffix}" for suffix, _, _ in steps]
    taken = {element.get("name") for element in (*joints(tree), *links(tree))}
    for name in names:
        if name in taken:
            what = f"joint '{old}' can't be written as successive joints: rename '{name}', whose name is needed"
            raise error_at(file, joint, what)
    parent, start = joint.find("parent").get("link"), joint.find("origin")
    made: list[Any] = []
    for name, (_, kind, vector) in zip(names, steps, strict=True):
        last = name == names[-1]
        element = etree.Element("joint", name=name, type=kind)
        etree.SubElement(element, "parent", link=parent)
        etree.SubElement(element, "child", link=joint.find("child").get("link") if last else name)
        if not made and start is not None:
            element.append(copy.deepcopy(start))
        etree.SubElement(element, "axis", xyz=" ".join(repr(float(x)) for x in vector))
        if kind == "prismatic":
            etree.SubElement(element, "limit", lower=f"-{_FAR}", upper=_FAR, effort=_FAR, velocity=_FAR)
        element.sourceline = joint.sourceline
        made.append(element)
        if not last:
            made.append(massless_link(name))
        parent = name
    for element in made:
        joint.addprevious(element)
    remove(joint)
    return names


def massless_link(name: str) -> Any:
    """Return an element of a link whose mass is stated as 0, such as the cross of a universal joint."""
    link = etree.Element("link", name=name)
    inertial = etree.SubElement(link, "inertial")
    etree.SubElement(inertial, "mass", value="0")
    etree.SubElement(inertial, "inertia", dict.fromkeys(MOMENTS, "0"))
    return link
