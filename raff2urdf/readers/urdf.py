"""A URDF's text, checked: what is wrong is told by its line."""

from __future__ import annotations

import math
from typing import Any

from lxml import etree

from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.readers.xml_file import parse_xml

UNLIMITED = 1e9
"""What a URDF says where there is no limit and it wants one (rad/s, m/s, N, N m; m for a slide's travel)."""

LARGEST = 1e13
"""No number may be greater (m, rad): its square must leave room for the rest. RAFF's own are a tenth of it at most."""

SIZE = f" (none beyond {LARGEST:g})"

IGNORE = "--ignore-loops (in Python ignore_loops=True)"
"""The option that leaves all loops open."""

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical")
"""Types of a joint. `spherical` is none of URDF's own, but some write it."""


def parse(text: str, name: str) -> Any:
    """The root element of a URDF: a tree whose joints, axes and limits make sense.

    Args:
        text: of the file.
        name: what errors call it.

    Raises:
        RaffError: no URDF; links and joints that are no tree; a joint whose axis is 0, whose origin or limits are no
            numbers, or whose limits contradict each other.
    """
    tree = parse_xml(text, name)
    if tree.tag != "robot":
        raise RaffError(f"{name}:{tree.sourceline}: this is no URDF: its first element is <{tree.tag}>, not <robot>")
    try:
        _check(tree, name)
    except RaffError as error:
        raise RaffError(f"{error}{unmade(tree, name)}") from None
    return tree


def _check(tree: Any, name: str) -> None:
    for joint in tree.iterchildren("joint"):
        if joint.find("parent") is None:
            raise RaffError(f"{name}:{joint.sourceline}: joint '{joint.get('name', '')}' has no <parent>")
    for joint in joints(tree):
        _check_axis(joint, name)
        _check_limit(joint, name)
        origin(joint, name)
        if joint.get("type") not in KINDS:
            what = f"the type '{joint.get('type')}' of joint '{joint.get('name', '')}' is none of URDF's"
            raise RaffError(f"{name}:{joint.sourceline}: {what}{did_you_mean(str(joint.get('type')), KINDS)}")
    _check_tree(tree, name)


def unmade(tree: Any, name: str) -> str:
    """What to say of a file that is wrong, if it is xacro: no URDF yet."""
    for element in tree.iter("*"):
        prefix = element.prefix or str(element.tag).partition(":")[0]
        if prefix == "xacro" or any("$(" in value or "${" in value for value in element.attrib.values()):
            return f". It holds xacro's words (line {element.sourceline}): load what `xacro {name}` makes of it"
    return ""


def joints(tree: Any) -> list[Any]:
    """The joints of a URDF, in file order (not those that some other element speaks of)."""
    return [joint for joint in tree.iterchildren("joint") if joint.find("parent") is not None]


def links(tree: Any) -> list[Any]:
    """The links of a URDF, in file order."""
    return list(tree.iterchildren("link"))


def root_first(tree: Any) -> list[str]:
    """Names of the links of a URDF: the one that stands on nothing, then the others in file order."""
    held = {ends(joint)[1] for joint in joints(tree)}
    return sorted((str(link.get("name")) for link in links(tree)), key=held.__contains__)


def several(found: list[Any], name: str) -> str:
    """Where the first of some joints stands, its name, and how many more there are."""
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    return f"{name}:{found[0].sourceline}: joint '{found[0].get('name', '')}'{more}"


def remove(element: Any) -> None:
    """Takes an element out, and leaves as many lines behind as it had: errors tell of lines."""
    lines = etree.tostring(element, encoding="unicode", with_tail=False).count("\n")
    blank = etree.Comment("\n" * lines)
    blank.tail = element.tail
    element.getparent().replace(element, blank)


def ends(joint: Any) -> tuple[str, str]:
    """Names of the links that a joint joins: parent and child."""
    child = joint.find("child")
    return str(joint.find("parent").get("link", "")), str("" if child is None else child.get("link", ""))


def origin(element: Any, name: str) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """xyz (m) and rpy (rad) of an element's <origin>; zeros where it has none.

    Raises:
        RaffError: they are no numbers.
    """
    found = element.find("origin")
    if found is None:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    return three(found, "xyz", name), three(found, "rpy", name)


def three(element: Any, word: str, name: str, default: str = "0 0 0") -> tuple[float, float, float]:
    """An attribute of three finite numbers.

    Raises:
        RaffError: it is none.
    """
    text = element.get(word, default)
    found = numbers(text)
    if found is None or len(found) != 3:
        shown = text if len(text) <= 60 else f"{text[:60]}..."
        raise RaffError(f'{name}:{element.sourceline}: {word}="{shown}" of <{element.tag}> must be three numbers{SIZE}')
    return found[0], found[1], found[2]


def numbers(text: str) -> list[float] | None:
    """The numbers of a text, parted by spaces; None if something else is in it, or a number beyond LARGEST."""
    found = [number(word) for word in text.split()]
    return found if all(abs(value) <= LARGEST for value in found) else None


def number(word: str) -> float:
    """A number as XML writes it, perhaps infinite; NaN where it is none."""
    try:
        return float(word) if word.isascii() and "_" not in word else math.nan
    except ValueError:
        return math.nan


