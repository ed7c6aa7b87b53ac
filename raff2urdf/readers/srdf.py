"""Read the pairs of links that an SRDF disables, and its home: the semantic description of a robot that MoveIt and
Pinocchio use."""

from __future__ import annotations

from collections.abc import Collection
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

from raff2urdf.errors import RaffError, did_you_mean, first_of
from raff2urdf.files import STANDARD, note
from raff2urdf.readers import xacro_file
from raff2urdf.readers.loops.sidecar import plain
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.urdf import SIZE, numbers
from raff2urdf.readers.xml_file import error_at, parse_xml, read_text

ENDING = ".srdf"

_MOST = 10  # unknown links that an error names
_HOMES = ("home", "ready", "default", "neutral", "standing", "half_sitting")  # names of states, the preferred one first


class Srdf(TypedDict):
    """The part of an SRDF that is read, as JSON values.

    Keys:
        file: name of the file.
        disabled: two links each, and the reason as written: "Adjacent", "Always", "Default", "Never", "User", or empty.
    """

    file: str
    disabled: list[tuple[str, str, str]]


class GroupState(NamedTuple):
    """A configuration that an SRDF names.

    Attributes:
        label: its name, groups and file as text.
        values: of joints by name, rad or m.
        poses: joints of several numbers, as of a floating base, which are not read.
    """

    label: str
    values: dict[str, float]
    poses: list[str]


def srdf_of(urdf: Path) -> Path | None:
    """Return the SRDF next to a URDF, `<stem>.srdf`; None if there is none."""
    path = plain(urdf).with_suffix(ENDING)
    note(path)
    return path if urdf != STANDARD and path.is_file() else None


def read_srdf(path: Path, links: Collection[str], robot: str, options: ReadOptions | None = None) -> Srdf:
    """Read which pairs of links an SRDF disables.

    As in MoveIt: `disable_default_collisions` disables all pairs of a link, `enable_collisions` one pair of these less;
    `disable_collisions` is stronger than both.

    Args:
        path: of the file; it may be xacro.
        links: of the robot.
        robot: its name, for errors.
        options: of how its own file is read.

    Raises:
        RaffError: the file can't be read, is no SRDF, or names links that the robot does not have.
    """
    root = _root_of(path, options)
    unknown: dict[str, int] = {}

    def name(element: Any, key: str) -> str:
        link = element.get(key)
        if not link:
            raise error_at(str(path), element, f"<{element.tag}> has no {key}: name a link of the robot")
        if link not in links:
            unknown.setdefault(link, element.sourceline)
        return str(link)

    def pairs(tag: str) -> dict[frozenset[str], str]:
        reasons = {}
        for element in root.iter(tag):
            pair = frozenset((name(element, "link1"), name(element, "link2")))
            if len(pair) == 1:
                raise error_at(str(path), element, f"<{tag}> names '{min(pair)}' twice: name two links")
            reasons[pair] = str(element.get("reason", ""))
        return reasons

    without = {name(element, "link") for element in root.iter("disable_default_collisions")}
    disabled = {frozenset(pair): "disable_default_collisions" for pair in combinations(links, 2) if without & {*pair}}
    for pair in pairs("enable_collisions"):
        disabled.pop(pair, None)
    disabled |= pairs("disable_collisions")
    if unknown:
        listed = first_of([f"'{link}' (line {line})" for link, line in unknown.items()], _MOST)
        near = did_you_mean(next(iter(unknown)), list(links)) if len(unknown) == 1 else ""
        what = "is not a link" if len(unknown) == 1 else "are not links"
        advice = "name the SRDF of this robot, or correct the names"
        raise RaffError(f"{path}: {listed} {what} of {robot}{near}: {advice}")
    return Srdf(file=path.name, disabled=[(min(pair), max(pair), reason) for pair, reason in disabled.items()])


def read_home(path: Path, options: ReadOptions | None = None) -> GroupState | None:
    """Read the group states of an SRDF that are called home, or else ready, default, neutral, standing or half_sitting.

    Several groups may have a state of that name. Of two that name the same joint, that with more joints holds.

    Returns:
        all of them together; None if there is none.

    Raises:
        RaffError: the file can't be read, is no SRDF, or a value is not a number.
    """
    root = _root_of(path, options)
    states = [(str(state.get("name", "")).lower(), state) for state in root.iterchildren("group_state")]
    chosen = next((word for word in _HOMES if any(word == name for name, _ in states)), None)
    if chosen is None:
        return None
    homes = [state for name, state in states if name == chosen]
    values, poses = dict[str, float](), list[str]()
    for state in sorted(homes, key=len):  # a stable order: the last one holds
        for joint in state.iterchildren("joint"):
            name, written = joint.get("name", ""), joint.get("value", "")
            position = numbers(written)
            if not position:
                what = f"value='{written[:60]}' of joint '{name}' in the group state '{chosen}'"
                raise error_at(str(path), joint, f"{what} must be numbers{SIZE}")
            if len(position) == 1:
                values[name] = position[0]
            else:
                poses += [name] if name not in poses else []
    groups = ", ".join(str(state.get("group")) for state in homes if state.get("group"))
    label = f"the group state '{chosen}'{f' of {groups}' if groups else ''} in {path.name}"
    return GroupState(label, values, poses)


def _root_of(path: Path, options: ReadOptions | None) -> Any:
    """Return the root element of an SRDF, which may be xacro.

    Raises:
        RaffError: it can't be read, or is no SRDF.
    """
    root = parse_xml(read_text(path), str(path))
    if xacro_file.is_xacro(path, root):
        root = parse_xml(xacro_file.expanded(path, options or ReadOptions()).text, str(path))
    if root.tag != "robot":
        raise error_at(str(path), root, f"its first element is <{root.tag}>: an SRDF begins with <robot>")
    declares = next(root.iter("disable_collisions", "group_state"), None) is not None
    if next(root.iter("link", "joint"), None) is not None and not declares:
        raise error_at(str(path), root, "this is a URDF, not an SRDF: it has links, or joints, of its own")
    return root
