"""A Magellan (SpaceMouse) or Spaceball on a serial port, or on another URL that pyserial opens."""

from __future__ import annotations

import contextlib
import re
import time
from typing import Any, NamedTuple

import serial

from cinegen.devices import magellan, spaceball
from cinegen.devices.magellan import Magellan
from cinegen.devices.mouse_events import MouseEvent, MouseFault, MouseKeys, MouseModel, MouseMotion
from cinegen.devices.spaceball import Spaceball
from cinegen.devices.threaded_sensor import DeviceLostError, ThreadedSensor, WrongDeviceError
from raff2urdf.errors import raised_as

_POLL = 0.05  # s, longest wait of a read
_QUIET = 2.0  # s without a byte, after which the device is queried
_AT_ONCE = 4096  # bytes read at once


class _Mouse(NamedTuple):
    """Device that has answered, with its decoder, start sequence and query."""

    decoder: Magellan | Spaceball
    model: MouseModel
    start: bytes
    question: bytes


class SerialMouse(ThreadedSensor):
    """Sensor that opens the port, identifies the device, and starts it; again whenever it is lost.

    Neither an unplugged device nor one at rest sends anything. So a silent device is queried for its keys from time to
    time: without an answer it is lost, and identified again, since a device that is plugged in again sends nothing by
    itself.

    Args:
        url: port (`/dev/ttyUSB0`, `COM3`) or URL of pyserial (`socket://host:port`, `rfc2217://host:port`).
        patience: longest time that a device takes to wake and to answer, s: real devices need 2.
    """

    def __init__(self, url: str, patience: float = 2.0) -> None:
        super().__init__(url)
        self._patience = patience

    def serve(self) -> None:
        """Open the port, identify the device, and pass on its readings.

        Raises:
            DeviceLostError: the device is gone, or the URL is malformed.
            WrongDeviceError: no 3D mouse answers.
            serial.SerialException: there is no such port, or it is gone.
        """
        with raised_as(DeviceLostError, (ValueError, re.error)):  # the text behind hwgrep:// may be no expression
            port = serial.serial_for_url(self.url, baudrate=9600, timeout=_POLL, write_timeout=1.0, exclusive=True)
        try:
            mouse = self._magellan(port) or self._spaceball(port)
            if mouse is None:
                raise WrongDeviceError(f"{self.url}: no 3D mouse answers, neither a Magellan nor a Spaceball")
            self._listen(port, mouse)
        finally:
            with contextlib.suppress(Exception):  # closing a lost port may raise anything
                port.close()

    # --- identification -----------------------------------------------------------------------------------------------

    def _magellan(self, port: Any) -> _Mouse | None:
        _set(port, stopbits=serial.STOPBITS_TWO, rtscts=True, xonxoff=False)
        decoder = Magellan()
        for _ in range(2):  # the first query may follow noise without a CR
            _write(port, magellan.WHO)
            model = self._who(port, decoder, 0.2 * self._patience)
            if model is not None:
                return _Mouse(decoder, model, magellan.START + magellan.ASK_KEYS, magellan.ASK_KEYS)
        return None

    def _spaceball(self, port: Any) -> _Mouse | None:
        _set(port, stopbits=serial.STOPBITS_ONE, rtscts=False, xonxoff=True)
        decoder = Spaceball()
        if self.wait(0.5 * self._patience):  # some devices take a second to wake
            return None
        _write(port, spaceball.RESET)
        model = self._who(port, decoder, self._patience)
        if model is None:
            return None
        if model == spaceball.UNKNOWN:  # its firmware is sent after its name
            model = self._who(port, decoder, 0.25 * self._patience) or model
        return _Mouse(decoder, model, spaceball.START, spaceball.ASK_KEYS)

    def _who(self, port: Any, decoder: Magellan | Spaceball, seconds: float) -> MouseModel | None:
        end = time.monotonic() + seconds
        while time.monotonic() < end and not self.ending:
            models = [event for event in decoder.feed(_read(port)) if isinstance(event, MouseModel)]
            if models:
                return models[-1]
        return None

    # --- readings --------------------------------------------------------------------------------------------

    def _listen(self, port: Any, mouse: _Mouse) -> None:
        _write(port, mouse.start)
        self._introduce(mouse.model)
        before = self.damaged
        heard = asked = time.monotonic()  # the start sequence contains the query
        answers, waiting = False, True  # whether the device answers queries; whether an answer is due
        while not self.ending:
            data = _read(port)
            now = time.monotonic()
            if data:
                heard = now
                for event in mouse.decoder.feed(data):
                    self._take(event, port, mouse)
                    if isinstance(event, MouseKeys):
                        answers, waiting = answers or waiting, False
                self.damaged = before + mouse.decoder.damaged
            elif waiting and now - max(asked, heard) > self._patience:
                if answers:
                    raise DeviceLostError("no longer answers: is it plugged in?")
                waiting, heard = False, now
            elif not waiting and now - heard > min(_QUIET, self._patience):
                _write(port, mouse.question)
                waiting, asked = True, now

    def _take(self, event: MouseEvent, port: Any, mouse: _Mouse) -> None:
        if isinstance(event, MouseMotion):
            self.newest.put(twist=event.twist)
        elif isinstance(event, MouseKeys):
            self.newest.press(event.down)
        elif isinstance(event, MouseModel):
            self._introduce(event)
            _write(port, mouse.start)  # a device that was plugged in again sends its model and waits
        elif isinstance(event, MouseFault):
            self.live(event.message)

    def _introduce(self, model: MouseModel) -> None:
        self.live(f"a {model.name} with {model.keys} buttons on {self.url}")


def _set(port: Any, **settings: Any) -> None:
    """Set line settings; a URL has none, and some adaptors support not all."""
    for name, value in settings.items():
        with contextlib.suppress(ValueError, NotImplementedError):
            setattr(port, name, value)
    with contextlib.suppress(Exception):
        port.reset_input_buffer()


def _read(port: Any) -> bytes:
    """Return the bytes that are there, or the first that come."""
    first: bytes = port.read(1)
    if not first:
        return first
    return first + bytes(port.read(min(_AT_ONCE, waiting)) if (waiting := port.in_waiting) else b"")


def _write(port: Any, data: bytes) -> None:
    with contextlib.suppress(serial.SerialTimeoutException):  # the device blocks the line: the missing answer shows it
        port.write(data)
