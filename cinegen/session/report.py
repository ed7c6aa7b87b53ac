"""Reports on a moving robot: distances to singularities and limits, the manipulability ellipsoid, and a forecast.

They are computed outside the session's loop, a few times per second.
"""

from __future__ import annotations

import contextlib

import numpy as np
import pinocchio as pin
from msgspec import Struct
from msgspec.structs import replace

from cinegen.arrays import Array
from cinegen.ik import Event, EventKind, FrameTask, LookAhead, Step
from cinegen.ik.singular_values import gained
from cinegen.loops.motions import motions_of
from cinegen.model import Mechanism
from cinegen.session.holding import BearingReporter, HoldingError, ReactionReport
from cinegen.session.state import CarriedMass, RobotState, RobotStatus
from cinegen.singularities.ball_joints import CountedLoops, balls
from cinegen.tolerances import NEAR_SINGULAR

HORIZON = 1.5
"""Duration of the forecast, s."""

_DT = 1.0 / 60.0  # s: period of the look-ahead solver
_REACH = 0.2  # rad or lengths: motion of the joints for the ellipsoid
_ALONG = 0.9  # component of a unit vector that is "along" an axis
_CLEAR = 0.08  # fraction of a joint's range that is near its limit
_POINTS = 40  # of the forecast
_ROUGH = 0.01  # error of a singular value at an event, which lies between two ticks


class SingularityReport(Struct, frozen=True):
    """Distance to a singularity.

    Attributes:
        sigma: singular value (dimensionless) that vanishes at the singularity.
        threshold: value below which it is near.
        text: the motion that is lost or uncontrolled, for people.
        node: node at which the motion is seen.
        position: of the node in the world (m).
        twist: the motion in the world, of length 1: linear (characteristic lengths), then angular (rad).
    """

    sigma: float
    threshold: float
    text: str
    node: str
    position: Array
    twist: Array

    @property
    def is_near(self) -> bool:
        """True below the threshold."""
        return self.sigma < self.threshold


_WORSE = ("BAD_TARGET", "TOUCHING", "UNAVOIDABLE", "REFUSED")
_OBSTRUCTED = ("BARRED", "PUSHED", "AT_LIMIT", "OUT_OF_REACH")


class Ellipsoid(Struct, frozen=True):
    """Manipulability ellipsoid: motion of a node if all joints together move by 0.2 rad or characteristic lengths.

    Attributes:
        center: position of the node in the world (m).
        axes: half axes in the world as rows (m).
    """

    center: Array
    axes: Array


class ForecastEvent(Struct, frozen=True):
    """An event in the forecast.

    Attributes:
        time: time from now, s.
        kind: name of an `EventKind`.
        text: the event, for people.
        position: of the node at that time, in the world (m).
    """

    time: float
    kind: str
    text: str
    position: Array


class ForecastReport(Struct, frozen=True):
    """Forecast of the next 1.5 s, if the targets move on as they do.

    Attributes:
        path: (n, 3) positions of the node in the world (m).
        events: singularities and limits on it.
    """

    path: Array
    events: tuple[ForecastEvent, ...]


class RobotReport(Struct, frozen=True):
    """Report on a robot.

    Attributes:
        q: values of its joints, in the order of the description, rad and m.
        saturated: joints whose limit restricts the motion.
        near_limit: joints near a limit.
        closure: largest loop residual, rad or characteristic lengths.
        type1: of the tasks, or of the robot's end without tasks; None if that can't move.
        type2: of the passive joints; None without loops.
        ellipsoid: None if the robot can't move.
        forecast: path and events ahead.
        carried: its payload; None for a robot whose links have no masses.
        reactions: reactions in its joints and loops, none where no torques hold the load; None unless a client has
            asked for them.
        locked: joints that are locked; None where joints can't be locked.
    """

    q: Array
    saturated: tuple[str, ...]
    near_limit: tuple[str, ...]
    closure: float
    type1: SingularityReport | None
    type2: SingularityReport | None
    ellipsoid: Ellipsoid | None
    forecast: ForecastReport
    carried: CarriedMass | None = None
    reactions: tuple[ReactionReport, ...] | None = None
    locked: tuple[str, ...] | None = None


