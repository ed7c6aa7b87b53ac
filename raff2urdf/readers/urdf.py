"""Read a URDF as an element tree, and check it: errors name the line."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Collection, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from lxml import etree

from raff2urdf.arrays import Array
from raff2urdf.errors import RaffError, defined_twice, did_you_mean, duplicates, limits_reversed, run_all
from raff2urdf.escape import one_line, shell_word
from raff2urdf.inertia import Inertia
from raff2urdf.placement import from_origin
from raff2urdf.raff import texts
from raff2urdf.readers.xml_file import error_at, parse_xml

UNLIMITED = 1e9
"""Value of a limit that a URDF requires but the robot does not have (rad/s, m/s, N, N m; m for a prismatic joint)."""

LARGEST = 1e13
"""Largest number (m, rad): its square must stay precise. Numbers of RAFF are a tenth of it at most."""

SIZE = f" (none beyond {LARGEST:g})"

LEAST_SPEED = 1e-12
"""A velocity limit (rad/s, m/s) is greater."""

TOO_SLOW = texts.TOO_SLOW.format(least=LEAST_SPEED)

IGNORE = "--ignore-loops (in Python ignore_loops=True)"
"""The option that leaves all loops open."""

SWAP = "--swap-limits (in Python swap_limits=True)"
"""The option that exchanges limits that are reversed."""

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


class MovingJoint(NamedTuple):
    """A joint of a URDF: revolute or prismatic, its limits (rad, m), velocity limit (rad/s, m/s) and effort limit
    (N m, N), if any."""

    type: str
    limits: tuple[float, float] | None = None
    velocity: float | None = None
    effort: float | None = None


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


def joints(tree: Any) -> list[Any]:
    """Return the joints of a URDF, in file order, without joints inside other elements."""
    return [joint for joint in tree.iterchildren("joint") if joint.find("parent") is not None]


def links(tree: Any) -> list[Any]:
    """Return the links of a URDF, in file order."""
    return list(tree.iterchildren("link"))


def root_first(tree: Any) -> list[str]:
    """Return the names of the links of a URDF: the root, then the others in file order."""
    children = {ends(joint)[1] for joint in joints(tree)}
    return sorted((str(link.get("name")) for link in links(tree)), key=children.__contains__)


def hash_of(tree: Any, name: str) -> str:
    """Return the SHA-256 of a URDF's links and joints in hexadecimal: of their names, and of types, ends, origins and
    axes of joints.

    It does not depend on limits, shapes, masses, other elements, comments, order and white space, nor on how a number
    is written. A continuous joint counts as revolute.

    Args:
        tree: the root element.
        name: of the file, in errors.
    """
    rows: list[list[str | float]] = []
    for joint in joints(tree):
        kind = str(joint.get("type")).replace("continuous", "revolute")
        placed = joint.find("origin")
        numbers = [] if placed is None else [*three(placed, "xyz", name), *three(placed, "rpy", name)]
        numbers = numbers or [0.0] * 6
        numbers += axis(joint, name).tolist() if kind in ("revolute", "prismatic", "planar") else []
        rows.append([str(joint.get("name")), kind, *ends(joint), *(number + 0.0 for number in numbers)])  # no -0.0
    values = [sorted(str(link.get("name")) for link in links(tree)), sorted(rows, key=lambda row: str(row[0]))]
    return hashlib.sha256(json.dumps(values).encode()).hexdigest()


def listed(found: Sequence[Any], name: str) -> str:
    """Return the line and name of the first of some joints, and how many more there are."""
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    return f"{name}:{found[0].sourceline}: {_label(found[0])}{more}"


def remove(element: Any) -> None:
    """Remove an element, and keep the number of lines, which errors name."""
    lines = etree.tostring(element, encoding="unicode", with_tail=False).count("\n")
    blank = etree.Comment("\n" * lines)
    blank.tail = element.tail
    element.getparent().replace(element, blank)


def ends(joint: Any) -> tuple[str, str]:
    """Return the names of the links that a joint joins: parent and child."""
    child = joint.find("child")
    return str(joint.find("parent").get("link", "")), str("" if child is None else child.get("link", ""))


def axis(joint: Any, name: str) -> Array:
    """Return the axis (3,) of a joint as written, in the joint's frame; x by default.

    Raises:
        RaffError: it is no vector.
    """
    found = joint.find("axis")
    return np.array((1.0, 0.0, 0.0) if found is None else three(found, "xyz", name, "1 0 0"))


def origin(element: Any, name: str) -> Array:
    """Return the placement (4, 4) of an element's <origin>; the identity by default.

    Raises:
        RaffError: it does not consist of numbers.
    """
    found = element.find("origin")
    return np.eye(4) if found is None else from_origin(three(found, "xyz", name), three(found, "rpy", name))


def three(element: Any, word: str, name: str, default: str = "0 0 0") -> tuple[float, float, float]:
    """Return an attribute of three finite numbers.

    Raises:
        RaffError: it is not.
    """
    text = element.get(word, default)
    found = numbers(text)
    if found is None or len(found) != 3:
        shown = text if len(text) <= 60 else f"{text[:60]}..."
        raise error_at(name, element, f'{word}="{shown}" of <{element.tag}> must be three numbers{SIZE}')
    return found[0], found[1], found[2]


def numbers(text: str) -> list[float] | None:
    """Return the numbers of a text, separated by spaces; None if there is anything else, or a number beyond LARGEST."""
    found = [number(word) for word in text.split()]
    return found if all(abs(value) <= LARGEST for value in found) else None


def number(word: str) -> float:
    """Return a number in XML's notation, which may be infinite; NaN if it is none."""
    try:
        return float(word) if word.isascii() and "_" not in word else math.nan
    except ValueError:
        return math.nan


