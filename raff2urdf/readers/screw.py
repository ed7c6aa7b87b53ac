"""The lead of a screw joint of SDF."""

from __future__ import annotations

import math
from typing import Any

from raff2urdf.readers.urdf import SIZE, numbers
from raff2urdf.readers.xml_file import error_at


def lead(element: Any, label: str, name: str) -> float:
    """Return the translation of a screw by its rotation, m/rad.

    `screw_thread_pitch` is in m per revolution of a right-handed thread, 1 by default; `thread_pitch`, which it
    replaced, in rad per m of a left-handed thread.

    Args:
        element: the joint.
        label: the joint, in errors.
        name: of the file, in errors.

    Raises:
        RaffError: a pitch is not a number, or 0 rad/m.
    """
    if element.find("screw_thread_pitch") is not None or element.find("thread_pitch") is None:
        return parameter(element, "screw_thread_pitch", label, name, 1.0) / (2.0 * math.pi)
    per_metre = parameter(element, "thread_pitch", label, name, 1.0)
    if not per_metre:
        raise error_at(name, element.find("thread_pitch"), f"the thread_pitch of {label} must be a number other than 0")
    return -1.0 / per_metre


def parameter(element: Any, word: str, label: str, name: str, default: float) -> float:
    """Return the number in an element of a joint, a mimic or an inertia; the arguments are those of `lead`.

    Raises:
        RaffError: it is not a number.
    """
    child = element.find(word)
    if child is None:
        return default
    text = child.text or ""
    value = numbers(text)
    if value is None or len(value) != 1:
        raise error_at(name, child, f"the {child.tag} of {label} must be a number, not '{text.strip()[:60]}'{SIZE}")
    return value[0]
