"""Joint trajectory of one robot, sampled at a fixed rate, within limits of velocity, acceleration and jerk."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator, PPoly

from cinegen.arrays import Array
from cinegen.errors import ClosureError, UnknownNameError
from cinegen.mission.branch import Branch
from cinegen.mission.curve_timing import CurveTiming, closed_along
from cinegen.mission.file_format import MissionError
from cinegen.mission.recording import Recording
from cinegen.model import Mechanism
from cinegen.model.motion_limits import MotionLimits, motion_limits
from cinegen.planning.singular_crossing import guided
from cinegen.planning.timing import averaged, averaging_window, excess, grid_of
from cinegen.planning.torque_limits import TorqueLimits
from raff2urdf.errors import counted, raised_as

_ROUNDING = 1e-9
_SLOWER = 1.001  # more than needed, so that few rounds suffice
_ROUNDS = 60
_MOST = 5_000_000  # most samples
_PART = 0.02  # rad or lengths: longest motion of an interval of the time law
_INSTANT = 1e-4  # s: of two recorded samples without motion between them


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
        limits: limits that the samples obey.
        torques: limits of torques and forces that they obey; None without any.
        used: (joints,) largest torques of `torques.joints`, relative to these limits; None without any.
    """

    name: str
    mechanism: Mechanism
    rate: float
    times: Array
    q: Array
    v: Array
    passes: Array
    limits: MotionLimits
    torques: TorqueLimits | None = None
    used: Array | None = None

    def __repr__(self) -> str:
        return f"<Trajectory of {self.name}: {self.seconds:.3f} s, {counted(len(self.times), 'sample')}>"

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


