"""Read joints that close loops: their two ends coincide with all joints at 0.

    <joint>, <drake:joint>     whose child has another parent, or which leads back to the root
    <joint> in <gazebo>        a joint of SDF, also a screw, between links that are connected already
    <plugin> in <gazebo>       pegasus_gazebo_plugins' closed loop: a revolute joint about the model's y

One joint of each loop is cut, and closes it: of those with the same child, one without limits if there is one, and the
last one in the file otherwise. The limits of a joint that is cut are not enforced.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.placement import from_origin, inverse
from raff2urdf.readers.loops import successive
from raff2urdf.readers.loops.declaration import Declaration, declared, label_of, local, tag_of
from raff2urdf.readers.loops.loop_elements import kind_of
from raff2urdf.readers.loops.loop_joint import LoopJoint
from raff2urdf.readers.screw import lead
from raff2urdf.readers.urdf import ends, joints, limits, links, numbers, origin, remove
from raff2urdf.readers.urdf_file import by_name
from raff2urdf.readers.urdf_tree import UrdfTree, along
from raff2urdf.readers.xml_file import error_at

DIALECT = "second parents"
"""Name of the dialect of joints whose child has another parent."""

_CLOSED_LOOP = re.compile(r"closed_?loop")


def with_joints_of_drake(root: Any, name: str) -> bool:
    """Make joints of Drake, <drake:joint>, joints of URDF; return whether there are any.

    Args:
        root: the root element; changed.
        name: of the file, in errors.
    """
    drake_joints = list(root.iterchildren("{*}joint", "drake:joint"))
    drake_joints = [joint for joint in drake_joints if joint.tag != "joint"]
    for joint in drake_joints:
        joint.tag = "joint"
        joint.set("type", {"ball": "spherical"}.get(joint.get("type", ""), joint.get("type", "")))
    return bool(drake_joints)


def without_links_of_gazebo(root: Any) -> list[str]:
    """Remove links that only Gazebo has, <link> in <gazebo>, with their joints: a URDF has others in their place.

    Args:
        root: the root element; changed.

    Returns:
        a note on them, if there are any.
    """
    known = {link.get("name") for link in links(root)}
    unknown = [link for link in root.iterfind("gazebo/link") if link.get("name") not in known]
    names = {link.get("name") for link in unknown}
    joined = [joint for joint in root.iterfind("gazebo/joint") if not names.isdisjoint(joined_links(joint) or ())]
    more = f" and {len(unknown) - 1} more" if len(unknown) > 1 else ""
    notes = [
        f"not read: {label_of(link, 'gazebo')} (line {link.sourceline}){more}, and its joints" for link in unknown[:1]
    ]
    for element in (*unknown, *joined):
        remove(element)
    return notes


def cut(root: Any, name: str, ignored: Callable[[str], bool]) -> list[Declaration]:
    """Remove joints from a URDF until the others form a tree.

    Args:
        root: the root element; changed. Universal joints of Drake that stay become two joints.
        name: of the file, in errors.
        ignored: returns whether declarations with a word are ignored.

    Returns:
        the joints that were removed.

    Raises:
        RaffError: two joints have one name.
    """
    removed = _cut(root, name, ignored)
    for joint in joints(root):
        if joint.get("type") == "universal":
            steps = (successive.ROTATIONS["X"], successive.ROTATIONS["Y"])
            added = {*successive.replace(root, joint, steps, name)}
            root[:0] = [link for link in links(root) if link.get("name") in added]  # no end of the robot
    return removed


def _cut(root: Any, name: str, ignored: Callable[[str], bool]) -> list[Declaration]:
    all_joints = joints(root)
    above: dict[str, list[Any]] = {}
    for joint in all_joints:
        above.setdefault(ends(joint)[1], []).append(joint)
    known = [str(link.get("name")) for link in links(root)]
    base = next((link for link in known if link not in above), known[0] if known else "")
    if base not in above and all(len(several) == 1 for several in above.values()):
        return []
    by_name(all_joints, name)
    mimicking = {str(mimic.get("joint")) for mimic in root.iter("mimic")}
    mimicking |= {str(joint.get("name")) for joint in all_joints if joint.find("mimic") is not None}
    best = {
        link: min(several, key=lambda joint: (joint.get("name") not in mimicking, limits(joint) is None))
        for link, several in above.items()
        if link != base
    }
    kept = best if _reached(base, best) == set(best) | {base} else _first_reached(base, all_joints)
    removed = [joint for joint in all_joints if kept.get(ends(joint)[1]) is not joint]
    declarations = []
    for joint in removed:
        joint_name = str(joint.get("name"))
        if joint_name in mimicking and not ignored("mimic"):
            why = (
                f"joint '{joint_name}' closes a loop and mimics another joint, or leads one: give it a child of its own"
            )
            raise error_at(name, joint, f"{why}, or leave the coupling out with --ignore mimic")
        text = f"joint '{joint_name}' closes a loop: its child '{ends(joint)[1]}' has another parent"
        label, low_high = f"joint '{joint_name}'", limits(joint)
        notes = (text,) if low_high is None else (f"{text}; its limits are not enforced",)
        declarations.append(declared(joint, DIALECT, _of_joint, label, text=text, notes=notes))
        remove(joint)
    return declarations


def find(root: Any, name: str) -> Iterator[Declaration]:
    """Yield the joints in elements for Gazebo that close loops.

    Args:
        root: the root element; its joints form a tree.
        name: of the file, in errors.
    """
    connected = Connections(root)
    for gazebo in root.iterchildren("gazebo"):
        for element in gazebo.iterchildren("*"):
            joined = joined_links(element)
            if joined is None or element.find("body1") is not None or not connected.join(*joined):
                continue
            label = label_of(element, "gazebo")
            text = f"{label} ({', '.join(map(repr, joined))}) declares a loop"
            if local(element) == "joint":
                yield declared(element, "Gazebo joints", _of_sdf, label, text=text)
            elif _CLOSED_LOOP.search(f"{element.get('name', '')} {element.get('filename', '')}".lower()):
                joint = (element.findtext("joint") or "").strip() or element.get("name", "")
                yield declared(element, "Gazebo plugins", _of_plugin, label, joint, text=text)


def joined_links(element: Any) -> tuple[str, str] | None:
    """Return the links that an element joins, in SDF's notation of joints; None if it joins none."""
    inner = {
        local(end): (end.get("link") or end.text or "").strip().rpartition("::")[2] for end in element.iterchildren("*")
    }
    for first, second in (("parent", "child"), ("body1", "body2")):
        if inner.get(first) and inner.get(second):
            return inner[first], inner[second]
    return None


