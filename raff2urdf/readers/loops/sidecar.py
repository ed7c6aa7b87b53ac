"""Read the constraints of a URDF: the file next to it, or the element in it, which raff2urdf writes. Find a file that
is not read, because of its name or a broken link."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection
from pathlib import Path
from typing import Any, NamedTuple

from raff2urdf.constraints import HASH, Constraints, load, loads
from raff2urdf.constraints_check import UrdfSummary
from raff2urdf.errors import RaffError, warn
from raff2urdf.escape import shell_word
from raff2urdf.readers.loops.successive import moving
from raff2urdf.readers.urdf import IGNORE, hash_of, root_first
from raff2urdf.readers.urdf_file import parse
from raff2urdf.readers.xml_file import own_element

ENDING = ".constraints.json"
_LARGEST = 4_000_000  # bytes of a file that is searched or read


class Misplaced(NamedTuple):
    """A file that is not read though it declares loops of a URDF.

    Attributes:
        file: its name.
        why: it is not read, and the remedy.
    """

    file: str
    why: str

    def refusal(self, urdf: Path) -> str:
        """Return the error for a URDF: place, cause and remedy."""
        return f"{urdf}: its loops would be lost: {self.file} {self.why}, or leave the loops open with {IGNORE}"


def constraints_of(urdf: Path) -> Path:
    """Return the path of a URDF's constraints file, which need not exist."""
    return plain(urdf).with_suffix(ENDING)


def plain(urdf: Path) -> Path:
    """Return the path of a URDF without the ending of xacro."""
    return urdf.with_suffix("") if urdf.suffix.lower() == ".xacro" else urdf


def loops_of(urdf: Path, text: str) -> tuple[str, Constraints] | None:
    """Return the text of a URDF and the contents of its constraints file; None if it has none.

    Raises:
        RaffError: the file is wrong, or contradicts the URDF.
    """
    file = constraints_of(urdf)
    if not file.exists():
        return None
    if not file.is_file():
        raise RaffError(f"{file}: is not a file: remove it, or leave it out with --ignore {shell_word(file.name)}")
    if file.stat().st_size > _LARGEST:
        raise RaffError(f"{file}: is not read: it is larger than {_LARGEST / 1e6:.0f} MB")
    return text, load(file, _summary(urdf, text))


def embedded(urdf: Path, text: str) -> Constraints | None:
    """Return the constraints in the element `raff:robot` of a URDF, which are JSON; None if it has none.

    Raises:
        RaffError: they are wrong, or contradict the URDF or its constraints file.
    """
    element = own_element(parse(text, str(urdf)), str(urdf))
    if element is None:
        return None
    name = f"{urdf}:{element.sourceline}: raff:robot"
    values = loads(element.text or "", name, _summary(urdf, text))
    file = loops_of(urdf, text)
    if file is not None and file[1] != values:
        other = constraints_of(urdf).name
        raise RaffError(f"{name} differs from {other}: remove one of them, or write both again with raff2urdf")
    return values


def _summary(urdf: Path, text: str) -> UrdfSummary:
    return UrdfSummary(root_first(parse(text, str(urdf))), moving(text, str(urdf)))


def check_hash(values: Constraints, holder: str, urdf: Path, root: Any) -> None:
    """Warn if constraints do not name their URDF by its hash, or name another one.

    Args:
        values: the constraints.
        holder: of them: a file's name, or the element.
        urdf: path of the URDF.
        root: its root element.
    """
    digest = hash_of(root, str(urdf))
    entry = f'"{HASH}": "{digest}"'
    if HASH not in values:
        what = f"{holder} does not name its URDF, so that a change of either is not noticed: add {entry}"
    elif values[HASH] != digest:
        what = (
            f"the links or joints (names, types, origins or axes) are not those for which {holder} was written: its "
            f"loops and home may not fit. Restore the URDF, or write both again; or, if it was meant, put {entry} there"
        )
    else:
        return
    warn(f"{urdf}: {what}")


def misplaced(urdf: Path, text: str) -> Misplaced | None:
    """Return the file in the folder of a URDF that should be its sidecar file but is not; None without any.

    Args:
        urdf: its path; it has no sidecar file.
        text: of the URDF.
    """
    urdf = plain(urdf)
    file, tree = constraints_of(urdf), parse(text, str(urdf))
    robot, names, joints = tree.get("name", ""), root_first(tree), moving(text, str(urdf))
    try:
        listing = sorted(os.listdir(urdf.parent))
    except OSError:
        return None
    for name in listing:
        path, lower, why = urdf.with_name(name), name.lower(), ""
        if lower == file.name.lower():
            why = _broken(path) or (f"differs only in case: rename it to {file.name}" if name != file.name else "")
        elif lower in (f"{urdf.stem}.yaml".lower(), f"{urdf.stem}.yml".lower(), "robot.yaml", "robot.yml"):
            why = _broken(path)
            if not why and b"closed_loop" in content_of(path):
                stem = "robot" if lower.startswith("robot.") else urdf.stem
                why = f"is not read under this name: rename it to {stem}.yaml"
        elif _is_candidate(name, urdf, listing) and _fits(path, robot, names, joints):
            why = f"fits this URDF and no other one here: rename it to {file.name}"
        elif lower.endswith(".json") and _written_for(path, hash_of(tree, str(urdf))):
            why = f"was written for the same links and joints: copy it to {file.name}"
        if why:
            return Misplaced(name, why)
    return None


def _broken(path: Path) -> str:
    if path.exists() or not path.is_symlink():
        return ""
    return f"is a link to {os.readlink(path)}, which does not exist: restore that file"


def _is_candidate(name: str, urdf: Path, listing: Collection[str]) -> bool:
    """Return whether a file may be constraints, by its name, and belongs to no other URDF in the folder."""
    lower = name.lower()
    if not lower.endswith(".json") or not (re.search("constraint|loop", lower) or lower == f"{urdf.stem}.json".lower()):
        return False
    stem = lower.removesuffix(ENDING)
    others = {other.lower() for other in listing} - {urdf.name.lower()}
    return f"{stem}.urdf" not in others and f"{stem}.xml" not in others


def _fits(path: Path, robot: str, links: Collection[str], joints: Collection[str]) -> bool:
    """Return whether a file holds constraints that a URDF can have: its joints, and loops between its links."""
    try:
        values = json.loads(content_of(path))
        listed = {joint["name"] for joint in values["joints"]}
        ends = {loop[end]["node"] for loop in values["loops"] for end in ("first", "second")}
        same = listed == set(joints) or values["robot"] == robot
        return bool(ends and same and listed <= set(joints) and ends <= set(links))
    except (ValueError, KeyError, TypeError, RecursionError):
        return False


def _written_for(path: Path, urdf_sha256: str) -> bool:
    """Return whether a file holds constraints with loops or couplings for a URDF with this hash."""
    content = content_of(path)
    if urdf_sha256.encode() not in content:
        return False
    try:
        values = json.loads(content)
        return values[HASH] == urdf_sha256 and bool(values["loops"] or values.get("couplings"))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return False


def content_of(path: Path) -> bytes:
    """Return the bytes of a file; none where it can't be read or is too large to be a sidecar."""
    try:
        return path.read_bytes() if path.is_file() and path.stat().st_size <= _LARGEST else b""
    except OSError:
        return b""
