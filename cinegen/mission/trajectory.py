"""The joint motion of one robot, sampled at a fixed rate, within its velocity limits: what a robot's control takes."""

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

_STILL = 1e-6  # rad or lengths: what moves less stands
_ROUNDING = 1e-9
_AIM = 0.999  # part of a limit that what was too fast is slowed to
_ROUNDS = 60
_MOST = 5_000_000  # samples


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Motion of all joints of a robot, at rest at both ends.

    Attributes:
        name: of the robot in the recording.
        mechanism: the robot; each of its joints is one number.
        rate: samples per second.
        times: (n,) s, k / rate; the motion ends with the last one or within the period before.
        q: (n, nq) where all joints are, rad and m, loops closed.
        v: (n, nv) how fast they are, rad/s and m/s.
        passes: (k, 2) when the recorded samples are passed: the time here, and that in the recording, s.
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
        """How long it takes."""
        return float(self.times[-1])

    @property
    def actuated(self) -> tuple[str, ...]:
        """Names of the joints with a motor."""
        return self.mechanism.actuated

    def positions(self, joints: tuple[str, ...]) -> Array:
        """(n, joints) of some joints, rad and m.

        Raises:
            UnknownNameError: no such joint.
        """
        return self.q[:, [self.mechanism.q_index(joint) for joint in joints]]

    def velocities(self, joints: tuple[str, ...]) -> Array:
        """(n, joints) of some joints, rad/s and m/s.

        Raises:
            UnknownNameError: no such joint.
        """
        return self.v[:, [self.mechanism.v_index(joint) for joint in joints]]

    def recorded(self, time: float) -> float:
        """The time in the recording that a time here belongs to, s."""
        return float(np.interp(time, self.passes[:, 0], self.passes[:, 1]))


def resampled(
    recording: Recording, robot: str | None = None, rate: float = 125.0, speed: float = 1.0, trim: bool = False
) -> Trajectory:
    """A robot's recorded motion, sampled anew.

    The motors go through all recorded positions on a smooth curve that nowhere overshoots; the other joints follow on
    the branch that the recording is on. Where a joint would be faster than it may, passive or not, the motion is slowed
    down as far as needed; a leap becomes a motion at the limit.

    Args:
        recording: of the robot.
        robot: its name in the recording; the only one unless given.
        rate: samples per second.
        speed: times as fast as recorded, as far as limits allow.
        trim: leaves out that the robot stands still at the beginning and the end.

    Raises:
        MissionError: the recording is empty, of several robots of which none is named, of one whose base can move, with
            open loops, or changes its branch by a leap (and says when); or rate or speed make no sense.
        UnknownNameError: no such robot.
    """
    name = _chosen(recording, robot)
    for what, value in (("rate", rate), ("speed", speed)):
        if not 0.0 < value < math.inf:
            raise MissionError(f"the {what} must be a positive number, not {value}")
    if not len(recording.times):
        raise MissionError(f"{recording.path}: nothing was recorded")
    mechanism = recording.mechanism(name)
    if mechanism.model.nq != len(mechanism.joints):
        what = "its base can move" if mechanism.floating else "it has joints of more than one number"
        raise MissionError(f"{name} can't be exported: {what}, and a joint motion does not tell how")
    branch = Branch(mechanism)
    kept = _kept(branch, recording.q[name], trim)
    times, knots = recording.times[kept], recording.q[name][kept].copy()
    for i, q in enumerate(knots):
        try:
            knots[i] = branch.closed(q)
        except ClosureError as error:
            raise MissionError(f"{name} can't be exported: at {times[i]:.3f} s {error}") from None
    passes, q, speeds = _timed(branch, (times - times[0]) / speed, times, knots, rate, name)
    v = np.zeros((len(q), mechanism.model.nv))
    v[1:-1] = (q[2:] - q[:-2]) * (0.5 * rate)
    motors = [mechanism.q_index(joint) for joint in mechanism.actuated]
    v[1:-1, motors] = speeds[1:-1, motors]
    return Trajectory(name, mechanism, rate, np.arange(len(q)) / rate, q, v, np.column_stack([passes, times]))