def _of_joint(tree: UrdfTree, element: Any) -> LoopJoint:
    label = f"joint '{element.get('name')}'"
    parent, child = (tree.link(element, link, label) for link in ends(element))
    kind, placed = kind_of(tree, element, element.get("type")), origin(element, tree.name)
    if kind == "universal":  # Drake's: rotations about the joint's x, then y
        first, second = along(placed, np.array([1.0, 0.0, 0.0])), along(np.eye(4), np.array([0.0, 1.0, 0.0]))
    else:
        axis = np.array([0.0, 0.0, 1.0]) if kind in ("rigid", "ball") else tree.vector(element.find("axis"))
        first, second = along(placed, axis), along(np.eye(4), axis)
    return LoopJoint(kind, parent, child, (first, second))


def _of_sdf(tree: UrdfTree, element: Any) -> LoopJoint:
    parent, child = _ends_of_sdf(tree, element)
    is_screw = (element.get("type") or "").strip() == "screw"
    kind, placed = "screw" if is_screw else kind_of(tree, element, element.get("type")), tree.zero[child]
    pose = element.find("pose")
    if pose is not None:
        around = (pose.get("relative_to") or pose.get("frame") or "").strip()
        start = tree.zero[tree.link(pose, around, "this <pose>")] if around else tree.zero[child]
        placed = start @ _pose(tree, pose, pose.text or "")
    directions = [_sdf_axis(tree, element, word, placed) for word in ("axis", "axis2")]
    first = along(placed, directions[0])
    second = along(placed, directions[1]) if kind == "universal" else first
    placements = inverse(tree.zero[parent]) @ first, inverse(tree.zero[child]) @ second
    return LoopJoint(kind, parent, child, placements, lead(element, label_of(element), tree.name) if is_screw else 0.0)


