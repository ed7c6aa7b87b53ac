"""`Session`: robots that users, sensors and recordings move; commands in, ticks, states out.

It has no screen and no socket; `cinegen.session.runner` runs its ticks.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Mapping

import numpy as np

from cinegen.errors import CinegenError
from cinegen.mission import Player, Recording
from cinegen.session import commands as c
from cinegen.session.avoiding import AvoidingRobot
from cinegen.session.carried import renamed
from cinegen.session.command_handlers import CommandHandlers
from cinegen.session.decoding import check_names
from cinegen.session.drags import Drags
from cinegen.session.other_robots import OtherRobots, driven_obstacles, driven_robots
from cinegen.session.robot import PIN, SENSOR, DrivenRobot, UserTask
from cinegen.session.sensors import SessionSensors, default_speed
from cinegen.session.session_recorder import SessionRecorder
from cinegen.session.setup import Setup
from cinegen.session.state import Notice, PlaybackStatus, SessionState, Settings
from cinegen.session.undo import UndoHistory
from cinegen.session.waypoints import Waypoints

SAMPLES = 100
"""Samples per second that are recorded."""

_NOTICES = 8  # that are kept
_INTERRUPTS = (
    c.StartDrag | c.AddTask | c.MoveJoint | c.MoveHome | c.MoveTo | c.Undo | c.Redo
)  # of motions through waypoints

_REST = 1.0  # s without motion, after which a session is at rest
_SAMPLED = 1.0 / 60.0  # s between two looks whether anything moves
_STILL = 1e-8  # rad or m: larger differences between two looks are motion


class Session(CommandHandlers):
    """Robots that are driven. For one thread at a time. Neither `obey` nor `tick` raises.

    Args:
        setup: robots, sensors and recordings of the session.

    Attributes:
        dt: period of the next tick, s; it may be set between two ticks.
        wake: called when a sensor has a new reading, by a thread of the sensor.

    Raises:
        CinegenError: a sensor or a recording does not exist.
    """

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.wake: Callable[[], object] = lambda: None
        self.dt = 1.0 / setup.rate
        self.robots = driven_robots(setup, self.dt)
        self.obstacles = driven_obstacles(setup, self.dt)
        self._driven: dict[str, DrivenRobot] = {**self.robots, **self.obstacles}
        self._count = self._edition = 0
        self._refused: tuple[int, str] | None = None
        self.sensors = SessionSensors(setup, self.robots, self._new_id, lambda: self.wake())
        self.time, self.paused = 0.0, False
        self._looked, self._still, self._moved = 0.0, 0.0, np.zeros(0)  # when, how long, where: for `at_rest`
        self._carried = [name for name in setup.order() if setup.base(name).robot is not None]
        self._drags = Drags(self._driven, self.sensors, self._new_id)
        self._history = UndoHistory(self._driven, self.sensors, self._new_id)
        self._notices: deque[Notice] = deque(maxlen=_NOTICES)
        self._noticed = self._answered = self._ticks = 0
        self.settings = Settings(100.0, 0.05, default_speed(self.robots), 0.5, "world")
        self._recorder = SessionRecorder(setup, self.robots, self.obstacles)
        self._waypoints = Waypoints(self.robots, self._new_id, self._record_motion)
        self._player = Player(Recording.load(setup.replay)) if setup.replay is not None else None
        if self._player is not None:
            self._player.set_speed(setup.playback_speed)
            if not setup.stops:
                self._player.play()
        self._place_bases()
        self._meet_obstacles()
        self._change_settings(c.ChangeSettings(gain=self.settings.gain))
        with contextlib.ExitStack() as opened:
            opened.callback(self.close)
            if self._player is None:
                for switch in setup.switches:
                    if switch.first is not None:
                        self.sensors.select(switch.robot, switch.node, switch.first)
            if setup.record is not None:
                self._recorder.start(setup.record, setup.overwrite)
            opened.pop_all()

    def _place_bases(self) -> None:
        for name, robot in self.robots.items():
            robot.set_base(self.setup.base(name).placement)
        self._carry()

    def _meet_obstacles(self) -> None:
        """Let the robot that avoids obstacles know them."""
        avoidance = self.setup.avoidance
        if avoidance is not None:
            avoiding = self.robots[avoidance.robot]
            assert isinstance(avoiding, AvoidingRobot)
            for number, (name, obstacle) in enumerate(zip(self.obstacles, avoidance.scene.obstacles, strict=True)):
                self.obstacles[name].meet(avoiding, number, obstacle)

    def close(self) -> None:
        """Close the sensors and the recording."""
        self.sensors.close()
        self._recorder.close()

    # --- other robots ----------------------------------------------------------------------------------------------

    def exchange(self, other: OtherRobots) -> None:
        """Go on with other robots, which were read from files that have changed. They are where the present ones are,
        as far as joints, loops and limits allow. Tasks, drags, undo steps, waypoints, settings and sensors stay.
        Obstacles stay where they were moved to, unless their file moves them. A recording ends: it describes its robots
        at its beginning. Notices report what can't stay."""
        if other.edition < self._edition:  # a later one was ready before
            return
        setup, names = other.setup, renamed(list(self.robots), list(other.robots))
        if self._recorder:
            self._notice(f"the file was saved, so the recording has ended: {self._recorder.stop()}", warning=True)
        dragged = bool(self._drags)
        self._history.detach(names)
        self._waypoints.detach(names)
        before = {names.get(name, name): robot for name, robot in self._driven.items()}
        moved = {
            name: (obstacle.pose, self.setup.obstacles[name].placement) for name, obstacle in self.obstacles.items()
        }
        self.setup = self._recorder.setup = setup
        self._edition, self._refused, self._still = other.edition, None, 0.0
        for driven in (self.robots, self.obstacles, self._driven):
            driven.clear()
        self.robots.update(other.robots)
        self.obstacles.update(other.obstacles)
        self._driven.update({**self.robots, **self.obstacles})
        self._carried = [name for name in setup.order() if setup.base(name).robot is not None]
        self._meet_obstacles()
        for name, (pose, placement) in moved.items():
            if name in self.obstacles and placement.isApprox(setup.obstacles[name].placement):
                self.obstacles[name].pose = pose
        self._change_settings(c.ChangeSettings(gain=self.settings.gain, damping=self.settings.damping))
        for name, robot in self.robots.items():
            if name in before:
                self._notice(robot.succeed(before[name]), warning=True)
        self._place_bases()
        lost = self.sensors.exchange(setup, other.sensors, names)
        tasks = self._restore_tasks(before, lost)
        self._drags.follow(tasks)
        if self._drags or dragged:
            self._history.begin()
        self._notice("; ".join(lost), warning=True)

    def _restore_tasks(
        self, before: Mapping[str, DrivenRobot], lost: list[str]
    ) -> dict[int, tuple[DrivenRobot, UserTask]]:
        """Give the present robots the tasks of earlier ones, by name; return those of frames by id, and add to `lost`
        what can't stay."""
        tasks = dict[int, tuple[DrivenRobot, UserTask]]()
        for name, was in before.items():
            for old, recorded in zip(was.tasks, was.recorded_tasks(), strict=True):
                if old.source == SENSOR:
                    continue
                new = self._driven.get(name)
                if new is not None and recorded.node in new.mechanism.nodes:
                    tasks[old.id] = new, new.restore(old.id, recorded, old.source)
                else:
                    what = "pin" if old.source == PIN else "drag"
                    lost.append(f"there is no '{recorded.node}' any more: its {what} has ended")
            for described in was.described:
                try:
                    self._driven[name].add_described(described.id, described.description)
                except (CinegenError, KeyError) as error:
                    why = f"there is no '{name}' any more" if isinstance(error, KeyError) else str(error)
                    lost.append(f"{why}: a task of kind {described.description.__struct_config__.tag} has ended")
        return tasks

    def refuse(self, edition: int, why: str) -> None:
        """Stay with the present robots, since those of a later setup can't be driven; states report the reason."""
        if edition > self._edition:
            self._refused = edition, why

    # --- in ------------------------------------------------------------------------------------------------------

    def obey(self, command: c.Command) -> None:
        """Carry out a command (by the method of its `type`) as far as possible; otherwise a notice gives the reason."""
        self._answered += 1
        self._still = 0.0
        if (self._player is not None) != isinstance(command, c.ControlPlayback) and not isinstance(command, c.SetView):
            if self._player is not None:
                self._notice("a recording is being replayed: it can't be driven", warning=True)
            return
        if isinstance(command, _INTERRUPTS):
            self._waypoints.stop()
        try:
            check_names(command, self.setup)  # it may have been sent before the robots were exchanged
            getattr(self, f"_{command.__struct_config__.tag}")(command)
        except CinegenError as error:
            self._notice(str(error), warning=True)

    def tick(self) -> None:
        """Advance by one tick of dt."""
        self._ticks += 1
        self.time += self.dt
        if self._player is not None:
            for name, q in self._player.advance(self.dt).items():
                with contextlib.suppress(CinegenError):  # a recording with open loops
                    self.robots[name].jump_to(q)
            for name, pose in self._player.placements().items():
                self.obstacles[name].pose = pose
        else:
            self.sensors.advance(self.dt, self.settings, not self.paused)
            if not self.paused:
                for robot in self._driven.values():
                    self._move(robot)
                self._notice(self._waypoints.tick(), warning=True)
        if self._carried:
            self._carry()
        self._history.tick(self.dt, bool(self._drags))
        if self._ticks % max(1, round(1.0 / (SAMPLES * self.dt))) == 0:
            self._recorder.sample(self.time)
        if self.at_rest or self.time - self._looked >= _SAMPLED:
            self._look()

    @property
    def at_rest(self) -> bool:
        """True after a second without commands, in which nothing has moved. Then ticks change nothing, and fewer are
        needed until a command or a reading of a sensor comes."""
        return self._still >= _REST

    def pass_time(self, seconds: float) -> None:
        """Advance the time (s) of a session at rest."""
        self.time += seconds

    def _look(self) -> None:
        """Find out whether anything has moved."""
        parts = [robot.moving_parts() for robot in self._driven.values()]
        before, self._moved = self._moved, np.concatenate(parts)
        busy = (
            bool(self._recorder)
            or (self._player is not None and self._player.playing)
            or (not self.paused and self._acts())
        )
        same = len(before) == len(self._moved) and np.abs(self._moved - before).max() <= _STILL
        self._still = self._still + self.time - self._looked if same and not busy else 0.0
        self._looked = self.time

    def _acts(self) -> bool:
        """Return whether a motion or a script is in progress."""
        return any(robot.motion is not None for robot in self._driven.values()) or self.sensors.scripts_run()

    def _move(self, robot: DrivenRobot) -> None:
        try:
            problem = robot.tick(self.dt)
        except CinegenError as error:  # a motion that diverged ends, and the robot stays where it is
            robot.motion, problem = None, str(error)
        self._notice(problem, warning=True)

    def _carry(self) -> None:
        """Set the base poses of robots that others carry."""
        for name in self._carried:
            base = self.setup.base(name)
            if base.robot is not None and base.node is not None:
                self.robots[name].set_base(self.robots[base.robot].placement(base.node) * base.placement)

    # --- out -----------------------------------------------------------------------------------------------------

    def state(self) -> SessionState:
        """Return the present state."""
        player = self._player
        return SessionState(
            time=self.time,
            robots={name: robot.state() for name, robot in self.robots.items()},
            obstacles={name: obstacle.obstacle_state() for name, obstacle in self.obstacles.items()},
            sensors=self.sensors.reports(),
            switches=dict(self.sensors.selected),
            settings=self.settings,
            undo=self._history.undo_count,
            redo=self._history.redo_count,
            paused=self.paused,
            moving=next((robot.motion.name for robot in self._driven.values() if robot.motion is not None), None),
            recording=self._recorder.status(),
            playback=None
            if player is None
            else PlaybackStatus(str(player.recording.path), player.seconds, player.time, player.playing, player.speed),
            compiled=all(robot.solver.is_compiled for robot in self._driven.values()),
            waypoints=self._waypoints.infos,
            waypoint=self._waypoints.target,
            notices=tuple(self._notices),
            answered=self._answered,
            at_rest=self.at_rest,
            edition=self._edition,
            refused=self._refused,
        )
