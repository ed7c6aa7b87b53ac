"""Find the loops and couplings that a URDF declares outside its tree of joints.

URDF has no element for a loop. These dialects exist:

    <loop>, <coupling>               URDF+
    <constraint>                     a proposal to ROS, written by `raff2urdf --constraint-elements`
    <loop_joint>                     Isaac Sim
    <drake:ball_constraint>, ...     Drake: constraints and bushings
    <joint> in <gazebo>              Gazebo: a joint of SDF, or a plugin with a <parent> and a <child>
    closing_NAME_1, closing_NAME_2   onshape-to-robot and placo: two frames that coincide
    a link with two parents          the second joint closes a loop

None of them is read: loops come from a sidecar file, which a comment by raff2urdf names.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lxml import etree

from raff2urdf.readers.sidecar import ENDING
from raff2urdf.readers.urdf import IGNORE, ends, joints, links, remove
from raff2urdf.readers.xml_file import parse_xml

NOTE = "raff2urdf constraints:"
"""Beginning of the comment in a URDF that names the file with its loops."""

COMMENT = "comment"
"""The dialect of comments that raff2urdf writes."""

_LOOP_LIKE = re.compile(r"loop|constrain|coupl|bushing|equalit|cut_?joint|(?<!en)(?<!dis)clos(?:ed|ing|ure)")
_COUPLING = re.compile(r"coupl|tendon|gear")
_CLOSING = re.compile(r"(?:.*[^a-z0-9])?closing_.+_([12])")
_SIMULATORS = ("gazebo", "plugin", "ros2_control", "sensor", "transmission")
_ENDS = (("parent", "child"), ("body1", "body2"))


@dataclass(frozen=True, slots=True)
class Declaration:
    """A loop or a coupling that a URDF declares.

    Attributes:
        line: of the URDF.
        dialect: the kind of element.
        label: the element, in a few words.
        text: the element and what it declares.
        coupling: whether it couples joints, which no sidecar file can declare.
        certain: whether it certainly removes degrees of freedom.
    """

    line: int
    dialect: str
    label: str
    text: str
    coupling: bool = False
    certain: bool = True


def find(tree: Any) -> list[Declaration]:
    """Return all declarations in a URDF, by line.

    Args:
        tree: the root element; its joints form a tree.
    """
    names = {str(element.get("name")) for element in (*links(tree), *joints(tree))}
    found = [*_notes(tree), *_closing_frames(tree), *_elements(tree, names, _Connections(tree))]
    return sorted(found, key=lambda declaration: declaration.line)


def unread(declarations: Sequence[Declaration], loops: int) -> list[Declaration]:
    """Return the declarations that are lost if a sidecar file closes a number of loops.

    A loop may be declared in several dialects at once: the file must close as many as the dialect with the most.
    """
    closing = [declaration for declaration in declarations if not declaration.coupling]
    most = max(Counter(one.dialect for one in closing if one.certain).values(), default=0)
    if loops:
        declarations = [one for one in declarations if one.dialect != COMMENT]
    return [one for one in declarations if one.coupling or loops < most or loops == 0]


def refusal(lost: Sequence[Declaration], urdf: Path, loops: int) -> str:
    """Return the error for declarations that are lost: place, cause and remedy.

    Args:
        lost: at least one.
        urdf: path of the URDF.
        loops: how many a sidecar file closes.
    """
    sidecar = urdf.with_suffix(ENDING).name
    more = f". Also not read: {listed(lost[1:], 3)}" if len(lost) > 1 else ""
    remedy = f"Declare the loops in {sidecar} or robot.yaml next to the URDF, or leave them open"
    if loops:
        remedy = f"Declare all loops in the file next to the URDF, which has {loops}, or leave all of them open"
    if lost[0].dialect == COMMENT:
        remedy = f"Restore that file next to the URDF as {sidecar}, or leave the loops open"
    elif all(one.coupling for one in lost):
        remedy = "Couplings are not supported yet: let the joints move independently"
    return f"{urdf}:{lost[0].line}: {lost[0].text}{more}. {remedy} with {IGNORE}"


def listed(declarations: Sequence[Declaration], most: int = 20) -> str:
    """Return labels with their lines, the first few of them."""
    shown = ", ".join(f"{one.label} (line {one.line})" for one in declarations[:most])
    return shown + (f" and {len(declarations) - most} more" if len(declarations) > most else "")


def without_second_parents(text: str, name: str) -> tuple[str, list[Declaration]]:
    """Remove every joint whose child is the child of an earlier joint.

    Args:
        text: of the URDF.
        name: of the file, in errors.

    Returns:
        the text, unchanged if each link has one parent, and the joints that were removed.

    Raises:
        RaffError: invalid XML.
    """
    tree = parse_xml(text, name)
    children: set[str] = set()
    removed = []
    for joint in joints(tree):
        child = ends(joint)[1]
        if child in children:
            label = f"joint '{joint.get('name', '')}'"
            removed.append(Declaration(joint.sourceline, "second parent", label, f"{label} closes a loop"))
            remove(joint)
        children.add(child)
    if removed:
        before = "\n" * (tree.sourceline - 1)  # errors name lines
        text = before + etree.tostring(tree, encoding="unicode")
    return text, removed


def note(file: str, loops: int) -> Any:
    """Return the comment that names the file with a URDF's loops."""
    text = f" {NOTE} {file} ({loops} loop{'s' * (loops != 1)}) "
    while "--" in text:
        text = text.replace("--", "- -")
    return etree.Comment(text)


