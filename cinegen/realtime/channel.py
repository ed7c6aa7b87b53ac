"""Data shared by a loop and its caller: a stop flag, the timing record, the newest command and the newest state.

Neither side ever waits for the other: only the newest command and the newest state are kept.
"""

from __future__ import annotations

import copyreg
import ctypes
import io
import multiprocessing
import pickle
import struct
import threading
import zlib
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from cinegen.errors import CinegenError
from cinegen.realtime.timing import TimingRecord

LARGEST = 1 << 16
"""Largest size of a pickled command or state that is sent to another process, bytes."""

_SLOTS = 4  # a reader has the time of this many messages to copy one
_TRIES = 8
_HEAD = struct.Struct("=QII")  # number, length, checksum


def _array_of(data: bytes, kind: str, shape: tuple[int, ...]) -> NDArray[Any]:
    return np.frombuffer(data, kind).reshape(shape).copy()


def _reduce(array: NDArray[Any]) -> Any:
    """Return what makes an array again, with numpy's own object for its type.

    Usual pickles make a new one for each array, and eigenpy 3.13, which converts arrays to Eigen's matrices, never
    frees the type of an array: each message with a `pin.SE3` would cost 129 bytes.
    """
    if array.dtype.kind not in "biufc":
        return array.__reduce_ex__(pickle.HIGHEST_PROTOCOL)
    return _array_of, (array.tobytes(), array.dtype.str, array.shape)


class _Pickler(pickle.Pickler):
    dispatch_table = copyreg.dispatch_table | {np.ndarray: _reduce}


class ClockError(CinegenError):
    """A clock is used wrongly, or its loop can't start, end or receive data."""


class LocalMailbox:
    """Newest value, within one process: the reader gets the very object that was written."""

    def __init__(self) -> None:
        self._value: Any = None

    def write(self, value: Any, what: str) -> None:
        """Replace the value."""
        self._value = value

    def read(self) -> Any:
        """Return the newest value; None before the first."""
        return self._value


class Mailbox:
    """Newest value, written by one process and read by another without waiting.

    Values go into a few slots in turn, so that a reader is rarely overtaken while it copies. If it is, or if it sees
    writes in another order, the checksum is wrong and it reads again.

    Args:
        memory: `SIZE` bytes, initially 0, that both processes share.
    """

    SIZE = 8 + _SLOTS * (_HEAD.size + LARGEST)

    def __init__(self, memory: Any) -> None:
        self._memory, view = memory, memoryview(memory).cast("B")
        self._newest = view[:8].cast("Q")
        size = _HEAD.size + LARGEST
        self._slots = [view[8 + i * size : 8 + (i + 1) * size] for i in range(_SLOTS)]
        self._read: tuple[int, Any] = (0, None)
        self._lock = threading.Lock()  # of this process's threads only

    def __reduce__(self) -> tuple[type[Mailbox], tuple[Any]]:
        return Mailbox, (self._memory,)

    def write(self, value: Any, what: str) -> None:
        """Replace the value.

        Raises:
            ClockError: the value can't be pickled, or its pickle is larger than `LARGEST`.
        """
        try:
            with io.BytesIO() as file:
                _Pickler(file, pickle.HIGHEST_PROTOCOL).dump(value)
                message = file.getvalue()
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


@dataclass(frozen=True)
class Channel:
    """Data shared by a loop and its caller. A shared one is passed as an argument of the loop's process.

    Attributes:
        record: timing of the loop.
        stopped: whether the loop must end.
        command: newest command.
        state: newest state.
    """

    record: TimingRecord
    stopped: ctypes.c_bool
    command: LocalMailbox | Mailbox
    state: LocalMailbox | Mailbox

    @classmethod
    def local(cls, period: float) -> Self:
        """Return a channel within one process, for a loop of a period (s)."""
        return cls(TimingRecord(period), ctypes.c_bool(), LocalMailbox(), LocalMailbox())

    @classmethod
    def shared(cls, period: float) -> Self:
        """Return a channel between two processes, for a loop of a period (s)."""
        context = multiprocessing.get_context("spawn")
        sizes = TimingRecord.SIZE, Mailbox.SIZE, Mailbox.SIZE
        record, command, state = (context.RawArray("B", size) for size in sizes)
        stopped = context.RawValue(ctypes.c_bool)
        return cls(TimingRecord(period, record), stopped, Mailbox(command), Mailbox(state))
