"""`DrivenRobot`: one robot of a session, with its base pose, its tasks, and its motion in a tick."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik import FrameTask, Range, Solver, State, Status, Step, Task
from cinegen.ik.given_task import errors_of
from cinegen.ik.joint_settings import checked_names, names_of
from cinegen.ik.tasks.described import TaskDescription, check, move_base, resolved, task_of
from cinegen.ik.thresholds import ARRIVED
from cinegen.joints import kinematic_data
from cinegen.mission import RecordedTask, RobotSample
from cinegen.model import Mechanism
from cinegen.session.carried import carried_over, joint_values
from cinegen.session.holding import Holding
from cinegen.session.motion import Retrace, RobotMotion, at_limit
from cinegen.session.state import CarriedMass, DescribedState, Obstruction, RobotState, RobotStatus, TaskState
from raff2urdf.errors import counted

POINTER, PIN, SENSOR = "pointer", "pin", "sensor"
"""Sources of tasks."""

FRAME_PRIORITY = 1
"""Priority of drags, pins and sensors: tasks of other kinds, by default of priority 0, hold while a part is dragged."""

_STAYS = 1e-9  # rad or lengths: a locked joint that a motion changes by less stays


@dataclass(eq=False)
class UserTask:
    """A task of a robot's solver, and what commands it.

    Attributes:
        id: number of the task in the session.
        task: task of the solver; its target is in the robot's own world.
        source: `POINTER`, `PIN` or `SENSOR`.
        label: name for people.
        scripted: whether a script commands it.
    """

    id: int
    task: FrameTask
    source: str
    label: str
    scripted: bool = False


@dataclass(eq=False)
class DescribedTask:
    """A task of a kind that plain data describe.

    Attributes:
        id: number of the task in the session.
        description: what describes it, in the session's world.
        task: task of the solver, in the robot's own world.
    """

    id: int
    description: TaskDescription
    task: Task | Range


class DrivenRobot:
    """A robot that is driven.

    Args:
        name: name in the session.
        solver: solver that moves it.

    Attributes:
        base: base pose: placement of its own world in the session's (m).
        home: (nq,) initial configuration, to which it is sent home.
        locked: names of the joints that are locked: only an undo moves them.
        tasks: its tasks that are frames, in the order in which they were added.
        described: its tasks of other kinds, likewise. They wait while a motion moves it.
        motion: motion that moves it instead of its tasks; None: the tasks do.
        step: last step of the solver.
        holding: torques that hold it; None if its links have no masses.
        carried: its payload.
    """

    _least_rotation = 0  # rotations that each task constrains, at least

    def __init__(self, name: str, solver: Solver) -> None:
        self.name, self.solver = name, solver
        self.mechanism: Mechanism = solver.mechanism
        self.base = pin.SE3.Identity()
        self.home = solver.q
        self.locked: tuple[str, ...] = ()
        self.tasks: list[UserTask] = []
        self.described: list[DescribedTask] = []
        self._follows = True  # its tasks of other kinds
        self._data = kinematic_data(self.mechanism.model)
        self.motion: RobotMotion | None = None
        self.holding: Holding | None = None
        self.carried = CarriedMass(self.mechanism.end, 0.0)
        self._reported = 0  # messages of the solver's exception log
        self.step: Step = self.solver.step()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}: {counted(len(self.tasks), 'task')}, {self.status().name}>"

    @property
    def q(self) -> Array:
        """(nq,) configuration."""
        return self.solver.q

    def placement(self, node: str) -> pin.SE3:
        """Return the placement of a node in the session's world."""
        return self.base * self.mechanism.placement(self.solver.q, node)

    # --- tasks ---------------------------------------------------------------------------------------------------

    def add_task(
        self, id: int, node: str, source: str, label: str, offset: pin.SE3 | None = None, dof: tuple[int, int] = (3, 3)
    ) -> UserTask:
        """Add a task at the present pose of a node.

        Args:
            id: number of the task in the session.
            node: node to move.
            source: `POINTER`, `PIN` or `SENSOR`.
            label: name for people.
            offset: frame to constrain, in the node's frame (m).
            dof: number of translations and rotations to constrain.
        """
        rotation = max(dof[1], self._least_rotation)
        task = self.solver.add_task(node, translation=dof[0], rotation=rotation, offset=offset, priority=FRAME_PRIORITY)
        self.tasks.append(UserTask(id, task, source, label))
        return self.tasks[-1]

    def remove_task(self, task: UserTask) -> None:
        """Remove a task."""
        self.tasks.remove(task)
        self.solver.remove_task(task.task)

    def tasks_of(self, source: str, node: str | None = None) -> Iterator[UserTask]:
        """Yield the tasks of a source, of a node or of all."""
        for task in tuple(self.tasks):
            if task.source == source and node in (None, task.task.node):
                yield task

    def add_described(self, id: int, description: TaskDescription) -> None:
        """Add a task of a kind; its target or axis is the present one where it is null.

        Raises:
            CinegenError: a name does not exist, or a value can't be followed.
        """
        described = self._made(id, description)
        self._follow(True)
        self.solver.add_task(described.task)
        self.described.append(described)

    def change_described(self, described: DescribedTask, description: TaskDescription) -> None:
        """Replace a task of a kind by another; see `add_described`."""
        new = self._made(described.id, description)
        self._follow(True)
        self.solver.add_task(new.task)
        self.solver.remove_task(described.task)
        described.description, described.task = new.description, new.task

    def remove_described(self, described: DescribedTask) -> None:
        """Remove a task of a kind."""
        self.described.remove(described)
        self.solver.remove_task(described.task)

    def _made(self, id: int, description: TaskDescription) -> DescribedTask:
        """Return a task of a kind that a solver can follow."""
        state = self._state
        description = resolved(description, state, self.base)
        task = task_of(description, self.base)
        check(task, state)
        return DescribedTask(id, description, task)

    @property
    def _state(self) -> State:
        return State(self.mechanism, self.q, self.solver.dt, (), self._data)

    def _follow(self, follows: bool) -> None:
        """Follow tasks of other kinds than frames, or let them wait."""
        if follows == self._follows:
            return
        self._follows = follows
        for described in self.described:
            if follows:
                self.solver.add_task(described.task)
            else:
                self.solver.remove_task(described.task)

    def recorded_tasks(self, source: str | None = None) -> tuple[RecordedTask, ...]:
        """Return the tasks of a source, or all, as values with targets in the session's world."""
        return tuple(
            RecordedTask(
                t.node,
                user_task.source,
                t.offset.copy(),
                self.base * t.target,
                t.translation,
                t.rotation,
                t.weight,
                t.priority,
            )
            for user_task, t in ((user_task, user_task.task) for user_task in self.tasks)
            if source in (None, user_task.source)
        )

    def restore(self, id: int, task: RecordedTask, source: str = PIN) -> UserTask:
        """Add a task again, with an id."""
        user_task = self.add_task(id, task.node, source, source, task.offset, (task.translation, task.rotation))
        user_task.task.weight, user_task.task.priority = task.weight, task.priority
        if task.target is not None:
            self.set_target(user_task, task.target)
        return user_task

    def set_target(self, task: UserTask, target: pin.SE3) -> None:
        """Set the target of a task, given in the session's world."""
        task.task.target = self.base.actInv(target)

    # --- motion --------------------------------------------------------------------------------------------------

    def lock(self, joint: str, locked: bool) -> None:
        """Lock a joint, or unlock it.

        Raises:
            UnknownNameError: no such joint.
            CinegenError: the base does not float.
        """
        names = checked_names(self.mechanism, [joint])
        others = tuple(name for name in self.locked if name not in names)
        self.locked = (*others, *names) if locked else others

    def _moved_locked(self, q: Array) -> list[str]:
        """Return the locked joints that are elsewhere in q (nq,)."""
        moved, names = np.abs(self.mechanism.scaled_difference(self.q, q)) > _STAYS, list[str]()
        for name in self.locked:
            names += [name] * bool(moved[self.mechanism.columns_of(name)].any())
        return names

    def set_base(self, base: pin.SE3) -> None:
        """Set the base pose. Targets keep their pose in the session's world."""
        moved = base.actInv(self.base)
        self.base = base
        for user_task in self.tasks:
            if user_task.task.is_valid():
                user_task.task.target = moved * user_task.task.target
        if not moved.isIdentity(0.0):
            for described in self.described:
                move_base(described.task, described.description, base)

    def tick(self, dt: float) -> str:
        """Move by one tick of dt (s). Return a message for people; mostly an empty one."""
        self.solver.dt = dt
        problem = self._advance(dt)
        messages = self.solver.exception_log.messages
        if len(messages) == self._reported:
            return problem
        new, self._reported = messages[self._reported :], len(messages)
        return "; ".join([problem] * bool(problem) + new)

    def _advance(self, dt: float) -> str:
        motion = self.motion
        self._follow(motion is None)
        if motion is None:
            self._hold(self.locked)
            self.step = self.solver.step()
            return ""
        self._hold(())  # motions know what is locked
        q = motion.advance(dt)
        if q is None:
            self.motion = None
            return f"{self.name}: {motion.problem}" if motion.problem else ""
        problem = self.collision(q)
        if self.locked and not problem and not isinstance(motion, Retrace):
            names = self._moved_locked(q)
            problem = f"locked: {', '.join(names[:3])}" if names else ""
        if problem:
            motion.block(self.q, problem)
        else:
            self.jump_to(q)
        return ""

    def _hold(self, joints: tuple[str, ...]) -> None:
        """Lock these joints of the solver, and no others."""
        if set(self.solver.locked) != set(joints):
            self.solver.unlock()
            self.solver.lock(*joints)

    def collision(self, q: Array) -> str:
        """Return a message about the collision on the straight line to q (nq,); empty if there is none."""
        return ""

    def jump_to(self, q: Array) -> None:
        """Set the configuration (nq,), with closed loops, and the targets of its tasks to their present poses."""
        if not np.array_equal(q, self.solver.q):
            self.solver.q = q
            self._retarget()
        self.step = self.solver.step()

    def succeed(self, other: DrivenRobot) -> str:
        """Move to where an earlier version of this robot is, with its payload; return a message if that can't be."""
        if other.carried.node in self.mechanism.nodes:
            self.carried = other.carried
        self.locked = tuple(name for name in other.locked if name in names_of(self.mechanism))
        q = carried_over(self.mechanism, joint_values(other.mechanism, other.q), self.q)
        why = "its loops can't be closed within its limits where it was" if q is None else self.contact(q)
        if q is not None and not why:
            self.jump_to(q)
        return f"{self.name} is at home: {why}" if why else ""

    def contact(self, q: Array) -> str:
        """Return a message about a collision at q (nq,); empty if there is none."""
        return ""

    def _retarget(self) -> None:
        """Set the targets of its tasks to their present poses."""
        for user_task in self.tasks:
            user_task.task.target = self.mechanism.placement(self.solver.q, user_task.task.node) * user_task.task.offset

    def moving_parts(self) -> Array:
        """Return the numbers that change when it moves: configuration, base pose and targets, rad and m."""
        poses = [self.base, *(user_task.task.target for user_task in self.tasks)]
        return np.concatenate([self.q, *(part for pose in poses for part in (pose.translation, pose.rotation.ravel()))])

    # --- state ---------------------------------------------------------------------------------------------------

    def status(self) -> RobotStatus:
        """Return the status of the last tick."""
        step, motion = self.step, self.motion
        if motion is not None:
            label = motion.problem or motion.label
            return RobotStatus(motion.name.upper(), label, f"{self.name}: {motion.label}")
        status = step.status
        label = status.name.lower().replace("_", " ")
        if status is Status.AT_LIMIT and step.saturated:
            label = at_limit(step.saturated)
        elif status is Status.OUT_OF_REACH:
            metres, angle = (max(parts) for parts in zip(*step.errors, strict=True))
            far = metres > self.mechanism.length * min(1e-3, angle)  # not 0 degrees
            label += f" by {1000.0 * metres:.3g} mm" if far else f" by {math.degrees(angle):.3g}°"
        description = "; ".join([status.value, *filter(None, step.problems)])
        return RobotStatus(status.name, label, description)

    def state(self) -> RobotState:
        """Return the state."""
        followed, task_errors = self.solver.tasks, self.step.errors
        errors = dict(zip(map(id, followed), task_errors, strict=True)) if len(followed) == len(task_errors) else {}
        tasks = tuple(
            TaskState(
                id=user_task.id, node=t.node, source=user_task.source, label=user_task.label,
                error=errors.get(id(t), (0.0, 0.0)), translation=t.translation, rotation=t.rotation, weight=t.weight,
                priority=t.priority, scripted=user_task.scripted, offset=t.offset.copy(), target=t.target.copy(),
            )
            for user_task, t in ((user_task, user_task.task) for user_task in self.tasks)
        )  # fmt: skip
        step, q = self.step, self.q
        carried = torques = None
        if self.holding is not None:
            self.holding.load(self.carried, self.base)
            carried, torques = self.carried, self.holding.torques(q)
        return RobotState(
            q, self.base.copy(), tasks, self.status(), step.saturated, step.closure, self.obstruction(), carried,
            torques, self.locked, tuple(map(self._described_state, self.described)),
        )  # fmt: skip

    def _described_state(self, described: DescribedTask) -> DescribedState:
        try:
            error = errors_of(described.task, self._state)
        except CinegenError:  # the tick reports it
            error = math.nan, math.nan
        reached = error[0] <= ARRIVED * self.mechanism.length and error[1] <= ARRIVED
        return DescribedState(id=described.id, description=described.description, error=error, reached=reached)

    def obstruction(self) -> Obstruction | None:
        """Return what stops it among obstacles; None where nothing does."""
        return None

    def sample(self) -> RobotSample:
        """Return what a mission records."""
        described = tuple(task.description for task in self.described)
        return RobotSample(self.q, self.status().name, self.recorded_tasks(), described)
