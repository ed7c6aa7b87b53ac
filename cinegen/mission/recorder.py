"""Write a mission to a file while it is recorded: a control loop hands over samples, a thread writes them.

The loop never waits for the disk. If the program is killed, the file holds all samples that were handed over more than
20 ms before: each line is one call of the system. The file is synchronised with the disk once a second.
"""

from __future__ import annotations

import math
import threading
import time as clock
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Self

import msgspec
import numpy as np
import pinocchio as pin
from msgspec import UNSET, UnsetType
from msgspec.structs import replace

from cinegen.line_file import LineFile, reason
from cinegen.mission.drawn_obstacle import DrawnObstacle
from cinegen.mission.file_format import (
    KEPT,
    BasePose,
    MissionError,
    RecordedTask,
    RobotSample,
    encode_header,
    is_mission,
)
from cinegen.model import Mechanism
from cinegen.typed_json import encode
from raff2urdf.files import is_stream

MOST = 10_000
"""Moments that may wait to be written; further ones are lost."""

_Samples = list[tuple[str, RobotSample]]
_Poses = list[tuple[str, pin.SE3]]

_POLL = 0.02  # s between two looks of the thread at the queue; waking it would delay the control loop
_SYNC = 1.0  # s between two synchronisations with the disk
_PATIENCE = 5.0  # s that `close` waits for the disk


class MissionRecorder:
    """Record the motion of robots. `write` may be called in a loop of 1 kHz; only the constructor raises.

    Args:
        path: path of the file.
        mechanisms: robots, by the names that `write` uses.
        bases: base poses of those that are not fixed in the origin, by name.
        obstacles: obstacles by name.
        overwrite: whether an existing file is replaced, when the first line is on the disk.

    Attributes:
        path: path of the file.
        error: reason why nothing more can be written; None while it can.

    Raises:
        MissionError: the file can't be written or exists, or a base pose names a robot or node that is not recorded.
    """

    def __init__(
        self,
        path: str | Path,
        mechanisms: Mapping[str, Mechanism],
        bases: Mapping[str, BasePose] | None = None,
        overwrite: bool = False,
        obstacles: Mapping[str, DrawnObstacle] | None = None,
    ) -> None:
        self.path = Path(path)
        self.error: str | None = None
        self._refused = self._invalid = 0  # moments lost in `write`, and in the thread
        header = encode_header(mechanisms, bases or {}, obstacles or {})
        if not overwrite:
            _check_free(self.path)
        self._file = LineFile(self.path, header, MissionError)
        self._queue: deque[tuple[float, _Samples, _Poses]] = deque()  # its ends are atomic: no lock
        self._end = threading.Event()
        self._sizes = {name: mechanism.model.nq for name, mechanism in mechanisms.items()}
        self._written: dict[str, tuple[bytes, dict[str, bytes]]] = {}  # last sample of each robot, and its tasks
        self._poses = {name: encode(obstacle.placement) for name, obstacle in (obstacles or {}).items()}  # the last
        self._first: float | None = None
        self._last = -math.inf
        self._thread = threading.Thread(target=self._run, name=f"recorder {self.path.name}", daemon=True)
        self._thread.start()

    @property
    def seconds(self) -> float:
        """Time from the first moment to the last, s."""
        return self._last - self._first if self._first is not None else 0.0

    @property
    def lost(self) -> int:
        """Number of lost moments: the queue was full, a value was not valid, or the time was not after the last."""
        return self._refused + self._invalid

    def write(
        self, time: float, robots: Mapping[str, RobotSample], obstacles: Mapping[str, pin.SE3] | None = None
    ) -> None:
        """Queue a moment. Neither raises nor waits.

        Args:
            time: time on any clock, s; after that of the moment before.
            robots: samples by name, which are copied; a robot that is not named stays as it was.
            obstacles: poses of obstacles in the world (m), likewise.
        """
        if self.error is not None:
            return
        try:
            if not self._last < time < math.inf or len(self._queue) >= MOST:
                self._refused += 1
                return
            samples = [(name, _copied(sample)) for name, sample in robots.items()]
            poses = [(name, pose.copy()) for name, pose in (obstacles or {}).items()]
            self._queue.append((time, samples, poses))
            if self._first is None:
                self._first = time
            self._last = time
        except Exception:  # any invalid value: the control loop goes on
            self._refused += 1

    @property
    def finished(self) -> bool:
        """True when all moments are on the disk, or will never be."""
        return not self._thread.is_alive()

    def close(self, wait: bool = True) -> None:
        """End the recording. May be called again.

        Args:
            wait: wait until all moments are on the disk, at most 5 s. A control loop passes False, and its owner closes
                again when the loop has ended.
        """
        self._end.set()
        if wait:
            self._thread.join(_PATIENCE)
            if self._thread.is_alive() and self.error in (None, "closed"):
                self.error = "the disk does not answer"
        self.error = self.error or "closed"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # --- in the thread -------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._write_all()
        except OSError as error:
            self.error = reason(error)
        except Exception as error:
            self.error = f"{type(error).__name__}: {error}"
        self._queue.clear()
        self._file.close()

    def _write_all(self) -> None:
        begin, last = None, -1.0
        dirty, due, ends = False, clock.monotonic() + _SYNC, False
        while not ends:
            ends = self._end.wait(_POLL)
            while self._queue:
                time, *moment = self._queue.popleft()
                since = round(time - begin, 9) if begin is not None else 0.0
                data = self._line(since, *moment) if since > last else None
                if data is None:
                    self._invalid += 1
                    continue
                self._file.append(data)
                begin, last, dirty = (time if begin is None else begin), since, True
            if dirty and clock.monotonic() >= due:
                self._file.synchronize()
                dirty, due = False, clock.monotonic() + _SYNC

    def _line(self, time: float, robots: _Samples, obstacles: _Poses) -> bytes | None:
        """Return the line of a moment: what differs from the one before. None if the moment is not valid."""
        parts, written = {}, {}
        try:
            for name, sample in robots:
                sample = _checked(sample, self._sizes[name])
                motion, before = encode(replace(sample, tasks=UNSET, described=UNSET)), self._written.get(name)
                last = {"described": b"[]"} if before is None else before[1]
                kept = {kind: getattr(sample, kind) for kind in KEPT}
                tasks = last | {kind: encode(value) for kind, value in kept.items() if value is not UNSET}
                if before == (motion, tasks):  # compared as text: -0.0 is not 0.0
                    continue
                written[name] = motion, tasks
                same = {kind: UNSET for kind, value in tasks.items() if value == last.get(kind)}
                parts[name] = msgspec.Raw(encode(replace(sample, **same)))
            poses = {name: encode(_finite(pose)) for name, pose in obstacles}
            moved = {name: msgspec.Raw(pose) for name, pose in poses.items() if self._poses[name] != pose}
            line = encode({"t": time, "robots": parts} | ({"obstacles": moved} if moved else {})) + b"\n"
        except Exception:
            return None
        self._written |= written
        self._poses |= poses
        return line