def resampled(
    recording: Recording,
    robot: str | None = None,
    rate: float = 125.0,
    speed: float = 1.0,
    acceleration: float | Mapping[str, float] | None = None,
    jerk: float | Mapping[str, float] | None = None,
    torques: Callable[[Mechanism], TorqueLimits] | None = None,
) -> Trajectory:
    """Return a robot's recorded motion as a trajectory within limits (`motion_limits`).

    The actuated joints pass all recorded positions on a smooth curve without overshoot; the other joints follow on the
    branch of the recording. Where a joint would exceed a limit, the motion is slower than recorded, as little as
    possible (`time_law`). Where jerks are limited, positions are averaged over a short window, so that corners between
    recorded positions are cut.

    Args:
        recording: recording of the robot.
        robot: name of the robot in the recording; the only one unless given.
        rate: samples per second, 0.1 to 1e5.
        speed: speed relative to the recording, 0.01 to 100, as far as limits allow; infinite for the fastest motion.
        acceleration: limits of acceleration, rad/s^2 and m/s^2: one number, or by joint name; defaults unless given.
        jerk: limits of jerk, rad/s^3 and m/s^3, likewise; unlimited unless given.
        torques: returns the limits of torques and forces of the robot, such as `TorqueLimits`; unlimited unless given.

    Raises:
        MissionError: the recording is empty, has several robots of which none is named, a floating base, open loops, or
            a jump to another branch (with its time); or rate or speed is out of range.
        UnknownNameError: no such robot, or no such joint.
        CinegenError: a limit is not positive.
        MissingExtraError: toppra is not installed.
    """
    name = _chosen(recording, robot)
    if not 0.1 <= rate <= 1e5:
        raise MissionError(f"the rate must be from 0.1 to 1e5, not {rate:g}")
    if not (0.01 <= speed <= 100.0 or speed == math.inf):
        raise MissionError(f"the speed must be from 0.01 to 100, or infinite, not {speed:g}")
    if not len(recording.times):
        raise MissionError(f"{recording.path}: nothing was recorded")
    mechanism = recording.mechanism(name)
    if mechanism.model.nq != len(mechanism.joints) + 4 * len(mechanism.balls):
        what = "its base is floating" if mechanism.floating else "it has joints of more than one number"
        raise MissionError(f"{name} can't be exported: {what}, which a joint trajectory does not contain")
    limits, strengths = motion_limits(mechanism, acceleration, jerk), None if torques is None else torques(mechanism)
    times, knots = recording.times, _continuous(mechanism, recording.q[name])
    crosses = strengths is not None and strengths.crosses and mechanism.is_constrained
    if crosses and np.isfinite(limits.jerk).any():
        raise MissionError(f"{name} can't be exported: jerks are not limited where a singularity is crossed")
    branch = Branch(guided(mechanism, knots) if crosses else mechanism)
    for i, q in enumerate(knots):
        with raised_as(MissionError, ClosureError, f"{name} can't be exported: at {times[i]:.3f} s "):
            knots[i] = branch.closed(q)
    passes, q, used = _timed(branch, limits, (times - times[0]) / speed, times, knots, rate, name, strengths)
    v = np.zeros((len(q), mechanism.model.nv))
    at_q, at_v = mechanism.structure.scalar_joints
    v[1:-1, at_v] = (q[2:, at_q] - q[:-2, at_q]) * (0.5 * rate)
    for k in range(1, len(q) - 1) if mechanism.balls else ():
        v[k] = mechanism.difference(q[k - 1], q[k + 1]) * (0.5 * rate)
    return Trajectory(
        name, mechanism, rate, np.arange(len(q)) / rate, q, v, np.column_stack([passes, times]), limits, strengths,
        used,
    )  # fmt: skip


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
    branch: Branch,
    limits: MotionLimits,
    begin: Array,
    recorded: Array,
    knots: Array,
    rate: float,
    name: str,
    torques: TorqueLimits | None,
) -> tuple[Array, Array, Array | None]:
    """Return the times of the recorded samples (k,), s, new samples (n, nq) that obey all limits, and the largest
    torques (joints,) relative to their limits.

    Args:
        branch: interpolation on the branch.
        limits: limits of all joints.
        begin: (k,) desired times of the recorded samples, s.
        recorded: (k,) their times in the recording, s.
        knots: (k, nq) recorded samples.
        rate: samples per second.
        name: name of the robot.
        torques: limits of torques and forces.
    """
    mechanism = branch.mechanism
    at_q, at_v = mechanism.structure.scalar_joints
    velocity, acceleration = np.full((2, mechanism.model.nq), np.inf)
    velocity[at_q], acceleration[at_q] = limits.velocity[at_v], limits.acceleration[at_v]
    steps, scale = np.abs(np.diff(knots, axis=0)), np.ones(mechanism.model.nq)
    scale[at_q] = mechanism.scale[at_v]
    if not steps.any():  # it stays where it is
        passes = begin if len(begin) > 1 else np.zeros(1)
        q = np.repeat(knots[:1], _count(passes[-1], rate, name), axis=0)
        return passes, q, None if torques is None else torques.largest(q[:1], rate)
    durations = np.maximum(np.diff(begin), (steps / velocity).max(axis=1))
    crosses = torques is not None and torques.crosses
    if crosses and begin[-1] == begin[0]:  # passive joints may move where the actuated ones hardly do
        durations = np.maximum(durations, (steps / scale).max(axis=1))
    s = np.concatenate([[0.0], np.cumsum(np.maximum(durations, _INSTANT))])
    curve = curve_through(s, knots)
    counts = np.ceil((steps / scale).max(axis=1) / _PART).astype(np.int64)
    timing = CurveTiming(branch, curve, knots, grid_of(s, counts), recorded, velocity, acceleration, name, torques)
    timing.fastest = np.inf if crosses and begin[-1] == begin[0] else 1.0
    law = timing.law()
    window = averaging_window(limits, rate)
    for _ in range(_ROUNDS):
        passes = np.interp(s, law.s, law.times)
        times = np.minimum(np.arange(_count(passes[-1], rate, name)) / rate, passes[-1])
        along = curve(law.at(times)[0])
        along[-1] = knots[-1]
        along, delay = averaged(along, window), 0.5 * (window - 1) / rate
        ends = np.searchsorted(np.arange(len(along)) / rate - delay, passes)
        q = closed_along(branch, knots, along, ends, recorded, name)
        slower = excess(mechanism, limits, q, rate)
        if timing.has_pace:
            most = timing.used(law)
            if slower <= 1.0 + _ROUNDING and most.max() <= 1.0:
                return passes + delay, q, most
            law = timing.law(max(slower, 1.0) * _SLOWER, max(float(most.max()), 1.0) * _SLOWER)
            continue
        slower = max(slower, 0.0 if torques is None else torques.excess(q, rate))
        if slower <= 1.0 + _ROUNDING:
            return passes + delay, q, None if torques is None else torques.largest(q, rate)
        law = law.slowed(slower * _SLOWER)
    if timing.has_pace:
        raise MissionError(
            f"{name} can't be exported: it passes points where it can't rest, and no speed was found at which limits "
            "of velocity, acceleration and torque are obeyed"
        )
    raise MissionError(f"{name} can't be exported: a passive joint is too fast however slow the actuated joints are")


def curve_through(s: Array, points: Array) -> PPoly:
    """Return a piecewise cubic curve with the slopes of F. N. Fritsch and J. Butland ("A method for constructing local
    monotone piecewise cubic interpolants", SIAM J. Sci. Stat. Comput. 5, 1984) at inner points, and 0 at both ends:
    between two points no value is beyond theirs.

    Args:
        s: (k,) parameter of each point, ascending; two at least.
        points: (k, m) points.
    """
    slopes = np.zeros_like(points)
    if len(s) > 2:
        slopes[1:-1] = PchipInterpolator(s, points)(s[1:-1], 1)
    return CubicHermiteSpline(s, points, slopes)


def _count(seconds: float, rate: float, name: str) -> int:
    """Return the number of samples of a motion."""
    count = math.ceil(seconds * rate - _ROUNDING) + 1
    if not count <= _MOST:
        raise MissionError(f"{name} can't be exported: {count:.3g} samples at {rate:g} a second are too many")
    return count
