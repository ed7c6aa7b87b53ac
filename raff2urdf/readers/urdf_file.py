"""Read the text of a URDF, and check what every reader of it needs."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial
from typing import Any

from raff2urdf.errors import RaffError, defined_twice, did_you_mean, duplicates, limits_reversed, run_all
from raff2urdf.escape import one_line, shell_word
from raff2urdf.readers.urdf import (
    IGNORE,
    LARGEST,
    MOMENTS,
    SIZE,
    SWAP,
    check_friction,
    direction,
    ends,
    joints,
    label,
    limit_value,
    links,
    negative_mass,
    number,
    numbers,
    origin,
)
from raff2urdf.readers.xml_file import error_at, parse_xml

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical")
"""Types of joints. `spherical` is not in URDF's specification, but some programs write it."""

MEANT = {
    "hinge": "revolute",
    "rotary": "revolute",
    "rotational": "revolute",
    "slide": "prismatic",
    "slider": "prismatic",
}
"""Types of joints by the words of other formats."""


def parse(text: str, name: str) -> Any:
    """Return the root element of a URDF whose joints form a tree and have valid axes and limits.

    Args:
        text: of the file.
        name: of the file, in errors.

    Raises:
        RaffError: not a URDF; links and joints that are no tree; a joint whose axis is 0, whose origin or limits are
            no numbers, or whose limits contradict each other.
    """
    tree = parse_xml(text, name)
    if tree.tag != "robot":
        raise error_at(name, tree, f"this is not a URDF: its first element is <{tree.tag}>, not <robot>")
    if tree.get("name"):
        tree.set("name", one_line(tree.get("name")))  # it names nothing but the robot, to users
    try:
        known = dict.fromkeys(str(link.get("name")) for link in links(tree))
        run_all(
            [
                partial(by_name, links(tree), name),
                *(partial(_check_joint, joint, known, name) for joint in tree.iterchildren("joint")),
                *(partial(check, link, name) for link in links(tree) for check in (_check_inertial, _check_shapes)),
            ]
        )
        _check_tree(tree, name)
    except RaffError as error:
        if hint := xacro_hint(tree, name):
            raise RaffError(f"{error}{hint}") from None
        raise
    return tree


def xacro_hint(tree: Any, name: str) -> str:
    """Return a hint to append to an error if the file is xacro, not yet a URDF; empty if it is not."""
    for element in tree.iter("*"):
        prefix = element.prefix or str(element.tag).partition(":")[0]
        if prefix == "xacro" or any("$(" in value or "${" in value for value in element.attrib.values()):
            return f". It contains xacro (line {element.sourceline}): load the output of `xacro {shell_word(name)}`"
    return ""


def _check_joint(joint: Any, known: Collection[str], name: str) -> None:
    if joint.find("parent") is None:
        raise error_at(name, joint, f"{label(joint)} has no <parent>: add it")
    run_all([partial(_check_numbers, joint, name), partial(_check_ends, joint, known, name)])


def _check_ends(joint: Any, known: Collection[str], name: str) -> None:
    for word, link in zip(("parent", "child"), ends(joint), strict=True):
        if known and link not in known:
            near = did_you_mean(link, list(known))
            add = "" if near.endswith("?") else f': add <link name="{link}"/>, or name one of these'
            what = f"{label(joint)} has the {word} '{link}', which is not a link{near}{add}"
            raise error_at(name, joint, what)


def _check_numbers(joint: Any, name: str) -> None:
    kind, vector = joint.get("type"), joint.find("axis")
    if kind not in KINDS:
        near = did_you_mean(str(MEANT.get(str(kind), kind)), KINDS)
        what = f"{label(joint)} has the type '{kind}', which is not in URDF{near}"
        raise error_at(name, joint, what)
    if vector is not None and kind not in ("fixed", "floating", "spherical"):
        direction(vector, vector.get("xyz", "1 0 0"), label(joint), name)
    origin(joint, name)
    for dynamics in joint.iterchildren("dynamics"):
        for word in ("damping", "friction"):
            check_friction(dynamics, dynamics.get(word, "0"), word, label(joint), name)
    limit = joint.find("limit")
    if limit is None:
        return
    words = [word for word in ("lower", "upper", "velocity", "effort") if limit.get(word) is not None]
    values = {word: limit_value(limit, limit.get(word), word, label(joint), name) for word in words}
    low, high = values.get("lower", 0.0), values.get("upper", 0.0)
    if kind in ("revolute", "prismatic") and low > high:
        edit = f'lower="{limit.get("upper", "0")}" upper="{limit.get("lower", "0")}"'
        raise error_at(name, limit, f"{limits_reversed(label(joint), low, high)} ({edit}), or add {SWAP}")


