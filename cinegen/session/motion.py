"""Motions of a robot that no task causes: of single joints, to a configuration, along a line, and of undo.

Each has `advance(dt)`: the configuration after dt (s), with closed loops, or None when it has ended. Once constructed,
none of them raises.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError, LimitError
from cinegen.ik import Solver
from cinegen.ik.objectives import Posture
from cinegen.ik.tasks.blend import eased
from cinegen.model import ForwardKinematics, Mechanism
from cinegen.tolerances import CLOSURE

_FASTEST = 2.0  # rad/s, or characteristic lengths per second: of a joint without a velocity limit
_SHORTEST, _LONGEST = 0.3, 30.0  # s for a motion to a configuration
_THERE = 1e-6  # rad or lengths: distance at which a configuration is reached
PATIENCE = 0.5
"""Time that a motion waits for what is in its path, s."""

_RETRACED = 1.5  # s: longest duration of an undo

_LINE_SPEED = 0.6  # characteristic lengths or rad per second, on average
_LINE_SHORTEST, _LINE_LONGEST = 0.4, 10.0  # s
_LAG = 0.01  # lengths or rad that the node may be behind its target; beyond, the target waits
_LINE_PATIENCE = 0.4  # s that it waits in all
_SPATIAL = 6  # DoF: with fewer, the node's orientation follows from its position


def at_limit(joints: Sequence[str]) -> str:
    """Return the text on joints at their limits, of which the first two are named."""
    return f"at the limit of {' and '.join(joints[:2])}"


class RobotMotion(Protocol):
    """A motion of a robot.

    Attributes:
        name: name in the state, in lower case.
        label: a few words for people.
        problem: reason why it did not do all that it should; empty if it did.
        jumps: whether its last configuration can't be reached from the one before.
    """

    name: str
    label: str
    problem: str
    jumps: bool

    def advance(self, dt: float) -> Array | None:
        """Return the configuration (nq,) after dt (s); None when the motion has ended."""

    def block(self, q: Array, problem: str) -> None:
        """Take back the last advance: the robot is still at q (nq,), for this reason."""


class JointMotion:
    """Motion of single actuated joints, within their velocity limits. Passive joints follow on this branch.

    If the loops can't follow, or a passive joint would pass its limit during a tick, all joints stay where they are
    (see `ForwardKinematics` on steps without proof).

    Args:
        mechanism: mechanism to move.
        q: (nq,) present configuration with closed loops.
    """

    name, label, jumps = "joints", "joint motion", False

    def __init__(self, mechanism: Mechanism, q: Array) -> None:
        self.problem = ""
        self.goal: dict[str, float] = {}
        self._mechanism = mechanism
        self._forward = ForwardKinematics(mechanism, q, within_limits=True)
        self._q = q.copy()
        self._speeds = _speeds(mechanism)
        self._ends = False

    def move(self, joint: str, value: float) -> None:
        """Set the goal of a joint (rad or m), clipped to its limits."""
        limits = self._mechanism.limits[joint]
        self.goal[joint] = min(max(value, limits.lower), limits.upper)

    def end(self) -> None:
        """End the motion when all joints have arrived."""
        self._ends = True

    def advance(self, dt: float) -> Array | None:
        """See `RobotMotion`."""
        values = {}
        for joint, goal in self.goal.items():
            value = self._q[self._mechanism.q_index(joint)]
            most = self._speeds[self._mechanism.v_index(joint)] * dt
            if value != goal:
                values[joint] = float(value + min(max(goal - value, -most), most))
        if not values:
            return None if self._ends else self._q
        self.problem = ""
        try:
            self._q = self._forward.move(values)
            return self._q
        except LimitError as error:
            self.problem = at_limit([error.joint])
        except CinegenError:
            self.problem = "its loops can't follow on this branch"
        self.goal = {}  # the next movement of a slider tries again
        return None if self._ends else self._q

    def block(self, q: Array, problem: str) -> None:
        """See `RobotMotion`; the next movement of a slider tries again."""
        self._forward.q = self._q = q
        self.goal, self.problem = {}, problem


class _TimedMotion:
    """A motion that advances with time, waits while it is blocked, and ends if it stays blocked."""

    problem, jumps = "", False
    _seconds: float
    _time = 0.0
    _waited = 0.0
    _dt = 0.0
    _blocked = False

    def _fraction(self, dt: float) -> float | None:
        """Return the fraction of the path after dt (s), 0 to 1; None when the motion has ended."""
        if self._time >= self._seconds:
            return None
        if not self._blocked:
            self._waited = 0.0
        self._blocked = False
        self._dt = dt
        self._time += dt
        return eased(self._time / self._seconds) if self._time < self._seconds else 1.0

    def block(self, q: Array, problem: str) -> None:
        """See `RobotMotion`."""
        self._blocked = True
        self._waited += self._dt
        self._time -= self._dt
        if self._waited >= PATIENCE or self._time == math.inf:
            self._time, self.problem = math.inf, problem


class ConfigurationMotion(_TimedMotion):
    """Motion to a configuration: actuated joints are interpolated, passive ones follow. A goal that can't be reached so
    on this branch, or within limits, is set at once.

    Args:
        mechanism: mechanism to move.
        q: (nq,) present configuration with closed loops.
        goal: (nq,) configuration with closed loops.
        name: name in the state.
        label: a few words for people.
    """

    def __init__(self, mechanism: Mechanism, q: Array, goal: Array, name: str, label: str) -> None:
        self.name, self.label = name, label
        self._mechanism, self._goal, self._start = mechanism, goal, q.copy()
        self._forward = ForwardKinematics(mechanism, q, within_limits=True)
        self._indices = [(joint, mechanism.q_index(joint)) for joint in mechanism.actuated]
        seconds = np.abs(mechanism.difference(q, goal)) / _speeds(mechanism)
        longest = seconds[[mechanism.v_index(joint) for joint in mechanism.actuated]].max(initial=0.0)
        self._seconds = min(max(2.0 * float(longest), _SHORTEST), _LONGEST)

    def advance(self, dt: float) -> Array | None:
        """See `RobotMotion`."""
        x = self._fraction(dt)
        if x is None:
            return None
        values = {joint: float((1.0 - x) * self._start[i] + x * self._goal[i]) for joint, i in self._indices}
        try:
            q = self._forward.move(values)
        except LimitError as error:
            return self._jump(f"{error.joint} would pass a limit in between")
        except CinegenError:
            return self._jump()
        if self._mechanism.floating:
            q[:7] = self._mechanism.interpolate(self._start, self._goal, x)[:7]
        if x < 1.0:
            return q
        return self._jump() if self._mechanism.distance(q, self._goal) > _THERE else self._goal

    def block(self, q: Array, problem: str) -> None:
        """See `RobotMotion`."""
        self._forward.q = q
        super().block(q, problem)

    def _jump(self, why: str = "the goal is in another assembly mode") -> Array:
        self._time, self.jumps = math.inf, True
        self.problem = f"{why}: the robot was moved there without a path"
        return self._goal


class Retrace(_TimedMotion):
    """Motion through recorded configurations.

    Args:
        trace: configurations (nq,), in order.
        period: time between two of them, s.
        name: name in the state.
        label: a few words for people.
    """

    def __init__(self, trace: Sequence[Array], period: float, name: str, label: str) -> None:
        self.name, self.label = name, label
        self._trace = trace
        self._seconds = min(period * (len(trace) - 1), _RETRACED)

    def advance(self, dt: float) -> Array | None:
        """See `RobotMotion`."""
        x = self._fraction(dt)
        return None if x is None else self._trace[round(x * (len(self._trace) - 1))]


class LineMotion:
    """Motion to a configuration: a node moves along a straight line at a limited speed, and a posture task moves the
    remaining DoF. From where that ends (another branch, out of reach) a `ConfigurationMotion` leads to the goal.

    Args:
        mechanism: mechanism to move.
        q: (nq,) present configuration with closed loops.
        goal: (nq,) configuration with closed loops.
        node: node that moves along the line.
        dt: period of a tick, s.
        locked: names of joints that do not move.

    Raises:
        ConfigurationError: the goal is not a configuration.
        CinegenError: its loops are open.
    """

    name, label, jumps = "move_to", "moving to a configuration", False

    def __init__(
        self, mechanism: Mechanism, q: Array, goal: Array, node: str, dt: float, locked: Sequence[str] = ()
    ) -> None:
        self.problem = ""
        self._mechanism, self._goal, self._dt = mechanism, mechanism.structure.checked(goal), dt
        closure = mechanism.closure(self._goal)
        if closure > CLOSURE:
            raise CinegenError(f"the goal would open loops of {mechanism.name} by {closure:.2g}: it stays where it is")
        self._solver = Solver(mechanism, dt, q)
        self._solver.lock(*locked)
        self._task = self._solver.add_task(node, rotation=3 if mechanism.mobility >= _SPATIAL else 0)
        self._from, self._to = mechanism.placement(q, node), mechanism.placement(self._goal, node)
        self._rotation = pin.log3(self._from.rotation.T @ self._to.rotation)
        far = float(np.linalg.norm(self._to.translation - self._from.translation)) / mechanism.length
        if self._task.rotation:
            far = max(far, float(np.linalg.norm(self._rotation)))
        self._seconds = min(max(far / _LINE_SPEED, _LINE_SHORTEST), _LINE_LONGEST)
        self._solver.objectives = (Posture(self._goal, rate=3.0 / self._seconds),)
        self._time = self._waited = 0.0
        self._rest: ConfigurationMotion | None = None

    def advance(self, dt: float) -> Array | None:
        """See `RobotMotion`."""
        if self.problem:
            return None
        if self._rest is not None:
            q = self._rest.advance(dt)
            self.jumps = self._rest.jumps
            self.problem = self._rest.problem if q is None else ""
            return q
        self._solver.dt = self._dt = dt
        self._task.target = self._target(eased(min(self._time / self._seconds, 1.0)))
        metres, angle = self._solver.step().errors[0]
        if max(metres / self._mechanism.length, angle) > _LAG:
            self._waited += dt
        else:
            self._time += dt
        if self._time > self._seconds or self._waited > _LINE_PATIENCE:
            self._rest = ConfigurationMotion(self._mechanism, self._solver.q, self._goal, self.name, self.label)
        return self._solver.q

    def block(self, q: Array, problem: str) -> None:
        """See `RobotMotion`."""
        if self._rest is not None:
            self._rest.block(q, problem)
            return
        self._solver.q = q
        self._waited += self._dt
        if self._waited > _LINE_PATIENCE:
            self.problem = problem

    def _target(self, x: float) -> pin.SE3:
        """Return the placement of the node at a fraction of the line."""
        rotation = self._from.rotation @ pin.exp3(x * self._rotation)
        return pin.SE3(rotation, (1.0 - x) * self._from.translation + x * self._to.translation)


def _speeds(mechanism: Mechanism) -> Array:
    """Return the velocity (nv,) at which joints are moved, rad/s and m/s."""
    limits = mechanism.limits.velocity
    return np.where(np.isfinite(limits), limits, _FASTEST * mechanism.scale)
