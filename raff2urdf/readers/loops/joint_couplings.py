"""Read couplings between the joints of a URDF.

<mimic>                    in a <joint>: q = multiplier * leader + offset
<coupling>                 URDF+: ratio * (sum of the joints down to the predecessor) = sum of those down to the
                           successor, both from their nearest common ancestor
<constraint type="coupling">  written by `raff2urdf --loops constraint`: the sum of c1 q + c2 q^2 + ... of each <term>,
                           with these coefficients, is the <constant>
<plugin> in <gazebo>       mimic plugins, with <joint> and <mimicJoint>
<param name="mimic">       in a <joint> of <ros2_control>
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from raff2urdf.coupling import coupling_entry
from raff2urdf.errors import did_you_mean
from raff2urdf.readers.loops.declaration import CouplingEntry, Declaration, declared, label_of
from raff2urdf.readers.urdf import joints, number, numbers
from raff2urdf.readers.urdf_tree import UrdfTree

COUPLING = "coupling"
"""Type of a `<constraint>` that couples joints."""

_MOVING = ("revolute", "continuous", "prismatic")


def find(root: Any) -> Iterator[Declaration]:
    """Yield the couplings that a URDF declares. A joint that is fixed, as in reduced models, follows nothing."""
    moving = [joint for joint in joints(root) if joint.get("type") != "fixed"]
    names = {str(joint.get("name")) for joint in moving}
    for joint in moving:
        for mimic in joint.iterchildren("mimic"):
            follower, leader = str(joint.get("name")), mimic.get("joint", "")
            written = {word: mimic.get(word) for word in ("multiplier", "offset")}
            label = f"<mimic> in joint '{follower}'"
            yield _mimic(mimic, "mimic", label, follower, leader, written)
    for element in root.iterchildren("coupling"):
        yield declared(element, "URDF+", _urdf_plus, coupling=True)
    for element in root.iterfind(f"constraint[@type='{COUPLING}']"):
        yield declared(element, "constraint elements", _constraint, coupling=True)
    for plugin in root.iterfind("gazebo/plugin"):
        leader, follower = ((plugin.findtext(word) or "").strip() for word in ("joint", "mimicJoint"))
        if leader in names and follower in names:
            written = {word: plugin.findtext(word) for word in ("multiplier", "offset")}
            yield _mimic(plugin, "Gazebo plugins", label_of(plugin, "gazebo"), follower, leader, written)
    for joint in root.iterfind("ros2_control/joint"):
        values = {str(param.get("name")): (param.text or "").strip() for param in joint.iterchildren("param")}
        follower = str(joint.get("name"))
        if values.get("mimic") in names and follower in names:
            label = f"joint '{follower}' in <ros2_control>"
            yield _mimic(joint, "ros2_control", label, follower, values["mimic"], values)


def _mimic(element: Any, dialect: str, label: str, follower: str, leader: str, texts: Any) -> Declaration:
    def read(tree: UrdfTree, element: Any) -> CouplingEntry:
        multiplier, offset = (_number(tree, element, label, texts.get(word), word) for word in ("multiplier", "offset"))
        if leader == follower:
            raise tree.error(element, f"{label} mimics the joint itself: name another joint, or remove it")
        _check(tree, element, follower, label)
        _check(tree, element, leader, label)
        _check_chain(tree, element, follower)
        terms = {follower: [1.0], **({leader: [-multiplier]} if multiplier else {})}
        return coupling_entry(follower, terms, offset)

    return declared(element, dialect, read, label, follower, coupling=True, also=("mimic",))


def _urdf_plus(tree: UrdfTree, element: Any) -> CouplingEntry:
    label, links = label_of(element), []
    for word in ("predecessor", "successor"):
        end = element.find(word)
        if end is None:
            raise tree.error(element, f"{label} declares a coupling, but has no <{word}>: add it")
        links.append(tree.link(end, end.get("link"), f"<{word}> of {label}"))
    stated = element.find("ratio")
    if stated is None:
        raise tree.error(element, f'{label} has no <ratio>: add <ratio value="..."/>')
    ratio = _number(tree, stated, label, stated.get("value", ""), "ratio")
    terms: dict[str, list[float]] = {}
    for chain, coefficient in zip(tree.between(*links), (ratio, -1.0), strict=True):
        for joint in chain:
            if joint.get("type") != "fixed" and coefficient:
                _check(tree, element, str(joint.get("name")), label)
                terms[str(joint.get("name"))] = [coefficient]
    if not terms:
        raise tree.error(element, f"{label} couples no joint: '{links[0]}' and '{links[1]}' are one rigid body")
    return coupling_entry(element.get("name") or "-".join(links), terms)


def _constraint(tree: UrdfTree, element: Any) -> CouplingEntry:
    label, terms = label_of(element), dict[str, list[float]]()
    for term in element.iterchildren("term"):
        joint, coefficients = term.get("joint", ""), numbers(term.get("coefficients", ""))
        _check(tree, element, joint, label)
        if not coefficients or not any(coefficients) or joint in terms:
            raise tree.error(term, f"the <term> of joint '{joint}' in {label} must have coefficients, and be one")
        terms[joint] = coefficients
    if not terms:
        raise tree.error(element, f"{label} has no <term>: add one for each joint")
    constant = element.find("constant")
    value = 0.0 if constant is None else _number(tree, constant, label, constant.get("value", ""), "constant")
    return coupling_entry(element.get("name") or "-".join(terms), terms, value)


def _number(tree: UrdfTree, element: Any, label: str, text: str | None, word: str) -> float:
    if text is None:
        return 1.0 if word == "multiplier" else 0.0
    value = number(text.strip())
    if not math.isfinite(value):
        raise tree.error(element, f"the {word} '{text}' of {label} is not a number")
    return value


def _check(tree: UrdfTree, element: Any, joint: str, label: str) -> None:
    """Check that a joint exists, and is one number."""
    in_urdf = tree.joints.get(joint)
    if in_urdf is None:
        why = f"names joint '{joint}', which the URDF lacks{did_you_mean(joint, list(tree.joints))}"
    elif in_urdf.get("type") not in _MOVING:
        why = f"couples joint '{joint}', which is {in_urdf.get('type')}"
    else:
        return
    raise tree.error(element, f"{label} {why}: correct it, or leave it out with --ignore {element.tag}")


def _check_chain(tree: UrdfTree, element: Any, follower: str) -> None:
    """Check that joints do not mimic each other in a circle."""
    seen, joint = [follower], follower
    while True:
        mimic = tree.joints[joint].find("mimic") if joint in tree.joints else None
        if mimic is None:
            return
        joint = mimic.get("joint", "")
        if joint in seen:
            shown = " -> ".join((*seen, joint))
            raise tree.error(element, f"joints mimic each other in a circle: {shown}: remove one <mimic>")
        seen.append(joint)
