"""Writes a mission to a file while it goes on: a loop hands over what happened, a thread of its own writes it down.

The loop never waits for a disk. Whatever happens to the program, what was handed over more than 20 ms before is in the
file: each line is given to the system in one piece. Once a second all is brought to the disk itself.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import threading
import time as clock
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pinocchio as pin

from cinegen.mission.line import MissionError, Motion, Place, begins_a_mission, header, line, written
from cinegen.model import Mechanism
from raff2urdf.files import is_stream, open_stream, write_all

MOST = 10_000
"""Moments that wait to be written: more are lost."""

_POLL = 0.02  # s: so often the thread looks what there is; to be woken by the loop would hold that up
_SYNC = 1.0  # s: so often what was written is brought to the disk
_PATIENCE = 5.0  # s: how long closing waits for the disk
_FULL = (errno.ENOSPC, errno.EDQUOT)

_Moment = tuple[float, list[tuple[str, Motion]]]


class Recorder:
    """Records what robots do. `write` may stand in a loop of 1 kHz; nothing but the constructor raises.

    Args:
        path: of the file.
        mechanisms: the robots, by the names that `write` gives them.
        places: where they stand, by name; in the world unless said.
        overwrite: whether a mission that is there already may be lost. Another kind of file never is.

    Attributes:
        path: of the file.
        error: why it can write no more; None while it can.

    Raises:
        MissionError: the file can't be written, or is there already; or places name what there is not.
    """

    def __init__(
        self,
        path: str | Path,
        mechanisms: Mapping[str, Mechanism],
        places: Mapping[str, Place] | None = None,
        overwrite: bool = False,
    ) -> None:
        self.path = Path(path)
        self.error: str | None = None
        self._left_out = self._senseless = 0  # by the loop, and by the thread
        self._file = _begin(self.path, header(mechanisms, places or {}), overwrite)
        self._queue: deque[_Moment] = deque()  # whose ends are atomic in Python: there is no lock
        self._end = threading.Event()
        self._sizes = {name: mechanism.model.nq for name, mechanism in mechanisms.items()}
        self._before: dict[str, dict[str, Any]] = {}
        self._first: float | None = None
        self._last = -math.inf
        self._thread = threading.Thread(target=self._run, name=f"recorder {self.path.name}", daemon=True)
        self._thread.start()

    @property
    def seconds(self) -> float:
        """From the first moment to the last one that was taken, s."""
        return self._last - self._first if self._first is not None else 0.0

    @property
    def lost(self) -> int:
        """How many moments were left out: they were too many to wait, made no sense or were no later than the last."""
        return self._left_out + self._senseless

    def write(self, time: float, robots: Mapping[str, Motion]) -> None:
        """Takes a moment; does not raise, does not wait.

        Args:
            time: s, on any clock; later than the one before.
            robots: by name; one that is not named stays as it was. They may change after this.
        """
        if self.error is not None:
            return
        try:
            if not self._last < time < math.inf or len(self._queue) >= MOST:
                self._left_out += 1
                return
            moment = [(name, _kept(motion)) for name, motion in robots.items()]
            self._queue.append((time, moment))
            if self._first is None:
                self._first = time
            self._last = time
        except Exception:  # whatever it was given: the loop goes on
            self._left_out += 1

    def close(self, wait: bool = True) -> None:
        """Ends. May be called again.

        Args:
            wait: until all that was taken is on the disk, unless `error` says otherwise; 5 s at most. A loop does not,
                and closes again when it has ended.
        """
        self._end.set()
        if wait:
            self._thread.join(_PATIENCE)
            if self._thread.is_alive() and self.error in (None, "closed"):
                self.error = "the disk does not answer"
        self.error = self.error or "closed"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # --- in the thread -------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._write_all()
        except OSError as error:
            self.error = _reason(error)
        except Exception as error:
            self.error = f"{type(error).__name__}: {error}"
        self._queue.clear()
        with contextlib.suppress(OSError):
            os.fsync(self._file)
        with contextlib.suppress(OSError):
            os.close(self._file)

    def _write_all(self) -> None:
        begin, last = None, -1.0
        dirty, due, ends = False, clock.monotonic() + _SYNC, False
        while not ends:
            ends = self._end.wait(_POLL)
            while self._queue:
                time, robots = self._queue.popleft()
                since = round(time - begin, 9) if begin is not None else 0.0
                data = self._line(since, robots) if since > last else None
                if data is None:
                    self._senseless += 1
                    continue
                _put(self._file, data)
                begin, last, dirty = (time if begin is None else begin), since, True
            if dirty and clock.monotonic() >= due:
                _sync(self._file)
                dirty, due = False, clock.monotonic() + _SYNC

    def _line(self, time: float, robots: list[tuple[str, Motion]]) -> bytes | None:
        """What there is to write; None where the moment makes no sense."""
        parts, news = {}, {}
        try:
            for name, motion in robots:
                if len(motion.q) != self._sizes[name]:
                    raise ValueError("q of another robot")
                part = written(motion)
                before = self._before.get(name)
                if part == before and repr(part["q"]) == repr(before["q"]):  # -0.0 is not 0.0
                    continue
                news[name] = parts[name] = part
                if before is not None and part["tasks"] == before["tasks"]:
                    parts[name] = {key: value for key, value in part.items() if key != "tasks"}
            data = line(time, parts)
        except Exception:
            return None
        self._before |= news
        return data


def _kept(motion: Motion) -> Motion:
    """A copy of what its owner may change."""
    tasks = tuple([task._replace(target=_copied(task.target)) for task in motion.tasks])
    return Motion(motion.q.copy(), tasks, motion.status)


def _copied(target: pin.SE3 | None) -> pin.SE3 | None:
    """A task may have been set to anything."""
    return target.copy() if isinstance(target, pin.SE3) else None


def _begin(path: Path, first: bytes, overwrite: bool) -> int:
    """Opens a file that holds the first line; what was there before is only lost when that is written."""
    flags = os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0)
    try:
        if is_stream(path):  # a pipe, for example
            file = open_stream(path)
            try:
                _put(file, first)
            except OSError:
                os.close(file)
                raise
            return file
        _check_free(path, overwrite)
        write_all({path: first})
        return os.open(path, flags)
    except OSError as error:
        raise MissionError(f"{path}: can't be written: {_reason(error)}") from None


def _check_free(path: Path, overwrite: bool) -> None:
    if not path.exists() or path.stat().st_size == 0:
        return
    with path.open("rb") as file:
        is_mission = begins_a_mission(file.readline())
    if not is_mission:
        raise MissionError(f"{path}: is there already, and no mission: it is not overwritten")
    if not overwrite:
        raise MissionError(f"{path}: is a mission already; name another file, or remove it first")


def _put(file: int, data: bytes) -> None:
    """Writes all: mostly in one call, for a disk that gets full takes but a part."""
    while data:
        data = data[os.write(file, data) :]


def _sync(file: int) -> None:
    try:
        os.fsync(file)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # a pipe has no disk
            raise


def _reason(error: OSError) -> str:
    return "the disk is full" if error.errno in _FULL else (error.strerror or str(error)).lower()
