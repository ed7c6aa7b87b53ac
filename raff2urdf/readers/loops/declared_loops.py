"""Find loops and couplings in a URDF that can't be read, so that none is lost in silence.

These are elements whose names contain loop, constraint, coupling and the like, and that no dialect reads; joints and
plugins of simulators between links that are connected already; and the comment by raff2urdf that names the file with
the loops, where that file is missing.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

from lxml import etree

from raff2urdf.escape import one_line, shell_word, xml_comment
from raff2urdf.readers.loops.closing_joints import Connections, joined_links
from raff2urdf.readers.loops.declaration import Declaration, label_of, listed, local, tag_of
from raff2urdf.readers.loops.sidecar import constraints_of
from raff2urdf.readers.urdf import IGNORE, joints, links

NOTE = "raff2urdf constraints:"
"""Beginning of the comment in a URDF that names the file with its loops."""

COMMENT = "comment"
"""The dialect of comments that raff2urdf writes."""

LOOP_LIKE = re.compile(
    r"loop|constrain|coupl|bushing|equalit|cut_?joint|(?<!en)(?<!dis)clos(?:ed|ing|ure)|mimic|tendon|weld|pulley"
    r"|belt|gear(?!.?(?:ratio|reduction))"
)
"""Names of elements that declare a loop or a coupling, in lower case."""

_COUPLING = re.compile(r"coupl|tendon|gear|mimic|pulley|belt")
_SIMULATORS = ("gazebo", "plugin", "ros2_control", "sensor", "transmission")


def find(root: Any, read: Collection[int]) -> list[Declaration]:
    """Return the declarations in a URDF that can't be read.

    Args:
        root: the root element; its joints form a tree.
        read: `id` of the elements that a dialect reads.
    """
    moving = [joint for joint in joints(root) if joint.get("type") != "fixed"]
    names = {str(element.get("name")) for element in (*links(root), *moving)}
    return [*_notes(root), *_elements(root, names, Connections(root), read)]


def lost(unread: Sequence[Declaration], spare: int, closed: int) -> list[Declaration]:
    """Return the declarations that are lost.

    A loop that can't be read may be closed by a file next to the URDF, and may be declared in several dialects at once:
    the file must close as many as the dialect with the most declares.

    Args:
        unread: declarations that can't be read.
        spare: number of loops in files next to the URDF that no element declares.
        closed: number of loops and couplings that are read.
    """
    elements = [d for d in unread if d.dialect != COMMENT]
    most = max(Counter(d.dialect for d in elements if d.certain and not d.coupling).values(), default=0)
    notes = [d for d in unread if d.dialect == COMMENT and int(d.also[0]) > closed]
    return notes + [d for d in elements if d.coupling or spare == 0 or spare < most]


def refusal(lost: Sequence[Declaration], urdf: Path, is_file: bool) -> str:
    """Return the error for declarations that are lost: place, cause and remedy.

    Args:
        lost: at least one.
        urdf: path of the URDF.
        is_file: whether files may be next to it.
    """
    sidecar = constraints_of(urdf).name
    more = f". Also not read: {listed(lost[1:], 3)}" if len(lost) > 1 else ""
    word = lost[0].words[0]
    ignore = f"--ignore {shell_word(word)} (in Python ignore=[{json.dumps(word)}])"
    leave = f"or leave it out with {ignore}, or all loops with {IGNORE}"
    what = "couplings" if all(d.coupling for d in lost) else "loops"
    remedy = f"Declare the {what} in {sidecar} next to the URDF, {leave}"
    if lost[0].dialect == COMMENT:
        leave = f"or leave the loops open with {IGNORE}"
        remedy = f"Restore that file next to the URDF as {sidecar}, {leave}"
    if not is_file:
        remedy = f"Load the URDF from a file with such a file, NAME.constraints.json, next to it, {leave}"
    return f"{urdf}:{lost[0].line}: {lost[0].text}{more}. {remedy}"


def note(file: str, loops: int, couplings: int = 0) -> Any:
    """Return the comment that names the file with a URDF's loops and couplings."""
    words = [("loop", loops)] * (loops > 0 or couplings == 0) + [("coupling", couplings)] * (couplings > 0)
    counts = [f"{count} {word}{'s' * (count != 1)}" for word, count in words]
    return etree.Comment(xml_comment(f" {NOTE} {one_line(file)} ({' and '.join(counts)}) "))


def _notes(root: Any) -> Iterator[Declaration]:
    for comment in (*root.itersiblings(etree.Comment, preceding=True), *root.iterchildren(etree.Comment)):
        head, _, file = str(comment.text).strip().partition(NOTE)
        if not head and file:
            where, _, counts = file.strip().removesuffix(")").rpartition(" (")
            numbers = [int(word) for word in counts.split() if word.isdecimal()]
            if not where or not numbers:
                where, numbers = file.strip(), [1]
            text = f"according to this comment, the loops are in {where}, but they were not read"
            yield Declaration(
                comment.sourceline, COMMENT, f"the loops in {where}", text, where, also=(str(sum(numbers)),)
            )


def _elements(
    parent: Any, names: Collection[str], connected: Connections, read: Collection[int], simulator: str = ""
) -> Iterator[Declaration]:
    """Yield the declarations in the elements below `parent`; `simulator` is the simulator's element around it."""
    for element in parent.iterchildren("*"):
        word = local(element)
        in_tree = element.tag == "joint" and parent.tag == "robot"
        joined = None if in_tree else joined_links(element)
        closes = joined is not None and connected.join(*joined)
        if id(element) in read or (word == "mimic" and parent.get("type") == "fixed"):
            continue
        if LOOP_LIKE.search(word) and (not simulator or len(named_in(element, names)) > 1):
            yield _declaration(element, named_in(element, names), simulator, bool(_COUPLING.search(word)))
        elif joined is not None and closes:
            yield _declaration(element, joined, simulator, False, element.find("body1") is None)
        elif word == "plugin" and LOOP_LIKE.search(own_words(element)) and len(named_in(element, names)) > 1:
            yield _declaration(element, named_in(element, names), simulator, False)
        else:
            within = simulator or (word if word in _SIMULATORS else "")
            yield from _elements(element, names, connected, read, within)


def _declaration(
    element: Any, named: Sequence[str], simulator: str, coupling: bool, certain: bool = True
) -> Declaration:
    label, tag = label_of(element, simulator), tag_of(element)
    between = f" ({', '.join(map(repr, named[:4]))})" if named else ""
    text = f"{label}{between} declares {'a coupling' if coupling else 'a loop'}, which can't be read"
    name = element.get("name", "")
    return Declaration(element.sourceline, tag, label, text, name, coupling=coupling, certain=certain, element=element)


def own_words(element: Any) -> str:
    """Return the name and the file of a plugin, in lower case."""
    return f"{element.get('name', '')} {element.get('filename', '')}".lower()


def named_in(element: Any, names: Collection[str]) -> list[str]:
    """Return the links and joints that an element names, in its attributes or texts."""
    words: dict[str, None] = {}
    for inner in element.iter("*"):
        values = [value for key, value in inner.attrib.items() if inner is not element or key != "name"]
        for word in (*values, inner.text or ""):
            words[word.strip().rpartition("::")[2]] = None
    return [word for word in words if word in names]
