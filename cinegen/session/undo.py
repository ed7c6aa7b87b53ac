"""`UndoHistory`: steps that people can undo and redo, with the path that the robots took in each."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik.tasks.described import TaskDescription
from cinegen.mission import RecordedTask
from cinegen.session.carried import Kept, attached, detached
from cinegen.session.motion import ConfigurationMotion, Retrace
from cinegen.session.robot import PIN, DrivenRobot
from cinegen.session.sensors import SessionSensors
from raff2urdf.errors import counted

_MOST = 100  # undo steps that are kept
_LONGEST = 600  # configurations of a trace; a longer one is thinned
_RATE = 60  # configurations per second
_NEAR = 0.05  # rad or lengths from the start of a trace: near enough to retrace it


@dataclass(frozen=True)
class Snapshot:
    """Configurations, pins and tasks of other kinds (by their ids) of all robots at a moment."""

    q: Mapping[str, Kept]
    pins: Mapping[str, tuple[RecordedTask, ...]]
    described: Mapping[str, Mapping[int, TaskDescription]]

    @classmethod
    def of(cls, robots: Mapping[str, DrivenRobot]) -> Snapshot:
        """Return the present one."""
        q = {name: robot.q for name, robot in robots.items()}
        described = {name: {t.id: t.description for t in robot.described} for name, robot in robots.items()}
        return cls(q, {name: robot.recorded_tasks(PIN) for name, robot in robots.items()}, described)

    def is_same(self, other: Snapshot) -> bool:
        """Return whether both are equal, up to rounding; of the same robots."""
        pairs = ((np.asarray(q), np.asarray(other.q[name])) for name, q in self.q.items())
        pins = ((pins, other.pins[name]) for name, pins in self.pins.items())
        same = all(len(some) == len(others) and all(map(_is_same_pin, some, others)) for some, others in pins)
        same = same and self.described == other.described
        return same and all(np.allclose(first, second, atol=1e-9) for first, second in pairs)

    def detached(self, robots: Mapping[str, DrivenRobot], names: Mapping[str, str]) -> Snapshot:
        """Return it for robots that replace others: joint values, under their new names."""
        mechanisms = {key: robot.mechanism for key, robot in robots.items()}
        values = {names.get(key, key): detached(mechanisms.get(key), q) for key, q in self.q.items()}
        pins = {names.get(key, key): pins for key, pins in self.pins.items()}
        return Snapshot(values, pins, {names.get(key, key): tasks for key, tasks in self.described.items()})


def _is_same_pin(pin: RecordedTask, other: RecordedTask) -> bool:
    same = (pin.node, pin.translation, pin.rotation, pin.weight, pin.priority) == (
        other.node, other.translation, other.rotation, other.weight, other.priority
    )  # fmt: skip
    for placed, other_placed in ((pin.offset, other.offset), (pin.target, other.target)):
        if placed is not None and other_placed is not None:
            same = same and placed.isApprox(other_placed, 1e-9)
        else:
            same = same and placed is other_placed
    return same


class MotionTrace:
    """Configurations of robots over time.

    Args:
        period: time between two configurations, s.

    Attributes:
        period: as above; doubled whenever the trace is thinned.
        configurations: (nq,) each, by robot.
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self.configurations: dict[str, list[Array]] = {}
        self._every, self._count = 1, 0

    def note(self, robots: Mapping[str, DrivenRobot]) -> None:
        """Add the present configurations; called once in an initial period."""
        skipped = self._count % self._every != 0
        self._count += 1
        if skipped:
            return
        for name, robot in robots.items():
            self.configurations.setdefault(name, []).append(robot.q)
        if any(len(trace) > _LONGEST for trace in self.configurations.values()):
            self.configurations = {name: trace[::2] for name, trace in self.configurations.items()}
            self._every *= 2
            self.period *= 2.0


@dataclass(frozen=True)
class UndoStep:
    """The robots before and after a step, and their path between."""

    before: Snapshot
    after: Snapshot
    trace: MotionTrace


