"""Decoder of the protocol of the Spaceball 1003, 2003, 3003 and 4000FLX: bytes in, events out.

A packet is a letter, binary data and a CR; ^Q, ^S, ^M and ^^ in the data stand for XON, XOFF, CR and ^ (facts as in
spacenavd). There is no checksum: damaged packets are found by their length, by counts out of range, and by jumps that
the following packet does not confirm.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence

from cinegen.devices.mouse_events import MouseEvent, MouseFault, MouseModel, MouseMotion, keys
from cinegen.sensor import Twist

RESET = b"\r@RESET\r"
"""Reset: the device sends its model after a second or two."""

START = b"\rCB\rMSSV\rk\r"
"""Start: binary packets, motion without a query, and the state of the keys, by which a 4000FLX is recognised."""

ASK_KEYS = b"k\r"
"""Query of the keys that are down. The device answers at once, so it also shows whether a device is connected."""

FULL = (8000.0, 8000.0, 8000.0, 1600.0, 1600.0, 1600.0)
"""Counts at full deflection, from the driver of the Linux kernel."""

LARGEST = 20480
"""Counts beyond which a packet is damaged; the author of VRPN's driver observed at most 20,000."""

JUMP = 0.125
"""Fraction of the full deflection by which two packets may differ without confirmation by a third."""

_ESCAPES = {ord("Q"): 0x11, ord("S"): 0x13, ord("M"): 0x0D, ord("^"): ord("^")}
_CR, _XON, _XOFF, _ESCAPE = 0x0D, 0x11, 0x13, ord("^")
_LONGEST = 128  # bytes of a packet that are kept: a longer packet is noise
_MODELS = {
    **dict.fromkeys((35, 62, 63), MouseModel("Spaceball 3003", 2)),
    **dict.fromkeys((43, 45), MouseModel("Spaceball 4000FLX", 12)),
    **dict.fromkeys((2, 13, 15, 42), MouseModel("Spaceball 2003", 8)),  # 42: also 4000FLX, known by its first '.'
}
UNKNOWN = MouseModel("Spaceball", 8)
"""Model of unknown firmware."""

_MOTION = struct.Struct(">H6h")  # time since the previous packet, 1/16 ms; x y z and the rotations about them
_POWER_ON = b"\n\v\0"  # bytes that may precede an answer


class Spaceball:
    """Decodes a stream of bytes in pieces of any length.

    Attributes:
        model: model, as far as it is known.
        damaged: number of packets that could not be used.
    """

    def __init__(self) -> None:
        self.model = UNKNOWN
        self.damaged = 0
        self._packet = bytearray()
        self._broken = False  # the packet has an unknown escape, or is too long
        self._escaped = False
        self._filter = JumpFilter()

    def feed(self, data: bytes) -> list[MouseEvent]:
        """Return the events that these bytes complete."""
        events: list[MouseEvent] = []
        for code in data:
            if code == _CR:
                self._broken |= self._escaped
                events += self._decode(bytes(self._packet.lstrip(_POWER_ON)))
                self._packet.clear()
                self._broken = self._escaped = False
            elif code in (_XON, _XOFF):
                pass  # flow control: those of the data are escaped
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

    def _decode(self, packet: bytes) -> list[MouseEvent]:
        if not packet:
            return []
        kind, body = packet[:1], packet[1:]
        if self._broken:
            self.damaged += 1
        elif kind == b"D" and len(body) == _MOTION.size:
            twist = self._filter.accept(_MOTION.unpack(body)[1:])
            if twist is not None:
                return [MouseMotion(twist)]
            self.damaged += 1
        elif kind == b"K" and len(body) == 2:
            if self.model.keys != 12:  # a 4000FLX also sends its keys by '.'
                return [keys(_bits(body) & (1 << self.model.keys) - 1)]
        elif kind == b"." and len(body) == 2:
            events: list[MouseEvent] = []
            if self.model.keys != 12:
                self.model = MouseModel("Spaceball 4000FLX", 12)
                events = [self.model]
            return [*events, keys(body[1] & 0x3F | (body[1] & 0x80) >> 1 | (body[0] & 0x1F) << 7)]
        elif kind == b"@" and body[:1].isdigit():
            return self._answer(body.decode("ascii", errors="replace"))
        elif kind == b"E":
            return [MouseFault(f"the Spaceball reports error {body.decode('ascii', errors='replace')}")]
        elif kind not in (b"M", b"C", b"?", b"F", b"N", b"P", b"Z", b"B"):  # answers to commands
            self.damaged += 1
        return []

    def _answer(self, text: str) -> list[MouseEvent]:
        version = re.search(r"Firmware version (\d+)\.(\d+)", text)
        if version is not None:
            known = int(version[1]) == 2 and _MODELS.get(int(version[2]))
            self.model = known or UNKNOWN
        elif not text.startswith("1"):
            return []
        else:
            self.model = UNKNOWN
        self._filter = JumpFilter()
        return [self.model]


def _bits(body: bytes) -> int:
    """Return bits of keys 1 to 4, or left and right of a 3003; then 5 to 7, and pick of a 2003."""
    return body[1] & 0x0F | body[1] >> 4 & 3 | (body[0] & 7) << 4 | (body[0] & 0x10) << 3


class JumpFilter:
    """Rejects counts that a user can't produce.

    A packet that is near the previous one, or all zeros, is used at once: zeros are safe, and sent only once. Any other
    waits for the next packet: if that is near it, or continues in the same direction, the motion was fast. If not, and
    the next packet is near the last that was used, the packet between was damaged.
    """

    def __init__(self) -> None:
        self._used: Twist = _scaled((0,) * 6)
        self._waiting: Twist | None = None

    def accept(self, counts: Sequence[int]) -> Twist | None:
        """Return the deflection of the counts in the axes of a `Twist`; None if they are not to be used."""
        if max(map(abs, counts)) > LARGEST:
            return None
        new, used, waiting = _scaled(counts), self._used, self._waiting
        if not any(counts) or _near(new, used) or (waiting is not None and _agrees(used, waiting, new)):
            self._used, self._waiting = new, None
            return _clipped(new)
        self._waiting = new
        return None


def _scaled(counts: Sequence[int]) -> Twist:
    """Convert the device's axes: x to the right, y up, z away from the user."""
    x, y, z, a, b, c = (count / full for count, full in zip(counts, FULL, strict=True))
    return x, z, y, a, c, b


def _clipped(twist: Twist) -> Twist:
    x, y, z, a, b, c = (min(1.0, max(-1.0, value)) for value in twist)
    return x, y, z, a, b, c


def _near(first: Twist, second: Twist) -> bool:
    return all(abs(a - b) <= JUMP for a, b in zip(first, second, strict=True))


def _agrees(used: Twist, waiting: Twist, new: Twist) -> bool:
    """Return whether, on each axis, the waiting packet is near the new one, or the jump continues in its direction."""
    return all(
        abs(n - w) <= JUMP or (abs(w - u) > JUMP and (n - w) * (w - u) > 0.0 and abs(n - w) <= JUMP + abs(w - u))
        for u, w, n in zip(used, waiting, new, strict=True)
    )
