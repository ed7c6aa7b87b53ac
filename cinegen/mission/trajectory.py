"""Joint trajectory of one robot, sampled at a fixed rate, within its velocity limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.errors import ClosureError, UnknownNameError
from cinegen.mission.branch import Branch
from cinegen.mission.curve import JointCurve, slowed
from cinegen.mission.file_format import MissionError
from cinegen.mission.recording import Recording
from cinegen.model import Mechanism

Array = NDArray[np.float64]

_ROUNDING = 1e-9
_AIM = 0.999  # fraction of a limit to which fast steps are slowed
_ROUNDS = 60
_MOST = 5_000_000  # most samples


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Trajectory of all joints of a robot, at rest at both ends.

    Attributes:
        name: name of the robot in the recording.
        mechanism: mechanism whose joints each have one number; ball joints, which are passive, have a quaternion.
        rate: samples per second.
        times: (n,) times k / rate, s; the motion ends with the last one or within the period before.
        q: (n, nq) configurations with closed loops, rad and m.
        v: (n, nv) velocities, rad/s and m/s.
        passes: (k, 2) times of the recorded samples, in the trajectory and in the recording, s.
    """

    name: str
    mechanism: Mechanism
    rate: float
    times: Array
    q: Array
    v: Array
    passes: Array

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return float(self.times[-1])

    def positions(self, joints: tuple[str, ...]) -> Array:
        """Return the positions (n, joints) of some joints, rad and m.

        Raises:
            UnknownNameError: no such joint.
        """
        return self.q[:, [self.mechanism.q_index(joint) for joint in joints]]

    def velocities(self, joints: tuple[str, ...]) -> Array:
        """Return the velocities (n, joints) of some joints, rad/s and m/s.

        Raises:
            UnknownNameError: no such joint.
        """
        return self.v[:, [self.mechanism.v_index(joint) for joint in joints]]

    def recorded(self, time: float) -> float:
        """Return the time in the recording of a time in the trajectory, s."""
        return float(np.interp(time, self.passes[:, 0], self.passes[:, 1]))


def resampled(recording: Recording, robot: str | None = None, rate: float = 125.0, speed: float = 1.0) -> Trajectory:
    """Return a robot's recorded motion as a trajectory.

    The actuated joints pass all recorded positions on a smooth curve without overshoot; the other joints follow on the
    branch of the recording. If a joint would exceed its velocity limit, the motion is slowed down as far as needed.

    Args:
        recording: recording of the robot.
        robot: name of the robot in the recording; the only one unless given.
        rate: samples per second, 0.1 to 1e5.
        speed: speed relative to the recording, 0.01 to 100, as far as limits allow.

    Raises:
        MissionError: the recording is empty, has several robots of which none is named, a floating base, open loops, or
            a jump to another branch (with its time); or rate or speed is out of range.
        UnknownNameError: no such robot.
    """
    name = _chosen(recording, robot)
    for what, value, low, high in (("rate", rate, 0.1, 1e5), ("speed", speed, 0.01, 100.0)):
        if not low <= value <= high:
            raise MissionError(f"the {what} must be from {low:g} to {high:g}, not {value:g}")
    if not len(recording.times):
        raise MissionError(f"{recording.path}: nothing was recorded")
    mechanism = recording.mechanism(name)
    if mechanism.model.nq != len(mechanism.joints) + 4 * len(mechanism.balls):
        what = "its base is floating" if mechanism.floating else "it has joints of more than one number"
        raise MissionError(f"{name} can't be exported: {what}, which a joint trajectory does not contain")
    branch = Branch(mechanism)
    times, knots = recording.times, _continuous(mechanism, recording.q[name])
    for i, q in enumerate(knots):
        try:
            knots[i] = branch.closed(q)
        except ClosureError as error:
            raise MissionError(f"{name} can't be exported: at {times[i]:.3f} s {error}") from None
    passes, q, speeds = _timed(branch, (times - times[0]) / speed, times, knots, rate, name)
    v = np.zeros((len(q), mechanism.model.nv))
    at_q, at_v = mechanism.scalar_joints
    v[1:-1, at_v] = (q[2:, at_q] - q[:-2, at_q]) * (0.5 * rate)
    for k in range(1, len(q) - 1) if mechanism.balls else ():
        v[k] = mechanism.difference(q[k - 1], q[k + 1]) * (0.5 * rate)
    actuated = [[of(joint) for joint in mechanism.actuated] for of in (mechanism.q_index, mechanism.v_index)]
    v[1:-1, actuated[1]] = speeds[1:-1, actuated[0]]
    return Trajectory(name, mechanism, rate, np.arange(len(q)) / rate, q, v, np.column_stack([passes, times]))


