"""List damping, friction and springs of a robot's file: forces leave them out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from raff2urdf.readers.urdf import numbers

_BEGINNING = "forces leave out "
_MOST = 4  # names that are listed


def note_of(named: Mapping[str, Sequence[str]]) -> list[str]:
    """Return a note that lists what is left out, by the names of the joints on which it acts; none without any."""
    parts = []
    for what, names in named.items():
        more = f" and {len(names) - _MOST} more" if len(names) > _MOST else ""
        parts += [f"the {what} of {', '.join(names[:_MOST])}{more}"] if names else []
    return [_BEGINNING + ", ".join(parts)] if parts else []


def is_uncounted(note: str) -> bool:
    """Return whether a note is one of these."""
    return note.startswith(_BEGINNING)


def of_dynamics(dynamics: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the joints with damping, friction and springs, by their elements <dynamics> of URDF or SDF."""
    found: dict[str, list[str]] = {"damping": [], "friction": [], "springs": []}
    for joint, element in dynamics.items():
        for names, word in zip(found.values(), ("damping", "friction", "spring_stiffness"), strict=True):
            text = "" if element is None else element.get(word) or element.findtext(word, "0")
            names += [joint] if any(numbers(text) or ()) else []
    return found
