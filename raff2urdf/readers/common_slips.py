"""Common slips in URDFs, which other programs read without a word: each has one meaning, and is read so, with a note.

xyz="0.07, 0, -0.69"          commas between numbers
<limit velocity="-1">         -1 for no limit, as simulators write it; of effort, too
<mesh scale="1 1 1 1">        more than three factors
"""

from __future__ import annotations

import re
from typing import Any

from raff2urdf.readers.urdf import number

_COMMA = re.compile(r"\s*,\s+")
_VECTORS = ("xyz", "rpy", "size", "scale")


def mend(root: Any) -> list[str]:
    """Write what slips mean into a URDF, and return notes, one of each kind of slip.

    Args:
        root: the root element; changed.
    """
    found: dict[str, list[str]] = {}
    for element in root.iter("*"):
        for word, text in list(element.attrib.items()):
            if word in _VECTORS and _COMMA.search(text):
                element.set(word, _COMMA.sub(" ", text))
                found.setdefault("commas between numbers are left out", []).append(_place(element, word, text))
        for word in ("velocity", "effort"):
            if element.tag == "limit" and number(element.get(word, "0")) == -1.0:
                found.setdefault("-1 is read as no limit", []).append(_place(element, word, element.attrib.pop(word)))
        factors = element.get("scale", "").split() if element.tag == "mesh" else []
        if len(factors) > 3:
            found.setdefault("the first three factors are read", []).append(_place(element, "scale", " ".join(factors)))
            element.set("scale", " ".join(factors[:3]))
    return [f"{places[0]}{f' and {len(places) - 1} more' * (len(places) > 1)}: {how}" for how, places in found.items()]


def _place(element: Any, word: str, text: str) -> str:
    return f'{word}="{text[:40]}" of <{element.tag}> on line {element.sourceline}'
