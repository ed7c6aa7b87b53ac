"""Commands that a session carries out, each by the method of its type."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pinocchio as pin

from cinegen.errors import CinegenError
from cinegen.mission import Player
from cinegen.session import commands as c
from cinegen.session.drags import Drags
from cinegen.session.holding import why_no_forces
from cinegen.session.motion import ConfigurationMotion, JointMotion, LineMotion
from cinegen.session.robot import PIN, SENSOR, DescribedTask, DrivenRobot, UserTask
from cinegen.session.sensors import SessionSensors
from cinegen.session.session_recorder import SessionRecorder
from cinegen.session.state import CarriedMass, Notice, Settings
from cinegen.session.undo import UndoHistory
from cinegen.session.waypoints import Waypoints

MOST_TASKS = 64
"""Tasks up to which pins and tasks of other kinds can be added."""


class CommandHandlers:
    """Methods of a `Session` that carry out commands: `_start_drag` does so for `StartDrag`."""

    dt: float
    time: float
    paused: bool
    robots: dict[str, DrivenRobot]
    sensors: SessionSensors
    settings: Settings
    _driven: dict[str, DrivenRobot]  # robots and obstacles
    _count: int  # of ids
    _drags: Drags
    _history: UndoHistory
    _notices: deque[Notice]
    _noticed: int
    _recorder: SessionRecorder
    _waypoints: Waypoints
    _player: Player | None

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
        if (located := self._task(command.task)) is None:
            return
        robot, task = located
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
        if (located := self._task(command.task)) is None:
            return
        robot, task = located
        values = {name: value for name, value in msgspec.structs.asdict(command).items() if value is not None}
        del values["task"]
        if isinstance(task, DescribedTask):
            self._change_described(robot, task, values)
            return
        if "description" in values:
            raise CinegenError(f"task {task.id} is a frame: it has no description to change")
        for name, value in values.items():
            setattr(task.task, name, value)

    def _change_described(self, robot: DrivenRobot, task: DescribedTask, values: dict[str, Any]) -> None:
        description = values.pop("description", task.description)
        wrong = [name for name in values if name not in description.__struct_fields__]
        if wrong:
            raise CinegenError(f"a task of kind {description.__struct_config__.tag} has no {wrong[0]} to change")
        description = msgspec.structs.replace(description, **values)
        if description != task.description:
            robot.change_described(task, description)

    def _task(self, id: int) -> tuple[DrivenRobot, UserTask | DescribedTask] | None:
        """Return a task by its id, and its robot. If it is of a kind, an undo step begins, which ends an undo: that may
        remove the task, or replace it."""
        robots = self._driven.values()
        if any(task.id == id for robot in robots for task in robot.described):
            self._history.begin()
        for robot in robots:
            tasks: list[UserTask | DescribedTask] = [*robot.tasks, *robot.described]
            for task in tasks:
                if task.id == id:
                    return robot, task
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
        for pinned in robot.tasks_of(PIN):
            robot.remove_task(pinned)
        for task in tuple(robot.described):
            robot.remove_described(task)

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

    def _new_id(self) -> int:
        self._count += 1
        return self._count

    def _notice(self, text: str, warning: bool = False) -> None:
        if not text:
            return
        self._noticed += 1
        self._notices.append(Notice(self._noticed, text, warning))