def _check_inertial(link: Any, name: str) -> None:
    """Check that the numbers of a link's mass and inertia are numbers, and the mass is not negative; those that are
    left out are not missed."""
    for inertial in link.iterchildren("inertial"):
        origin(inertial, name)
        for tag, words in (("mass", ("value",)), ("inertia", MOMENTS)):
            for element in inertial.iterchildren(tag):
                for word in words:
                    text = element.get(word)
                    if text is not None and not abs(number(text)) <= LARGEST:
                        what = f"{word}=\"{text[:60]}\" of <{tag}> in link '{link.get('name')}'"
                        raise error_at(name, element, f"{what} must be a number{SIZE}")
                    if word == "value" and text is not None and number(text) < 0.0:
                        raise error_at(name, element, negative_mass(f"link '{link.get('name')}'", number(text)))


SHAPES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
    "capsule": {"radius": 1, "length": 1},
}
"""Kinds of shapes, their sizes, by their names in URDF and in SDF, and how many numbers each of these has."""


def _check_shapes(link: Any, name: str) -> None:
    """Check the numbers of a link's shapes, which other readers of a URDF would leave out or take for 0."""
    for geometry in link.iterfind("*/geometry"):
        origin(geometry.getparent(), name)
        for shape in geometry.iterchildren(*SHAPES):
            for word, count in SHAPES[shape.tag].items():
                text = shape.get(word)
                if text is None and shape.tag == "mesh":
                    continue
                values = numbers(text or "")
                if values is None or len(values) != count:
                    what = f"{word}=\"{(text or '')[:60]}\" of <{shape.tag}> in link '{link.get('name')}'"
                    plural = "a number" if count == 1 else f"{count} numbers"
                    raise error_at(name, shape, f"{what} must be {plural}{SIZE}")


def _check_tree(tree: Any, name: str) -> None:
    known = by_name(links(tree), name)
    if not known:
        raise error_at(name, tree, f"the robot '{tree.get('name', '')}' has no link: add one")
    joint_of: dict[str, Any] = {}
    for joint in by_name(joints(tree), name).values():
        child = ends(joint)[1]
        other = joint_of.setdefault(child, joint)
        if other is not joint:
            what = f"{label(joint)} has the child '{child}' of {label(other)} on line {other.sourceline}"
            remedy = "Give the joint a child of its own and close the loop in a sidecar file (.constraints.json)"
            raise error_at(
                name, joint, f"{what}: a URDF can't close loops. {remedy}, or leave this joint out with {IGNORE}"
            )
    roots = [link for link in known if link not in joint_of]
    if not roots:
        raise error_at(name, tree, "every link has a parent: remove the joint above the link that is the root")
    if len(roots) > 1:
        shown = ", ".join(f"'{root}' (line {known[root].sourceline})" for root in roots[:8])
        raise error_at(
            name, known[roots[1]], f"{len(roots)} links have no parent, but exactly one must be the root: {shown}"
        )
    children: dict[str, list[str]] = {}
    for child, joint in joint_of.items():
        children.setdefault(ends(joint)[0], []).append(child)
    reached = roots
    for link in reached:
        reached += children.get(link, [])
    unreached = known.keys() - set(reached)
    for link in known:
        if link in unreached:
            above, at = [link], link
            while (at := ends(joint_of[at])[0]) not in above:
                above.append(at)
            first = next(candidate for candidate in known if candidate in above[above.index(at) :])
            why = f"link '{link}' is not connected to the root, but part of a kinematic cycle or attached to one"
            remedy = f'give {label(joint_of[first])} another parent, such as <parent link="{roots[0]}"/>'
            raise error_at(name, joint_of[link], f"{why}: {remedy}")


def by_name(elements: Sequence[Any], name: str, prefix: str = "") -> dict[str, Any]:
    """Return elements by their names; `prefix` precedes the names in errors.

    Raises:
        RaffError: an element has no name, or that of another one.
    """
    for element in elements:
        if not element.get("name"):
            raise error_at(name, element, f"this {element.tag} has no name: give it one")
        if not element.get("name").isprintable():
            what = f"the name {ascii(element.get('name'))[:100]} of this {element.tag}"
            raise error_at(name, element, f"{what} holds a character that can't be printed: change it")
    for first, element in duplicates(elements, lambda element: element.get("name")):
        what = f"{element.tag} '{prefix}{element.get('name')}'"
        raise error_at(name, element, defined_twice(what, first.sourceline))
    return {element.get("name"): element for element in elements}
