"""`Recording`: a recorded mission, with the configurations of all robots at any time."""

from __future__ import annotations

from bisect import bisect_right
from pathlib import Path
from typing import Self

import numpy as np
import pinocchio as pin
from msgspec import UnsetType

from cinegen.arrays import Array
from cinegen.errors import CinegenError, ClosureError, UnknownNameError
from cinegen.ik.tasks.described import AnyDescription
from cinegen.line_file import read_lines
from cinegen.mission.file_format import (
    BasePose,
    MissionError,
    MissionHeader,
    Moment,
    RecordedTask,
    RobotSample,
    decode_header,
    decode_moment,
)
from cinegen.model import Mechanism
from cinegen.model.build import build
from cinegen.model.fingerprint import fingerprint


class Recording:
    """A recorded mission. A robot that a moment leaves out is as in the moment before; at first, at home without tasks.

    Attributes:
        path: path of the file.
        created: time, in ISO 8601.
        times: (count,) time of each moment since the first, s.
        q: configurations (count, nq) of each robot, rad and m, with the doubles that were written.
        tasks: tasks of each robot, (count).
        described: tasks of each robot of other kinds than frames, (count).
        statuses: names of the statuses of each robot, (count).
        placements: poses of each obstacle in the world (m), (count).
        obstacles: obstacles by name.
    """

    def __init__(self, path: Path, header: MissionHeader, moments: list[Moment]) -> None:
        self.path, self.created, self.obstacles = path, header.created, header.obstacles
        self._described = header.robots
        self._built: dict[str, Mechanism] = {}
        self.times: Array = np.array([moment.t for moment in moments])
        self.q: dict[str, Array] = {}
        self.tasks: dict[str, list[tuple[RecordedTask, ...]]] = {}
        self.described: dict[str, list[tuple[AnyDescription, ...]]] = {}
        self.statuses: dict[str, list[str]] = {}
        self.placements = {name: [moment.obstacles[name] for moment in moments] for name in header.obstacles}
        for name, robot in header.robots.items():
            samples = [moment.robots.get(name) or self._at_home(name) for moment in moments]
            self.q[name] = np.array([sample.q for sample in samples]).reshape(len(samples), robot.nq)
            self.q[name].flags.writeable = False
            self.tasks[name] = [() if isinstance(each.tasks, UnsetType) else each.tasks for each in samples]
            self.described[name] = [() if isinstance(each.described, UnsetType) else each.described for each in samples]
            self.statuses[name] = [sample.status for sample in samples]

    def __repr__(self) -> str:
        return f"<Recording of {', '.join(self.robots)}: {len(self.times)} moments in {self.seconds:.3f} s>"

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a file. A last line that was cut off by a crash is left out.

        Raises:
            MissionError: the file can't be read, is no mission, of another version or damaged; names the line.
        """
        return cls(Path(path), *read_lines(path, MissionError, decode_header, decode_moment))

    def _at_home(self, name: str) -> RobotSample:
        return RobotSample(self.mechanism(name).q_home, "IDLE")

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

    def mechanism(self, name: str) -> Mechanism:
        """Build a robot from the first line, as it was recorded; once for all calls. Its meshes are only read when they
        are drawn, and only where the recording may name them, see `raff2urdf.graphics.names`.

        Raises:
            UnknownNameError: there is no such robot.
            MissionError: its description was changed since, or can't be built any more.
        """
        robot = self._described.get(name)
        if robot is None:
            raise UnknownNameError("robot", name, self.robots)
        if name not in self._built:
            if fingerprint(robot.urdf, robot.constraints) != robot.hash:
                raise MissionError(f"{self.path}:1: the description of '{name}' was changed after it was recorded")
            try:
                owner = str(self.path.absolute().parent)
                mechanism = build(robot.urdf, robot.constraints, robot.folder, robot.source, owner=owner)
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
    if not mechanism.is_constrained:
        return q
    try:
        closed = mechanism.close(q)
    except ClosureError:
        return nearer.copy()
    return closed if mechanism.distance(q, closed) <= mechanism.distance(first, second) else nearer.copy()
