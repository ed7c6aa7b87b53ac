"""JSON whose schema is a msgspec Struct: poses and arrays as lists of numbers, and the types that schemas share."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, is_dataclass
from enum import Enum
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

import msgspec
import numpy as np
import pinocchio as pin
from msgspec import Meta, Struct, UnsetType

from cinegen.arrays import Array
from raff2urdf.escape import one_line

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


def every_problem(data: bytes | str, of: msgspec.json.Decoder[Any], first: Exception) -> str:
    """Return all problems of what a decoder refused, a line each.

    Args:
        data: that was refused.
        of: decoder.
        first: its error.
    """
    try:
        value = msgspec.json.decode(data)
        return "\n".join(_problems(value, of.type, "$")) or str(first)
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return str(first)


def _problems(value: Any, kind: Any, at: str) -> list[str]:
    try:
        msgspec.convert(value, kind, dec_hook=_decoded)
    except msgspec.ValidationError as error:
        what, _, where = str(error).partition(" - at `$")
    else:
        return []
    problems = [f"{problem} - at `{at}`" for problem in _wrong_fields(value, kind)]
    for part, inner, name in _parts(value, kind):
        problems += _problems(part, inner, at + name)
    return problems or [f"{what} - at `{at}{where.rstrip('`')}`"]


def _wrong_fields(value: Any, kind: Any) -> list[str]:
    if not (isinstance(kind, type) and issubclass(kind, Struct) and isinstance(value, dict)):
        return []
    fields, config = msgspec.structs.fields(kind), kind.__struct_config__
    known = {config.tag_field, *(field.encode_name for field in fields)}
    missing = [field.encode_name for field in fields if field.required and field.encode_name not in value]
    unknown = [one_line(name) for name in value if name not in known] if config.forbid_unknown_fields else []
    return [f"Object missing required field `{name}`" for name in missing] + [
        f"Object contains unknown field `{name:.40}`" for name in unknown
    ]


def _parts(value: Any, kind: Any) -> Iterator[tuple[Any, Any, str]]:
    """Yield the parts of a value with their types and names: fields of structs, elements of lists and mappings."""
    origin, inner = get_origin(kind), [part for part in get_args(kind) if part not in (type(None), UnsetType)]
    if origin in (Union, UnionType) and len(inner) == 1:
        yield value, inner[0], ""
    elif isinstance(kind, type) and issubclass(kind, Struct) and isinstance(value, dict):
        for field in msgspec.structs.fields(kind):
            if field.encode_name in value:
                yield value[field.encode_name], field.type, f".{field.encode_name}"
    elif origin is dict and isinstance(value, dict):
        yield from ((part, inner[1], f".{one_line(name):.40}") for name, part in value.items())
    elif origin in (tuple, list, frozenset) and isinstance(value, list):
        kinds = inner[:1] * len(value) if inner[1:] in ([], [...]) else inner
        if len(kinds) == len(value):
            yield from ((part, kinds[i], f"[{i}]") for i, part in enumerate(value))


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
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, Enum):
        return value.value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _encoded(value: Any) -> Any:
    if isinstance(value, pin.SE3):
        return pin.SE3ToXYZQUAT(value).tolist()
    if isinstance(value, np.ndarray | np.generic):
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


def unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a table of JSON; the `object_pairs_hook` of `json.loads`.

    Raises:
        ValueError: a key occurs twice.
    """
    table = dict(pairs)
    if len(table) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"key '{next(key for key in keys if keys.count(key) > 1)}' occurs twice in a table")
    return table
