"""What people want to know of a robot that moves: how near singularities are, which way it is moved worst, what lies
ahead. Computed beside the session's loop, a few times a second."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik import EventKind, Solver
from cinegen.ik.resolve import free_motions
from cinegen.ik.singular import NEAR_PASSIVE
from cinegen.model import Mechanism
from cinegen.session.state import RobotState

Array = NDArray[np.float64]

AHEAD = 1.5
"""s that are foreseen."""

NEAR = 0.05
"""A singular value of the tasks (without unit) below this is near a singularity of type 1."""

_DT = 1.0 / 60.0  # s: of the twin's ticks
_REACH = 0.2  # rad or lengths of the joints that the ellipsoid is drawn for
_ALONG = 0.9  # part of a unit vector that makes it "along" an axis
_CLEAR = 0.08  # part of a joint's range that counts as near its limit
_POINTS = 40  # of the path ahead


@dataclass(frozen=True)
class Singularity:
    """How near a singularity is.

    Attributes:
        sigma: the singular value that vanishes there, without unit.
        near: below which it is near.
        words: which motion is lost, or gained.
        node: that it is seen at.
        at: (3,) where that is, in the session's world.
        twist: (6,) the motion there: linear (characteristic lengths) above angular (rad), a unit vector.
    """

    sigma: float
    near: float
    words: str
    node: str
    at: Array
    twist: Array


@dataclass(frozen=True)
class Ahead:
    """An event that lies ahead.

    Attributes:
        time: s from now.
        kind: of `EventKind`, its name.
        words: for people.
        at: (3,) where the node is then, in the session's world.
    """

    time: float
    kind: str
    words: str
    at: Array


@dataclass(frozen=True)
class Report:
    """A robot at a moment.

    Attributes:
        near: joints near a limit.
        type1: of what holds the robot, or of its end where nothing does; None where that can't move at all.
        type2: of its passive joints; None without loops.
        ellipsoid: (3,) centre and (3, 3) half axes as rows, m, in the session's world: how far the node goes when the
            joints go by 0.2 rad or characteristic lengths together. None where it can't move.
        path: (n, 3) where the node will be, in the session's world.
        events: what lies ahead.
    """

    near: tuple[str, ...]
    type1: Singularity | None
    type2: Singularity | None
    ellipsoid: tuple[Array, Array] | None
    path: Array
    events: tuple[Ahead, ...]


class Reporter:
    """Looks at one robot. One thread at a time.

    Args:
        mechanism: which.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._twin = Solver(mechanism, _DT)
        self._kinds: list[tuple[object, ...]] = []
        self._last: dict[int, tuple[float, pin.SE3]] = {}  # targets, and when they were so

    def report(self, robot: RobotState, time: float) -> Report:
        """What there is to know.

        Args:
            robot: its state.
            time: s, of the session.
        """
        mechanism, q = self.mechanism, robot.q
        self._hold(robot)
        tasks = self._twin.tasks
        node, at = tasks[0].node, tasks[0].offset
        velocities = self._velocities(robot, time)
        self._twin.q = q
        here = mechanism.placement(q, node) * at
        for task in tasks:
            task.target = mechanism.placement(q, task.node) * task.offset
        step = self._twin.step()  # of no length: what it knows is of q
        lost, gained = step.lost_dof, step.uncontrolled_dof
        type1 = type2 = None
        base = robot.base
        if lost is not None:
            which = int(np.argmax(np.linalg.norm(lost.twists, axis=1)))
            own = tasks[which]
            type1 = self._singularity(lost.sigma, NEAR, own.node, own.offset, lost.twists[which], robot, "lost")
        if gained is not None:
            moving, twist = self._moved_most(q, gained.joints)
            type2 = self._singularity(gained.sigma, NEAR_PASSIVE, moving, pin.SE3.Identity(), twist, robot, "gained")
        path, events = self._ahead(robot, velocities, node, at)
        ellipsoid = self._ellipsoid(q, node, at)
        if ellipsoid is not None:
            ellipsoid = ellipsoid @ base.rotation.T
        return Report(
            self._near(q),
            type1,
            type2,
            None if ellipsoid is None else (base.act(here.translation), ellipsoid),
            path @ base.rotation.T + base.translation,
            events,
        )

    # --- what holds it -------------------------------------------------------------------------------------------

    def _hold(self, robot: RobotState) -> None:
        """The twin is held as the robot is; by its end where nothing holds it."""
        kinds: list[tuple[object, ...]] = [
            (task.node, task.translation, task.rotation, task.offset.homogeneous.tobytes()) for task in robot.tasks
        ]
        if not kinds or kinds != self._kinds:
            for task in self._twin.tasks:
                self._twin.remove_task(task)
            for state in robot.tasks:
                self._twin.add_task(
                    state.node, translation=state.translation, rotation=state.rotation, offset=state.offset
                ).weight = state.weight
            if not kinds:
                self._twin.add_task(self.mechanism.end)
            self._kinds = kinds

    def _velocities(self, robot: RobotState, time: float) -> list[pin.Motion]:
        """How fast the targets move, each in its own axes."""
        found, now = [], {}
        for task in robot.tasks:
            velocity = pin.Motion.Zero()
            before = self._last.get(task.number)
            if before is not None and time > before[0] and not task.scripted:
                velocity = pin.log6(before[1].actInv(task.target)) / (time - before[0])
            now[task.number] = time, task.target
            found.append(velocity)
        self._last = now
        return found

    # --- singularities -------------------------------------------------------------------------------------------

    def _singularity(
        self, sigma: float, near: float, node: str, at: pin.SE3, twist: Array, robot: RobotState, what: str
    ) -> Singularity:
        """
        Args:
            twist: (6,) in the axes of the robot's world.
        """
        length = self.mechanism.length
        unit = np.concatenate([twist[:3] / length, twist[3:]])
        size = float(np.linalg.norm(unit))
        unit = unit / size if size > 0.0 else unit
        place = self.mechanism.placement(robot.q, node) * at
        direction = self._direction(unit, place.rotation, node)
        close = sigma < near
        if what == "lost":
            words = f"hardly any motion {direction}" if close else f"hardest to move {direction}"
        else:
            words = f"the motors hardly hold it {direction}" if close else f"held least {direction}"
        world = robot.base.rotation
        turned = np.concatenate([world @ unit[:3], world @ unit[3:]])
        return Singularity(sigma, near, words, node, robot.base.act(place.translation), turned)

    @staticmethod
    def _direction(unit: Array, rotation: Array, node: str) -> str:
        """A twist's direction, for people: `along x of platform`."""
        linear, angular = np.linalg.norm(unit[:3]), np.linalg.norm(unit[3:])
        part, how = (unit[:3], "along") if linear >= angular else (unit[3:], "about")
        axis = part / np.linalg.norm(part) if part.any() else part
        for axes, of in ((rotation, node), (np.eye(3), "the base")):
            own = axes.T @ axis
            k = int(np.argmax(np.abs(own)))
            if abs(own[k]) > _ALONG:
                return f"{how} {'xyz'[k]} of {of}"
        return f"{how} ({', '.join(f'{x:.1f}' for x in axis)}) of the base"

    def _moved_most(self, q: Array, joints: Array) -> tuple[str, Array]:
        """The node that a motion of the joints moves most, the end before others; its twist in the world's axes."""
        best, most, found = self.mechanism.end, 0.0, np.zeros(6)
        for node in (self.mechanism.end, *self.mechanism.nodes):
            twist = self.mechanism.jacobian(q, node) @ joints
            size = float(np.linalg.norm(twist / np.array([self.mechanism.length] * 3 + [1.0] * 3)))
            if size > 1.5 * most + 1e-6:
                rotation = self.mechanism.placement(q, node).rotation
                best, most = node, size
                found = np.concatenate([rotation @ twist[:3], rotation @ twist[3:]])
        return best, found

    def _ellipsoid(self, q: Array, node: str, at: pin.SE3) -> Array | None:
        """(3, 3) half axes as rows, m, in the axes of the robot's world."""
        mechanism = self.mechanism
        motions = np.eye(mechanism.model.nv)
        if mechanism.loops:
            motions = free_motions(mechanism.system.evaluate(q)[1], mechanism.loop_rank)[0]
        if motions.shape[1] == 0:
            return None
        own = at.toActionMatrixInverse() @ mechanism.jacobian(q, node)
        rotation = (mechanism.placement(q, node) * at).rotation
        u, sigma, _ = np.linalg.svd(rotation @ own[:3] * mechanism.scale @ motions)
        sizes = np.zeros(3)
        sizes[: len(sigma)] = sigma
        return np.asarray((u * sizes).T * _REACH)

    def _near(self, q: Array) -> tuple[str, ...]:
        """Joints near a limit."""
        found = []
        for joint, (low, high, *_) in self.mechanism.limits.items():
            value = q[self.mechanism.q_index(joint)]
            if np.isfinite(high - low) and min(value - low, high - value) < _CLEAR * (high - low):
                found.append(joint)
        return tuple(found)

    # --- ahead ---------------------------------------------------------------------------------------------------

    def _ahead(
        self, robot: RobotState, velocities: list[pin.Motion], node: str, at: pin.SE3
    ) -> tuple[Array, tuple[Ahead, ...]]:
        """Where the node will go when targets move on as they do, and what happens then."""
        twin, mechanism = self._twin, self.mechanism
        if not robot.tasks:
            return np.zeros((0, 3)), ()
        for part in (-1.0, 0.0):
            for own, task, velocity in zip(twin.tasks, robot.tasks, velocities, strict=True):
                own.target = task.target * pin.exp6(velocity * (part * _DT))
            twin.step()
        forecast = twin.forecast(AHEAD, dt=_DT, threshold=NEAR, passive_threshold=NEAR_PASSIVE)
        every = max(1, len(forecast.q) // _POINTS)
        path = np.array([(mechanism.placement(q, node) * at).translation for q in forecast.q[::every]])
        if np.ptp(path, axis=0).max() < 1e-4 * mechanism.length:
            path = np.zeros((0, 3))
        events = tuple(
            Ahead(
                event.time,
                event.kind.name,
                str(event),
                robot.base.act((mechanism.placement(event.q, node) * at).translation),
            )
            for event in forecast.events
            if event.time > 0.0 and event.kind is not EventKind.STOPPED
        )
        return path, events