def _copied(sample: RobotSample) -> RobotSample:
    """Return a copy of what its owner may change."""
    tasks = sample.tasks
    if not isinstance(tasks, UnsetType):
        tasks = tuple([replace(task, target=_copied_pose(task.target)) for task in tasks])
    return RobotSample(sample.q.copy(), sample.status, tasks, sample.described)


def _finite(pose: pin.SE3) -> pin.SE3:
    if not np.isfinite(pose.homogeneous).all():
        raise ValueError("pose")
    return pose


def _copied_pose(target: pin.SE3 | None) -> pin.SE3 | None:
    return target.copy() if isinstance(target, pin.SE3) else None


def _checked(sample: RobotSample, nq: int) -> RobotSample:
    """Return a sample that can be written: with numbers that are finite, and without targets that are not.

    Raises:
        ValueError: q has another length, or a number is not finite.
    """
    q = np.array(sample.q, dtype=float)
    if q.shape != (nq,) or not np.isfinite(q).all():
        raise ValueError("q")
    if isinstance(sample.tasks, UnsetType):
        return RobotSample(q, str(sample.status), UNSET, sample.described)
    tasks = []
    for task in sample.tasks:
        if not math.isfinite(task.weight):
            raise ValueError("weight")
        target = task.target if task.target is not None and np.isfinite(task.target.homogeneous).all() else None
        numbers = int(task.translation), int(task.rotation), float(task.weight), int(task.priority)
        tasks.append(RecordedTask(str(task.node), str(task.source), task.offset, target, *numbers))
    return RobotSample(q, str(sample.status), tuple(tasks), sample.described)


def _check_free(path: Path) -> None:
    try:
        if is_stream(path) or not path.exists() or path.stat().st_size == 0:
            return
        with path.open("rb") as file:
            mission = is_mission(file.readline())
    except OSError as error:
        raise MissionError(f"{path}: can't be written: {reason(error)}") from None
    kind = "a mission" if mission else "not a mission"
    raise MissionError(f"{path}: exists, and is {kind}: name another file, or remove it first")