def limits(joint: Any) -> tuple[float, float] | None:
    """Low and high (rad or m) of a revolute or prismatic joint; None where it has no limits.

    A joint whose `<limit>` gives neither `lower` nor `upper` has none: exporters leave them out, and a joint from 0 to
    0, as the format has it, would be none. Where one is given, the other is 0. Limits of `UNLIMITED` are none either,
    and where only one is so far away, it is that.
    """
    limit = joint.find("limit")
    if joint.get("type") not in ("revolute", "prismatic") or silent(joint):
        return None
    low, high = (min(max(number(limit.get(word, "0")), -UNLIMITED), UNLIMITED) for word in ("lower", "upper"))
    return None if low <= -UNLIMITED and high >= UNLIMITED else (low, high)


def middle(allowed: tuple[float, float] | None) -> float:
    """Where a joint stands if nothing says so: at 0, or between its limits (1 rad or m from one without another)."""
    low, high = allowed or (0.0, 0.0)
    if low <= 0.0 <= high:
        return 0.0
    return high - 1.0 if low <= -UNLIMITED else low + 1.0 if high >= UNLIMITED else (low + high) / 2.0


def velocity(joint: Any) -> float | None:
    """The greatest speed (rad/s or m/s) of a joint; None where it has none, or one of 0, as exporters write."""
    limit = joint.find("limit")
    fastest = 0.0 if limit is None else number(limit.get("velocity", "0"))
    return fastest if 1e-12 < fastest < UNLIMITED else None


def silent(joint: Any) -> bool:
    """Whether a joint that wants limits says nothing of them."""
    limit = joint.find("limit")
    says_nothing = limit is None or (limit.get("lower") is None and limit.get("upper") is None)
    return joint.get("type") in ("revolute", "prismatic") and says_nothing


def _check_axis(joint: Any, name: str) -> None:
    axis = joint.find("axis")
    if axis is None or joint.get("type") in ("fixed", "floating", "spherical"):
        return
    found = numbers(axis.get("xyz", "1 0 0"))
    if found is None or len(found) != 3 or math.hypot(*found) <= 1e-9:
        what = f"axis '{axis.get('xyz')}' of joint '{joint.get('name', '')}'"
        raise RaffError(f"{name}:{axis.sourceline}: the {what} must be three numbers, not all 0{SIZE}")


def _check_limit(joint: Any, name: str) -> None:
    limit = joint.find("limit")
    if limit is None:
        return
    where = f"{name}:{limit.sourceline}: joint '{joint.get('name', '')}'"
    values = {}
    for word in ("lower", "upper", "velocity", "effort"):
        if limit.get(word) is None:
            continue
        values[word] = number(limit.get(word))
        if math.isnan(values[word]):
            raise RaffError(f"{where}: its {word} limit '{limit.get(word)}' is no number")
    for word in ("velocity", "effort"):
        if values.get(word, 0.0) < 0.0:
            raise RaffError(f"{where}: its limit of {word} is {values[word]:g}, below 0")
    low, high = values.get("lower", 0.0), values.get("upper", 0.0)
    counts = joint.get("type") in ("revolute", "prismatic")
    if ("lower" in values or "upper" in values) and counts and low > high:
        raise RaffError(f"{where}: its lower limit of {low:g} is above its upper one of {high:g}")


def _check_tree(tree: Any, name: str) -> None:
    known: dict[str, Any] = {}
    for link in links(tree):
        _unique(link, known, name)
    if not known:
        raise RaffError(f"{name}:{tree.sourceline}: the robot '{tree.get('name', '')}' has no link")
    seen: dict[str, Any] = {}
    father: dict[str, Any] = {}
    for joint in joints(tree):
        _unique(joint, seen, name)
        said = f"{name}:{joint.sourceline}: joint '{joint.get('name')}'"
        for word, link in zip(("parent", "child"), ends(joint), strict=True):
            if link not in known:
                raise RaffError(f"{said} has the {word} '{link}', which is no link{did_you_mean(link, list(known))}")
        child = ends(joint)[1]
        if child in father:
            other = father[child]
            raise RaffError(
                f"{said} holds link '{child}', which joint '{other.get('name')}' on line {other.sourceline} holds "
                f"already: a URDF can't close loops. Let the joint end at a link of its own, and close the loop in a "
                f"file beside it (.constraints.json), or leave this joint out with {IGNORE}"
            )
        father[child] = joint
    roots = [link for link in known if link not in father]
    if not roots:
        raise RaffError(f"{name}:{tree.sourceline}: every link has a parent: links stand on each other in a ring")
    if len(roots) > 1:
        listed = ", ".join(f"'{root}' (line {known[root].sourceline})" for root in roots[:8])
        raise RaffError(f"{name}:{known[roots[1]].sourceline}: {len(roots)} links stand on nothing: {listed}")
    carried: dict[str, list[str]] = {}
    for child, joint in father.items():
        carried.setdefault(ends(joint)[0], []).append(child)
    reached = roots
    for link in reached:
        reached += carried.get(link, [])
    if len(reached) < len(known):
        stands = set(reached)
        start = next(link for link in known if link not in stands)
        raise RaffError(f"{name}:{father[start].sourceline}: link '{start}' stands on itself, through its parents")


def _unique(element: Any, seen: dict[str, Any], name: str) -> None:
    own = element.get("name", "")
    where = f"{name}:{element.sourceline}:"
    if not own:
        raise RaffError(f"{where} a {element.tag} without a name")
    if own in seen:
        raise RaffError(f"{where} a second {element.tag} '{own}': the first is on line {seen[own].sourceline}")
    seen[own] = element
