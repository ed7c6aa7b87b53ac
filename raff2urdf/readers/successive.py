"""Joints of several freedoms, written as successive joints of one freedom each.

    planar      two slides in the plane, then a turn about its normal
    spherical   turns about x, y and z
    floating    three slides, then turns about x, y and z
    universal   turns about two axes

The same motions, exactly; but three turns in a row lose a direction where the middle one stands at 90 degrees.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from lxml import etree

from raff2urdf.errors import RaffError
from raff2urdf.readers.urdf import joints, links, parse, remove, three

Step = tuple[str, str, Sequence[float]]
"""What a joint's name gets behind it, the joint's type, and its axis."""

_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
TURNS: Mapping[str, Step] = {
    "X": ("X", "continuous", _X),
    "Y": ("Y", "continuous", _Y),
    "Z": ("Z", "continuous", _Z),
}
SLIDES: tuple[Step, ...] = (("TX", "prismatic", _X), ("TY", "prismatic", _Y), ("TZ", "prismatic", _Z))
SPHERICAL: tuple[Step, ...] = tuple(TURNS.values())

_FAR = "1e9"  # what a URDF says of a slide without limits


def moving(text: str, name: str) -> dict[str, str]:
    """Types of the joints of a URDF that move, once each is one number: revolute or prismatic, by name.

    Raises:
        RaffError: no URDF.
    """
    tree = parse(text, name)
    replace_compound(tree, name, keep_root=True)
    return {
        str(joint.get("name")): "prismatic" if joint.get("type") == "prismatic" else "revolute"
        for joint in joints(tree)
        if joint.get("type") not in ("fixed", "floating")
    }


def replace_compound(tree: Any, name: str, keep_root: bool) -> dict[str, list[str]]:
    """Replaces all planar, spherical and floating joints of a URDF.

    Args:
        tree: the URDF's root; changed.
        name: what errors call it.
        keep_root: leave a floating joint alone that lets the whole robot move: the only one at its root.

    Returns:
        the joints that were replaced, each with the names of those that it became.
    """
    replaced: dict[str, list[str]] = {}
    for joint in joints(tree):
        kind = joint.get("type")
        if kind == "floating" and keep_root and is_root(tree, joint):
            continue
        own = str(joint.get("name"))
        if kind == "planar":
            replaced[own] = replace(tree, joint, _planar(joint, name), name)
        elif kind == "spherical":
            replaced[own] = replace(tree, joint, SPHERICAL, name)
        elif kind == "floating":
            replaced[own] = replace(tree, joint, (*SLIDES, *SPHERICAL), name)
    return replaced


def is_root(tree: Any, joint: Any) -> bool:
    """Whether a joint is the only one on a link that stands on nothing."""
    parent = joint.find("parent").get("link")
    others = [other for other in joints(tree) if other is not joint]
    return all(parent not in (other.find("parent").get("link"), other.find("child").get("link")) for other in others)


def replace(tree: Any, joint: Any, steps: Sequence[Step], file: str) -> list[str]:
    """Replaces a joint by successive ones, each named after it; between them stand empty links.

    Args:
        tree: the URDF's root; changed.
        joint: an element of it. It becomes the last of the successive joints.
        steps: the joints, from the parent on.
        file: what errors call the URDF.

    Returns:
        names of the successive joints.

    Raises:
        RaffError: a name is taken.
    """
    own = str(joint.get("name"))
    names = [f"{own}_{suffix}" for suffix, _, _ in steps]
    taken = {element.get("name") for element in (*joints(tree), *links(tree))}
    for name in names:
        if name in taken:
            what = f"joint '{own}' can't be written as successive joints: the name '{name}' is taken"
            raise RaffError(f"{file}:{joint.sourceline}: {what}")
    parent, start = joint.find("parent").get("link"), joint.find("origin")
    at = joint.getparent().index(joint)
    for i, (name, (_, kind, axis)) in enumerate(zip(names, steps, strict=True)):
        last = i == len(steps) - 1
        made = etree.Element("joint", name=name, type=kind)
        etree.SubElement(made, "parent", link=parent)
        etree.SubElement(made, "child", link=joint.find("child").get("link") if last else name)
        if i == 0 and start is not None:
            made.append(copy.deepcopy(start))
        etree.SubElement(made, "axis", xyz=" ".join(repr(float(x)) for x in axis))
        if kind == "prismatic":
            etree.SubElement(made, "limit", lower=f"-{_FAR}", upper=_FAR, effort=_FAR, velocity=_FAR)
        made.sourceline = joint.sourceline
        joint.getparent().insert(at, made)
        at += 1
        if not last:
            joint.getparent().insert(at, etree.Element("link", name=name))
            at += 1
        parent = name
    remove(joint)
    return names


def _planar(joint: Any, name: str) -> tuple[Step, ...]:
    """Slides along two directions at right angles to the axis, and a turn about it."""
    axis = joint.find("axis")
    normal = np.array((1.0, 0.0, 0.0) if axis is None else three(axis, "xyz", name, "1 0 0"))
    normal = normal / math.hypot(*normal)
    aside = np.array(_X if abs(normal[0]) < 0.9 else _Y)
    first = aside - normal * float(normal @ aside)
    first = first / math.hypot(*first)
    return (
        ("TX", "prismatic", first.tolist()),
        ("TY", "prismatic", np.cross(normal, first).tolist()),
        ("Z", "continuous", normal.tolist()),
    )
