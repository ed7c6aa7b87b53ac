"""The language of the Spaceball 1003, 2003, 3003 and 4000FLX: bytes in, events out, no input or output of its own.

A packet is a letter, binary data and a CR; ^Q, ^S, ^M and ^^ in the data stand for XON, XOFF, CR and ^ (facts as in
spacenavd). There is no checksum, so what is damaged is told by its length and by what a hand can do: counts within a
range, and no jump from one packet to the next unless the one after agrees.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence

from cinegen.devices.mouse_events import Event, Fault, Model, Motion, keys
from cinegen.sensor import Twist

RESET = b"\r@RESET\r"
"""Makes it say who it is, after a second or two."""

START = b"\rCB\rMSSV\rk\r"
"""Binary packets, motion without being asked, and a report of the keys: a 4000FLX is known by it."""

ASK_KEYS = b"k\r"
"""The question which keys are down: answered at once, so it also tells whether anybody is there."""

FULL = (8000.0, 8000.0, 8000.0, 1600.0, 1600.0, 1600.0)
"""Counts at full deflection, as the Linux kernel's driver has them."""

LARGEST = 20480
"""Counts beyond which a packet is damaged; the author of VRPN's driver has seen 20,000 at most."""

JUMP = 0.125
"""Part of the full deflection by which two packets may differ without a third that agrees."""

_ESCAPES = {ord("Q"): 0x11, ord("S"): 0x13, ord("M"): 0x0D, ord("^"): ord("^")}
_CR, _XON, _XOFF, _ESCAPE = 0x0D, 0x11, 0x13, ord("^")
_LONGEST = 128  # bytes of a packet that are kept: it is an answer, or noise
_MODELS = {
    **dict.fromkeys((35, 62, 63), Model("Spaceball 3003", 2)),
    **dict.fromkeys((43, 45), Model("Spaceball 4000FLX", 12)),
    **dict.fromkeys((2, 13, 15, 42), Model("Spaceball 2003", 8)),  # 42 may be a 4000FLX: its first '.' tells
}
UNKNOWN = Model("Spaceball", 8)
"""A model whose firmware is not known."""

_MOTION = struct.Struct(">H6h")  # time since the packet before, 1/16 ms; x y z and the rotations about them
_POWER_ON = b"\n\v\0"  # what may come before an answer


class Spaceball:
    """Decodes a stream, however it is cut.

    Attributes:
        model: as far as it is known.
        damaged: how many packets could not be used.
    """

    def __init__(self) -> None:
        self.model = UNKNOWN
        self.damaged = 0
        self._packet = bytearray()
        self._broken = False  # the packet has an escape that there is not, or is too long
        self._escaped = False
        self._steady = Steady()

    def feed(self, data: bytes) -> list[Event]:
        """The events of these bytes, together with those before."""
        events: list[Event] = []
        for code in data:
            if code == _CR:
                self._broken |= self._escaped
                events += self._decode(bytes(self._packet.lstrip(_POWER_ON)))
                self._packet.clear()
                self._broken = self._escaped = False
            elif code in (_XON, _XOFF):
                pass  # of the line: those of the data are escaped
            elif self._escaped:
                self._escaped = False
                self._broken |= code not in _ESCAPES
                self._append(_ESCAPES.get(code, code))
            elif code == _ESCAPE:
                self._escaped = True
            else:
                self._append(code)
        return events

    def _append(self, code: int) -> None:
        if len(self._packet) < _LONGEST:
            self._packet.append(code)
        else:
            self._broken = True

    def _decode(self, packet: bytes) -> list[Event]:
        if not packet:
            return []
        kind, body = packet[:1], packet[1:]
        if self._broken:
            self.damaged += 1
        elif kind == b"D" and len(body) == _MOTION.size:
            twist = self._steady.sift(_MOTION.unpack(body)[1:])
            if twist is not None:
                return [Motion(twist)]
            self.damaged += 1
        elif kind == b"K" and len(body) == 2:
            if self.model.keys != 12:  # a 4000FLX also says by '.' what it says here
                return [keys(_bits(body) & (1 << self.model.keys) - 1)]
        elif kind == b"." and len(body) == 2:
            found: list[Event] = []
            if self.model.keys != 12:
                self.model = Model("Spaceball 4000FLX", 12)
                found = [self.model]
            return [*found, keys(body[1] & 0x3F | (body[1] & 0x80) >> 1 | (body[0] & 0x1F) << 7)]
        elif kind == b"@" and body[:1].isdigit():
            return self._answer(body.decode("ascii", errors="replace"))
        elif kind == b"E":
            return [Fault(f"the Spaceball reports error {body.decode('ascii', errors='replace')}")]
        elif kind not in (b"M", b"C", b"?", b"F", b"N", b"P", b"Z", b"B"):  # answers to what it is told
            self.damaged += 1
        return []

    def _answer(self, text: str) -> list[Event]:
        version = re.search(r"Firmware version (\d+)\.(\d+)", text)
        if version is not None:
            known = int(version[1]) == 2 and _MODELS.get(int(version[2]))
            self.model = known or UNKNOWN
        elif not text.startswith("1"):
            return []
        else:
            self.model = UNKNOWN
        self._steady = Steady()
        return [self.model]


def _bits(body: bytes) -> int:
    """Keys 1 to 4, or left and right of a 3003; then 5 to 7, and pick of a 2003."""
    return body[1] & 0x0F | body[1] >> 4 & 3 | (body[0] & 7) << 4 | (body[0] & 0x10) << 3


class Steady:
    """Leaves out counts that no hand makes.

    A packet that is near the one before, or all zeros, is used at once: zeros are safe, and said only once. Another one
    waits for the packet after: if that is near it, or goes on in the same direction, the hand was fast. If not, and
    that one is near the last that was used, the packet between was damaged.
    """

    def __init__(self) -> None:
        self._used: Twist = _scaled((0,) * 6)
        self._waiting: Twist | None = None

    def sift(self, counts: Sequence[int]) -> Twist | None:
        """What the counts say, in the axes of a `Twist`; None if they are not to be used."""
        if max(map(abs, counts)) > LARGEST:
            return None
        new, used, waiting = _scaled(counts), self._used, self._waiting
        if not any(counts) or _near(new, used) or (waiting is not None and _agrees(used, waiting, new)):
            self._used, self._waiting = new, None
            return _clipped(new)
        self._waiting = new
        return None


def _scaled(counts: Sequence[int]) -> Twist:
    """The device's x is to the right, y up, z away from the user."""
    x, y, z, a, b, c = (count / full for count, full in zip(counts, FULL, strict=True))
    return x, z, y, a, c, b


def _clipped(twist: Twist) -> Twist:
    x, y, z, a, b, c = (min(1.0, max(-1.0, value)) for value in twist)
    return x, y, z, a, b, c


def _near(first: Twist, second: Twist) -> bool:
    return all(abs(a - b) <= JUMP for a, b in zip(first, second, strict=True))


def _agrees(used: Twist, waiting: Twist, new: Twist) -> bool:
    """Whether, on each axis, the packet that waits is near the new one, or the way goes on in a jump of its kind."""
    return all(
        abs(n - w) <= JUMP or (abs(w - u) > JUMP and (n - w) * (w - u) > 0.0 and abs(n - w) <= JUMP + abs(w - u))
        for u, w, n in zip(used, waiting, new, strict=True)
    )
