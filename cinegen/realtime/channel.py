"""Data shared by a loop and its caller: a stop flag, the timing record, the newest command and the newest state.

Neither side ever waits for the other: only the newest command and the newest state are kept.
"""

from __future__ import annotations

import multiprocessing.sharedctypes
import pickle
import struct
import threading
import zlib
from itertools import accumulate
from typing import Any, Protocol

from cinegen.errors import CinegenError
from cinegen.realtime.timing import TimingRecord

LARGEST = 1 << 16
"""Largest size of a pickled command or state that is sent to another process, bytes."""

_SLOTS = 4  # a reader has the time of this many messages to copy one
_TRIES = 8
_HEAD = struct.Struct("=QII")  # number, length, checksum


class ClockError(CinegenError):
    """A clock is used in a wrong way, or its loop can't start, end or receive data."""


class Channel(Protocol):
    """Data shared by a loop and its caller."""

    stopped: bool
    command: Any
    state: Any
    record: TimingRecord


class LocalChannel:
    """Channel within one process: the reader gets the very object that was written."""

    def __init__(self, period: float) -> None:
        self.stopped = False
        self.command: Any = None
        self.state: Any = None
        self.record = TimingRecord(period)


class SharedChannel:
    """Channel between two processes in shared memory: the reader gets a copy, by pickle. Pass it as an argument of the
    process.

    Args:
        period: period of the loop, s.
    """

    def __init__(self, period: float) -> None:
        context = multiprocessing.get_context("spawn")
        self._map(period, context.RawArray("B", 8 + TimingRecord.SIZE + 2 * Mailbox.SIZE))

    def _map(self, period: float, memory: Any) -> None:
        self._period, self._memory = period, memory
        whole = memoryview(memory).cast("B")
        sizes = 8, TimingRecord.SIZE, Mailbox.SIZE, Mailbox.SIZE
        parts = (whole[end - size : end] for size, end in zip(sizes, accumulate(sizes), strict=True))
        self._flags, record, command, state = parts
        self.record = TimingRecord(period, record)
        self._command, self._state = Mailbox(command), Mailbox(state)

    def __getstate__(self) -> tuple[float, Any]:
        return self._period, self._memory

    def __setstate__(self, state: tuple[float, Any]) -> None:
        self._map(*state)

    @property
    def stopped(self) -> bool:
        """True when the loop must end."""
        return bool(self._flags[0])

    @stopped.setter
    def stopped(self, stopped: bool) -> None:
        self._flags[0] = stopped

    @property
    def command(self) -> Any:
        """Newest value; None before the first."""
        return self._command.read()

    @command.setter
    def command(self, command: Any) -> None:
        self._command.write(command, "command")

    @property
    def state(self) -> Any:
        """Newest value; None before the first."""
        return self._state.read()

    @state.setter
    def state(self, state: Any) -> None:
        self._state.write(state, "state")


class Mailbox:
    """Newest value, written by one process and read by another without waiting.

    Values go into a few slots in turn, so that a reader is rarely overtaken while it copies. If it is, or if it sees
    writes in another order, the checksum is wrong and it reads again.

    Args:
        memory: `SIZE` bytes, initially 0.
    """

    SIZE = 8 + _SLOTS * (_HEAD.size + LARGEST)

    def __init__(self, memory: memoryview[int]) -> None:
        self._newest = memory[:8].cast("Q")
        size = _HEAD.size + LARGEST
        self._slots = [memory[8 + i * size : 8 + (i + 1) * size] for i in range(_SLOTS)]
        self._read: tuple[int, Any] = (0, None)
        self._lock = threading.Lock()  # of this process's threads only

    def write(self, value: Any, what: str) -> None:
        """Replace the value.

        Raises:
            ClockError: the value can't be pickled, or its pickle is larger than `LARGEST`.
        """
        try:
            message = pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
        except Exception as error:
            kind = type(value).__name__
            raise ClockError(f"a {what} for another process must be picklable, {kind} is not: {error}") from error
        if len(message) > LARGEST:
            raise ClockError(f"a {what} has {len(message)} bytes when pickled: at most {LARGEST} can be sent")
        with self._lock:
            number = self._newest[0] + 1
            slot = self._slots[number % _SLOTS]
            slot[_HEAD.size : _HEAD.size + len(message)] = message
            _HEAD.pack_into(slot, 0, number, len(message), zlib.crc32(message, number & 0xFFFFFFFF))
            self._newest[0] = number

    def read(self) -> Any:
        """Return the newest value that could be read completely; the same object until there is a newer one."""
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
