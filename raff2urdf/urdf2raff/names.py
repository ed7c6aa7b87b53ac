"""Names and numbers of nodes and joints in a RAFF file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from raff2urdf.raff.check import RESERVED, is_xml_name


def numbers(numbered: Sequence[Any]) -> dict[str, int]:
    """Return the numbers of joints by name: those of `joint5` if all have such names, else in file order, moving ones
    first. The joint that only places raff2urdf's own base is not numbered."""
    matches = [re.fullmatch("joint([1-9][0-9]{0,8})", joint.get("name")) for joint in numbered]
    if all(matches):
        return {match[0]: int(match[1]) for match in matches if match}
    moving_first = sorted(numbered, key=lambda joint: joint.get("type") == "fixed")
    return {joint.get("name"): number for number, joint in enumerate(moving_first, 1)}


class Names:
    """Names of nodes: the URDF's if RAFF has a notation for them and they are free."""

    def __init__(self, links: Iterable[str]) -> None:
        self.links = frozenset(links)
        self.reserved = {xml_name(link) for link in self.links}
        self.taken = set(RESERVED)

    def new(self, wanted: str | None, otherwise: str, default: str) -> str | None:
        """Return a name for a node; None if the node's default name will do.

        Args:
            wanted: name of the link that the node is; None if it is none.
            otherwise: name of a node that is no link, if its default name is that of some link.
            default: the node's name if none is given.
        """
        if wanted is None and default not in self.reserved | self.taken:
            self.taken.add(default)
            return None
        name = stem = xml_name(otherwise if wanted is None else wanted)
        count = 1
        while name in self.taken or (count > 1 and name in self.reserved):
            count += 1
            name = f"{stem}_{count}"
        self.taken.add(name)
        return None if name == default else name


def xml_name(name: str) -> str:
    """Return a name that RAFF accepts: characters that no XML name may contain become '_'."""
    if is_xml_name(name):
        return name
    name = re.sub(r"[^\w.\-]", "_", name)
    return name if is_xml_name(name) else f"_{name}"
