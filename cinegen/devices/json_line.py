"""A reading as a line of JSON: what programs send, and what recordings hold."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NamedTuple, NoReturn

import numpy as np
import pinocchio as pin

from cinegen.errors import CinegenError
from cinegen.sensor import Reading, Twist

LONGEST = 4096
"""Bytes of a line; none of those that make sense is half as long."""

_SKEW = 1e-3  # how far a rotation may be from one; it is made one
_FAR = 1e6  # m
_BUTTONS = 64
_KEYS = {"twist", "placement", "translation", "quaternion", "buttons"}


class LineError(CinegenError):
    """A line that is no reading; says why."""


class Said(NamedTuple):
    """What a line says; None for what it doesn't say."""

    twist: Twist | None
    target: pin.SE3 | None
    buttons: frozenset[int] | None


def parse(line: bytes | str, besides: frozenset[str] = frozenset()) -> tuple[Said, Mapping[str, Any]]:
    """What a line says, and the other values that stand in it.

    Args:
        line: of JSON, an object.
        besides: names of values that may stand there too.

    Raises:
        LineError: it is none, or makes no sense.
    """
    if len(line) > LONGEST:
        raise LineError(f"a line of more than {LONGEST} bytes")
    try:
        values = json.loads(line, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:  # no JSON, no UTF-8, brackets without end
        raise LineError(f"no JSON: {str(error) or 'too deep'}"[:200]) from None
    if not isinstance(values, dict):
        raise LineError('not an object, such as {"twist": [0, 0, 0.5, 0, 0, 0]}')
    unknown = values.keys() - _KEYS - besides
    if unknown:
        raise LineError(f"'{min(unknown)[:40]}' means nothing here: it takes {', '.join(sorted(_KEYS | besides))}")
    return Said(_twist(values), _target(values), _buttons(values, "buttons")), values


def written(reading: Reading) -> dict[str, Any]:
    """What `parse` reads as the same reading, times and presses apart."""
    values: dict[str, Any] = {}
    if reading.twist is not None:
        values["twist"] = list(reading.twist)
    if reading.target is not None:
        values["placement"] = reading.target.homogeneous.tolist()
    values["buttons"] = sorted(reading.buttons)
    return values


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number")


def numbers(values: Any, count: int, name: str) -> list[float]:
    """A list of so many finite numbers.

    Raises:
        LineError: it is none.
    """
    if not isinstance(values, list) or len(values) != count:
        raise LineError(f"'{name}' must be a list of {count} numbers")
    if not all(type(value) in (int, float) for value in values):
        raise LineError(f"'{name}' must be numbers")
    try:
        found = [float(value) for value in values]
    except OverflowError:
        found = [math.inf]
    if not all(map(math.isfinite, found)):
        raise LineError(f"'{name}' must be finite")
    return found


def _twist(values: Mapping[str, Any]) -> Twist | None:
    if "twist" not in values:
        return None
    x, y, z, a, b, c = (min(1.0, max(-1.0, value)) for value in numbers(values["twist"], 6, "twist"))
    return x, y, z, a, b, c


def _target(values: Mapping[str, Any]) -> pin.SE3 | None:
    if "placement" in values:
        rows = values["placement"]
        if not isinstance(rows, list) or len(rows) != 4:
            raise LineError("'placement' must be four lists of four numbers")
        matrix = np.array([numbers(row, 4, "placement") for row in rows])
        if np.abs(matrix[3] - [0, 0, 0, 1]).max() > 1e-9:
            raise LineError("'placement' must end with [0, 0, 0, 1]")
        rotation, translation = matrix[:3, :3], matrix[:3, 3]
    elif "translation" in values or "quaternion" in values:
        translation = np.array(numbers(values.get("translation"), 3, "translation"))
        quaternion = np.array(numbers(values.get("quaternion"), 4, "quaternion"))
        length = np.linalg.norm(quaternion)
        if not 1e-3 < length < 1e3:
            raise LineError("'quaternion' must be [x, y, z, w] of length 1")
        rotation = pin.Quaternion(quaternion / length).matrix()
    else:
        return None
    if np.abs(translation).max() > _FAR:
        raise LineError(f"a placement more than {_FAR:.0e} m away")
    if not np.abs(rotation).max() < 2.0 or np.abs(rotation.T @ rotation - np.eye(3)).max() > _SKEW:
        raise LineError("'placement' does not hold a rotation: its columns must be orthonormal")
    if np.linalg.det(rotation) < 0.0:
        raise LineError("'placement' holds a reflection")
    u, _, vt = np.linalg.svd(rotation)
    return pin.SE3(u @ vt, translation)


def _buttons(values: Mapping[str, Any], name: str) -> frozenset[int] | None:
    if name not in values:
        return None
    given = values[name]
    if not isinstance(given, list) or not all(type(one) is int and 0 <= one < _BUTTONS for one in given):
        raise LineError(f"'{name}' must be a list of whole numbers from 0 to {_BUTTONS - 1}")
    return frozenset(given)


def pressed(values: Mapping[str, Any]) -> tuple[int, ...]:
    """The buttons under `pressed`, in order.

    Raises:
        LineError: they are none.
    """
    _buttons(values, "pressed")
    return tuple(values.get("pressed", ()))