def _notes(tree: Any) -> Iterator[Declaration]:
    for comment in (*tree.itersiblings(etree.Comment, preceding=True), *tree.iterchildren(etree.Comment)):
        head, _, file = str(comment.text).strip().partition(NOTE)
        if not head and file:
            where = re.sub(r" [(][0-9]+ loops?[)]$", "", file.strip())
            text = f"according to this comment, the loops are in {where}, but none was read"
            yield Declaration(comment.sourceline, COMMENT, f"the loops in {where}", text)


def _closing_frames(tree: Any) -> Iterator[Declaration]:
    pairs: dict[str, dict[str, Any]] = {}
    for element in (*links(tree), *tree.iterchildren("frame")):
        name = str(element.get("name", ""))
        match = _CLOSING.fullmatch(name.lower())
        if match:
            pairs.setdefault(name.lower()[:-1], {})[match[1]] = element
    for pair in pairs.values():
        first, last = pair[min(pair)], pair[max(pair)]
        name = first.get("name")
        if first is not last:
            label = f"frames '{name}' and '{last.get('name')}'"
            text = f"the {label} (line {last.sourceline}) declare a loop, which is not read from a URDF"
            yield Declaration(first.sourceline, "closing frames", label, text)
        else:
            partner = f"{name[:-1]}{'2' if '1' in pair else '1'}"
            text = f"the frame '{name}' is named as the end of a loop, but there is no '{partner}': it closes none"
            yield Declaration(first.sourceline, "closing frames", f"frame '{name}'", text, certain=False)


def _elements(parent: Any, names: Collection[str], links: _Connections, simulator: str = "") -> Iterator[Declaration]:
    """Yield the declarations in the elements below `parent`; `simulator` is the simulator's element around it."""
    for element in parent.iterchildren("*"):
        word = _local(element)
        in_tree = element.tag == "joint" and parent.tag == "robot"
        joined = None if in_tree else _joined(element)
        if _LOOP_LIKE.search(word) and (not simulator or len(_named(element, names)) > 1):
            yield _declaration(element, _named(element, names), simulator, bool(_COUPLING.search(word)))
        elif joined is not None and links.join(*joined):
            yield _declaration(element, joined, simulator, False, element.find("body1") is None)
        elif word == "plugin" and _LOOP_LIKE.search(_own_words(element)) and len(_named(element, names)) > 1:
            yield _declaration(element, _named(element, names), simulator, False)
        else:
            yield from _elements(element, names, links, simulator or (word if word in _SIMULATORS else ""))


def _declaration(
    element: Any, named: Sequence[str], simulator: str, coupling: bool, certain: bool = True
) -> Declaration:
    tag = re.sub(r"\{.*\}", f"{element.prefix}:" if element.prefix else "", str(element.tag))
    own = f" '{element.get('name')}'" if element.get("name") else ""
    label = f"<{tag}>{own}{f' in <{simulator}>' if simulator else ''}"
    between = f" ({', '.join(map(repr, named[:4]))})" if named else ""
    text = f"{label}{between} declares {'a coupling' if coupling else 'a loop'}, which is not read from a URDF"
    return Declaration(element.sourceline, tag, label, text, coupling, certain)


def _local(element: Any) -> str:
    """Return an element's name in lower case, without a namespace or its prefix."""
    return re.split("[}:]", str(element.tag))[-1].lower()


def _own_words(element: Any) -> str:
    return f"{element.get('name', '')} {element.get('filename', '')}".lower()


def _named(element: Any, names: Collection[str]) -> list[str]:
    """Return the links and joints that an element names, in its attributes or texts."""
    words: dict[str, None] = {}
    for inner in element.iter("*"):
        own = [value for key, value in inner.attrib.items() if inner is not element or key != "name"]
        for word in (*own, inner.text or ""):
            words[word.strip().rpartition("::")[2]] = None
    return [word for word in words if word in names]


def _joined(element: Any) -> tuple[str, str] | None:
    """Return the links that an element joins, in SDF's notation of joints; None if it joins none."""
    inner = {
        _local(end): (end.get("link") or end.text or "").strip().rpartition("::")[2]
        for end in element.iterchildren("*")
    }
    for first, second in _ENDS:
        if inner.get(first) and inner.get(second):
            return inner[first], inner[second]
    return None


class _Connections:
    """Links that are connected by joints, directly or through others."""

    def __init__(self, tree: Any) -> None:
        self._next: dict[str, str] = {}
        for joint in joints(tree):
            self.join(*ends(joint))

    def join(self, first: str, second: str) -> bool:
        """Connect two links; return whether they were connected already."""
        first, second = self._last(first), self._last(second)
        self._next[second] = first
        return first == second

    def _last(self, link: str) -> str:
        while self._next.get(link, link) != link:
            link = self._next[link]
        return link
