"""A URDF's text, checked and made ready for Pinocchio: what is wrong is told by its line."""

from __future__ import annotations

import math
import warnings
from typing import Any

from lxml import etree

from cinegen.errors import CinegenWarning, LoadError

_NUMBER_EACH = ("revolute", "prismatic")  # joints whose limits count


def parsed(urdf: str, name: str) -> Any:
    """The root of a URDF, joints and their limits checked.

    Args:
        urdf: its text. Entities that it defines are not read.
        name: what errors call it.

    Raises:
        LoadError: no URDF; a joint whose axis is 0, or whose limits are no numbers or contradict each other.
    """
    parser = etree.XMLParser(encoding="utf-8", resolve_entities=False, no_network=True, load_dtd=False)
    try:
        tree = etree.fromstring(urdf.encode(), parser)
    except etree.XMLSyntaxError as error:
        raise LoadError(f"{name}:{error.lineno or 1}: no XML: {error.msg}") from None
    if tree.tag != "robot":
        raise LoadError(f"{name}:{tree.sourceline}: this is no URDF: its first element is <{tree.tag}>, not <robot>")
    subset = tree.getroottree().docinfo.internalDTD
    for entity in subset.iterentities() if subset is not None else ():
        raise LoadError(f"{name}:1: it defines the entity '{entity.name}': entities are not read")
    for joint in tree.iter("joint"):
        if joint.find("parent") is not None:  # else it is a joint that some other element speaks of
            _check_axis(joint, name)
            _check_limit(joint, name)
    return tree


def free(tree: Any, name: str) -> set[str]:
    """Makes all joints without limits revolute or prismatic with some, so that each is one number (Pinocchio takes the
    cosine and the sine of continuous ones); returns their names.

    A joint whose `<limit>` gives neither `lower` nor `upper` has none: exporters leave them out, and a joint from 0 to
    0, as the format has it, would be none. One warning tells of all these.
    """
    names, silent = set(), []
    for joint in tree.iter("joint"):
        kind, limit = joint.get("type"), joint.find("limit")
        says_nothing = limit is None or (limit.get("lower") is None and limit.get("upper") is None)
        if kind in _NUMBER_EACH and says_nothing and joint.find("parent") is not None:
            silent.append(joint)
        elif kind != "continuous":
            continue
        if kind == "continuous":
            joint.set("type", "revolute")
        if limit is None:
            limit = etree.SubElement(joint, "limit", effort="0", velocity="0")
        limit.set("lower", "-1")
        limit.set("upper", "1")
        names.add(joint.get("name", ""))
    if silent:
        first = f"{name}:{silent[0].sourceline}: joint '{silent[0].get('name', '')}'"
        others = f" and {len(silent) - 1} more" if len(silent) > 1 else ""
        warnings.warn(
            f"{first}{others}: no lower and upper limit are given; taken as unlimited", CinegenWarning, stacklevel=2
        )
    return names


def _check_axis(joint: Any, name: str) -> None:
    axis = joint.find("axis")
    if axis is None or joint.get("type") in ("fixed", "floating"):
        return
    try:
        numbers = [float(word) for word in axis.get("xyz", "1 0 0").split()]
        good = len(numbers) == 3 and all(map(math.isfinite, numbers)) and math.hypot(*numbers) > 1e-9
    except ValueError:
        good = False
    if not good:
        what = f"axis '{axis.get('xyz')}' of joint '{joint.get('name', '')}'"
        raise LoadError(f"{name}:{axis.sourceline}: the {what} must be three numbers, not all 0")


def _check_limit(joint: Any, name: str) -> None:
    limit = joint.find("limit")
    if limit is None:
        return
    where = f"{name}:{limit.sourceline}: joint '{joint.get('name', '')}'"
    values = {}
    for word in ("lower", "upper", "velocity"):
        if limit.get(word) is None:
            continue
        try:
            values[word] = float(limit.get(word))
        except ValueError:
            values[word] = math.nan
        if math.isnan(values[word]):
            raise LoadError(f"{where}: its {word} limit '{limit.get(word)}' is no number")
    if values.get("velocity", 0.0) < 0.0:
        raise LoadError(f"{where}: its limit of velocity is {values['velocity']:g}, below 0")
    ends = values.get("lower", 0.0), values.get("upper", 0.0)
    if ("lower" in values or "upper" in values) and joint.get("type") in _NUMBER_EACH and ends[0] > ends[1]:
        raise LoadError(f"{where}: its lower limit of {ends[0]:g} is above its upper one of {ends[1]:g}")
