"""A URDF as Pinocchio should see it, and all that is said of it, in the URDF or beside it, in one place."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Mapping
from typing import Any

from lxml import etree

from cinegen.errors import CinegenWarning, LoadError
from raff2urdf.constraints import Constraints
from raff2urdf.errors import did_you_mean
from raff2urdf.readers import successive
from raff2urdf.readers.urdf import (
    UNLIMITED,
    joints,
    limits,
    links,
    middle,
    number,
    parse,
    root_first,
    several,
    silent,
    velocity,
)


def simple(tree: Any, name: str) -> Constraints:
    """Makes every joint of a URDF one number, a base that can move apart, and says what its joints and nodes are.

    Joints of several freedoms become successive ones (`raff2urdf.readers.successive`); Pinocchio would take the cosine
    and the sine of an angle without limits, so all are given some. One warning tells of joints whose limits are left
    out, and one of joints that should mimic others.

    Args:
        tree: its root; changed.
        name: what errors call it.

    Returns:
        what `raff2urdf.constraints` would say of it: nodes, joints, floating, and no loops.
    """
    nodes = root_first(tree)
    successive.replace_compound(tree, name, keep_root=True)
    _tell(tree, name)
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
            }
        )
        _give_limits(joint, allowed)
    return {
        "robot": tree.get("name") or "robot",
        "nodes": nodes,
        "floating": floating,
        "joints": entries,
        "loops": [],
    }


def kinematics_of(urdf: str, name: str) -> str:
    """A URDF's text (`name` is what errors call it) without all that no motion depends on, shapes above all.

    Raises:
        RaffError: no URDF.
    """
    tree = parse(urdf, name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # whoever loads it is told
        simple(tree, name)
    return kinematics(tree)


def kinematics(tree: Any) -> str:
    """The text of a URDF, its root from `simple`, without what Pinocchio may refuse though no motion depends on it."""
    robot = etree.Element("robot", name=tree.get("name") or "robot")
    for link in links(tree):
        kept = etree.SubElement(robot, "link", name=link.get("name"))
        kept.extend(copy.deepcopy(inertial) for inertial in link.iterchildren("inertial"))
    for joint in joints(tree):
        kept = etree.SubElement(robot, "joint", name=joint.get("name"), type=joint.get("type"))
        for word in ("parent", "child", "origin", "axis", "limit"):
            found = joint.find(word)
            if found is not None:
                kept.append(copy.deepcopy(found))
    text: str = etree.tostring(robot, encoding="unicode")
    return text


def completed(said: Constraints, beside: Mapping[str, Any] | None, name: str) -> Constraints:
    """What a URDF says of itself, and what a file beside it adds or says otherwise.

    Args:
        said: by the URDF, see `simple`.
        beside: likewise, by the other file. Its list of joints, if it has one, orders them.
        name: what errors call the URDF.

    Raises:
        LoadError: the other file names a joint or a link that the URDF lacks.
    """
    if beside is None:
        for entry in said["joints"]:  # without loops, 0 is as good as anything else
            entry["home"] = middle(entry["limits"])
        return said
    known = {entry["name"]: entry for entry in said["joints"]}
    for entry in beside.get("joints", []):
        if entry["name"] not in known:
            near = did_you_mean(entry["name"], list(known))
            raise LoadError(f"{name}: the constraints name joint '{entry['name']}', which the URDF lacks{near}")
    named = {entry["name"] for entry in beside.get("joints", [])}
    for joint in known if "joints" in beside else ():
        if joint not in named:
            raise LoadError(f"{name}: the constraints don't name joint '{joint}', which moves")
    if beside.get("floating", said["floating"]) != said["floating"]:
        raise LoadError(
            f"{name}: the constraints say that '{beside['floating']}' lets the base move, the URDF does not"
        )
    for node in beside.get("nodes", []):
        if node not in said["nodes"]:
            raise LoadError(f"{name}: the constraints name '{node}', which is no link of the URDF")
    whole = {**said, **beside}
    if "joints" in beside:
        whole["joints"] = [{**known[entry["name"]], **entry} for entry in beside["joints"]]
    return whole


def _tell(tree: Any, name: str) -> None:
    """One warning of joints that leave their limits out, and one of joints that should follow others."""
    left_out = [joint for joint in joints(tree) if silent(joint)]
    if left_out:
        _warn(name, left_out, "no lower and upper limit are given; taken as unlimited")
    followers = [joint for joint in joints(tree) if joint.find("mimic") is not None]
    if followers:
        _warn(name, followers, "it should mimic another joint; taken as a joint of its own")


def _warn(name: str, found: list[Any], what: str) -> None:
    warnings.warn(f"{several(found, name)}: {what}", CinegenWarning, stacklevel=5)


def _give_limits(joint: Any, allowed: tuple[float, float] | None) -> None:
    """Writes all that Pinocchio wants of limits, and limits that mean nothing where a joint has none."""
    joint.set("type", "prismatic" if joint.get("type") == "prismatic" else "revolute")
    limit = joint.find("limit")
    if limit is None:
        limit = etree.SubElement(joint, "limit")
    for word in ("effort", "velocity"):
        limit.set(word, repr(min(number(limit.get(word, "0")), UNLIMITED)))
    for word, value in zip(("lower", "upper"), (-1.0, 1.0) if allowed is None else allowed, strict=True):
        limit.set(word, repr(float(value)))
