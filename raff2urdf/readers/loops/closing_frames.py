"""Read pairs of frames that coincide: `closing_NAME_1` and `closing_NAME_2`, of onshape-to-robot and placo.

The frames are links with fixed joints, or elements <frame>. A prefix is allowed, as in `left/closing_NAME_1`. The
format does not state the kind of the joint: the two origins coincide (a ball loop), as placo closes them. Of a hinge
onshape-to-robot writes two pairs, the second one with `_z`, on the axis: then it is a revolute loop about z.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.escape import shell_word
from raff2urdf.readers.loops.declaration import Declaration
from raff2urdf.readers.loops.loop_joint import LoopJoint
from raff2urdf.readers.urdf import links, placement
from raff2urdf.readers.urdf_tree import UrdfTree

_CLOSING = re.compile(r"((?:.*[^a-z0-9])?closing_.+)_([12])(_z)?")

DIALECT = "closing frames"


def is_end(element: Any) -> bool:
    """Return whether an element is named as the end of a loop."""
    return bool(_CLOSING.fullmatch(str(element.get("name", "")).lower()))


def find(root: Any) -> Iterator[Declaration]:
    """Yield the pairs of frames of a URDF, and frames that lack their partner."""
    pairs: dict[str, dict[str, Any]] = {}
    hinges: set[str] = set()
    for element in (*links(root), *root.iterchildren("frame")):
        name = str(element.get("name", ""))
        match = _CLOSING.fullmatch(name.lower())
        if match and match[3]:
            hinges.add(match[1])
        elif match:
            pairs.setdefault(match[1], {})[match[2]] = element
    for stem, pair in pairs.items():
        first, last = pair[min(pair)], pair[max(pair)]
        name = str(first.get("name"))
        if first is last:
            partner = f"{name[:-1]}{'2' if '1' in pair else '1'}"
            text = f"the frame '{name}' is named as the end of a loop, but there is no '{partner}': it closes none"
            yield Declaration(first.sourceline, DIALECT, f"frame '{name}'", text, name, certain=False)
            continue
        kind = "revolute" if stem in hinges else "ball"
        label = f"frames '{name}' and '{last.get('name')}'"
        text = f"the {label} (line {last.sourceline}) declare a loop"
        other = f"--loop {shell_word(name[:-2])}=revolute for a hinge about their z axes"
        note = f"the {label} don't state the kind of loop: their origins coincide; {other}"
        also = tuple(str(frame.get("name")) for frame in pair.values())
        yield Declaration(
            first.sourceline, DIALECT, label, text, name[:-2], read=partial(_read, first=first, last=last, kind=kind),
            also=also, notes=(note,) if kind == "ball" else (),
        )  # fmt: skip


def _read(tree: UrdfTree, first: Any, last: Any, kind: str) -> LoopJoint:
    (link, at), (other, other_at) = _end(tree, first), _end(tree, last)
    if tree.body(link)[0] == tree.body(other)[0]:
        names = f"'{first.get('name')}' and '{last.get('name')}'"
        raise tree.error(first, f"the frames {names} are on one rigid body: put each on another link")
    return LoopJoint(kind, link, other, (at, other_at))


def _end(tree: UrdfTree, element: Any) -> tuple[str, Array]:
    """Return the link of a frame, and the frame's placement (4, 4) on it."""
    if element.tag == "link":
        return str(element.get("name")), np.eye(4)
    label = f"the frame '{element.get('name')}'"
    return tree.link(element, element.get("link"), label), placement(element, tree.name)
