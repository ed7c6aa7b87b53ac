"""Make one tree of a URDF with several roots, or without the link `world` that its joints name.

Where loops join several trees, one root is the base. Every other tree moves freely on it, by six passive joints, and is
placed so that one of its loops is closed as written; the loops hold it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from lxml import etree

from raff2urdf.errors import RaffError
from raff2urdf.placement import inverse, roll_pitch_yaw
from raff2urdf.readers.loops import successive
from raff2urdf.readers.loops.loop_joint import LoopJoint
from raff2urdf.readers.urdf import ends, joints, links
from raff2urdf.readers.urdf_tree import UrdfTree
from raff2urdf.readers.xml_file import error_at

WORLD = "world"

_STEPS = (*successive.TRANSLATIONS, *successive.SPHERICAL)


def with_world(root: Any) -> list[str]:
    """Add the link `world` to a URDF if it is the parent of a joint and not declared; return a note about it.

    Args:
        root: the root element; changed.
    """
    parents = {ends(joint)[0] for joint in joints(root)}
    if WORLD not in parents or any(link.get("name") == WORLD for link in links(root)):
        return []
    root.insert(0, etree.Element("link", name=WORLD))
    return [f"link '{WORLD}' is the parent of a joint, and not declared: it is the base"]


def attach(root: Any) -> list[str]:
    """Attach all roots of a URDF to one of them, by floating joints; return the names of these joints.

    The base is `world`, or else the first root that has a joint.

    Args:
        root: the root element; changed.
    """
    below = {ends(joint)[1] for joint in joints(root)}
    parents = {ends(joint)[0] for joint in joints(root)}
    roots = {str(link.get("name")): link for link in links(root) if link.get("name") not in below}
    if len(roots) < 2:
        return []
    base = min(roots, key=lambda name: (name != WORLD, name not in parents))
    taken, added = {element.get("name") for element in (*links(root), *joints(root))}, []
    for name, link in roots.items():
        if name == base:
            continue
        joint_name = f"{name}_free"
        while joint_name in taken:
            joint_name += "_"
        joint = etree.Element("joint", name=joint_name, type="floating")
        etree.SubElement(joint, "parent", link=base)
        etree.SubElement(joint, "child", link=name)
        etree.SubElement(joint, "origin", xyz="0 0 0", rpy="0 0 0")
        link.addnext(joint)
        added.append(joint_name)
    return added


def place(tree: UrdfTree, added: Sequence[str], loops: Sequence[LoopJoint]) -> tuple[UrdfTree, list[str], list[str]]:
    """Place the trees that `attach` attached, so that a loop of each is closed with all joints at 0.

    Args:
        tree: changed.
        added: the joints of `attach`.
        loops: that join the trees.

    Returns:
        the tree, the passive joints that will replace the floating ones, and notes.

    Raises:
        RaffError: no loop joins a tree to the others; see `refusal`.
    """
    root_of = {link: _root_of(tree, link, added) for link in tree.links}
    placed = {tree.base: np.eye(4)}  # roots, in the base
    pending = dict(_first(tree, joint) for joint in added)
    while pending:
        for loop in (*loops, *(loop.swapped() for loop in loops)):
            first, second = root_of[loop.first], root_of[loop.second]
            if first in placed and second in pending:
                end = inverse(tree.zero[first]) @ tree.zero[loop.first] @ loop.placed[0]
                other = inverse(tree.zero[second]) @ tree.zero[loop.second] @ loop.placed[1]
                placed[second] = placed[first] @ end @ inverse(other)
                origin = pending.pop(second).find("origin")
                origin.set("xyz", " ".join(map(repr, placed[second][:3, 3].tolist())))
                origin.set("rpy", " ".join(map(repr, roll_pitch_yaw(placed[second]))))
                break
        else:
            raise refusal(tree, list(pending))
    passive = [f"{joint}_{suffix}" for joint in added for suffix, _, _ in _STEPS]
    notes = [f"link '{root}' has no parent: it moves freely on '{tree.base}', and loops hold it" for root in placed]
    return UrdfTree(tree.root, tree.name), passive, notes[1:]


def refusal(tree: UrdfTree, roots: Sequence[str]) -> RaffError:
    """Return the error for roots that nothing joins to the base."""
    first, base = roots[0], tree.base
    listed = ", ".join(f"'{root}' (line {tree.links[root].sourceline})" for root in (base, *roots[:7]))
    joint = f'<joint name="{first}_joint" type="fixed"><parent link="{base}"/><child link="{first}"/></joint>'
    why = f"{len(roots) + 1} links have no parent, but one must be the root, unless loops join their trees: {listed}"
    return error_at(tree.name, tree.links[first], f"{why}. If it is meant, join them, as by {joint}")


def _root_of(tree: UrdfTree, link: str, added: Sequence[str]) -> str:
    roots = {_first(tree, joint)[0] for joint in added}
    return next((ends(joint)[1] for joint in tree.above(link) if ends(joint)[1] in roots), tree.base)


def _first(tree: UrdfTree, joint: str) -> tuple[str, Any]:
    """Return the root below a joint of `attach`, and its element; `robot.yaml` may have replaced it."""
    floating = tree.joints.get(joint)
    if floating is not None:
        return ends(floating)[1], floating
    last = tree.joints[f"{joint}_{_STEPS[-1][0]}"]
    return ends(last)[1], tree.joints[f"{joint}_{_STEPS[0][0]}"]