def agreed_status(status: RobotStatus, report: RobotReport | None) -> RobotStatus:
    """Return the status of a robot in agreement with the singular values in a report on it.

    The first that applies is returned: BAD_TARGET, TOUCHING, UNAVOIDABLE, REFUSED; UNCONTROLLED, near a type 2
    singularity; BARRED, PUSHED, AT_LIMIT, OUT_OF_REACH; SINGULAR, near a type 1 singularity; DAMPED, slowed down by
    damping elsewhere; the status itself.

    Args:
        status: status in the session.
        report: last report; None: there is none yet, and the status stays.
    """
    if report is None or status.name in _WORSE:
        return status
    if report.type2 is not None and report.type2.is_near:
        return RobotStatus("UNCONTROLLED", "near a singularity: uncontrolled DoF", report.type2.text)
    near = report.type1 is not None and report.type1.is_near
    if status.name in _OBSTRUCTED:
        return replace(status, label=f"{status.label}, near a singularity") if near else status
    if report.type1 is not None and near:
        return RobotStatus("SINGULAR", "near a singularity: lost DoF", report.type1.text)
    if status.name == "SINGULAR":
        return RobotStatus("DAMPED", "motion is damped", "the damping threshold is above the singular value")
    return status


class Reporter:
    """Reports on one robot. For one thread at a time.

    Where three revolute joints stand for a ball joint, their gimbal lock is not reported as a singularity.

    Args:
        mechanism: mechanism of the robot.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        inner = {mechanism.model.getJointId(joint) for names in balls(mechanism) for joint in names[:2]}
        frames = {node: mechanism.model.frames[mechanism.frame_id(node)] for node in mechanism.nodes}
        self._within = {node for node, frame in frames.items() if frame.parentJoint in inner}
        self._system = mechanism.structure.own_system()
        self._counted = CountedLoops(mechanism) if inner else self._system
        self._loops = self._counted
        self._look_ahead = LookAhead(mechanism, _DT)
        self._solver = self._look_ahead.solver
        self._last: dict[int, tuple[float, pin.SE3]] = {}  # last targets, with their times
        self._bearing: BearingReporter | None = None
        with contextlib.suppress(HoldingError):
            self._bearing = BearingReporter(mechanism)

    def report(self, robot: RobotState, time: float, with_reactions: bool = False) -> RobotReport:
        """Return the report.

        Args:
            robot: state of the robot.
            time: time of the session, s.
            with_reactions: whether reactions are wanted.
        """
        q = robot.q
        self._set_tasks(robot)
        if set(robot.locked) != set(self._solver.locked):
            self._solver.unlock()
            self._solver.q = q
            self._solver.lock(*robot.locked)
        tasks = self._solver.frame_tasks
        self._loops = self._system if any(task.node in self._within for task in tasks) else self._counted
        mechanism = self._solver.held_mechanism
        if robot.locked:
            self._loops = mechanism.structure.system
        node, at = tasks[0].node, tasks[0].offset
        self._look_ahead.velocities = self._velocities(robot, time)
        placement, step = mechanism.placement(q, node) * at, self._step_at(q)
        lost, uncontrolled = step.lost_dof_in(self._loops), gained(mechanism, q, self._loops)
        type1 = type2 = None
        base = robot.base
        if lost is not None:
            which = int(np.argmax(np.linalg.norm(lost.twists, axis=1)))
            worst = tasks[which]
            type1 = self._singularity(
                lost.values, NEAR_SINGULAR, worst.node, worst.offset, lost.twists[which], robot, "lost"
            )
        if uncontrolled is not None:
            moving, twist = self._moved_most(uncontrolled.joints)
            unit = pin.SE3.Identity()
            type2 = self._singularity(uncontrolled.values, NEAR_SINGULAR, moving, unit, twist, robot, "gained")
        path, events = self._forecast(robot, node, at)
        ellipsoid = self._ellipsoid(q, node, at)
        if ellipsoid is not None:
            ellipsoid = ellipsoid @ base.rotation.T
        return RobotReport(
            q[[mechanism.q_index(joint) for joint in mechanism.joints]],
            robot.saturated,
            self._near_limit(q),
            robot.closure,
            type1,
            type2,
            None if ellipsoid is None else Ellipsoid(base.act(placement.translation), ellipsoid),
            ForecastReport(path @ base.rotation.T + base.translation, events),
            robot.carried,
            self._bearing.report(robot) if with_reactions and self._bearing is not None else None,
            robot.locked,
        )

    def _step_at(self, q: Array) -> Step:
        """Return a step of length 0, whose numbers are those of q."""
        self._solver.q = q
        for task in self._solver.frame_tasks:
            task.target = self.mechanism.placement(q, task.node) * task.offset
        return self._solver.step()

    # --- tasks ---------------------------------------------------------------------------------------------------

    def _set_tasks(self, robot: RobotState) -> None:
        """Give the look-ahead solver the robot's tasks; one for its end if there are none."""
        tasks = [
            FrameTask(task.node, task.target, task.translation, task.rotation, task.weight, offset=task.offset)
            for task in robot.tasks
        ]
        self._solver.copy_tasks(tasks or [FrameTask(self.mechanism.end, pin.SE3.Identity())])

    def _velocities(self, robot: RobotState, time: float) -> tuple[pin.Motion, ...]:
        """Return the velocity of each target in the robot's own world."""
        velocities, now = [], {}
        for task in robot.tasks:
            velocity = pin.Motion.Zero()
            before = self._last.get(task.id)
            if before is not None and time > before[0] and not task.scripted:
                linear = task.target.translation - before[1].translation
                angular = pin.log3(task.target.rotation @ before[1].rotation.T)
                velocity = pin.Motion(linear, angular) / (time - before[0])
            now[task.id] = time, task.target
            velocities.append(velocity)
        self._last = now
        return tuple(velocities)

    # --- singularities -------------------------------------------------------------------------------------------

    def _singularity(
        self, values: Array, near: float, node: str, at: pin.SE3, twist: Array, robot: RobotState, what: str
    ) -> SingularityReport:
        """
        Args:
            values: singular values, largest first.
            twist: (6,) of the last one, in the axes of the robot's own world.
        """
        length, sigma = self.mechanism.length, float(values[-1])
        unit = np.concatenate([twist[:3] / length, twist[3:]])
        size = float(np.linalg.norm(unit))
        unit = unit / size if size > 0.0 else unit
        place = self.mechanism.placement(robot.q, node) * at
        direction = self._direction(unit, place.rotation, node)
        close = sigma < near
        if what == "lost":
            words = f"hardly any motion {direction}" if close else f"hardest to move {direction}"
        else:
            words = f"the actuated joints hardly control it {direction}" if close else f"controlled least {direction}"
        others = int((values < near).sum()) - 1
        if others > 0:
            words += f", and {others} more DoF"
        world = robot.base.rotation
        turned = np.concatenate([world @ unit[:3], world @ unit[3:]])
        return SingularityReport(sigma, near, words, node, robot.base.act(place.translation), turned)

    @staticmethod
    def _direction(unit: Array, rotation: Array, node: str) -> str:
        """Return the direction of a twist for people: `along x of platform`."""
        linear, angular = np.linalg.norm(unit[:3]), np.linalg.norm(unit[3:])
        part, how = (unit[:3], "along") if linear >= angular else (unit[3:], "about")
        axis = part / np.linalg.norm(part) if part.any() else part
        for axes, of in ((rotation, node), (np.eye(3), "the base")):
            in_axes = axes.T @ axis
            k = int(np.argmax(np.abs(in_axes)))
            if abs(in_axes[k]) > _ALONG:
                return f"{how} {'xyz'[k]} of {of}"
        return f"{how} ({', '.join(f'{x:.1f}' for x in axis)}) of the base"

    def _moved_most(self, joints: Array) -> tuple[str, Array]:
        """Return the node that a motion, of the columns of `_loops`, moves most, preferably the end, and its twist in
        the world's axes."""
        best, most, best_twist = self.mechanism.end, 0.0, np.zeros(6)
        for node in (self.mechanism.end, *self.mechanism.nodes):
            if node in self._within:
                continue
            twist = self._jacobian(node, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED) @ joints
            size = float(np.linalg.norm(twist / np.array([self.mechanism.length] * 3 + [1.0] * 3)))
            if size > 1.5 * most + 1e-6:
                best, most, best_twist = node, size, twist
        return best, best_twist

    def _jacobian(self, node: str, axes: pin.ReferenceFrame) -> Array:
        """Return the Jacobian (6, nv) of a node where `_loops` was evaluated last, m and rad."""
        frame, model, data = self.mechanism.frame_id(node), self.mechanism.model, self._loops.data
        pin.updateFramePlacement(model, data, frame)
        return np.asarray(pin.getFrameJacobian(model, data, frame, axes)).reshape(6, -1)

    def _ellipsoid(self, q: Array, node: str, at: pin.SE3) -> Array | None:
        """Return the half axes as rows (3, 3), m, in the axes of the robot's own world."""
        mechanism = self._solver.held_mechanism
        motions = motions_of(self._loops, q, mechanism.loop_rank)
        if motions.shape[1] == 0:
            return None
        jacobian = at.toActionMatrixInverse() @ self._jacobian(node, pin.ReferenceFrame.LOCAL)
        rotation = (mechanism.placement(q, node) * at).rotation
        u, sigma, _ = np.linalg.svd(rotation @ jacobian[:3] * mechanism.scale @ motions)
        sizes = np.zeros(3)
        sizes[: len(sigma)] = sigma
        return np.asarray((u * sizes).T * _REACH)

    def _near_limit(self, q: Array) -> tuple[str, ...]:
        """Return the joints near a limit."""
        joints = []
        for joint, (low, high, *_) in self.mechanism.limits.items():
            value = q[self.mechanism.q_index(joint)]
            if np.isfinite(high - low) and min(value - low, high - value) < _CLEAR * (high - low):
                joints.append(joint)
        return tuple(joints)

    # --- forecast ---------------------------------------------------------------------------------------------------

    def _forecast(self, robot: RobotState, node: str, at: pin.SE3) -> tuple[Array, tuple[ForecastEvent, ...]]:
        """Return the path of the node if the targets move on as they do, and the events on it."""
        mechanism = self.mechanism
        if not robot.tasks or robot.described:  # it does not know tasks of other kinds
            return np.zeros((0, 3)), ()
        for copied, task in zip(self._solver.frame_tasks, robot.tasks, strict=True):
            copied.target = task.target
        forecast = self._look_ahead.forecast(HORIZON, NEAR_SINGULAR)
        every = max(1, len(forecast.q) // _POINTS)
        path = np.array([(mechanism.placement(q, node) * at).translation for q in forecast.q[::every]])
        if np.ptp(path, axis=0).max() < 1e-4 * mechanism.length:
            path = np.zeros((0, 3))
        events = tuple(
            ForecastEvent(
                event.time,
                event.kind.name,
                str(event),
                robot.base.act((mechanism.placement(event.q, node) * at).translation),
            )
            for event in forecast.events
            if event.time > 0.0 and event.kind is not EventKind.STOPPED and not self._is_gimbal_lock(event)
        )
        return path, events

    def _is_gimbal_lock(self, event: Event) -> bool:
        """Return whether only the joints that stand for ball joints are singular at an event.

        Three revolute joints that stand for a ball joint are singular where their axes are in a plane, which the ball
        joint is not: the mechanism is regular there if the smallest singular value with ball joints counted as one
        (`CountedLoops`, dimensionless) is clearly above the threshold of events.
        """
        if not isinstance(self._loops, CountedLoops) or event.kind not in (EventKind.TYPE_1, EventKind.TYPE_2):
            return False
        if event.kind is EventKind.TYPE_1:
            lost = self._step_at(event.q).lost_dof_in(self._loops)
            return lost is not None and lost.sigma > NEAR_SINGULAR + _ROUGH
        weakest = gained(self.mechanism, event.q, self._loops)
        return weakest is not None and weakest.sigma > NEAR_SINGULAR + _ROUGH
