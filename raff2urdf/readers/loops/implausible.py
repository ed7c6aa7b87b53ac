"""Probable slips in a URDF.

Degrees for radians, misspelled words: it is read as it is written; a warning names the edit (`warnings_of`).

Slips that other programs read without a word, and that have one meaning: it is read so, with a note (`mend`).

    xyz="0.07, 0, -0.69"          commas between numbers
    <limit velocity="-1">         -1 for no limit, as simulators write it; of effort, too
    <mesh scale="1 1 1 1">        more than three factors
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

from raff2urdf.readers.urdf import joints, links, number, numbers


def in_degrees(angles: Sequence[float]) -> bool:
    """Return whether angles of an orientation, rad, are probably in degrees: one is more than a revolution, and all are
    multiples of half a degree."""
    return math.tau < max(map(abs, angles), default=0.0) <= 360.0 and all(2.0 * x == round(2.0 * x) for x in angles)


_ATTRIBUTES = {
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "parent": ("link",),
    "child": ("link",),
    "limit": ("lower", "upper", "velocity", "effort"),
    "mimic": ("joint", "multiplier", "offset"),
    "mass": ("value",),
}
"""Words of URDF for what places, limits and weighs, by element."""

_ELEMENTS = {
    "joint": ("origin", "parent", "child", "axis", "limit", "mimic", "dynamics", "calibration", "safety_controller"),
    "link": ("inertial", "visual", "collision"),
    "inertial": ("origin", "mass", "inertia"),
}
"""Elements of URDF, by the element around them."""

_ALIKE = 0.75  # of two words, such as `xzy` and `xyz`


_COMMA = re.compile(r"\s*,\s+")
_VECTORS = ("xyz", "rpy", "size", "scale")


def mend(root: Any) -> list[str]:
    """Write what slips mean into a URDF, and return notes, one of each kind of slip.

    Args:
        root: the root element; changed.
    """
    slips: dict[str, list[str]] = {}
    for element in root.iter("*"):
        for word, text in list(element.attrib.items()):
            if word in _VECTORS and _COMMA.search(text):
                element.set(word, _COMMA.sub(" ", text))
                slips.setdefault("commas between numbers are left out", []).append(_place(element, word, text))
        for word in ("velocity", "effort"):
            if element.tag == "limit" and number(element.get(word, "0")) == -1.0:
                slips.setdefault("-1 is read as no limit", []).append(_place(element, word, element.attrib.pop(word)))
        factors = element.get("scale", "").split() if element.tag == "mesh" else []
        if len(factors) > 3:
            slips.setdefault("the first three factors are read", []).append(_place(element, "scale", " ".join(factors)))
            element.set("scale", " ".join(factors[:3]))
    return [f"{places[0]}{f' and {len(places) - 1} more' * (len(places) > 1)}: {how}" for how, places in slips.items()]


def _place(element: Any, word: str, text: str) -> str:
    return f'{word}="{text[:40]}" of <{element.tag}> on line {element.sourceline}'


def warnings_of(root: Any, name: str) -> list[str]:
    """Return warnings about a URDF, one of each kind.

    Args:
        root: the root element.
        name: of the file.
    """
    degrees, words = list(_degrees(root)), list(_misspelled(root))
    shown = []
    for kind in (degrees, words):
        more = f" (and {len(kind) - 1} more)" if len(kind) > 1 else ""
        shown += [f"{name}:{line}: {text}{more}" for line, text in kind[:1]]
    return shown


def _degrees(root: Any) -> Iterator[tuple[int, str]]:
    for joint in joints(root):
        for origin in joint.iterchildren("origin"):
            written = origin.get("rpy", "")
            angles = numbers(written) or []
            if in_degrees(angles):
                meant = " ".join(f"{math.radians(angle):.10g}" for angle in angles)
                where = f"joint '{joint.get('name', '')}'"
                why = f'rpy="{written}" of {where} is more than a revolution, since angles are in radians'
                yield origin.sourceline, f'{why}: if these are degrees, write rpy="{meant}"'


def _misspelled(root: Any) -> Iterator[tuple[int, str]]:
    """Yield words that are nearly words of URDF, in elements where these are missing."""
    around = [*links(root), *joints(root)]
    around += [inertial for link in links(root) for inertial in link.iterchildren("inertial")]
    for element in around:
        children = [inner for inner in element.iterchildren("*") if isinstance(inner.tag, str)]
        for inner, meant in _near(_ELEMENTS[element.tag], {inner.tag: inner for inner in children}):
            yield inner.sourceline, f"<{inner.tag}> is not read: did you mean <{meant}>?"
        for inner in children:
            known = _ATTRIBUTES.get(inner.tag, ())
            for word, meant in _near(known, {word: word for word in inner.attrib}):
                yield inner.sourceline, f"{word} of <{inner.tag}> is not read: did you mean {meant}?"


def _near(known: tuple[str, ...], used: dict[str, Any]) -> Iterator[tuple[Any, str]]:
    missing = [word for word in known if word not in used]
    for word, thing in used.items():
        near = [] if word in known else difflib.get_close_matches(word, missing, 1, _ALIKE)
        near = near or [other for other in missing if word not in known and sorted(word) == sorted(other)]
        if near:
            yield thing, near[0]
