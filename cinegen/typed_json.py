"""JSON whose schema is a msgspec Struct: poses and arrays as lists of numbers, and the types that schemas share."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, is_dataclass
from enum import Enum
from typing import Annotated, Any, TypeVar, get_origin

import msgspec
import numpy as np
import pinocchio as pin
from msgspec import Meta

from cinegen.arrays import Array

Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]
Vector6 = tuple[float, float, float, float, float, float]
Vector7 = tuple[float, float, float, float, float, float, float]
Button = Annotated[int, Meta(ge=0, le=63)]
DoF = Annotated[int, Meta(ge=0, le=3)]

_UNIT = 1e-6  # how far the length of a pose's quaternion may be from 1
_T = TypeVar("_T")


def decoder(kind: Any, result: type[_T] | None = None) -> msgspec.json.Decoder[_T]:
    """Return a decoder of a type in which poses (`pinocchio.SE3`) are x y z (m) and a quaternion x y z w, arrays lists.

    It raises `msgspec.MsgspecError`, whose message names the field, or `RecursionError`.
    """
    return msgspec.json.Decoder(kind, dec_hook=_decoded)


def encode(message: Any) -> bytes:
    """Encode a message as one line of JSON, without its end; what is not finite becomes null."""
    try:
        return _ENCODER.encode(message)
    except UnicodeEncodeError:  # the name of a file, which is not UTF-8: it is escaped
        text = json.dumps(msgspec.to_builtins(message, enc_hook=_encoded))
        return json.dumps(json.loads(text, parse_constant=lambda _: None)).encode()


def as_json(of: object, *names: str, **others: Any) -> dict[str, Any]:
    """Return attributes of an object by their names, and other values, as what JSON holds: arrays and tuples as lists,
    enums as their values, dataclasses by their fields, None for what is not finite."""
    return {name: _plain(value) for name, value in ({name: getattr(of, name) for name in names} | others).items()}


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, Enum):
        return value.value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _encoded(value: Any) -> Any:
    if isinstance(value, pin.SE3):
        return pin.SE3ToXYZQUAT(value).tolist()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise NotImplementedError(f"a {type(value).__name__} has no form in JSON")


def _decoded(kind: Any, value: Any) -> Any:
    if kind is pin.SE3:
        numbers = _converted(value, Vector7)
        if not abs(math.hypot(*numbers[3:]) - 1.0) < _UNIT:
            raise ValueError("Expected a quaternion of length 1")
        return pin.XYZQUATToSE3(numbers)
    if get_origin(kind) is np.ndarray:
        return _converted(value, list[float])
    raise NotImplementedError(f"a {kind} has no form in JSON")


def _converted(value: Any, kind: Any) -> Array:
    try:
        return np.array(msgspec.convert(value, kind), dtype=float)
    except msgspec.ValidationError as error:  # msgspec adds the path of the whole field
        raise ValueError(str(error).partition(" - at ")[0]) from None


_ENCODER = msgspec.json.Encoder(enc_hook=_encoded)
