"""`Drags`: what users drag, by pointer. A mouse is one pointer; a headset has two, one in each hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import msgspec
import numpy as np
import pinocchio as pin

from cinegen.mission import RecordedTask
from cinegen.session.commands import MoveDrag, StartDrag
from cinegen.session.robot import PIN, POINTER, DrivenRobot, UserTask
from cinegen.session.sensors import SessionSensors


@dataclass
class _Drag:
    """A drag in progress.

    Attributes:
        robot: robot or obstacle.
        task: task that moves it.
        pin: pin of the node before it was dragged; it is restored at the end.
    """

    robot: DrivenRobot
    task: UserTask
    pin: RecordedTask | None

    def is_of(self, robot: DrivenRobot, node: str) -> bool:
        """Return whether it drags a node."""
        return self.robot is robot and self.task.task.node == node


class Drags:
    """The drags in progress, one per pointer. Two pointers may drag two points of one node.

    Args:
        robots: robots and obstacles by name.
        sensors: sensors, which a drag suspends.
        new_id: returns the id of the next task.
    """

    def __init__(self, robots: Mapping[str, DrivenRobot], sensors: SessionSensors, new_id: Callable[[], int]) -> None:
        self._robots, self._sensors, self._new_id = robots, sensors, new_id
        self._drags: dict[int, _Drag] = {}

    def __repr__(self) -> str:
        return f"<Drags: {', '.join(f'{key}: {drag.task.task.node}' for key, drag in self._drags.items()) or 'none'}>"

    def __bool__(self) -> bool:
        return bool(self._drags)

    def start(self, command: StartDrag) -> None:
        """Start a drag; one that the same pointer had begun ends."""
        self.end(command.pointer)
        robot = self._robots[command.robot]
        robot.motion = None
        other = next((active for active in self._drags.values() if active.is_of(robot, command.node)), None)
        was = None
        if other is None:  # otherwise the other drag has suspended them already
            self._sensors.suspend(command.robot, command.node)
            was = next((recorded for recorded in robot.recorded_tasks(PIN) if recorded.node == command.node), None)
            for pinned in robot.tasks_of(PIN, command.node):  # a pin moves with its node, and is restored at the end
                robot.remove_task(pinned)
        point = command.point
        offset = pin.SE3.Identity() if point is None else pin.SE3(np.eye(3), np.array(point))
        dof = 3, 3 if command.rotation and point is None else 0
        task = robot.add_task(self._new_id(), command.node, POINTER, POINTER, offset, dof)
        self._drags[command.pointer] = _Drag(robot, task, was)

    def move(self, command: MoveDrag) -> None:
        """Set the target and the weight of a drag, unless it has ended meanwhile."""
        drag = self._drags.get(command.pointer)
        if drag is None:
            return
        robot, task = drag.robot, drag.task
        if command.weight is not None:
            task.task.weight = command.weight
        position = np.array(command.position)
        if command.quaternion is None:
            robot.set_target(task, pin.SE3((robot.base * task.task.target).rotation, position))
        else:
            robot.set_target(task, pin.XYZQUATToSE3(np.array([*position, *command.quaternion])))

    def end(self, pointer: int | None = None, as_pin: bool = False) -> None:
        """End a drag, or all: null; the task is removed or becomes a pin. Nothing happens if there is none."""
        for key in tuple(self._drags) if pointer is None else (pointer,):
            drag = self._drags.pop(key, None)
            if drag is not None:
                self._release(drag, as_pin)

    def end_of(self, task: UserTask) -> bool:
        """End the drag that a task belongs to; return whether there is one."""
        pointer = next((key for key, drag in self._drags.items() if drag.task is task), None)
        if pointer is not None:
            self.end(pointer)
        return pointer is not None

    def follow(self, tasks: Mapping[int, tuple[DrivenRobot, UserTask]]) -> None:
        """Go on with other robots, in which tasks have the ids that they had; drags whose task is gone end."""
        for key, drag in tuple(self._drags.items()):
            if drag.task.id in tasks:
                drag.robot, drag.task = tasks[drag.task.id]
            else:
                del self._drags[key]

    def _release(self, drag: _Drag, as_pin: bool) -> None:
        robot, task = drag.robot, drag.task
        node = task.task.node
        other = next((active for active in self._drags.values() if active.is_of(robot, node)), None)
        if as_pin:
            task.source = task.label = PIN
            self._sensors.deselect_suspended(robot.name, node)
            return
        robot.remove_task(task)
        if other is not None:  # the last drag of a node restores its pin and its sensor
            other.pin = other.pin or drag.pin
            return
        if drag.pin is not None:
            at = robot.placement(node) * drag.pin.offset
            robot.restore(self._new_id(), msgspec.structs.replace(drag.pin, target=at))
        self._sensors.resume(robot.name, node)
