"""Readings of sensors as lines of JSON, which programs send and recordings hold: this module is the schema.

The tables in `docs/reference/protocol.md` are generated from the classes here by `docs/protocols.py`.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeVar, cast

import msgspec
import numpy as np
import pinocchio as pin
from msgspec import UNSET, Struct, UnsetType

from cinegen.errors import CinegenError
from cinegen.sensor import Reading, Twist
from cinegen.typed_json import Button, Vector3, Vector4, Vector6, decoder, encode, every_problem
from raff2urdf.errors import listed

LONGEST = 4096
"""Bytes of a line; no valid line is half as long."""

VERSION = 1

_NOT_A_ROTATION = 1e-3  # largest deviation of a rotation from orthonormal; a smaller one is removed
_FARTHEST = 1e6  # m
_M = TypeVar("_M", bound="ReadingMessage")


class ReadingError(CinegenError):
    """A line doesn't match the schema; the message names each field that is wrong."""


class ReadingMessage(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A reading, as programs send it. What is left out is not reported.

    Attributes:
        twist: deflection, three translations and three rotations; each is clipped to -1 to 1. Send it at least ten
            times a second.
        placement: target in the world, a homogeneous 4 x 4 matrix in rows (m).
        translation: position of the target [x, y, z] (m), instead of `placement`.
        quaternion: orientation of the target [x, y, z, w], with `translation`.
        buttons: buttons that are pressed.
    """

    twist: Vector6 | UnsetType = UNSET
    placement: tuple[Vector4, Vector4, Vector4, Vector4] | UnsetType = UNSET
    translation: Vector3 | UnsetType = UNSET
    quaternion: Vector4 | UnsetType = UNSET
    buttons: frozenset[Button] | UnsetType = UNSET


class TokenMessage(Struct, frozen=True, forbid_unknown_fields=True):
    """The first line of a program.

    Attributes:
        token: token of the port.
    """

    token: str


class RecordedReading(ReadingMessage, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A reading in a recording: with the fields of a reading that a program sends.

    Attributes:
        time: time since the first reading, s.
        pressed: buttons that were pressed since the reading before, in order.
    """

    time: float
    pressed: tuple[Button, ...] = ()


class ReadingsHeader(Struct, frozen=True):
    """The first line of a recording.

    Attributes:
        cinegen: kind of the file.
        version: of the format.
        timeout: time without a reading after which the sensor counted as silent, s; null: none.
    """

    cinegen: Literal["readings"]
    version: int
    timeout: float | None = None


class PartialReading(NamedTuple):
    """Content of a line; None for what it leaves out.

    Attributes:
        twist: see `Reading`.
        target: see `Reading`.
        buttons: see `Reading`.
    """

    twist: Twist | None
    target: pin.SE3 | None
    buttons: frozenset[int] | None


_MESSAGE = decoder(ReadingMessage, ReadingMessage)
_TOKEN = decoder(TokenMessage, TokenMessage)
_RECORDED = decoder(RecordedReading, RecordedReading)


def decode_reading(line: bytes | str) -> PartialReading:
    """Decode a reading that a program sent.

    Raises:
        ReadingError: it doesn't match the schema.
    """
    return _partial(_decoded(line, _MESSAGE))


def decode_token(line: bytes) -> str | None:
    """Return the token in a program's first line; None if it is another line."""
    try:
        return _TOKEN.decode(line).token
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return None


def encode_token(token: str) -> str:
    """Return the first line of a program, without its end."""
    return encode(TokenMessage(token)).decode()


def decode_recorded(line: bytes | str) -> Reading:
    """Decode a reading in a recording.

    Raises:
        ReadingError: it doesn't match the schema.
    """
    message = _decoded(line, _RECORDED)
    twist, target, buttons = _partial(message)
    return Reading(message.time, twist, target, buttons or frozenset(), message.pressed)


def encode_recorded(reading: Reading, begin: float) -> bytes:
    """Encode a reading for a recording.

    Args:
        reading: reading to encode.
        begin: start of the recording, on the clock of `Reading.time`, s.
    """
    message = RecordedReading(
        twist=UNSET if reading.twist is None else reading.twist,
        placement=UNSET if reading.target is None else reading.target.homogeneous.tolist(),
        buttons=reading.buttons,
        time=round(reading.time - begin, 6),
        pressed=reading.pressed,
    )
    return encode(message) + b"\n"


def encode_header(timeout: float) -> bytes:
    """Encode the first line of a recording of a sensor with a time-out (s)."""
    return encode(ReadingsHeader("readings", VERSION, timeout)) + b"\n"


def _decoded(line: bytes | str, decode: msgspec.json.Decoder[_M]) -> _M:
    if len(line) > LONGEST:
        raise ReadingError(f"a line must not be longer than {LONGEST} bytes")
    try:
        return decode.decode(line)
    except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
        raise ReadingError(listed(every_problem(line, decode, error).split("\n"))) from None


def _partial(message: ReadingMessage) -> PartialReading:
    twist, buttons = message.twist, message.buttons
    return PartialReading(
        None if isinstance(twist, UnsetType) else cast(Twist, tuple(min(1.0, max(-1.0, value)) for value in twist)),
        _target(message),
        None if isinstance(buttons, UnsetType) else buttons,
    )


def _target(message: ReadingMessage) -> pin.SE3 | None:
    placement, position, quaternion = message.placement, message.translation, message.quaternion
    if placement is position is quaternion is UNSET:
        return None
    wrong = dict[str, bool]()
    if placement is not UNSET and position is quaternion is UNSET:
        matrix, field = np.array(placement), "placement"
        rotation, translation = matrix[:3, :3], matrix[:3, 3]
        wrong["Expected [0, 0, 0, 1] - at `$.placement[3]`"] = np.abs(matrix[3] - [0, 0, 0, 1]).max() > 1e-9
        if not np.abs(rotation).max() < 2.0 or np.abs(rotation.T @ rotation - np.eye(3)).max() > _NOT_A_ROTATION:
            wrong["Expected a rotation, with orthonormal columns - at `$.placement`"] = True
        elif np.linalg.det(rotation) < 0.0:
            wrong["Expected a rotation, not a reflection - at `$.placement`"] = True
    elif placement is UNSET and position is not UNSET and quaternion is not UNSET:
        translation, field = np.array(position), "translation"
        length = np.linalg.norm(quaternion)
        rotation = pin.Quaternion(np.array(quaternion) / (length or 1.0)).matrix()
        wrong["Expected a quaternion x y z w of length 1 - at `$.quaternion`"] = not 1e-3 < length < 1e3
    else:
        raise ReadingError("Expected `placement`, or both `translation` and `quaternion`")
    wrong[f"Expected a position within {_FARTHEST:.0e} m - at `$.{field}`"] = np.abs(translation).max() > _FARTHEST
    if any(wrong.values()):
        raise ReadingError("\n".join(text for text, is_wrong in wrong.items() if is_wrong))
    u, _, vt = np.linalg.svd(rotation)
    return pin.SE3(u @ vt, translation)
