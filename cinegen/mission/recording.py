"""A mission that was recorded: where all robots were, and what held them, at any time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cinegen.errors import CinegenError, ClosureError, UnknownNameError
from cinegen.mission.line import Entry, LineError, MissionError, Motion, Place, RecordedTask, parse_header
from cinegen.mission.line import parse_line as parse
from cinegen.model import Mechanism
from cinegen.model.fingerprint import fingerprint
from cinegen.model.load import build

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Recording:
    """What was recorded. A robot that a moment does not name is as it was before; at first, at home and not held.

    Attributes:
        path: of the file.
        created: when, as in ISO 8601.
        times: (count,) s since the first moment.
        q: of each robot (count, nq), rad and m, as it was written, bit for bit.
        tasks: of each robot what held it, (count).
        statuses: of each robot the names of its statuses, (count).
        places: where each robot stands.
    """

    path: Path
    created: str
    times: Array
    q: Mapping[str, Array]
    tasks: Mapping[str, list[tuple[RecordedTask, ...]]]
    statuses: Mapping[str, list[str]]
    places: Mapping[str, Place]
    _entries: Mapping[str, Entry] = field(repr=False)
    _built: dict[str, Mechanism] = field(repr=False, default_factory=dict)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Reads a file. A last line that was cut by a crash is left out.

        Raises:
            MissionError: the file can't be read, is no mission, of another version or damaged; says in which line.
        """
        path = Path(path)
        try:
            data = path.read_bytes()
        except OSError as error:
            raise MissionError(f"{path}: can't be read: {(error.strerror or str(error)).lower()}") from None
        first, *lines = data.split(b"\n")
        del data
        try:
            created, entries = parse_header(first)
        except LineError as error:
            raise MissionError(f"{path}: {error}") from None
        moments = _moments(path, lines, {name: entry.nq for name, entry in entries.items()})
        self = cls(path, created, np.array([time for time, _ in moments]), {}, {}, {}, {}, entries)
        courses = {name: self._course(name, [robots.get(name) for _, robots in moments]) for name in entries}
        return replace(
            self,
            q={name: course[0] for name, course in courses.items()},
            tasks={name: course[1] for name, course in courses.items()},
            statuses={name: course[2] for name, course in courses.items()},
            places={name: entry.place for name, entry in entries.items()},
        )

    def _course(
        self, name: str, said: list[tuple[Motion, bool] | None]
    ) -> tuple[Array, list[tuple[RecordedTask, ...]], list[str]]:
        """A robot's q (count, nq), tasks and statuses, from what the moments say of it; None where they don't."""
        motions: list[Motion] = []
        for one in said:
            if one is None:
                motions.append(motions[-1] if motions else Motion(self.mechanism(name).q_home))
            else:
                motion, says_tasks = one
                motions.append(motion if says_tasks or not motions else motion._replace(tasks=motions[-1].tasks))
        q = np.array([motion.q for motion in motions]).reshape(len(motions), self._entries[name].nq)
        q.flags.writeable = False
        return q, [tuple(motion.tasks) for motion in motions], [motion.status for motion in motions]

    @property
    def robots(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self._entries)

    @property
    def seconds(self) -> float:
        """From the first moment to the last, s."""
        return float(self.times[-1]) if len(self.times) else 0.0

    def actuated(self, name: str) -> tuple[str, ...]:
        """Names of a robot's joints with a motor.

        Raises:
            UnknownNameError: no such robot.
        """
        return self._entry(name).actuated

    def _entry(self, name: str) -> Entry:
        if name not in self._entries:
            raise UnknownNameError("robot", name, self.robots)
        return self._entries[name]

    def mechanism(self, name: str) -> Mechanism:
        """A robot as it was when it was recorded, built from the first line; once for all calls. Its meshes are looked
        for only when they are shown.

        Raises:
            UnknownNameError: no such robot.
            MissionError: its description was changed since, or can't be built any more.
        """
        entry = self._entry(name)
        if name not in self._built:
            if fingerprint(entry.urdf, entry.constraints) != entry.hash:
                raise MissionError(f"{self.path}:1: the description of '{name}' was changed after it was recorded")
            try:
                constraints = None if entry.constraints is None else dict(entry.constraints)
                mechanism = build(entry.urdf, constraints, entry.folder, entry.source)
            except (CinegenError, LookupError, TypeError, ValueError) as error:
                raise MissionError(f"{self.path}:1: '{name}' can't be built: {error}") from None
            if mechanism.model.nq != entry.nq or mechanism.actuated != entry.actuated:
                raise MissionError(f"{self.path}:1: '{name}' is built otherwise today than when it was recorded")
            self._built[name] = mechanism
        return self._built[name]

    def index_at(self, time: float) -> int:
        """Which moment is the last that is not after a time (s); the first one where all are. 0 where there is none."""
        return max(0, bisect_right(self.times, time) - 1)

    def at(self, time: float) -> dict[str, Array]:
        """Where all robots are at a time, between two moments too: on the shortest way, loops closed.

        Args:
            time: s since the first moment; before it and after the last, all stand.

        Returns:
            (nq,) for each robot; home where nothing was recorded.

        Raises:
            MissionError: see `mechanism`.
        """
        if not len(self.times):
            return {name: self.mechanism(name).q_home.copy() for name in self.robots}
        i = self.index_at(time)
        j = min(i + 1, len(self.times) - 1)
        x = (time - self.times[i]) / (self.times[j] - self.times[i]) if j > i else 0.0
        x = min(1.0, max(0.0, x)) if x == x else 0.0
        return {name: between(self.mechanism(name), q[i], q[j], float(x)) for name, q in self.q.items()}


def _moments(
    path: Path, lines: list[bytes], sizes: Mapping[str, int]
) -> list[tuple[float, dict[str, tuple[Motion, bool]]]]:
    moments: list[tuple[float, dict[str, tuple[Motion, bool]]]] = []
    for number, data in enumerate(lines[:-1], 2):  # behind the last line's end there is nothing, or a line that was cut
        if not data.strip():
            continue
        try:
            moment = parse(data, sizes)
            if moments and moment[0] <= moments[-1][0]:
                raise LineError("its time is not after that of the line before")
        except LineError as error:
            raise MissionError(f"{path}:{number}: {error}") from None
        moments.append(moment)
    return moments


def between(mechanism: Mechanism, first: Array, second: Array, x: float) -> Array:
    """(nq,) on the shortest way between two configurations that are near each other, loops closed.

    Args:
        mechanism: which.
        first: (nq,) loops closed.
        second: (nq,) loops closed.
        x: part of the way, 0 to 1. Where loops can't be closed on that way, the nearer end is given.
    """
    nearer = first if x < 0.5 else second
    if x in (0.0, 1.0) or not mechanism.model.nv or np.array_equal(first, second):
        return nearer.copy()
    q = mechanism.interpolate(first, second, x)
    if not mechanism.loops:
        return q
    try:
        closed = mechanism.close(q)
    except ClosureError:
        return nearer.copy()
    return closed if mechanism.distance(q, closed) <= mechanism.distance(first, second) else nearer.copy()
