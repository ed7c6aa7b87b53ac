"""Devices that are played: a pseudo-terminal with a thread behind it that answers as a Magellan or a Spaceball does."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import threading
import time
import tty
from pathlib import Path

from mouse_streams import magellan_keys, magellan_motion, spaceball_motion


class Device:
    """On a pseudo-terminal whose name a link at `path` leads to, as a port's name stays when it is plugged in anew.

    A kind of device answers questions (`answer`), and sends counts of its axes (`move`).
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.heard = b""
        self.deaf = False
        self.started = threading.Event()
        self._thread: threading.Thread | None = None

    def plug(self) -> Device:
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self._slave_name = os.ttyname(slave)
        os.close(slave)
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()
        self.path.symlink_to(self._slave_name)
        self._out = False
        self.started.clear()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()
        return self

    def unplug(self) -> None:
        self._out = True
        if self._thread is not None:
            self._thread.join()
            self._thread = None
            os.close(self._master)
            self.path.unlink()

    def send(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            os.write(self._master, data)

    def _listen(self) -> None:
        waiting = b""
        while not self._out:
            if not select.select([self._master], [], [], 0.01)[0]:
                continue
            try:
                data = os.read(self._master, 256)
            except OSError:  # nobody has it open at the moment
                time.sleep(0.01)
                continue
            self.heard += data
            *asked, waiting = (waiting + data).split(b"\r")
            for question in asked:
                if not self.deaf:
                    self.answer(question)


class PlayedMagellan(Device):
    keys = 0

    def answer(self, question: bytes) -> None:
        if question == b"vQ":
            self.send(b"vMAGELLAN  Version 6.60  by LOGITECH INC. 10/10/02\r")
        elif question == b"kQ":
            self.send(magellan_keys(self.keys))
        elif question in (b"m3", b"c3B"):
            self.send(question + b"\r")
            self.started.set()
        elif question:
            self.send(b"eA00\r")

    def press(self, keys: int) -> None:
        self.keys = keys
        self.send(magellan_keys(keys))

    def move(self, counts: tuple[int, ...]) -> None:
        self.send(magellan_motion(counts))


class PlayedSpaceball(Device):
    def answer(self, question: bytes) -> None:
        if question == b"@RESET":
            self.send(b"\r@1 Spaceball alive and well after a software reset.\r")
            self.send(b"@2 Firmware version 2.42 created on 29-Jan-1992.\r")
        elif question == b"MSSV":
            self.send(b"MSSV\r")
            self.started.set()
        elif question == b"k":
            self.send(b"K\x40\x00\r")
        elif question not in (b"", b"CB"):
            self.send(b"?\r")

    def move(self, counts: tuple[int, ...]) -> None:
        self.send(spaceball_motion(counts))