def _chosen(recording: Recording, robot: str | None) -> str:
    if robot is None and len(recording.robots) > 1:
        names = ", ".join(recording.robots)
        raise MissionError(f"{recording.path}: has several robots: name one of {names} (--robot NAME)")
    name = recording.robots[0] if robot is None else robot
    if name not in recording.robots:
        raise UnknownNameError("robot", name, recording.robots)
    return name


def _continuous(mechanism: Mechanism, recorded: Array) -> Array:
    """Return recorded configurations (k, nq) in which a quaternion does not change to its negative."""
    q = recorded.copy()
    for ball in mechanism.balls:
        part = slice(mechanism.q_index(ball), mechanism.q_index(ball) + 4)
        turns = np.einsum("ki,ki->k", q[1:, part], q[:-1, part]) < 0.0
        q[1:, part] *= np.where(np.cumsum(turns) % 2, -1.0, 1.0)[:, None]
    return q


def _timed(
    branch: Branch, begin: Array, recorded: Array, knots: Array, rate: float, name: str
) -> tuple[Array, Array, Array]:
    """Stretch a motion until all its steps obey all velocity limits.

    Args:
        branch: interpolation on the branch.
        begin: (k,) desired times of the recorded samples, s.
        recorded: (k,) their times in the recording, s.
        knots: (k, nq) recorded samples.
        rate: samples per second.
        name: name of the robot.

    Returns:
        Times of the recorded samples (k,), new samples (n, nq) and velocities of the curve (n, nq).
    """
    mechanism = branch.mechanism
    at_q, at_v = mechanism.scalar_joints
    limits, guided = np.full((2, mechanism.model.nq), np.inf)  # of all joints, and of those that the curve moves
    limits[at_q] = mechanism.limits.velocity[at_v]
    free = np.isin(at_v, mechanism.passive_columns, invert=True) | (not mechanism.is_constrained)
    guided[at_q[free]] = limits[at_q[free]]
    passes = slowed(begin, knots, guided)
    for _ in range(_ROUNDS):
        count = math.ceil(passes[-1] * rate - _ROUNDING) + 1
        if not count <= _MOST:
            raise MissionError(f"{name} can't be exported: {count:.3g} samples at {rate:g} a second are too many")
        curve = JointCurve(passes, knots)
        times = np.minimum(np.arange(count) / rate, passes[-1])
        q = _interpolated(branch, curve, times, recorded, name)
        over = (np.abs(np.diff(q, axis=0)) * rate / limits).max(axis=1, initial=0.0)
        if (over <= 1.0 + _ROUNDING).all():
            return passes, q, curve.speeds(times)
        lengths = np.diff(passes)
        stretch = np.ones(len(lengths))
        for k in np.flatnonzero(over > 1.0):
            first = max(0, int(np.searchsorted(passes, times[k], side="right")) - 1)
            last = int(np.searchsorted(passes, times[k + 1], side="left"))
            stretch[first:last] = np.maximum(stretch[first:last], over[k] / _AIM)
        passes = slowed(np.concatenate([[0.0], np.cumsum(lengths * stretch)]), knots, guided)
    raise MissionError(f"{name} can't be exported: a passive joint is too fast however slow the actuated joints are")


def _interpolated(branch: Branch, curve: JointCurve, times: Array, recorded: Array, name: str) -> Array:
    """Return all joints (n, nq) at times (n,): those of a curve, on the branch."""
    along = curve.at(times)
    if branch.mechanism.balls:
        along = np.array([branch.mechanism.normalized(q) for q in along]).reshape(along.shape)
    if not branch.mechanism.is_constrained:
        return along
    knots, passes = curve.points, curve.times
    ends = np.searchsorted(times, passes, side="left")  # most samples before each knot
    ends[-1] = len(times)
    for i in range(len(knots) - 1):
        part = slice(ends[i], ends[i + 1])
        if np.array_equal(knots[i], knots[i + 1]):
            along[part] = knots[i]
            continue
        try:
            along[part] = branch.interpolate(knots[i], knots[i + 1], along[part])
        except MissionError as error:
            when = f"between {recorded[i]:.3f} and {recorded[i + 1]:.3f} s of the recording"
            raise MissionError(f"{name} can't be exported: {when} it {error}") from None
    along[-1] = knots[-1]
    return along
