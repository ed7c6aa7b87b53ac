"""Decoder of the Magellan (SpaceMouse) protocol: bytes in, events out.

A packet is a letter, nibbles and a CR. A nibble is one character whose upper half follows from the lower so that the
number of bits is even ("Magellan/SPACE MOUSE Programmer's Manual", LogiCad3D, 2000): a character that is not one of the
sixteen is damaged, and its packet left out. Facts beyond the manual are those of spacenavd.
"""

from __future__ import annotations

from cinegen.devices.mouse_events import MouseEvent, MouseFault, MouseKeys, MouseModel, MouseMotion, keys
from cinegen.sensor import Twist

WHO = b"vQ\r"
"""Query of the model."""

START = b"m3\rc3B\r"
"""Start: motion of all six axes is sent without a query; extended keys."""

ASK_KEYS = b"kQ\r"
"""Query of the keys that are down. The device answers at once, so it also shows whether a device is connected."""

FULL = 400.0
"""Counts at full deflection. The maker's FAQ names 370 to 440, depending on the axis."""

_D, _K = ord("d"), ord("k")
_NIBBLES = {code: value for value, code in enumerate(b"0AB3D56GH9:K<MN?")}
_MODELS = {"MAGELLAN": ("Magellan SpaceMouse", 11), "SPACEBALL": ("Spaceball 5000", 12), "CadMan": ("CadMan", 4)}
_MOTION = 25  # the letter and six times four nibbles
_LONGEST = 256  # characters of a line that are kept: a longer line is noise
_KEPT = 64  # characters that are kept of a longer line


class Magellan:
    """Decodes a stream of bytes in pieces of any length.

    A packet is decoded whatever precedes it in its line: half a packet, noise, a packet whose CR was lost. A packet
    with one damaged byte (an odd number of bits flipped, a byte left out or put in) is never used.

    Attributes:
        damaged: number of lines that could not be used.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._line = b""
        self._whole = True  # whether the beginning of the line was kept
        self._key_nibbles: int | None = None
        self._other = False  # the previous packet of keys had another number of nibbles

    def feed(self, data: bytes) -> list[MouseEvent]:
        """Return the events that these bytes complete."""
        *ends, rest = data.split(b"\r")
        events: list[MouseEvent] = []
        for end in ends:
            self._append(end)
            if self._line:
                event = self._decode(self._line)
                if event is not None:
                    events.append(event)
            self._line, self._whole = b"", True
        self._append(rest)
        return events

    def _append(self, part: bytes) -> None:
        self._line += part
        if len(self._line) > _LONGEST:
            self._line, self._whole = self._line[-_KEPT:], False

    def _decode(self, line: bytes) -> MouseEvent | None:
        first = line[:1]
        answer = self._whole and first == b"v" and len(line) > 5
        motion = _motion(line)
        if motion is not None:
            return motion
        model = _model(line) if answer else None
        if model is not None:
            return model
        pressed = self._keys(line)
        if pressed is not None:
            return pressed
        if self._whole and first == b"e" and 2 <= len(line) <= 4:
            return _fault(line)
        echo = self._whole and first in (b"m", b"c", b"p", b"q", b"n", b"z", b"b", b"f", b"l") and len(line) <= 4
        if not (answer or echo):
            self.damaged += 1
        return None

    def _keys(self, line: bytes) -> MouseKeys | None:
        for count in (3, 4):
            start = len(line) - count - 1
            if start >= 0 and line[start] == _K:
                break
        else:
            return None
        values = [_NIBBLES.get(code) for code in line[start + 1 :]]
        if None in values or _torn(line[:start]):
            return None
        if self._key_nibbles not in (None, count) and not self._other:
            self._other = True  # a model always sends the same number: one is missing or was put in
            return None
        self._key_nibbles, self._other = count, False
        return keys(sum((value or 0) << 4 * i for i, value in enumerate(values)))


def _motion(line: bytes) -> MouseMotion | None:
    if len(line) < _MOTION or line[-_MOTION] != _D:
        return None
    counts = []
    for i in range(len(line) - _MOTION + 1, len(line), 4):
        count = 0
        for code in line[i : i + 4]:
            nibble = _NIBBLES.get(code)
            if nibble is None:
                return None
            count = count << 4 | nibble
        counts.append(count - 0x8000)
    return MouseMotion(_twist(counts))


def _twist(counts: list[int]) -> Twist:
    """Convert the device's axes: x to the right, y up, z towards the user."""
    x, y, z, a, b, c = (min(1.0, max(-1.0, count / FULL)) for count in counts)
    return x, -z + 0.0, y, a, -c + 0.0, b


def _torn(before: bytes) -> bool:
    """Return whether the k behind this belongs to a packet of motion: a damaged K (one bit differs), or put in."""
    nibbles = 0
    while nibbles < len(before) and before[-1 - nibbles] in _NIBBLES:
        nibbles += 1
    return nibbles < len(before) and before[-1 - nibbles] == _D and 19 <= nibbles <= 21


def _model(line: bytes) -> MouseModel | None:
    text = line[1:].decode("ascii", errors="replace")
    for word, (name, count) in _MODELS.items():
        if word in text:
            return MouseModel(name, count)
    return None


def _fault(line: bytes) -> MouseFault:
    what = {1: "an unknown command", 2: "a framing error"}.get(line[1] & 0xF, "an error")
    return MouseFault(f"the Magellan reports {what} ({line.decode('ascii', errors='replace')})")
