"""`Recording`: a recorded mission, with the configurations of all robots at any time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self

import msgspec
import numpy as np
import pinocchio as pin
from msgspec import UNSET, UnsetType
from numpy.typing import NDArray

from cinegen.errors import CinegenError, ClosureError, UnknownNameError
from cinegen.mission.drawn_obstacle import DrawnObstacle
from cinegen.mission.file_format import (
    BasePose,
    MissionError,
    MissionHeader,
    Moment,
    RecordedRobot,
    RecordedTask,
    RobotSample,
    decode_header,
    decode_moment,
)
from cinegen.model import Mechanism
from cinegen.model.fingerprint import fingerprint
from cinegen.model.load import build

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """A recorded mission. A robot that a moment leaves out is as in the moment before; at first, at home without tasks.

    Attributes:
        path: path of the file.
        created: time, in ISO 8601.
        times: (count,) time of each moment since the first, s.
        q: configurations (count, nq) of each robot, rad and m, with the doubles that were written.
        tasks: tasks of each robot, (count).
        statuses: names of the statuses of each robot, (count).
        placements: poses of each obstacle in the world (m), (count).
        obstacles: obstacles by name.
    """

    path: Path
    created: str
    times: Array
    q: Mapping[str, Array]
    tasks: Mapping[str, list[tuple[RecordedTask, ...]]]
    statuses: Mapping[str, list[str]]
    placements: Mapping[str, list[pin.SE3]]
    obstacles: Mapping[str, DrawnObstacle]
    _described: Mapping[str, RecordedRobot]
    _built: dict[str, Mechanism] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<Recording of {', '.join(self.robots)}: {len(self.times)} moments in {self.seconds:.3f} s>"

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a file. A last line that was cut off by a crash is left out.

        Raises:
            MissionError: the file can't be read, is no mission, of another version or damaged; names the line.
        """
        path = Path(path)
        try:
            data = path.read_bytes()
        except OSError as error:
            raise MissionError(f"{path}: can't be read: {(error.strerror or str(error)).lower()}") from None
        first, *lines = data.split(b"\n")
        del data
        try:
            header = decode_header(first)
        except MissionError as error:
            raise MissionError(f"{path}: {error}") from None
        moments = _moments(path, lines, header)
        placements = {name: _placements(name, one, moments) for name, one in header.obstacles.items()}
        times = np.array([moment.t for moment in moments])
        self = cls(path, header.created, times, {}, {}, {}, placements, header.obstacles, header.robots)
        samples = {name: self._samples(name, moments) for name in header.robots}
        return replace(
            self,
            q={name: self._configurations(name, all_) for name, all_ in samples.items()},
            tasks={name: [_tasks(sample) for sample in all_] for name, all_ in samples.items()},
            statuses={name: [sample.status for sample in all_] for name, all_ in samples.items()},
        )

    def _samples(self, name: str, moments: list[Moment]) -> list[RobotSample]:
        """Return the samples of a robot, one for each moment."""
        samples: list[RobotSample] = []
        for moment in moments:
            sample, last = moment.robots.get(name), samples[-1] if samples else None
            if sample is None:
                sample = last or RobotSample(self.mechanism(name).q_home, "IDLE")
            elif last is not None and sample.tasks is UNSET:
                sample = msgspec.structs.replace(sample, tasks=last.tasks)
            samples.append(sample)
        return samples

    def _configurations(self, name: str, samples: list[RobotSample]) -> Array:
        q = np.array([sample.q for sample in samples]).reshape(len(samples), self._described[name].nq)
        q.flags.writeable = False
        return q

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots."""
        return tuple(self._described)

    @property
    def bases(self) -> dict[str, BasePose]:
        """Base pose of each robot."""
        return {name: robot.base for name, robot in self._described.items()}

    @property
    def seconds(self) -> float:
        """Time from the first moment to the last, s."""
        return float(self.times[-1]) if len(self.times) else 0.0

    def actuated(self, name: str) -> tuple[str, ...]:
        """Return the names of a robot's actuated joints.

        Raises:
            UnknownNameError: no such robot.
        """
        return self._robot(name).actuated

    def _robot(self, name: str) -> RecordedRobot:
        if name not in self._described:
            raise UnknownNameError("robot", name, self.robots)
        return self._described[name]

    def mechanism(self, name: str) -> Mechanism:
        """Build a robot from the first line, as it was recorded; once for all calls. Its meshes are only read when they
        are drawn.

        Raises:
            UnknownNameError: there is no such robot.
            MissionError: its description was changed since, or can't be built any more.
        """
        robot = self._robot(name)
        if name not in self._built:
            if fingerprint(robot.urdf, robot.constraints) != robot.hash:
                raise MissionError(f"{self.path}:1: the description of '{name}' was changed after it was recorded")
            try:
                mechanism = build(robot.urdf, robot.constraints, robot.folder, robot.source)
            except (CinegenError, LookupError, TypeError, ValueError) as error:
                raise MissionError(f"{self.path}:1: '{name}' can't be built: {error}") from None
            if mechanism.model.nq != robot.nq or mechanism.actuated != robot.actuated:
                raise MissionError(f"{self.path}:1: '{name}' is built differently today than when it was recorded")
            self._built[name] = mechanism
        return self._built[name]

    def index_at(self, time: float) -> int:
        """Return the index of the last moment not after a time (s); 0 if all are after it, or there is none."""
        return max(0, bisect_right(self.times, time) - 1)

    def at(self, time: float) -> dict[str, Array]:
        """Return the configurations at a time: between two moments interpolated, with closed loops.

        Args:
            time: time since the first moment, s; before it the first and after the last moment the last is returned.

        Returns:
            (nq,) for each robot; home if nothing was recorded.

        Raises:
            MissionError: see `mechanism`.
        """
        if not len(self.times):
            return {name: self.mechanism(name).q_home.copy() for name in self.robots}
        i, j, x = self._around(time)
        return {name: between(self.mechanism(name), q[i], q[j], x) for name, q in self.q.items()}

    def placements_at(self, time: float) -> dict[str, pin.SE3]:
        """Return the poses of all obstacles in the world at a time (s): between two moments interpolated."""
        if not len(self.times):
            return {name: obstacle.placement.copy() for name, obstacle in self.obstacles.items()}
        i, j, x = self._around(time)
        return {name: pin.SE3.Interpolate(poses[i], poses[j], x) for name, poses in self.placements.items()}

    def _around(self, time: float) -> tuple[int, int, float]:
        """Return the moments before and after a time, and the fraction of the time between them that has passed."""
        i = self.index_at(time)
        j = min(i + 1, len(self.times) - 1)
        x = (time - self.times[i]) / (self.times[j] - self.times[i]) if j > i else 0.0
        return i, j, float(min(1.0, max(0.0, x))) if x == x else 0.0


def _placements(name: str, obstacle: DrawnObstacle, moments: list[Moment]) -> list[pin.SE3]:
    """Return the pose of an obstacle at each moment."""
    found, last = [], obstacle.placement
    for moment in moments:
        last = moment.obstacles.get(name, last)
        found.append(last)
    return found


def _moments(path: Path, lines: list[bytes], header: MissionHeader) -> list[Moment]:
    moments: list[Moment] = []
    for number, line in enumerate(lines[:-1], 2):  # after the last line's end there is nothing, or a line that was cut
        if not line.strip():
            continue
        try:
            moment = decode_moment(line, header)
            if moments and moment.t <= moments[-1].t:
                raise MissionError("Expected a time after that of the line before - at `$.t`")
        except MissionError as error:
            raise MissionError(f"{path}:{number}: {error}") from None
        moments.append(moment)
    return moments


def _tasks(sample: RobotSample) -> tuple[RecordedTask, ...]:
    return () if isinstance(sample.tasks, UnsetType) else sample.tasks


def between(mechanism: Mechanism, first: Array, second: Array, x: float) -> Array:
    """Return the interpolation of two configurations that are near each other, with closed loops.

    Args:
        mechanism: mechanism of both.
        first: (nq,) configuration with closed loops.
        second: (nq,) configuration with closed loops.
        x: fraction of the path, 0 to 1.

    Returns:
        (nq,) configuration; the nearer of the two where the loops can't be closed between them.
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
