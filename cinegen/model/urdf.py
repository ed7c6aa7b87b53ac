"""A URDF as Pinocchio needs it, and everything that the URDF and its sidecar file declare, in one object."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Mapping
from typing import Any

from lxml import etree

from cinegen.errors import LoadError, warn
from raff2urdf.bounds import UNLIMITED
from raff2urdf.constraints import Constraints
from raff2urdf.errors import did_you_mean
from raff2urdf.readers.loops import successive
from raff2urdf.readers.urdf import (
    default_value,
    friction,
    joints,
    lacks,
    lacks_limits,
    limits,
    links,
    listed,
    number,
    root_first,
    velocity,
)
from raff2urdf.readers.urdf_file import parse


def simple(tree: Any, name: str) -> Constraints:
    """Make every joint of a URDF one number, except a free base, and return what the URDF declares.

    Joints of several degrees of freedom become successive ones (`raff2urdf.readers.loops.successive`). All joints are
    given limits, since Pinocchio would represent an angle without limits by its cosine and sine. One warning lists
    joints whose limits are left out.

    Args:
        tree: root of the URDF; changed.
        name: the file's, for errors.

    Returns:
        constraints as `raff2urdf.constraints` describes: nodes, joints, ball joints, floating, and no loops.
    """
    nodes = root_first(tree)
    spherical = {joint.get("name") for joint in joints(tree) if joint.get("type") == "spherical"}
    replaced = successive.replace_compound(tree, name, keep_root=True)
    _warn_of_assumptions(tree, name)
    floating, entries = None, []
    for joint in joints(tree):
        kind = joint.get("type")
        if kind == "floating":
            floating = joint.get("name")
        if kind not in ("revolute", "continuous", "prismatic"):
            continue
        allowed = limits(joint)
        entries.append(
            {
                "name": joint.get("name"),
                "type": "prismatic" if kind == "prismatic" else "revolute",
                "home": 0.0,
                "limits": None if allowed is None else list(allowed),
                "velocity": velocity(joint),
                "friction": friction(joint),
            }
        )
        _give_limits(joint, allowed)
    return {
        "robot": tree.get("name") or "robot",
        "nodes": nodes,
        "floating": floating,
        "joints": entries,
        "balls": [{"name": joint, "joints": names} for joint, names in replaced.items() if joint in spherical],
        "loops": [],
    }


def with_fixed_base(
    urdf: str, constraints: Mapping[str, Any] | None, name: str
) -> tuple[str, Mapping[str, Any] | None]:
    """Return a URDF and its constraints with a base that does not move; as they are if there is no floating base.

    Args:
        urdf: its text.
        constraints: as `raff2urdf.constraints` describes; None for a tree.
        name: the file's, for errors.

    Raises:
        raff2urdf.RaffError: no URDF.
    """
    tree = parse(urdf, name)
    floating = [j for j in joints(tree) if j.get("type") == "floating" and successive.is_root(tree, j)]
    if not floating:
        return urdf, constraints
    floating[0].set("type", "fixed")
    if constraints is not None:  # what is stated of the mobility was counted with the base's
        constraints = {key: value for key, value in constraints.items() if key not in ("loop_rank", "mobility")}
        constraints["floating"] = None
    return etree.tostring(tree, encoding="unicode"), constraints


def kinematics_of(urdf: str, name: str) -> str:
    """Return a URDF's text without everything that motion does not depend on, such as shapes.

    Args:
        urdf: its text.
        name: the file's, for errors.

    Raises:
        RaffError: no URDF.
    """
    tree = parse(urdf, name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # `load` warns
        simple(tree, name)
    return kinematics(tree)


def kinematics(tree: Any) -> str:
    """Return the text of a URDF changed by `simple`, without elements that motion does not depend on: Pinocchio may
    refuse them."""
    robot = etree.Element("robot", name=tree.get("name") or "robot")
    for link in links(tree):
        kept = etree.SubElement(robot, "link", name=link.get("name"))
        kept.extend(copy.deepcopy(inertial) for inertial in link.iterchildren("inertial") if lacks(inertial) is None)
    for joint in joints(tree):
        kept = etree.SubElement(robot, "joint", name=joint.get("name"), type=joint.get("type"))
        moves = joint.get("type") in ("revolute", "continuous", "prismatic")
        for word in ("parent", "child", "origin", *(("axis", "limit") if moves else ())):
            child = joint.find(word)
            if child is not None:
                kept.append(copy.deepcopy(child))
    for element in robot.iter("origin", "mass", "inertia", "axis", "limit"):
        for word, value in element.items():
            element.set(word, " ".join(value.split()))  # urdfdom refuses "3.3 "
    text: str = etree.tostring(robot, encoding="unicode")
    return text


def completed(declared: Constraints, sidecar: Mapping[str, Any] | None, name: str) -> Constraints:
    """Return what a URDF declares, completed and overridden by its sidecar file.

    Args:
        declared: by the URDF, see `simple`.
        sidecar: likewise, by the sidecar file. Its list of joints, if it has one, orders them.
        name: the URDF's, for errors.

    Raises:
        LoadError: the other file names a joint or a link that the URDF lacks, or lacks one of its joints.
    """
    if sidecar is None or not (sidecar.get("loops") or sidecar.get("couplings")):
        for entry in declared["joints"]:  # without loops, 0 is as good as anything else
            entry["home"] = default_value(entry["limits"])
    if sidecar is None:
        return declared
    known, entries = {entry["name"]: entry for entry in declared["joints"]}, sidecar.get("joints", declared["joints"])
    listed = {entry["name"] for entry in entries}
    for joint in sorted(listed - known.keys()):
        raise LoadError(f"{name}: the URDF has no joint '{joint}'{did_you_mean(joint, list(known))}")
    for joint in sorted(known.keys() - listed):
        raise LoadError(f"{name}: the constraints have no joint '{joint}', which the URDF has")
    if sidecar.get("floating", declared["floating"]) != declared["floating"]:
        raise LoadError(
            f"{name}: the constraints declare that '{sidecar['floating']}' lets the base move, the URDF does not"
        )
    for node in sidecar.get("nodes", []):
        if node not in declared["nodes"]:
            raise LoadError(f"{name}: the constraints name '{node}', which is no link of the URDF")
    return {**declared, **sidecar, "joints": [{**known[entry["name"]], **entry} for entry in entries]}


def declared_joints(urdf: str, constraints: Mapping[str, Any] | None, name: str) -> dict[str, Mapping[str, Any]]:
    """Return what a URDF and its sidecar file declare of each joint, see `completed`, by name."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # `build` warns
        declared = completed(simple(parse(urdf, name), name), constraints, name)
    return {joint["name"]: joint for joint in declared["joints"]}


