"""Types of the values of commands, and the base of all messages."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct

from cinegen.errors import CinegenError
from cinegen.typed_json import Vector4

LONGEST = 2000
"""Characters of a message."""

Coordinate = Annotated[float, Meta(ge=-1e6, le=1e6)]
Position = tuple[Coordinate, Coordinate, Coordinate]
Quaternion = Vector4
Weight = Annotated[float, Meta(ge=0.01, le=100.0)]
Priority = Annotated[int, Meta(ge=0, le=9)]
Pointer = Annotated[int, Meta(ge=0, le=9)]
TaskId = Annotated[int, Meta(ge=0, lt=1 << 53)]
WaypointId = TaskId

Name = Annotated[
    str, Meta(min_length=1, max_length=40, pattern=r"^[^\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]*$")
]
"""A name that people choose: no control characters, none that reverse the direction of text."""

CommandFrame = Literal["world", "base", "tool", "view"]
"""Frame in whose axes a sensor's deflection moves a node."""


class CommandError(CinegenError):
    """A command is malformed or refers to something that does not exist. The sender is disconnected."""


def snake_case(name: str) -> str:
    """Return the `type` of a message of a class: "start_drag" of `StartDrag`, "state" of `StateMessage`."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name.removesuffix("Message")).lower()


class TypedMessage(Struct, frozen=True, forbid_unknown_fields=True, tag_field="type", tag=snake_case):
    """A message with a `type`, which accepts no other fields than its own."""


def set_field(message: Struct, name: str, value: Any) -> None:
    """Set a field of a frozen message while it is constructed."""
    msgspec.structs.force_setattr(message, name, value)


def normalize(message: Struct, quaternion: Quaternion) -> None:
    """Make the quaternion of a message a unit quaternion.

    Raises:
        ValueError: its norm is not near 1.
    """
    length = math.hypot(*quaternion)
    if not 0.9 < length < 1.1:
        raise ValueError(f"Expected a quaternion x y z w of length 1, not {length:.3g} - at `$.quaternion`")
    set_field(message, "quaternion", tuple(value / length for value in quaternion))