def limits(joint: Any) -> tuple[float, float] | None:
    """Return lower and upper limit (rad or m) of a revolute or prismatic joint; None if it has none.

    A joint whose `<limit>` gives neither `lower` nor `upper` has none: exporters leave them out, and the format's
    default of 0 for both would lock the joint. If one is given, the other is 0. Limits of `UNLIMITED` are none either;
    a joint with one such limit keeps it.
    """
    limit = joint.find("limit")
    if joint.get("type") not in ("revolute", "prismatic") or lacks_limits(joint):
        return None
    low, high = (min(max(number(limit.get(word, "0")), -UNLIMITED), UNLIMITED) for word in ("lower", "upper"))
    return None if low <= -UNLIMITED and high >= UNLIMITED else (low, high)


def default_value(limits: tuple[float, float] | None) -> float:
    """Return the value of a joint at home by default: 0, or else the middle of its limits (1 rad or m from a single
    limit)."""
    low, high = limits or (0.0, 0.0)
    if low <= 0.0 <= high:
        return 0.0
    return high - 1.0 if low <= -UNLIMITED else low + 1.0 if high >= UNLIMITED else (low + high) / 2.0


def velocity(joint: Any) -> float | None:
    """Return the velocity limit (rad/s or m/s) of a joint; None without one, or for 0, which exporters write."""
    limit = joint.find("limit")
    fastest = 0.0 if limit is None else number(limit.get("velocity", "0"))
    return fastest if LEAST_SPEED < fastest < UNLIMITED else None


def effort(joint: Any) -> float | None:
    """Return the effort limit (N m or N) of a joint; None without one, or for 0, which exporters write."""
    limit = joint.find("limit")
    most = 0.0 if limit is None else number(limit.get("effort", "0"))
    return most if 0.0 < most < UNLIMITED else None


def friction(joint: Any) -> tuple[float, float]:
    """Return the viscous friction (N m s/rad or N s/m) and Coulomb friction (N m or N) of a joint; 0 by default."""
    found = joint.find("dynamics")
    damping, dry = (0.0 if found is None else number(found.get(word, "0")) for word in ("damping", "friction"))
    return damping, dry


def lacks_limits(joint: Any) -> bool:
    """Return whether a joint requires limits but has none."""
    limit = joint.find("limit")
    neither = limit is None or (limit.get("lower") is None and limit.get("upper") is None)
    return joint.get("type") in ("revolute", "prismatic") and neither


def direction(element: Any, text: str, label: str, name: str) -> Array:
    """Return the axis (3,) of a joint as written.

    Raises:
        RaffError: it is not three numbers, or they are all 0.
    """
    found = numbers(text)
    if found is None or len(found) != 3 or math.hypot(*found) <= 1e-9:
        raise error_at(
            name,
            element,
            f"the axis '{text.strip()}' of {label} must be three numbers, not all 0: 0 0 1, for example{SIZE}",
        )
    return np.array(found)


def limit_value(element: Any, text: str, word: str, label: str, name: str) -> float:
    """Return a limit of a joint: `lower`, `upper`, `velocity` or `effort`.

    Raises:
        RaffError: it is not a number, or a negative velocity or effort.
    """
    value = number(text)
    if math.isnan(value):
        raise error_at(name, element, f"the {word} limit '{text}' of {label} is not a number")
    if word == "velocity" and 0.0 < value <= LEAST_SPEED:
        raise error_at(name, element, f"the velocity limit of {label} is {value:g}: {TOO_SLOW}")
    if word in ("velocity", "effort") and value < 0.0:
        raise error_at(name, element, f"the {word} limit of {label} is {value:g}: it must not be negative")
    return value