def with_joints(
    constraints: Mapping[str, Any] | None,
    declared: Mapping[str, Mapping[str, Any]],
    stated: Mapping[str, Mapping[str, Any]],
) -> Constraints:
    """Return constraints that state more of some joints; `declared` is of all."""
    bare = [{"name": name} | ({} if constraints else {"home": joint["home"]}) for name, joint in declared.items()]
    entries = (constraints or {}).get("joints", bare)
    joints = [{**entry, **stated.get(entry["name"], {})} for entry in entries]
    return {**(constraints or {"loops": []}), "joints": joints}


def _warn_of_assumptions(tree: Any, name: str) -> None:
    """Warn of joints whose limits are left out, and of incomplete masses."""
    partial = [inertial for link in links(tree) for inertial in link.iterchildren("inertial") if lacks(inertial)]
    if partial:
        more = f" (and {len(partial) - 1} more like it)" if len(partial) > 1 else ""
        link = partial[0].getparent().get("name")
        where = f"{name}:{partial[0].sourceline}: the <inertial> of link '{link}'"
        warn(f"{where} has no {lacks(partial[0])}: its mass is left out{more}")
    left_out = [joint for joint in joints(tree) if lacks_limits(joint)]
    if left_out:
        remedy = 'add lower and upper to <limit>, or write type="continuous" if it is meant'
        warn(f"{listed(left_out, name)}: no lower and upper limit are given; taken as unlimited: {remedy}")


def _give_limits(joint: Any, allowed: tuple[float, float] | None) -> None:
    """Write the limits that Pinocchio requires; placeholders where a joint has none."""
    joint.set("type", "prismatic" if joint.get("type") == "prismatic" else "revolute")
    limit = joint.find("limit")
    if limit is None:
        limit = etree.SubElement(joint, "limit")
    for word in ("effort", "velocity"):
        limit.set(word, repr(min(number(limit.get(word, "0")), UNLIMITED)))
    for word, value in zip(("lower", "upper"), (-1.0, 1.0) if allowed is None else allowed, strict=True):
        limit.set(word, repr(float(value)))
