"""Waypoints of a session: named configurations of all robots, to which they move, one by one or in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.session.carried import Kept, attached, detached
from cinegen.session.commands import ChangeWaypoint
from cinegen.session.motion import ConfigurationMotion
from cinegen.session.robot import DrivenRobot
from cinegen.session.state import WaypointInfo

MOST_WAYPOINTS = 50
"""Waypoints of a session."""

_THERE = 1e-6  # rad or lengths: distance at which a waypoint is reached


class WaypointError(CinegenError):
    """A waypoint does not exist, can't be saved, or can't be played."""


@dataclass
class Waypoint:
    """Configurations of all robots by name, saved under a name."""

    id: int
    name: str
    configurations: Mapping[str, Kept]


class Waypoints:
    """Waypoints, and the motion through them. A motion ends early where a robot does not reach a waypoint on a path.

    Args:
        robots: robots by name.
        new_id: returns the id of the next waypoint.
        record: starts (True) or stops (False) a recording; the present moment belongs to it if the second argument is
            True. It may raise a CinegenError when it starts.
    """

    def __init__(
        self, robots: Mapping[str, DrivenRobot], new_id: Callable[[], int], record: Callable[[bool, bool], None]
    ) -> None:
        self._robots, self._new_id, self._record = robots, new_id, record
        self._all: list[Waypoint] = []
        self._target: Waypoint | None = None
        self._last = ""  # name of the waypoint that was reached before
        self._next: deque[Waypoint] = deque()
        self._motions: dict[str, ConfigurationMotion] = {}
        self._goals: dict[str, Array] = {}  # of the robots on the way to the target
        self._plays = False  # whether the motion goes through several waypoints
        self._waits = self._records = False  # whether a recording starts at the first waypoint, or is in progress

    def __repr__(self) -> str:
        return f"<Waypoints: {', '.join(waypoint.name for waypoint in self._all) or 'none'}>"

    @property
    def infos(self) -> tuple[WaypointInfo, ...]:
        """Ids and names, in order."""
        return tuple(WaypointInfo(waypoint.id, waypoint.name) for waypoint in self._all)

    @property
    def target(self) -> int | None:
        """Id of the waypoint that the robots move to; None without such a motion."""
        return None if self._target is None else self._target.id

    # --- the list ------------------------------------------------------------------------------------------------

    def save(self, name: str) -> None:
        """Save the present configurations as the last waypoint.

        Raises:
            WaypointError: there are `MOST_WAYPOINTS` already.
        """
        if len(self._all) >= MOST_WAYPOINTS:
            raise WaypointError(f"there are {MOST_WAYPOINTS} waypoints: remove some first")
        self._all.append(Waypoint(self._new_id(), name, {key: robot.q for key, robot in self._robots.items()}))

    def change(self, change: ChangeWaypoint) -> None:
        """Rename a waypoint, or move it to another index.

        Raises:
            WaypointError: it does not exist.
        """
        waypoint = self._waypoint(change.waypoint)
        waypoint.name = change.name or waypoint.name
        if change.index is not None:
            self._all.remove(waypoint)
            self._all.insert(change.index, waypoint)

    def remove(self, id: int) -> None:
        """Remove a waypoint; a motion to it goes on.

        Raises:
            WaypointError: it does not exist.
        """
        self._all.remove(self._waypoint(id))

    def _waypoint(self, id: int) -> Waypoint:
        waypoint = next((waypoint for waypoint in self._all if waypoint.id == id), None)
        if waypoint is None:
            raise WaypointError("this waypoint was removed")
        return waypoint

    def detach(self, names: Mapping[str, str]) -> None:
        """End the motion, before other robots take the place of the present ones: waypoints keep the values of joints.

        Args:
            names: new names of robots by their old ones, where they differ.
        """
        self.stop()
        for waypoint in self._all:
            waypoint.configurations = {
                names.get(key, key): detached(self._robots[key].mechanism if key in self._robots else None, q)
                for key, q in waypoint.configurations.items()
            }

    # --- the motion ----------------------------------------------------------------------------------------------

    def move_to(self, id: int) -> None:
        """Start a motion to a waypoint, which replaces all other motions.

        Raises:
            WaypointError: it does not exist.
        """
        self._start([self._waypoint(id)])

    def play(self, record: bool = False) -> None:
        """Start a motion through all waypoints, which replaces all other motions.

        Args:
            record: whether it is recorded from the first waypoint on.

        Raises:
            WaypointError: there are fewer than two waypoints.
        """
        if len(self._all) < 2:
            raise WaypointError("save two waypoints or more to play them")
        self._start(self._all)
        self._plays, self._waits = True, record

    def stop(self) -> None:
        """End the motion; the robots stay where they are."""
        for name, motion in self._motions.items():
            if self._robots[name].motion is motion:
                self._robots[name].motion = None
        self._end()

    def tick(self) -> str:
        """Go on after each tick of the robots. Return a message for people; mostly an empty one."""
        if self._target is None:
            return ""
        for name, motion in self._motions.items():
            robot = self._robots[name]
            if motion.jumps:
                again = f"drag it there from '{self._last}' and save it again, or remove it"
                reason = f"{name} can't reach '{self._target.name}' on a path"
                return self._fail(f"{reason}: {again if self._last else 'play again'}")
            if robot.motion is not None and robot.motion is not motion:
                return self._fail(f"another motion moves {name}")
        if any(self._robots[name].motion is not None for name in self._motions):
            return ""
        for name, goal in self._goals.items():
            if self._robots[name].mechanism.distance(self._robots[name].q, goal) > _THERE:
                return self._fail(f"{name} did not reach '{self._target.name}'")
        try:
            if self._waits:
                self._record(True, True)
                self._waits, self._records = False, True
        except CinegenError as error:
            return self._fail(str(error))
        if self._next:
            try:
                self._last = self._target.name
                self._begin(self._next.popleft())
            except WaypointError as error:
                return self._fail(str(error))
        else:
            self._end(arrived=True)
        return ""

    def _start(self, waypoints: Sequence[Waypoint]) -> None:
        self.stop()
        self._last = ""
        self._next = deque(waypoints)
        self._begin(self._next.popleft())

    def _begin(self, waypoint: Waypoint) -> None:
        goals = dict[str, Array]()
        for name, q in waypoint.configurations.items():
            if name in self._robots:
                robot = self._robots[name]
                goal = attached(robot.mechanism, q, robot.q)
                if goal is None:
                    raise WaypointError(f"{name} can't be at '{waypoint.name}': its file has changed. Save it again")
                goals[name] = goal
        self._target, self._goals = waypoint, goals
        for name, goal in goals.items():
            robot = self._robots[name]
            label = f"moving to {waypoint.name}"
            robot.motion = self._motions[name] = ConfigurationMotion(robot.mechanism, robot.q, goal, "waypoint", label)

    def _fail(self, reason: str) -> str:
        """End the motion; return a message, which the robots' own messages are enough for where nothing is played."""
        plays = self._plays
        self.stop()
        return f"waypoints are no longer played: {reason}" if plays else ""

    def _end(self, arrived: bool = False) -> None:
        if self._records:
            self._record(False, arrived)
        self._target, self._plays, self._waits, self._records = None, False, False, False
        self._next.clear()
        self._motions.clear()
