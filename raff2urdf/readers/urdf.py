"""Read a URDF as an element tree, and check it: errors name the line."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from lxml import etree

from raff2urdf.arrays import Array
from raff2urdf.bounds import UNLIMITED
from raff2urdf.inertia import Inertia
from raff2urdf.placement import from_origin
from raff2urdf.readers.xml_file import error_at

LARGEST = 1e13
"""Largest number (m, rad): its square must stay precise. Numbers of RAFF are a tenth of it at most."""

SIZE = f" (none beyond {LARGEST:g})"

LEAST_SPEED = 1e-12
"""A velocity limit (rad/s, m/s) is greater."""

TOO_SLOW = f"it must be above 0, and not as slow as {LEAST_SPEED:g} rad/s or m/s; or left out"

IGNORE = "--ignore-loops (in Python ignore_loops=True)"
"""The option that leaves all loops open."""

SWAP = "--swap-limits (in Python swap_limits=True)"
"""The option that exchanges limits that are reversed."""


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


def listed(several: Sequence[Any], name: str) -> str:
    """Return the line and name of the first of some joints, and how many more there are."""
    more = f" and {len(several) - 1} more" if len(several) > 1 else ""
    return f"{name}:{several[0].sourceline}: {label(several[0])}{more}"


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
    element = joint.find("axis")
    return np.array((1.0, 0.0, 0.0) if element is None else three(element, "xyz", name, "1 0 0"))


def origin(element: Any, name: str) -> Array:
    """Return the placement (4, 4) of an element's <origin>; the identity by default.

    Raises:
        RaffError: it does not consist of numbers.
    """
    stated = element.find("origin")
    return np.eye(4) if stated is None else placement(stated, name)


def placement(element: Any, name: str) -> Array:
    """Return the placement (4, 4) that an element's own `xyz` and `rpy` give."""
    return from_origin(three(element, "xyz", name), three(element, "rpy", name))


def three(element: Any, word: str, name: str, default: str = "0 0 0") -> tuple[float, float, float]:
    """Return an attribute of three finite numbers.

    Raises:
        RaffError: it is not.
    """
    text = element.get(word, default)
    vector = numbers(text)
    if vector is None or len(vector) != 3:
        shown = text if len(text) <= 60 else f"{text[:60]}..."
        raise error_at(name, element, f'{word}="{shown}" of <{element.tag}> must be three numbers{SIZE}')
    return vector[0], vector[1], vector[2]


def numbers(text: str) -> list[float] | None:
    """Return the numbers of a text, separated by spaces; None if there is anything else, or a number beyond LARGEST."""
    values = [number(word) for word in text.split()]
    return values if all(abs(value) <= LARGEST for value in values) else None


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
    dynamics = joint.find("dynamics")
    damping, dry = (0.0 if dynamics is None else number(dynamics.get(word, "0")) for word in ("damping", "friction"))
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
    vector = numbers(text)
    if vector is None or len(vector) != 3 or math.hypot(*vector) <= 1e-9:
        raise error_at(
            name,
            element,
            f"the axis '{text.strip()}' of {label} must be three numbers, not all 0: 0 0 1, for example{SIZE}",
        )
    return np.array(vector)


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
    return f"the mass of {label} is {mass:g} kg: it must not be negative"


def lacks(inertial: Any) -> str | None:
    """Return an element or attribute that an <inertial> lacks; None if it is complete."""
    for tag, words in (("mass", ("value",)), ("inertia", MOMENTS)):
        element = inertial.find(tag)
        missing = [tag] if element is None else [f"{word} of <{tag}>" for word in words if element.get(word) is None]
        if missing:
            return missing[0]
    return None


def inertia(link: Any, name: str) -> Inertia | None:
    """Return the inertia of a link in its own axes: that of the first complete <inertial>; None without one."""
    for inertial in link.iterchildren("inertial"):
        if lacks(inertial) is None:
            xx, xy, xz, yy, yz, zz = (number(inertial.find("inertia").get(word)) for word in MOMENTS)
            placed, matrix = origin(inertial, name), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            return Inertia(number(inertial.find("mass").get("value")), np.zeros(3), matrix).in_frame(placed)
    return None


MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def label(joint: Any) -> str:
    """Return a joint as errors name it."""
    return f"joint '{joint.get('name', '')}'"
