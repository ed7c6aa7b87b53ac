"""What serial 3D mice send, made by hand from the description of their languages: encoders for the tests."""

import itertools
import struct
from collections.abc import Sequence

from hypothesis import strategies as st

NIBBLES = b"0AB3D56GH9:K<MN?"

counts = st.tuples(*[st.integers(-400, 400)] * 6)


def nibbles(value: int, count: int) -> bytes:
    return bytes(NIBBLES[value >> 4 * i & 15] for i in reversed(range(count)))


def magellan_motion(values: Sequence[int]) -> bytes:
    return b"d" + b"".join(nibbles(value + 0x8000, 4) for value in values) + b"\r"


def magellan_keys(bits: int) -> bytes:
    return b"k" + bytes(NIBBLES[bits >> 4 * i & 15] for i in range(3)) + b"\r"


def magellan_twist(values: Sequence[int]) -> tuple[float, ...]:
    x, y, z, a, b, c = (min(1.0, max(-1.0, value / 400.0)) for value in values)
    return (x, -z, y, a, -c, b)


def escaped(data: bytes) -> bytes:
    data = data.replace(b"^", b"^^")
    for code, name in ((0x11, b"^Q"), (0x13, b"^S"), (0x0D, b"^M")):
        data = data.replace(bytes([code]), name)
    return data


def spaceball_motion(values: Sequence[int], period: int = 800) -> bytes:
    return b"D" + escaped(struct.pack(">H6h", period, *values)) + b"\r"


def spaceball_twist(values: Sequence[int]) -> tuple[float, ...]:
    full = (8000.0,) * 3 + (1600.0,) * 3
    x, y, z, a, b, c = (min(1.0, max(-1.0, value / most)) for value, most in zip(values, full, strict=True))
    return (x, z, y, a, c, b)


def cut(data: bytes, places: Sequence[int]) -> list[bytes]:
    """A stream in pieces."""
    ends = sorted({0, len(data), *(place % (len(data) + 1) for place in places)})
    return [data[a:b] for a, b in itertools.pairwise(ends)]
