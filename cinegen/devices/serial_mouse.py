"""A 3D mouse on a serial port, or on whatever else pyserial opens: a Magellan (SpaceMouse) or a Spaceball."""

from __future__ import annotations

import contextlib
import time
from typing import Any, NamedTuple

import serial

from cinegen.devices import magellan, spaceball
from cinegen.devices.feed import Feed, LostError, RefusedError
from cinegen.devices.magellan import Magellan
from cinegen.devices.mouse_events import Event, Fault, Keys, Model, Motion
from cinegen.devices.spaceball import Spaceball

_POLL = 0.05  # s that a read waits at most
_QUIET = 2.0  # s without a byte, after which it is asked whether it is still there
_AT_ONCE = 4096  # bytes


class _Mouse(NamedTuple):
    """One that has answered: how it is understood, started, and asked whether it is there."""

    decoder: Magellan | Spaceball
    model: Model
    start: bytes
    question: bytes


class SerialMouse(Feed):
    """Opens the port, finds out which kind answers, and starts it; again whenever it is lost.

    A device that is pulled off its cable says nothing, and neither does one that is let go. So one that is quiet is
    asked for its keys now and then: without an answer it is lost, and asked who it is again, since one that was plugged
    in anew sends nothing by itself.

    Args:
        url: a port (`/dev/ttyUSB0`, `COM3`) or a URL of pyserial (`socket://host:port`, `rfc2217://host:port`).
        patience: s that a device takes to wake and to answer, at most: real ones need 2.
    """

    def __init__(self, url: str, patience: float = 2.0) -> None:
        super().__init__(url)
        self._patience = patience

    def serve(self) -> None:
        """Opens the port, finds out which kind it is, and hands on what that says.

        Raises:
            LostError: the device is gone.
            RefusedError: no 3D mouse answers.
            serial.SerialException: there is no such port, or it is gone.
        """
        port = serial.serial_for_url(self.url, baudrate=9600, timeout=_POLL, write_timeout=1.0, exclusive=True)
        try:
            found = self._magellan(port) or self._spaceball(port)
            if found is None:
                raise RefusedError(f"{self.url}: no 3D mouse answers, neither a Magellan nor a Spaceball")
            self._listen(port, found)
        finally:
            with contextlib.suppress(Exception):  # closing a port that is gone may raise anything
                port.close()

    # --- who it is -----------------------------------------------------------------------------------------------

    def _magellan(self, port: Any) -> _Mouse | None:
        _set(port, stopbits=serial.STOPBITS_TWO, rtscts=True, xonxoff=False)
        decoder = Magellan()
        for _ in range(2):  # the first question may follow noise, without a CR between
            _write(port, magellan.WHO)
            model = self._who(port, decoder, 0.2 * self._patience)
            if model is not None:
                return _Mouse(decoder, model, magellan.START + magellan.ASK_KEYS, magellan.ASK_KEYS)
        return None

    def _spaceball(self, port: Any) -> _Mouse | None:
        _set(port, stopbits=serial.STOPBITS_ONE, rtscts=False, xonxoff=True)
        decoder = Spaceball()
        if self.wait(0.5 * self._patience):  # some take a second to wake
            return None
        _write(port, spaceball.RESET)
        model = self._who(port, decoder, self._patience)
        if model is None:
            return None
        if model == spaceball.UNKNOWN:  # its firmware is said after its name
            model = self._who(port, decoder, 0.25 * self._patience) or model
        return _Mouse(decoder, model, spaceball.START, spaceball.ASK_KEYS)

    def _who(self, port: Any, decoder: Magellan | Spaceball, seconds: float) -> Model | None:
        end = time.monotonic() + seconds
        while time.monotonic() < end and not self.ending:
            models = [event for event in decoder.feed(_read(port)) if isinstance(event, Model)]
            if models:
                return models[-1]
        return None

    # --- what it says --------------------------------------------------------------------------------------------

    def _listen(self, port: Any, mouse: _Mouse) -> None:
        _write(port, mouse.start)
        self._introduce(mouse.model)
        before = self.damaged
        heard = asked = time.monotonic()  # the question came with the start
        answers, waiting = False, True  # whether it answers it at all; whether an answer is due
        while not self.ending:
            data = _read(port)
            now = time.monotonic()
            if data:
                heard = now
                for event in mouse.decoder.feed(data):
                    self._take(event, port, mouse)
                    if isinstance(event, Keys):
                        answers, waiting = answers or waiting, False
                self.damaged = before + mouse.decoder.damaged
            elif waiting and now - max(asked, heard) > self._patience:
                if answers:
                    raise LostError("answers no more: is it plugged in?")
                waiting, heard = False, now
            elif not waiting and now - heard > min(_QUIET, self._patience):
                _write(port, mouse.question)
                waiting, asked = True, now

    def _take(self, event: Event, port: Any, mouse: _Mouse) -> None:
        if isinstance(event, Motion):
            self.newest.put(twist=event.twist)
        elif isinstance(event, Keys):
            self.newest.press(event.down)
        elif isinstance(event, Model):
            self._introduce(event)
            _write(port, mouse.start)  # one that was plugged in anew says who it is, and waits
        elif isinstance(event, Fault):
            self.live(event.words)

    def _introduce(self, model: Model) -> None:
        self.live(f"a {model.name} with {model.keys} buttons on {self.url}")


def _set(port: Any, **settings: Any) -> None:
    """Line settings; a URL has none, and some adaptors not all."""
    for name, value in settings.items():
        with contextlib.suppress(ValueError, NotImplementedError):
            setattr(port, name, value)
    with contextlib.suppress(Exception):
        port.reset_input_buffer()


def _read(port: Any) -> bytes:
    """What there is, or what comes within a moment."""
    first: bytes = port.read(1)
    if not first:
        return first
    return first + bytes(port.read(min(_AT_ONCE, waiting)) if (waiting := port.in_waiting) else b"")


def _write(port: Any, data: bytes) -> None:
    with contextlib.suppress(serial.SerialTimeoutException):  # it holds the line: whether it answers, tells
        port.write(data)
