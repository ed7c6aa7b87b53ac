"""Read the pairs of links that an SRDF disables: the semantic description of a robot that MoveIt and Pinocchio use."""

from __future__ import annotations

from collections.abc import Collection
from itertools import combinations
from pathlib import Path
from typing import Any, TypedDict

from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.files import STANDARD, note
from raff2urdf.readers import xacro_file
from raff2urdf.readers.sidecar import plain
from raff2urdf.readers.xml_file import error_at, parse_xml, read_text

ENDING = ".srdf"

_MOST = 10  # unknown links that an error names


class Srdf(TypedDict):
    """The part of an SRDF that is read, as JSON values.

    Keys:
        file: name of the file.
        disabled: two links each, and the reason as written: "Adjacent", "Always", "Default", "Never", "User", or empty.
    """

    file: str
    disabled: list[tuple[str, str, str]]


def srdf_of(urdf: Path) -> Path | None:
    """Return the SRDF next to a URDF, `<stem>.srdf`; None if there is none."""
    path = plain(urdf).with_suffix(ENDING)
    note(path)
    return path if urdf != STANDARD and path.is_file() else None


def read_srdf(path: Path, links: Collection[str], robot: str) -> Srdf:
    """Read which pairs of links an SRDF disables.

    As in MoveIt: `disable_default_collisions` disables all pairs of a link, `enable_collisions` one pair of these less;
    `disable_collisions` is stronger than both. Everything else of an SRDF, such as groups, is not read.

    Args:
        path: of the file; it may be xacro.
        links: of the robot.
        robot: its name, for errors.

    Raises:
        RaffError: the file can't be read, is no SRDF, or names links that the robot does not have.
    """
    text = read_text(path)
    root = parse_xml(text, str(path))
    if xacro_file.is_xacro(path, root):
        root = parse_xml(xacro_file.expanded(path), str(path))
    if root.tag != "robot":
        raise error_at(str(path), root, f"its first element is <{root.tag}>: an SRDF begins with <robot>")
    if next(root.iterchildren("link", "joint"), None) is not None:  # those of groups and group states are inside these
        raise error_at(str(path), root, "this is a URDF, not an SRDF: it has links, or joints, of its own")
    unknown: dict[str, int] = {}

    def name(element: Any, key: str) -> str:
        found = element.get(key)
        if not found:
            raise error_at(str(path), element, f"<{element.tag}> has no {key}: name a link of the robot")
        if found not in links:
            unknown.setdefault(found, element.sourceline)
        return str(found)

    def pairs(tag: str) -> dict[frozenset[str], str]:
        found = {}
        for element in root.iter(tag):
            pair = frozenset((name(element, "link1"), name(element, "link2")))
            if len(pair) == 1:
                raise error_at(str(path), element, f"<{tag}> names '{min(pair)}' twice: name two links")
            found[pair] = str(element.get("reason", ""))
        return found

    without = {name(element, "link") for element in root.iter("disable_default_collisions")}
    disabled = {frozenset(pair): "disable_default_collisions" for pair in combinations(links, 2) if without & {*pair}}
    for pair in pairs("enable_collisions"):
        disabled.pop(pair, None)
    disabled |= pairs("disable_collisions")
    if unknown:
        listed = [f"'{one}' (line {line})" for one, line in list(unknown.items())[:_MOST]]
        more = f" and {len(unknown) - _MOST} more" if len(unknown) > _MOST else ""
        near = did_you_mean(next(iter(unknown)), list(links)) if len(unknown) == 1 else ""
        what = "is not a link" if len(unknown) == 1 else "are not links"
        advice = "name the SRDF of this robot, or correct the names"
        raise RaffError(f"{path}: {', '.join(listed)}{more} {what} of {robot}{near}: {advice}")
    return Srdf(file=path.name, disabled=[(min(pair), max(pair), reason) for pair, reason in disabled.items()])
