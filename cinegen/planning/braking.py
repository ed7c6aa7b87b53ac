"""`BrakingBarrier`: keeps a safety distance with joints that can neither stop nor evade at once, from obstacles that
move."""

from __future__ import annotations

from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.clearance import Clearance, NearPairs
from cinegen.ik.barrier import Bounds
from cinegen.ik.objectives import State
from cinegen.planning.clearance_barrier import ClearanceBarrier, is_clear

Array = NDArray[np.float64]

_RANGE = 0.25  # characteristic lengths beyond the stop distance, and
_AHEAD = 0.3  # s of all motion: pairs further apart have no bound
_CAPACITY = 0.5  # of the acceleration by which joints can separate a pair: other tasks and bounds need the rest
_RETREAT = 0.5  # fraction of a missing distance that a tick restores
_USABLE = 0.98  # of a limit of acceleration
_HORIZON = 1.0  # s: collisions that are further away are not predicted
_INSTANTS = 40  # of the prediction
_REACHED = 0.9  # of that acceleration, at best
_SOON = 0.1  # s to a contact: only the direction away from the obstacle counts from then on
_IMMINENT = 0.04  # s to a contact: from then on nothing but the present velocities counts
_TELEPORT = 10.0  # m/s: an obstacle that is faster was put somewhere else
_PARTS = 4  # of a braking motion, each straight


class Threat(NamedTuple):
    """A collision, or one that can't be avoided.

    Attributes:
        pair: names of the two bodies.
        points: (2, 3) their nearest points in the world, m.
        distance: m; negative where they overlap.
        happens: whether they are in contact; else they will be.
        moves: whether the obstacle comes nearer.
    """

    pair: tuple[str, str]
    points: Array
    distance: float
    happens: bool
    moves: bool


class ObstacleMotion:
    """Estimate of the velocity of an obstacle, constant between its last two poses.

    Args:
        placement: first pose.
        tick: number of the tick at which it has this pose.
    """

    def __init__(self, placement: pin.SE3, tick: int) -> None:
        self._pose, self._tick, self._interval = placement.copy(), tick, 1
        self._linear = self._angular = np.zeros(3)

    def update(self, placement: pin.SE3, tick: int, dt: float) -> None:
        """Take over the pose at a tick of dt (s)."""
        if tick > self._tick:
            seconds, self._interval = (tick - self._tick) * dt, tick - self._tick
            self._linear = (placement.translation - self._pose.translation) / seconds
            self._angular = pin.log3(placement.rotation @ self._pose.rotation.T) / seconds
            if not np.abs(self._linear).max() < _TELEPORT:
                self._linear = self._angular = np.zeros(3)
        self._pose, self._tick = placement.copy(), tick

    def speed(self, tick: int) -> float:
        """Return the speed of the obstacle's origin at a tick, m/s."""
        return float(np.linalg.norm(self.velocity(self._pose.translation, tick)))

    def velocity(self, point: Array, tick: int) -> Array:
        """Return the velocity (3,) of a point (3,) of the obstacle at a tick, m/s; 0 if it has stopped."""
        if tick - self._tick > self._interval + 1:
            return np.zeros(3)
        (a, b, c), (x, y, z) = self._angular, point - self._pose.translation
        return np.asarray(self._linear + np.array([b * z - c * y, c * x - a * z, a * y - b * x]))


