"""Events that the decoders of serial 3D mice find in a stream of bytes."""

from __future__ import annotations

from typing import NamedTuple

from cinegen.sensor import Twist


class MouseMotion(NamedTuple):
    """Deflection of the ball or cap; zeros when it is released."""

    twist: Twist


class MouseKeys(NamedTuple):
    """Indices of the keys that are down, from 0."""

    down: frozenset[int]


class MouseModel(NamedTuple):
    """Model of the device, and its number of keys."""

    name: str
    keys: int


class MouseFault(NamedTuple):
    """Error that the device reports."""

    message: str


MouseEvent = MouseMotion | MouseKeys | MouseModel | MouseFault


def keys(bits: int) -> MouseKeys:
    """Return the keys of the bits of a number; the lowest bit is key 0."""
    return MouseKeys(frozenset(i for i in range(bits.bit_length()) if bits >> i & 1))
