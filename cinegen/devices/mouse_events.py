"""What the decoders of serial 3D mice find in a stream of bytes."""

from __future__ import annotations

from typing import NamedTuple

from cinegen.sensor import Twist


class Motion(NamedTuple):
    """The ball or cap is deflected so; zeros when it is let go."""

    twist: Twist


class Keys(NamedTuple):
    """These keys are down, from 0."""

    down: frozenset[int]


class Model(NamedTuple):
    """The device has said who it is, and how many keys it has."""

    name: str
    keys: int


class Fault(NamedTuple):
    """The device complains."""

    words: str


Event = Motion | Keys | Model | Fault


def keys(bits: int) -> Keys:
    """Keys by the bits of a number, the lowest is key 0."""
    return Keys(frozenset(i for i in range(bits.bit_length()) if bits >> i & 1))