class BrakingBarrier(ClearanceBarrier):
    """Barrier of a solver whose joints have limits of acceleration, among obstacles that move.

    Links approach at most as fast as they can still brake, less the velocity of the obstacle. After each step, the
    mechanism can stop on a motion that is clear (of obstacles at rest): a step that would not leave one is replaced by
    the beginning of the braking motion that the step before left. An obstacle that moves into that motion is evaded.

    Args:
        clearance: distances of the mechanism.
        safety: safety distance, m.
        acceleration: (nv,) limits, rad/s^2 and m/s^2; infinite where there is none.

    Attributes:
        v: (nv,) velocity of the last tick, rad/s and m/s.
        tick: number of the tick.
        motions: motion of each obstacle that was moved, by its index.
        basis: (k, nv) motions that the loops allow; None without loops.
        is_released: whether there are no bounds, so that the mechanism may come to a stop wherever it does.
    """

    def __init__(self, clearance: Clearance, safety: float, acceleration: Array) -> None:
        super().__init__(clearance, safety)
        self.acceleration = acceleration
        self.v = np.zeros(clearance.mechanism.model.nv)
        self.tick = 0
        self.motions: dict[int, ObstacleMotion] = {}
        self.basis: Array | None = None
        self.is_released = False

    def move(self, obstacle: int, placement: pin.SE3, dt: float) -> None:
        """Take over the pose of an obstacle, by its index, for a tick of dt (s)."""
        if obstacle in self.motions:
            self.motions[obstacle].update(placement, self.tick, dt)
        else:
            self.motions[obstacle] = ObstacleMotion(placement, self.tick)

    # --- bounds --------------------------------------------------------------------------------------------------

    def bounds(self, state: State) -> Bounds:
        """Return the bounds of the next tick's velocities."""
        if self.is_released:
            self.pairs = np.zeros(0, dtype=np.int64)
            return Bounds(np.zeros((0, len(self.v))), np.zeros(0))
        near = self._near(state.q)
        rows, self.pairs = near.rows.copy(), near.pairs.copy()
        remaining = near.distances - self.stop
        room = np.abs(remaining)
        capacity = _CAPACITY * self._separations(rows)
        damped = np.where(remaining < 0.0, _RETREAT, -np.expm1(-self.approach * state.dt)) * room / state.dt
        change = capacity * state.dt
        braked = np.sqrt(0.25 * change * change + 2.0 * capacity * room) - 0.5 * change
        with np.errstate(invalid="ignore"):
            allowed = np.sign(remaining) * np.fmin(damped, np.where(np.isfinite(braked), braked, np.inf))
        most = allowed - np.maximum(self._approaches(self.pairs), 0.0)
        return Bounds(rows, np.maximum(most, rows @ self._evasion(state, rows, most) + 1e-9))

    def _near(self, q: Array) -> NearPairs:
        """Return the pairs that may come near soon."""
        fastest = max((motion.speed(self.tick) for motion in self.motions.values()), default=0.0)
        return self.clearance.near(q, self.stop + _RANGE * self.clearance.mechanism.length + _AHEAD * fastest)

    def _approaches(self, pairs: NDArray[np.int64]) -> Array:
        """Return the velocity (m,) at which the obstacle of each pair comes nearer by itself, m/s."""
        found = np.zeros(len(pairs))
        moving = {i: motion for i, motion in self.motions.items() if motion.speed(self.tick) > 0.0}
        known: dict[int, float] = {}
        for i, pair in enumerate(pairs.tolist() if moving else ()):
            motion = moving.get(int(self.clearance.groups[pair]))
            if motion is not None and pair not in known:
                _, point, normal = self.clearance.nearest_points(pair)
                meets = self._may_meet(pair, motion)
                known[pair] = -float(normal @ motion.velocity(point, self.tick)) if meets else 0.0
            found[i] = known.get(pair, 0.0)
        return found

    def _may_meet(self, pair: int, motion: ObstacleMotion) -> bool:
        """Return whether the bounding ball of an obstacle that goes on straight meets that of a link, enlarged by the
        stop distance."""
        balls = []
        for i in self.clearance.pairs[pair].tolist():
            body, now = self.clearance.bodies[i], self.clearance.placement(i)
            balls.append((now.act(body.placement.actInv(np.asarray(body.centre))), body.radius))
        (link, first), (obstacle, second) = balls
        away, u = link - obstacle, motion.velocity(obstacle, self.tick)
        nearest = away - u * max(0.0, float(away @ u) / max(float(u @ u), 1e-12))
        return bool(np.linalg.norm(nearest) < first + second + self.stop)

    def _swept(self, pair: int, times: Array) -> Array:
        """Return the distances (n,) of a pair at times (n,) from now, s, if the link stays and the obstacle goes on."""
        first, second = self.clearance.pairs[pair].tolist()
        motion = self.motions[int(self.clearance.groups[pair])]
        link, obstacle = (self.clearance.placement(i) for i in (first, second))
        shapes = [self.clearance.bodies[i].shape for i in (first, second)]
        u = motion.velocity(obstacle.translation, self.tick)
        found = []
        for t in times.tolist():
            there = coal.Transform3s(obstacle.rotation, obstacle.translation + u * t)
            here = coal.Transform3s(link.rotation, link.translation)
            found.append(
                coal.distance(shapes[0], here, shapes[1], there, coal.DistanceRequest(), coal.DistanceResult())
            )
        return np.array(found)

    def _separations(self, rows: Array, limits: Array | None = None) -> Array:
        """Return the largest rate (m,) at which joints within limits (nv,), of acceleration unless given, can change
        what rows (m, nv) give."""
        limits = self.acceleration if limits is None else limits
        if self.basis is not None:
            limited = np.isfinite(limits)
            rows, limits = rows @ self.basis.T @ np.linalg.pinv(self.basis[:, limited].T, rcond=1e-3), limits[limited]
        with np.errstate(invalid="ignore"):
            return np.asarray(np.where(rows == 0.0, 0.0, np.abs(rows) * limits).sum(axis=1))

    def _evasion(self, state: State, rows: Array, most: Array) -> Array:
        """Return a velocity (nv,) within the limits of acceleration: the braked one, changed towards bounds that it
        violates. What it does not reach, no bound asks for."""
        braked = self._braked(state.dt)
        violated = rows @ braked > most
        if not violated.any():
            return braked
        active, lack = rows[violated], (most - rows @ braked)[violated]
        if self.basis is not None:
            active = active @ self.basis.T
        gram = active @ active.T
        change = active.T @ np.linalg.solve(gram + (1e-6 * np.trace(gram) + 1e-12) * np.eye(len(gram)), lack)
        if self.basis is not None:
            change = self.basis.T @ change
        low, high = self._box(state)
        if self.basis is None:
            return np.clip(braked + change, np.minimum(low, braked), np.maximum(high, braked))
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(change == 0.0, np.inf, (np.where(change > 0.0, high, low) - braked) / change)
        return np.asarray(braked + change * max(0.0, min(1.0, float(room.min(initial=1.0)))))

    def _box(self, state: State) -> tuple[Array, Array]:
        """Return the least and the largest velocity (nv,) of the next tick, by limits of position, velocity and
        acceleration."""
        limits, change = state.mechanism.limits, _USABLE * self.acceleration * state.dt
        low, high = np.maximum(self.v - change, -limits.velocity), np.minimum(self.v + change, limits.velocity)
        at_q, at_v = state.mechanism.scalar_joints
        slow = np.where(np.isfinite(self.acceleration[at_v]), self.acceleration[at_v], 1e6)
        up = np.sqrt(2.0 * slow * np.maximum(limits.upper[at_q] - state.q[at_q], 0.0))
        down = np.sqrt(2.0 * slow * np.maximum(state.q[at_q] - limits.lower[at_q], 0.0))
        low[at_v], high[at_v] = np.maximum(low[at_v], -0.9 * down), np.minimum(high[at_v], 0.9 * up)
        return low, high

    def _braked(self, dt: float) -> Array:
        """Return the velocity (nv,) after a tick of braking in the direction of the motion."""
        return np.asarray(self.v * max(0.0, 1.0 - _USABLE * dt / max(self._braking_time(self.v), 1e-12)))

    def _braking_time(self, v: Array) -> float:
        """Return the time in which a velocity (nv,) can be braked to rest, s."""
        return float((np.abs(v) / self.acceleration).max(initial=0.0))

    # --- steps ---------------------------------------------------------------------------------------------------

    def clear(self, state: State, q: Array) -> float:
        """Return 1 if the motion from the state to q (nq,) is clear, and so is a braking motion after it, at a few
        instants, or it comes less near than braking at once does; else a smaller fraction."""
        if self.is_released:
            return 1.0
        mechanism = self.clearance.mechanism
        v = mechanism.difference(state.q, q) / state.dt
        path = [state.q, q, *self._stop(q, v, state.dt)]
        first, change = self.clearance.motion_bounds(state.q, path[-1])
        if (first - change >= self.safety).all():  # each joint moves in one direction: that bounds the whole path
            return 1.0
        if not is_clear(self.clearance, state.q, q, self.safety):
            return 0.3
        least = min(map(self.clearance.least, path[1:]))
        if least >= self.safety:
            return 1.0
        now = min(map(self.clearance.least, (state.q, *self._stop(state.q, self.v, state.dt))))
        return 1.0 if least >= now else 0.3

    def _stop(self, q: Array, v: Array, dt: float) -> list[Array]:
        """Return configurations on the motion of braking from q (nq,) and v (nv,) to rest; the last is at rest."""
        seconds = self._braking_time(v)
        ticks = int(np.ceil(seconds / dt - 1e-9))
        found = []
        for count in sorted({int(np.ceil(ticks * part / _PARTS)) for part in range(1, _PARTS + 1)} - {0}):
            if self.basis is None:  # each joint as fast as it can
                change = self.acceleration * dt
                own = np.minimum(count, np.floor(np.abs(v) / change + 1e-9))
                lost = np.where(np.isfinite(change), 0.5 * change * own * (own + 1.0), 0.0)
                moved = np.sign(v) * (np.abs(v) * own - lost) * dt
            else:
                part = min(1.0, count * dt / seconds)
                moved = v * seconds * (part - 0.5 * part * part)
            found.append(self.clearance.mechanism.integrate(q, moved))
        return found

    # --- prediction ----------------------------------------------------------------------------------------------

    def threat(self, state: State) -> Threat | None:
        """Return the collision at a state, or the nearest one that can't be avoided; None without one.

        A collision can't be avoided if the pair meets within a second though the obstacle goes on at constant velocity,
        and all joints move the link away at their limits of acceleration and velocity.
        """
        near = self._near(state.q)
        if not len(near.pairs):
            return None
        rows, pairs, distances = near.rows.copy(), near.pairs.copy(), near.distances.copy()
        i = int(distances.argmin())
        comes = np.maximum(self._approaches(pairs), 0.0)
        if distances[i] <= 0.0:
            return self._named(pairs, i, distances[i], True, bool(comes[i] > 1e-3))
        closing = rows @ self.v + comes
        meets = (closing > 1e-3) & (distances < closing * _HORIZON) & (comes > 1e-3)
        if not meets.any():
            return None
        fastest = np.where(np.isfinite(self.acceleration), state.mechanism.limits.velocity, np.inf)
        times = np.linspace(0.0, _HORIZON, _INSTANTS)
        own, soon = rows @ self.v, distances < closing * _SOON
        capacity, retreats = self._separations(rows), self._separations(rows, fastest)
        order = np.argsort(np.where(meets, distances / np.maximum(closing, 1e-9), np.inf))[: int(meets.sum())]
        for i in order.tolist():
            pair = int(pairs[i])
            change, retreat = capacity[i], retreats[i]
            if distances[i] < closing[i] * _IMMINENT:  # at the present velocities
                change, retreat = 0.0, -own[i]
            elif not soon[i]:  # it may still move aside
                change, retreat = self._evasions(pair, self.acceleration), self._evasions(pair, fastest)
            away = np.cumsum(np.minimum(min(_REACHED * change, 1e9) * times - own[i], min(retreat, 1e9))) * times[1]
            if distances[i] + (away - comes[i] * times).min() > 0.0:
                continue  # even if it came straight
            if (self._swept(pair, times) + away).min() <= 0.0:
                return self._named(pairs, i, distances[i], False, True)
        return None

    def _evasions(self, pair: int, limits: Array) -> float:
        """Return a bound of the rate by which joints within limits (nv,) can move the link of a pair, at its nearest
        point, in any direction."""
        clearance = self.clearance
        point, _, _ = clearance.nearest_points(pair)
        jacobian = clearance.jacobian * clearance.moved_by[clearance.bodies[clearance.pairs[pair, 0]].joint]
        rows = jacobian[:3] - pin.skew(point) @ jacobian[3:]
        limited = np.isfinite(limits)
        if self.basis is not None:
            rows = rows @ self.basis.T @ np.linalg.pinv(self.basis[:, limited].T, rcond=1e-3)
        elif np.abs(rows[:, ~limited]).max(initial=0.0) > 0.0:
            return float("inf")
        else:
            rows = rows[:, limited]
        return float(np.linalg.norm(rows, axis=0) @ limits[limited])

    def _named(self, pairs: NDArray[np.int64], i: int, distance: float, happens: bool, moves: bool) -> Threat:
        pair = int(pairs[i])
        first, second, _ = self.clearance.nearest_points(pair)
        return Threat(self.clearance.names(pair), np.array([first, second]), float(distance), happens, moves)