def check_friction(element: Any, text: str, word: str, label: str, name: str) -> float:
    """Return the `damping` or `friction` of a joint.

    Raises:
        RaffError: it is not a number, or negative.
    """
    value = number(text)
    if not 0.0 <= value <= LARGEST:
        raise error_at(
            name, element, f"the {word} '{text.strip()[:60]}' of {label} must be a number, and not negative{SIZE}"
        )
    return value


def swap_limits(tree: Any) -> list[str]:
    """Exchange lower and upper limits of joints where the lower one is above the upper one; return their names."""
    swapped = []
    for joint in tree.iterchildren("joint"):
        limit = joint.find("limit")
        if limit is None or joint.get("type") not in ("revolute", "prismatic"):
            continue
        low, high = limit.get("lower", "0"), limit.get("upper", "0")
        if number(low) > number(high):
            limit.set("lower", high)
            limit.set("upper", low)
            swapped.append(str(joint.get("name")))
    return swapped


def negative_mass(label: str, mass: float) -> str:
    """Return the error of a mass (kg) below 0."""
    return texts.NEGATIVE_MASS.format(what=label, mass=mass)


def lacks(inertial: Any) -> str | None:
    """Return an element or attribute that an <inertial> lacks; None if it is complete."""
    for tag, words in (("mass", ("value",)), ("inertia", MOMENTS)):
        found = inertial.find(tag)
        missing = [tag] if found is None else [f"{word} of <{tag}>" for word in words if found.get(word) is None]
        if missing:
            return missing[0]
    return None


def inertia(link: Any, name: str) -> Inertia | None:
    """Return the inertia of a link in its own axes: that of the first complete <inertial>; None without one."""
    for inertial in link.iterchildren("inertial"):
        if lacks(inertial) is None:
            xx, xy, xz, yy, yz, zz = (number(inertial.find("inertia").get(word)) for word in MOMENTS)
            placed, matrix = origin(inertial, name), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            found = Inertia(number(inertial.find("mass").get("value")), np.zeros(3), matrix)
            return found.in_frame(placed)
    return None


MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def _label(joint: Any) -> str:
    return f"joint '{joint.get('name', '')}'"


def _check_joint(joint: Any, known: Collection[str], name: str) -> None:
    if joint.find("parent") is None:
        raise error_at(name, joint, f"{_label(joint)} has no <parent>: add it")
    run_all([partial(_check_numbers, joint, name), partial(_check_ends, joint, known, name)])


def _check_ends(joint: Any, known: Collection[str], name: str) -> None:
    for word, link in zip(("parent", "child"), ends(joint), strict=True):
        if known and link not in known:
            near = did_you_mean(link, list(known))
            add = "" if near.endswith("?") else f': add <link name="{link}"/>, or name one of these'
            what = f"{_label(joint)} has the {word} '{link}', which is not a link{near}{add}"
            raise error_at(name, joint, what)


def _check_numbers(joint: Any, name: str) -> None:
    kind, vector = joint.get("type"), joint.find("axis")
    if kind not in KINDS:
        near = did_you_mean(str(MEANT.get(str(kind), kind)), KINDS)
        what = f"{_label(joint)} has the type '{kind}', which is not in URDF{near}"
        raise error_at(name, joint, what)
    if vector is not None and kind not in ("fixed", "floating", "spherical"):
        direction(vector, vector.get("xyz", "1 0 0"), _label(joint), name)
    origin(joint, name)
    for dynamics in joint.iterchildren("dynamics"):
        for word in ("damping", "friction"):
            check_friction(dynamics, dynamics.get(word, "0"), word, _label(joint), name)
    limit = joint.find("limit")
    if limit is None:
        return
    words = [word for word in ("lower", "upper", "velocity", "effort") if limit.get(word) is not None]
    values = {word: limit_value(limit, limit.get(word), word, _label(joint), name) for word in words}
    low, high = values.get("lower", 0.0), values.get("upper", 0.0)
    if kind in ("revolute", "prismatic") and low > high:
        edit = f'lower="{limit.get("upper", "0")}" upper="{limit.get("lower", "0")}"'
        raise error_at(name, limit, f"{limits_reversed(_label(joint), low, high)} ({edit}), or add {SWAP}")


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
                found = numbers(text or "")
                if found is None or len(found) != count:
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
            what = f"{_label(joint)} has the child '{child}' of {_label(other)} on line {other.sourceline}"
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
            first = next(one for one in known if one in above[above.index(at) :])
            why = f"link '{link}' is not connected to the root, but part of a kinematic cycle or attached to one"
            remedy = f'give {_label(joint_of[first])} another parent, such as <parent link="{roots[0]}"/>'
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