def _chosen(recording: Recording, robot: str | None) -> str:
    if robot is None and len(recording.robots) > 1:
        names = ", ".join(recording.robots)
        raise MissionError(f"{recording.path}: holds several robots: name one of {names} (--robot NAME)")
    name = recording.robots[0] if robot is None else robot
    if name not in recording.robots:
        raise UnknownNameError("robot", name, recording.robots)
    return name


def _kept(branch: Branch, q: Array, trim: bool) -> slice:
    """Which of the recorded samples (count, nq) are used."""
    if not trim:
        return slice(None)
    first = next((i for i in range(1, len(q)) if branch.far(q[0], q[i]) > _STILL), len(q)) - 1
    last = next((i for i in range(len(q) - 1, first, -1) if branch.far(q[-1], q[i - 1]) > _STILL), first)
    return slice(first, last + 1)


def _timed(
    branch: Branch, begin: Array, recorded: Array, knots: Array, rate: float, name: str
) -> tuple[Array, Array, Array]:
    """Stretches a motion until every step of it obeys all velocity limits.

    Args:
        branch: leads it.
        begin: (k,) when the recorded samples would be passed.
        recorded: (k,) their times in the recording.
        knots: (k, nq) the samples.
        rate: samples per second.
        name: of the robot.

    Returns:
        (k,) when they are passed, (n, nq) the samples and (n, nq) how fast the curve that leads them is.
    """
    mechanism = branch.mechanism
    limits = mechanism.limits.velocity  # each joint is one number: q's order is v's
    led = np.ones(len(limits), dtype=bool)
    if mechanism.loops:
        led[mechanism.passive_columns] = False
    passes = slowed(begin, knots, np.where(led, limits, np.inf))
    for _ in range(_ROUNDS):
        count = math.ceil(passes[-1] * rate - _ROUNDING) + 1
        if not count <= _MOST:
            raise MissionError(f"{name} can't be exported: {count:.3g} samples at {rate:g} a second are too many")
        curve = JointCurve(passes, knots)
        times = np.minimum(np.arange(count) / rate, passes[-1])
        q = _led(branch, curve, times, recorded, name)
        over = (np.abs(np.diff(q, axis=0)) * rate / limits).max(axis=1, initial=0.0)
        if (over <= 1.0 + _ROUNDING).all():
            return passes, q, curve.speeds(times)
        lengths = np.diff(passes)
        stretch = np.ones(len(lengths))
        for k in np.flatnonzero(over > 1.0):
            first = max(0, int(np.searchsorted(passes, times[k], side="right")) - 1)
            last = int(np.searchsorted(passes, times[k + 1], side="left"))
            stretch[first:last] = np.maximum(stretch[first:last], over[k] / _AIM)
        passes = slowed(np.concatenate([[0.0], np.cumsum(lengths * stretch)]), knots, np.where(led, limits, np.inf))
    raise MissionError(f"{name} can't be exported: however slow its motors, a joint that follows them is too fast")


def _led(branch: Branch, curve: JointCurve, times: Array, recorded: Array, name: str) -> Array:
    """(n, nq) all joints at times (n,): those of a curve, led along the branch."""
    along = curve.at(times)
    if not branch.mechanism.loops:
        return along
    knots, passes = curve.points, curve.times
    ends = np.searchsorted(times, passes, side="left")  # samples before each knot
    ends[-1] = len(times)
    for i in range(len(knots) - 1):
        part = slice(ends[i], ends[i + 1])
        if np.array_equal(knots[i], knots[i + 1]):
            along[part] = knots[i]
            continue
        try:
            along[part] = branch.lead(knots[i], knots[i + 1], along[part])
        except MissionError as error:
            when = f"between {recorded[i]:.3f} and {recorded[i + 1]:.3f} s of the recording"
            raise MissionError(f"{name} can't be exported: {when} it {error}") from None
    along[-1] = knots[-1]
    return along
