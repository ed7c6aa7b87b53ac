"""`Session`: robots that users, sensors and recordings move; commands in, ticks, states out.

It has no screen and no socket; `cinegen.session.runner` runs its ticks.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
import pinocchio as pin

from cinegen.errors import CinegenError
from cinegen.ik import Solver
from cinegen.mission import Player, Recording
from cinegen.sensor import Sensor
from cinegen.session import commands as c
from cinegen.session.avoiding import AvoidingRobot
from cinegen.session.carried import renamed
from cinegen.session.drags import Drags
from cinegen.session.driven_obstacle import DrivenObstacle
from cinegen.session.holding import Holding, HoldingError, why_no_forces
from cinegen.session.motion import ConfigurationMotion, JointMotion, LineMotion
from cinegen.session.robot import PIN, SENSOR, DescribedTask, DrivenRobot, UserTask
from cinegen.session.sensors import SessionSensors, default_speed, opened
from cinegen.session.session_recorder import SessionRecorder
from cinegen.session.setup import Setup
from cinegen.session.state import CarriedMass, Notice, PlaybackStatus, SessionState, Settings
from cinegen.session.undo import UndoHistory
from cinegen.session.waypoints import Waypoints

SAMPLES = 100
"""Samples per second that are recorded."""

MOST_TASKS = 64
"""Tasks up to which pins and tasks of other kinds can be added."""

_NOTICES = 8  # that are kept
_INTERRUPTS = (
    c.StartDrag | c.AddTask | c.MoveJoint | c.MoveHome | c.MoveTo | c.Undo | c.Redo
)  # of motions through waypoints

_REST = 1.0  # s without motion, after which a session is at rest
_SAMPLED = 1.0 / 60.0  # s between two looks whether anything moves
_STILL = 1e-8  # rad or m: larger differences between two looks are motion


class Session:
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
        self.robots = _robots(setup, self.dt)
        self.obstacles = _obstacles(setup, self.dt)
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
        moved = {name: (one.pose, self.setup.obstacles[name].placement) for name, one in self.obstacles.items()}
        self.setup = self._recorder.setup = setup
        self._edition, self._refused, self._still = other.edition, None, 0.0
        for one in (self.robots, self.obstacles, self._driven):
            one.clear()
        self.robots.update(other.robots)
        self.obstacles.update(other.obstacles)
        self._driven.update({**self.robots, **self.obstacles})
        self._carried = [name for name in setup.order() if setup.base(name).robot is not None]
        self._meet_obstacles()
        for name, (pose, written) in moved.items():
            if name in self.obstacles and written.isApprox(setup.obstacles[name].placement):
                self.obstacles[name].pose = pose
        self._change_settings(c.ChangeSettings(gain=self.settings.gain, damping=self.settings.damping))
        for name, robot in self.robots.items():
            if name in before:
                self._notice(robot.succeed(before[name]), warning=True)
        self._place_bases()
        tasks, lost = dict[int, tuple[DrivenRobot, UserTask]](), self.sensors.exchange(setup, other.sensors, names)
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
        self._drags.follow(tasks)
        if self._drags or dragged:
            self._history.begin()
        self._notice("; ".join(lost), warning=True)

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
            c.check_names(command, self.setup)  # it may have been sent before the robots were exchanged
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

    # --- the pointers --------------------------------------------------------------------------------------------

    def _start_drag(self, command: c.StartDrag) -> None:
        self._history.begin()
        self._drags.start(command)

    def _move_drag(self, command: c.MoveDrag) -> None:
        self._drags.move(command)

    def _end_drag(self, command: c.EndDrag) -> None:
        self._drags.end(command.pointer, command.pin)

    # --- tasks ---------------------------------------------------------------------------------------------------

    def _pin(self, command: c.Pin) -> None:
        robot = self._driven[command.robot]
        if any(robot.tasks_of(PIN, command.node)):
            return
        self._check_room()
        self._history.begin()
        robot.add_task(self._new_id(), command.node, PIN, PIN)

    def _check_room(self) -> None:
        if sum(len(other.tasks) + len(other.described) for other in self._driven.values()) >= MOST_TASKS:
            raise CinegenError(f"there are {MOST_TASKS} tasks: remove some first")

    def _add_task(self, command: c.AddTask) -> None:
        self._check_room()
        self._history.begin()
        robot = self.robots[command.robot]
        robot.motion = None
        robot.add_described(self._new_id(), command.description)

    def _remove_task(self, command: c.RemoveTask) -> None:
        found = self._task(command.task)
        if found is None:
            return
        robot, task = found
        if isinstance(task, DescribedTask):
            robot.remove_described(task)
            return
        if self._drags.end_of(task):
            return
        if task.source == SENSOR:
            self.sensors.select(robot.name, task.task.node, None)
        else:
            self._history.begin()
            robot.remove_task(task)

    def _change_task(self, command: c.ChangeTask) -> None:
        found = self._task(command.task)
        if found is None:
            return
        robot, one = found
        given = {name: value for name, value in msgspec.structs.asdict(command).items() if value is not None}
        del given["task"]
        if isinstance(one, DescribedTask):
            self._change_described(robot, one, given)
            return
        if "description" in given:
            raise CinegenError(f"task {one.id} is a frame: it has no description to change")
        for name, value in given.items():
            setattr(one.task, name, value)

    def _change_described(self, robot: DrivenRobot, one: DescribedTask, given: dict[str, Any]) -> None:
        description = given.pop("description", one.description)
        wrong = [name for name in given if name not in description.__struct_fields__]
        if wrong:
            raise CinegenError(f"a task of kind {description.__struct_config__.tag} has no {wrong[0]} to change")
        description = msgspec.structs.replace(description, **given)
        if description != one.description:
            robot.change_described(one, description)

    def _task(self, id: int) -> tuple[DrivenRobot, UserTask | DescribedTask] | None:
        """Return a task by its id, and its robot. If it is of a kind, an undo step begins, which ends an undo: that may
        remove the task, or replace it."""
        robots = self._driven.values()
        if any(one.id == id for robot in robots for one in robot.described):
            self._history.begin()
        for robot in robots:
            tasks: list[UserTask | DescribedTask] = [*robot.tasks, *robot.described]
            for one in tasks:
                if one.id == id:
                    return robot, one
        return None

    # --- motions -------------------------------------------------------------------------------------------------

    def _move_joint(self, command: c.MoveJoint) -> None:
        robot = self._driven[command.robot]
        if command.joint in robot.locked:
            self._notice(f"{command.joint} of {robot.name} is locked: unlock it to move it", warning=True)
            return
        if not isinstance(robot.motion, JointMotion):
            self._history.begin()
            self.sensors.stop_scripts(command.robot)
            robot.motion = JointMotion(robot.mechanism, robot.q)
        robot.motion.move(command.joint, command.value)

    def _lock_joint(self, command: c.LockJoint) -> None:
        self._driven[command.robot].lock(command.joint, command.locked)

    def _end_joint_motion(self, command: c.EndJointMotion) -> None:
        for robot in self.robots.values():
            if isinstance(robot.motion, JointMotion):
                robot.motion.end()

    def _move_home(self, command: c.MoveHome) -> None:
        self._drags.end()
        self._history.begin()
        for robot in self.robots.values() if command.robot is None else (self._driven[command.robot],):
            self._free(robot)
            robot.motion = ConfigurationMotion(robot.mechanism, robot.q, robot.home, "home", "moving home")

    def _move_to(self, command: c.MoveTo) -> None:
        robot = self._driven[command.robot]
        motion = LineMotion(robot.mechanism, robot.q, np.array(command.q), command.node, self.dt, robot.locked)
        self._drags.end()
        self._history.begin()
        self._free(robot)
        robot.motion = motion

    # --- waypoints -----------------------------------------------------------------------------------------------

    def _save_waypoint(self, command: c.SaveWaypoint) -> None:
        self._waypoints.save(command.name)

    def _change_waypoint(self, command: c.ChangeWaypoint) -> None:
        self._waypoints.change(command)

    def _remove_waypoint(self, command: c.RemoveWaypoint) -> None:
        self._waypoints.remove(command.waypoint)

    def _move_to_waypoint(self, command: c.MoveToWaypoint) -> None:
        self._follow(lambda: self._waypoints.move_to(command.waypoint))

    def _play_waypoints(self, command: c.PlayWaypoints) -> None:
        if not command.on:
            self._waypoints.stop()
        elif command.record and self._recorder:
            self._notice("a recording is in progress: stop it first, or play the waypoints within it", warning=True)
        else:
            self._follow(lambda: self._waypoints.play(command.record))

    def _follow(self, start: Callable[[], None]) -> None:
        """Start a motion through waypoints."""
        self._drags.end()
        self._history.begin()
        start()
        for robot in self.robots.values():
            self._free(robot)

    def _free(self, robot: DrivenRobot) -> None:
        """Stop the scripts of a robot, and remove its pins and tasks of other kinds."""
        self.sensors.stop_scripts(robot.name)
        for one in robot.tasks_of(PIN):
            robot.remove_task(one)
        for own in tuple(robot.described):
            robot.remove_described(own)

    def _undo(self, command: c.Undo) -> None:
        self._drags.end()
        self._notice(self._history.undo(), warning=True)

    def _redo(self, command: c.Redo) -> None:
        self._drags.end()
        self._notice(self._history.redo(), warning=True)

    def _pause(self, command: c.Pause) -> None:
        self.paused = command.on

    # --- sensors and settings ------------------------------------------------------------------------------------

    def _select_sensor(self, command: c.SelectSensor) -> None:
        self.sensors.select(command.robot, command.node, command.sensor)

    def _change_sensor(self, command: c.ChangeSensor) -> None:
        self.sensors.change_axes(command.sensor, command.axes)

    def _set_view(self, command: c.SetView) -> None:
        x, y, z = pin.Quaternion(np.array(command.quaternion)).matrix().T
        self.sensors.view = np.column_stack([x, -z, y])

    def _change_settings(self, command: c.ChangeSettings) -> None:
        values = {name: value for name, value in msgspec.structs.asdict(command).items() if value is not None}
        self.settings = msgspec.structs.replace(self.settings, **values)
        for robot in self._driven.values():
            if command.gain is not None:
                robot.solver.gain = command.gain
            if command.damping is not None:
                robot.solver.damping_threshold = command.damping

    def _set_payload(self, command: c.SetPayload) -> None:
        robot = self._driven[command.robot]
        if robot.holding is None:
            self._notice(f"{robot.name} carries no payload: {why_no_forces(robot.mechanism)}", warning=True)
        else:
            robot.carried = CarriedMass(command.node, command.mass)

    def _gamepad_input(self, command: c.GamepadInput) -> None:
        self.sensors.put_gamepad(command.twist, command.buttons)

    # --- recordings ----------------------------------------------------------------------------------------------

    def _set_recording(self, command: c.SetRecording) -> None:
        if command.on:
            self._recorder.start()
        else:
            self._notice(self._recorder.stop())

    def _record_motion(self, on: bool, arrived: bool = True) -> None:
        """Start or stop a recording; the present moment belongs to it if the robots have arrived."""
        if on:
            self._recorder.start()
        if arrived:
            self._recorder.sample(self.time)
        if not on:
            self._set_recording(c.SetRecording(False))

    def _control_playback(self, command: c.ControlPlayback) -> None:
        if self._player is None:
            return
        if command.time is not None:
            self._player.seek(command.time)
        if command.speed is not None:
            self._player.set_speed(command.speed)
        if command.playing is not None:
            (self._player.play if command.playing else self._player.pause)()

    # --- out -----------------------------------------------------------------------------------------------------

    def state(self) -> SessionState:
        """Return the present state."""
        player = self._player
        return SessionState(
            time=self.time,
            robots={name: robot.state() for name, robot in self.robots.items()},
            obstacles={name: one.obstacle_state() for name, one in self.obstacles.items()},
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

    def _new_id(self) -> int:
        self._count += 1
        return self._count

    def _notice(self, text: str, warning: bool = False) -> None:
        if not text:
            return
        self._noticed += 1
        self._notices.append(Notice(self._noticed, text, warning))


@dataclass(frozen=True)
class OtherRobots:
    """Robots, obstacles and sensors of another setup, made for a session that is to go on with them.

    Attributes:
        setup: the other setup.
        edition: its number.
        robots: robots by name.
        obstacles: obstacles by name.
        sensors: sensors by name, not started.
    """

    setup: Setup
    edition: int
    robots: Mapping[str, DrivenRobot]
    obstacles: Mapping[str, DrivenObstacle]
    sensors: Mapping[str, Sensor]

    @classmethod
    def of(cls, setup: Setup, edition: int) -> OtherRobots:
        """Return those of a setup; this may take a second.

        Raises:
            CinegenError: they can't be driven.
        """
        dt = 1.0 / setup.rate
        robots = _robots(setup, dt)
        sensors = {device.name: opened(device, robots) for device in setup.devices}
        for robot in robots.values():  # what is made at the first closure is not made in a tick
            robot.succeed(robot)
        return cls(setup, edition, robots, _obstacles(setup, dt), sensors)


def _obstacles(setup: Setup, dt: float) -> dict[str, DrivenObstacle]:
    return {name: DrivenObstacle(name, drawn, dt) for name, drawn in setup.obstacles.items()}


def _robots(setup: Setup, dt: float) -> dict[str, DrivenRobot]:
    robots: dict[str, DrivenRobot] = {}
    for name, mechanism in setup.robots.items():
        if setup.avoidance is not None and setup.avoidance.robot == name:
            robots[name] = AvoidingRobot(name, setup.avoidance.scene, tuple(setup.obstacles), dt)
        else:
            robots[name] = DrivenRobot(name, Solver(mechanism, dt, setup.start(name)))
        for joint in setup.locked.get(name, ()):
            robots[name].lock(joint, True)
        with contextlib.suppress(HoldingError):  # without masses there are no torques
            robots[name].holding = Holding(mechanism)
    return robots