def _of_plugin(tree: UrdfTree, element: Any) -> LoopJoint:
    parent, child = _ends_of_sdf(tree, element)
    words = [element.findtext(word) or "0 0 0" for word in ("position", "rotation")]
    placed = tree.zero[child] @ _pose(tree, element, " ".join(words))
    placed = along(placed, placed[:3, :3].T @ np.array([0.0, 1.0, 0.0]))  # ClosedLoopPlugin::Load: y of the model
    return LoopJoint(
        "revolute", parent, child, (inverse(tree.zero[parent]) @ placed, inverse(tree.zero[child]) @ placed)
    )


def _ends_of_sdf(tree: UrdfTree, element: Any) -> tuple[str, str]:
    """Return the links that an element of SDF joins."""
    words, label = ("parent", "child"), label_of(element, "gazebo")
    parent, child = (tree.link(element.find(word), element.findtext(word), label) for word in words)
    return parent, child


def _sdf_axis(tree: UrdfTree, element: Any, word: str, placed: Array) -> Array:
    """Return an axis (3,) of a joint of SDF, in the joint's frame, which has a placement (4, 4) in the base."""
    axis = element.find(word)
    xyz = None if axis is None else axis.find("xyz")
    text = "0 0 1" if xyz is None else xyz.text or ""
    values = numbers(text) or []
    if len(values) != 3 or not any(values):
        raise tree.error(
            element, f"the {word} '{text.strip()}' of {label_of(element)} must be three numbers, not all 0"
        )
    direction = np.array(values) / np.linalg.norm(values)
    around = "" if xyz is None else (xyz.get("expressed_in") or "").strip()
    if axis is not None and (axis.findtext("use_parent_model_frame") or "").strip() in ("1", "true"):
        around = "__model__"
    if not around:
        return np.asarray(direction)
    turned = np.eye(4) if around == "__model__" else tree.zero[tree.link(xyz, around, "this <xyz>")]
    return np.asarray(placed[:3, :3].T @ turned[:3, :3] @ direction)


def _pose(tree: UrdfTree, element: Any, text: str) -> Array:
    values = numbers(text)
    if values is None or len(values) != 6:
        raise tree.error(element, f"'{text.strip()}' in <{tag_of(element)}> must be six numbers: x y z roll pitch yaw")
    return from_origin(values[:3], values[3:])


def _reached(base: str, above: dict[str, Any]) -> set[str]:
    """Return the links that are connected to the base by the joints above them."""
    below: dict[str, list[str]] = {}
    for link, joint in above.items():
        below.setdefault(ends(joint)[0], []).append(link)
    reached = [base]
    for link in reached:
        reached += below.get(link, [])
    return set(reached)


def _first_reached(base: str, all_joints: list[Any]) -> dict[str, Any]:
    """Return the joint above each link if joints are added in file order, as soon as their parent is connected."""
    above: dict[str, Any] = {}
    connected = {base}
    pending = list(all_joints)
    while True:
        joint = next((each for each in pending if ends(each)[0] in connected and ends(each)[1] not in connected), None)
        if joint is None:  # joints that are connected to nothing are left to the check of the tree
            loose = [each for each in pending if ends(each)[1] not in connected]
            return above | {ends(each)[1]: each for each in reversed(loose)}
        above[ends(joint)[1]] = joint
        connected.add(ends(joint)[1])
        pending.remove(joint)


class Connections:
    """Links that are connected by joints, directly or through others."""

    def __init__(self, root: Any) -> None:
        self._next: dict[str, str] = {}
        for joint in joints(root):
            self.join(*ends(joint))

    def join(self, first: str, second: str) -> bool:
        """Connect two links; return whether they were connected already."""
        first, second = self._last(first), self._last(second)
        self._next[second] = first
        return first == second

    def _last(self, link: str) -> str:
        while self._next.get(link, link) != link:
            link = self._next[link]
        return link
