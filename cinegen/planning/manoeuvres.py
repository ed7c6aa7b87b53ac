"""`ReactingJoints`: the manoeuvres that joints can make within their limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.collision.body import Body
from cinegen.joints import translations
from cinegen.loops.clusters import clusters
from cinegen.loops.motions import free_motions
from cinegen.model import Mechanism

_USABLE = 0.98  # of limits: closing loops, and the solver's tick, need the remainder
_FASTEST = 0.9  # of the limits of velocity, as for redundancy


def driven_motions(mechanism: Mechanism, q: Array, columns: Indices) -> Array:
    """Return the velocities (nv, columns) of all joints of a mechanism with loops at q (nq,), by those of some."""
    free, _ = free_motions(mechanism.structure.system.evaluate(q)[1], mechanism.loop_rank)
    basis = mechanism.scale[:, None] * free
    return np.asarray(basis @ np.linalg.pinv(basis[columns], rcond=1e-3))


class Manoeuvre(NamedTuple):
    """Motion of joints that accelerate for a time, and brake then.

    Attributes:
        acceleration: (joints,) rad/s^2 and m/s^2.
        seconds: time in which all joints accelerate, each at most to its largest velocity, s; by joint (joints,).
    """

    acceleration: Array
    seconds: Array

    def after(self, dt: float) -> Manoeuvre:
        """Return what remains of it after dt (s)."""
        return Manoeuvre(self.acceleration, np.maximum(self.seconds - dt, 0.0))


class JointRollout(NamedTuple):
    """A manoeuvre at some times.

    Attributes:
        moved: (times, joints) rad and m, from its beginning.
        velocity: (times, joints) rad/s and m/s.
    """

    moved: Array
    velocity: Array


class ReactingJoints:
    """The joints of a mechanism that react: those with a limit of acceleration; with loops, the actuated ones.

    Args:
        mechanism: mechanism.
        links: bodies of its links.
        acceleration: (nv,) limits, rad/s^2 and m/s^2; infinite where there is none.

    Attributes:
        mechanism: as given.
        columns: (joints,) their columns; none where actuated joints do not determine the others.
        limits: (joints,) usable accelerations.
        fastest: (joints,) largest velocities.
        reach: (joints,) bounds of the distances of link points from their axes, m (1 for prismatic joints); of joints
            that loops tie together, which move passive ones, too, an estimate: the characteristic length.
        dt: period of a tick, s.
    """

    def __init__(self, mechanism: Mechanism, links: Sequence[Body], acceleration: Array) -> None:
        self.mechanism = mechanism
        self.columns = np.flatnonzero(np.isfinite(acceleration))
        at = {int(j): int(i) for i, j in zip(*mechanism.structure.scalar_joints, strict=True)}
        if mechanism.is_constrained:
            self.columns = np.array([mechanism.v_index(joint) for joint in mechanism.actuated], dtype=np.intp)
            if len(self.columns) != mechanism.mobility or not set(self.columns) <= set(at):
                self.columns = self.columns[:0]
        self._at = np.array([at.get(int(j), -1) for j in self.columns], dtype=np.intp)
        self.limits = _USABLE * acceleration[self.columns]
        self.fastest = _FASTEST * mechanism.limits.velocity[self.columns]
        self.reach = _reaches(mechanism, links)[self.columns]
        self.dt = 0.0

    @property
    def braking(self) -> Manoeuvre:
        """Each joint brakes as fast as it can."""
        return Manoeuvre(np.zeros(len(self.columns)), np.zeros(len(self.columns)))

    def manoeuvre(self, q: Array, v: Array, fractions: Array, seconds: float) -> Manoeuvre:
        """Return the manoeuvre from q (nq,) and v (nv,) with fractions (joints,) of the accelerations, at most for some
        seconds; joints with limits of position can still brake before these."""
        acceleration, limits, velocity = fractions * self.limits, self.mechanism.limits, v[self.columns]
        times = np.full(len(velocity), seconds)
        for j, i in enumerate(self._at.tolist()):
            a, speed, limit = abs(acceleration[j]), velocity[j] * np.sign(acceleration[j]), self.limits[j]
            if i < 0 or a == 0.0:
                continue
            room = max(0.0, limits.upper[i] - q[i] if acceleration[j] > 0.0 else q[i] - limits.lower[i])
            if room < math.inf:  # accelerated for t, it stops after v t + a t^2 / 2 + (v + a t)^2 / (2 limit)
                square, linear = 0.5 * a * (1.0 + a / limit), speed * (1.0 + a / limit)
                rest = 0.5 * speed * abs(speed) / limit - 0.98 * room
                root = linear * linear - 4.0 * square * rest
                times[j] = min(seconds, max(0.0, (math.sqrt(root) - linear) / (2.0 * square)) if root > 0.0 else 0.0)
        return Manoeuvre(acceleration, times)

    def next_velocity(self, v: Array, manoeuvre: Manoeuvre) -> Array:
        """Return the velocity (joints,) after a tick of a manoeuvre from v (nv,)."""
        return np.asarray(self.roll_out(v, manoeuvre, np.array([self.dt])).velocity[0])

    def towards(self, q: Array, goal: Array) -> Array:
        """Return the motion (nv,) of the next tick straight towards a configuration (nq,) in joint space, from which
        all joints can still brake until there."""
        rest = self.mechanism.difference(q, goal)
        left, change = rest[self.columns], _USABLE * self.limits * self.dt * self.dt
        if not left.any():
            return np.zeros(len(rest))
        with np.errstate(divide="ignore"):
            least = float((change / np.abs(left)).min(initial=np.inf))  # of the whole, by which a tick can slow down
            fastest = float((self.fastest * self.dt / np.abs(left)).min(initial=np.inf))
        stopping = 0.5 * least * (math.sqrt(1.0 + 8.0 / least) - 1.0)  # s + (s - least) + ... = 1
        part = min(1.0, fastest, stopping)
        if not self.mechanism.is_constrained or not len(self.columns):
            return np.asarray(part * rest)
        return np.asarray(driven_motions(self.mechanism, q, self.columns) @ (part * left))

    def roll_out(self, v: Array, manoeuvre: Manoeuvre, times: Array) -> JointRollout:
        """Return a manoeuvre from v (nv,) at some times (n,), s."""
        start, change, driven = v[self.columns], manoeuvre.acceleration, manoeuvre.seconds
        fast, rising, stopping = self._phases(start, manoeuvre)
        seconds = times[:, None]
        up, last = np.minimum(seconds, rising), np.clip(seconds - driven, 0.0, stopping)
        hold, sign = np.clip(seconds - rising, 0.0, driven - rising), np.sign(fast)
        moved = (
            start * up + 0.5 * change * up * up + fast * hold + sign * (np.abs(fast) - 0.5 * self.limits * last) * last
        )
        velocity = np.where(seconds < rising, start + change * up, fast - sign * self.limits * last)
        return JointRollout(
            moved + 0.5 * self.dt * (velocity - start), velocity
        )  # a tick moves by the velocity at its end

    def fastest_between(self, v: Array, manoeuvre: Manoeuvre, begin: float, end: float) -> Array:
        """Return the largest speeds (joints,) of a manoeuvre from v (nv,) between two times, s."""
        fast, rising, _ = self._phases(v[self.columns], manoeuvre)
        speeds = np.abs(self.roll_out(v, manoeuvre, np.array([begin, end])).velocity).max(axis=0)
        peaks = (begin <= manoeuvre.seconds) & (rising <= end)
        return np.asarray(np.maximum(speeds, np.where(peaks, np.abs(fast), 0.0)) + 0.5 * self.dt * self.limits)

    def duration(self, v: Array, manoeuvre: Manoeuvre) -> float:
        """Return the time after which all joints are at rest, s."""
        _, _, stopping = self._phases(v[self.columns], manoeuvre)
        return float((manoeuvre.seconds + stopping).max(initial=0.0))

    def configuration(self, q: Array, moved: Array, guess: Array) -> Array:
        """Return the configuration (nq,) in which the joints have moved by some amounts (joints,) from q (nq,).

        Args:
            q: (nq,) where they begin.
            moved: (joints,) rad and m.
            guess: (nq,) a configuration near it, from which loops are closed.

        Raises:
            ClosureError: loops can't be closed there.
        """
        mechanism, step = self.mechanism, np.zeros(self.mechanism.model.nv)
        step[self.columns] = moved
        ahead = np.asarray(mechanism.integrate(q, step))
        if not mechanism.is_constrained:
            return ahead
        start = guess.copy()
        start[self._at] = ahead[self._at]
        return mechanism.close(start, locked=mechanism.actuated)

    def _phases(self, start: Array, manoeuvre: Manoeuvre) -> tuple[Array, Array, Array]:
        """Return the velocity (joints,) from which joints brake, and the times (joints,) in which they reach it and
        brake from it, s."""
        change, driven = manoeuvre.acceleration, manoeuvre.seconds
        most = np.maximum(self.fastest, np.abs(start))
        fast = np.clip(start + change * driven, -most, most)
        rising = np.minimum(np.abs(fast - start) / np.where(change == 0.0, np.inf, np.abs(change)), driven)
        return fast, rising, np.abs(fast) / self.limits


def _reaches(mechanism: Mechanism, links: Sequence[Body]) -> Array:
    """Return `ReactingJoints.reach` of all columns (nv,)."""
    model, length = mechanism.model, mechanism.length
    reach, by_column, travel = np.zeros(model.njoints), np.ones(model.nv), np.full(model.nv, length)
    at_q, at_v = mechanism.structure.scalar_joints
    limited = np.maximum(np.abs(mechanism.limits.lower[at_q]), np.abs(mechanism.limits.upper[at_q]))
    travel[at_v] = np.where(np.isfinite(limited), limited, length)
    for link in links:
        reach[link.joint] = max(reach[link.joint], float(np.linalg.norm(link.centre)) + link.radius)
    for i in range(model.njoints - 1, 0, -1):
        joint, parent = model.joints[i], model.parents[i]
        sliding = translations(joint)
        by_column[joint.idx_v + sliding : joint.idx_v + joint.nv] = reach[i]
        far = float(np.linalg.norm(model.jointPlacements[i].translation) + travel[joint.idx_v :][:sliding].sum())
        reach[parent] = max(reach[parent], far + reach[i])
    for cluster in clusters(mechanism.structure.system):
        by_column[cluster.columns] = length
    return by_column
