"""List what acts on the joints of a robot's file and forces leave out: springs, friction of balls and tendons, ..."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from raff2urdf.errors import first_of
from raff2urdf.readers.urdf import numbers

_BEGINNING = "forces leave out "
_MOST = 4  # names that are listed


def note_of(named: Mapping[str, Sequence[str]]) -> list[str]:
    """Return a note that lists what is left out, by the names of the joints on which it acts; none without any."""
    parts = [f"the {what} of {first_of(names, _MOST)}" for what, names in named.items() if names]
    return [_BEGINNING + ", ".join(parts)] if parts else []


def is_uncounted(note: str) -> bool:
    """Return whether a note is one of these."""
    return note.startswith(_BEGINNING)


def is_given(dynamics: Any, word: str) -> bool:
    """Return whether an element <dynamics> of URDF or SDF, or none, gives a number other than 0."""
    text = "" if dynamics is None else dynamics.get(word) or dynamics.findtext(word, "0")
    return any(numbers(text) or ())


def of_urdf(root: Any, counted: Collection[str]) -> dict[str, list[str]]:
    """Return the joints of a URDF with damping, friction and springs that are not counted: springs of all of them, and
    the others of those that are not among the joints `counted`."""
    by_kind: dict[str, dict[str, None]] = {"damping": {}, "friction": {}, "springs": {}}
    for element in root.iter("dynamics"):
        joint = str(element.getparent().get("name"))
        for names, word in zip(by_kind.values(), ("damping", "friction", "spring_stiffness"), strict=True):
            if is_given(element, word) and (names is by_kind["springs"] or joint not in counted):
                names[joint] = None
    return {what: list(names) for what, names in by_kind.items()}
