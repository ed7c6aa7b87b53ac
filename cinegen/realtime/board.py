"""What a loop and those outside share: a flag that stops it, its record, the newest command and the newest state.

Nobody ever waits for anybody: of a command or a state only the newest counts.
"""

from __future__ import annotations

import multiprocessing.sharedctypes
import pickle
import struct
import threading
import zlib
from typing import Any, Protocol

from cinegen.errors import CinegenError
from cinegen.realtime.record import Record

LARGEST = 1 << 16
"""Bytes of a pickled command or state that another process can be told."""

_SLOTS = 4  # a reader has as many messages' time to copy one
_TRIES = 8
_HEAD = struct.Struct("=QII")  # number, length, checksum


class ClockError(CinegenError):
    """A clock that is used wrongly, or whose loop can't begin, end or be told something."""


class Board(Protocol):
    """One for a loop and whoever started it."""

    stopped: bool
    command: Any
    state: Any
    record: Record


class HereBoard:
    """Within one process: what is written is what is read, no copy."""

    def __init__(self, period: float) -> None:
        self.stopped = False
        self.command: Any = None
        self.state: Any = None
        self.record = Record(period)


class SharedBoard:
    """Between two processes, in shared memory: a copy is read, by pickle. Handed over as a process's argument.

    Args:
        period: s.
    """

    def __init__(self, period: float) -> None:
        context = multiprocessing.get_context("spawn")
        self._map(period, context.RawArray("B", 8 + Record.SIZE + 2 * Mailbox.SIZE))

    def _map(self, period: float, memory: Any) -> None:
        self._period, self._memory = period, memory
        whole = memoryview(memory).cast("B")
        self._flags = whole[:8]
        parts = [whole[8 : 8 + Record.SIZE]]
        parts += [whole[end : end + Mailbox.SIZE] for end in (8 + Record.SIZE, 8 + Record.SIZE + Mailbox.SIZE)]
        self.record = Record(period, parts[0])
        self._command, self._state = Mailbox(parts[1]), Mailbox(parts[2])

    def __getstate__(self) -> tuple[float, Any]:
        return self._period, self._memory

    def __setstate__(self, state: tuple[float, Any]) -> None:
        self._map(*state)

    @property
    def stopped(self) -> bool:
        """Whether the loop should end."""
        return bool(self._flags[0])

    @stopped.setter
    def stopped(self, stopped: bool) -> None:
        self._flags[0] = stopped

    @property
    def command(self) -> Any:
        """The newest; None if there is none yet."""
        return self._command.read()

    @command.setter
    def command(self, command: Any) -> None:
        self._command.write(command, "command")

    @property
    def state(self) -> Any:
        """The newest; None if there is none yet."""
        return self._state.read()

    @state.setter
    def state(self, state: Any) -> None:
        self._state.write(state, "state")


class Mailbox:
    """Holds the newest value: one process writes, another reads, neither waits.

    A value goes into the next of a few slots, so that a reader is not overtaken while it copies; where it is, or sees
    things in another order than they were written, the checksum tells, and it looks again.

    Args:
        memory: `SIZE` bytes, 0 at the beginning.
    """

    SIZE = 8 + _SLOTS * (_HEAD.size + LARGEST)

    def __init__(self, memory: memoryview[int]) -> None:
        self._newest = memory[:8].cast("Q")
        size = _HEAD.size + LARGEST
        self._slots = [memory[8 + i * size : 8 + (i + 1) * size] for i in range(_SLOTS)]
        self._read: tuple[int, Any] = (0, None)
        self._lock = threading.Lock()  # of this process's threads only

    def write(self, value: Any, what: str) -> None:
        """Puts a value in place of the one before.

        Raises:
            ClockError: it can't be pickled, or is larger than `LARGEST`.
        """
        try:
            message = pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
        except Exception as error:
            kind = type(value).__name__
            raise ClockError(f"a {what} for another process must be picklable, {kind} is not: {error}") from error
        if len(message) > LARGEST:
            raise ClockError(f"a {what} has {len(message)} bytes when pickled: send {LARGEST} at most, or parts of it")
        with self._lock:
            number = self._newest[0] + 1
            slot = self._slots[number % _SLOTS]
            slot[_HEAD.size : _HEAD.size + len(message)] = message
            _HEAD.pack_into(slot, 0, number, len(message), zlib.crc32(message, number & 0xFFFFFFFF))
            self._newest[0] = number

    def read(self) -> Any:
        """The newest value that could be read whole; the same object until there is a newer one."""
        for _ in range(_TRIES):
            newest = self._newest[0]
            number, value = self._read
            if newest == number:
                return value
            slot = self._slots[newest % _SLOTS]
            number, length, checksum = _HEAD.unpack_from(slot)
            message = bytes(slot[_HEAD.size : _HEAD.size + length])
            if number == newest and zlib.crc32(message, number & 0xFFFFFFFF) == checksum:
                self._read = number, pickle.loads(message)
                break
        return self._read[1]