class UndoHistory:
    """History of undo steps. A step begins with a user's action, and ends when nothing is dragged and all robots are at
    rest.

    Undo moves all robots back along their path and restores pins and tasks of other kinds; redo moves them forward
    again. A robot that is no longer on that path (a sensor has moved it) is moved there by its actuated joints.

    Args:
        robots: robots of the session.
        sensors: sensors, which release a robot that is moved.
        new_id: returns the id of the next task.
    """

    def __init__(self, robots: Mapping[str, DrivenRobot], sensors: SessionSensors, new_id: Callable[[], int]) -> None:
        self._robots, self._sensors, self._new_id = robots, sensors, new_id
        self._ticks = 0
        self._done: deque[UndoStep] = deque(maxlen=_MOST)
        self._undone: deque[UndoStep] = deque()
        self._open: tuple[Snapshot, MotionTrace] | None = None
        self._goal: Snapshot | None = None  # of an undo or redo in progress

    def __repr__(self) -> str:
        return f"<UndoHistory: {counted(self.undo_count, 'step')}, {self.redo_count} undone>"

    @property
    def undo_count(self) -> int:
        """Number of steps that can be undone."""
        return len(self._done) + (self._open is not None)

    @property
    def redo_count(self) -> int:
        """Number of steps that can be redone."""
        return len(self._undone)

    def begin(self) -> None:
        """Begin a step, unless one is in progress."""
        if self._goal is not None:  # an undo is interrupted: it is finished at once
            goal, self._goal = self._goal, None
            for name, robot in self._robots.items():
                robot.motion = None
                q = goal.q.get(name)
                if isinstance(q, np.ndarray) and not robot.collision(q):
                    robot.jump_to(q)
            self._restore(goal)
        if self._open is None:
            trace = MotionTrace(1.0 / _RATE)
            trace.note(self._robots)
            self._open = Snapshot.of(self._robots), trace

    def tick(self, dt: float, dragging: bool) -> None:
        """Advance by a tick of dt (s); `dragging` is True while something is dragged."""
        self._ticks += 1
        moving = any(robot.motion for robot in self._robots.values())
        if self._open is not None and self._ticks % max(1, round(1.0 / (_RATE * dt))) == 0:
            self._open[1].note(self._robots)
        if self._open is not None and not dragging and not moving:
            self._close()
        if self._goal is not None and not moving:
            goal, self._goal = self._goal, None
            self._restore(goal)

    def undo(self) -> str:
        """Undo the last step, which may be in progress. Return a message for people; mostly an empty one."""
        return self._retrace(self._done, self._undone, backwards=True)

    def redo(self) -> str:
        """Redo the step that was undone last. Return a message for people; mostly an empty one."""
        return self._retrace(self._undone, self._done, backwards=False)

    def detach(self, names: Mapping[str, str]) -> None:
        """End what is in progress, before other robots take the place of the present ones: steps keep the values of
        joints and no path.

        Args:
            names: new names of robots by their old ones, where they differ.
        """
        self._finish()
        for steps in (self._done, self._undone):
            for _ in range(len(steps)):
                step = steps.popleft()
                before, after = (snapshot.detached(self._robots, names) for snapshot in (step.before, step.after))
                steps.append(UndoStep(before, after, MotionTrace(step.trace.period)))

    def _close(self) -> None:
        """Close the step in progress; it is kept if it changed anything."""
        if self._open is None:
            return
        before, trace = self._open
        self._open = None
        trace.note(self._robots)
        after = Snapshot.of(self._robots)
        if not after.is_same(before):
            self._done.append(UndoStep(before, after, trace))
            self._undone.clear()

    def _finish(self) -> None:
        """End every motion and the step in progress."""
        if self._goal is not None:
            self.begin()
            self._open = None
        for robot in self._robots.values():
            robot.motion = None
        self._close()

    def _retrace(self, source: deque[UndoStep], target: deque[UndoStep], backwards: bool) -> str:
        """Move the robots through the last step of one list, if there is one, and put it into the other. Return a
        message about those that can't be moved."""
        self._finish()
        if not source:
            return ""
        step = source.pop()
        target.append(step)
        snapshot = step.before if backwards else step.after
        reached, lost = dict[str, Kept](), list[str]()
        name, label = ("undo", "undoing") if backwards else ("redo", "redoing")
        for key, robot in self._robots.items():
            for pin in robot.tasks_of(PIN):
                robot.remove_task(pin)
            if key not in snapshot.q:  # it came with a later version of its file
                continue
            q, trace = attached(robot.mechanism, snapshot.q[key], robot.q), step.trace.configurations.get(key, [])
            if q is None:
                lost.append(key)
                continue
            reached[key] = q
            if np.allclose(robot.q, q, atol=1e-9):
                continue
            self._sensors.stop_scripts(key)
            path = [*(trace[::-1] if backwards else trace), q]
            if robot.mechanism.distance(robot.q, path[0]) < _NEAR:
                robot.motion = Retrace(path, step.trace.period, name, label)
            else:
                robot.motion = ConfigurationMotion(robot.mechanism, robot.q, q, name, label)
        self._goal = Snapshot(reached, snapshot.pins, snapshot.described)
        what = "before" if backwards else "after"
        return f"{', '.join(lost)}: the file has changed: no configuration as {what} this step is left" if lost else ""

    def _restore(self, snapshot: Snapshot) -> None:
        """Restore pins and tasks of other kinds that a snapshot has, as far as their nodes are there."""
        for name, pins in snapshot.pins.items():
            robot = self._robots.get(name)
            for pin in pins if robot is not None else ():
                if robot is not None and pin.node in robot.mechanism.nodes:
                    robot.restore(self._new_id(), pin)
        for name, tasks in snapshot.described.items():
            robot = self._robots.get(name)
            if robot is not None:
                for task in [task for task in robot.described if task.id not in tasks]:
                    robot.remove_described(task)
                present = {task.id: task for task in robot.described}
                for id, description in tasks.items():
                    with contextlib.suppress(CinegenError):
                        if id not in present:
                            robot.add_described(id, description)
                        elif present[id].description != description:
                            robot.change_described(present[id], description)
