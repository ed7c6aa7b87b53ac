"""`BrakingBarrier`: keeps a safety distance with joints that can neither stop nor evade at once."""

from __future__ import annotations

import numpy as np

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance
from cinegen.errors import ClosureError
from cinegen.ik.barrier import Bounds
from cinegen.ik.state import State
from cinegen.loops.clusters import clusters
from cinegen.planning.clearance_barrier import ClearanceBarrier
from cinegen.planning.evasion import Evasion

_RANGE = 0.25  # characteristic lengths beyond the stop distance: pairs further apart have no bound
_CAPACITY = 0.5  # of the acceleration by which joints can separate a pair: other tasks and bounds need the rest
_RETREAT = 0.5  # fraction of a missing distance that a tick restores
_USABLE = 0.98  # of a limit of acceleration
_PARTS = 3  # of a braking motion, each straight
_HALVINGS = 3  # of each of them: what is not known to be clear then, is refused
_REFUSED = 0.2  # fraction of a step that is tried if the whole is not clear


class BrakingBarrier(ClearanceBarrier):
    """Barrier of a solver whose joints have limits of acceleration.

    Links approach at most as fast as they can still brake. After each step, the mechanism can stop on a motion that is
    clear, also of obstacles that go on at constant velocity: a step that would not leave one is replaced by the
    beginning of the braking motion that the step before left. Passive joints, which can't brake by themselves, come
    near their limits at most as fast as actuated ones can stop them.

    Args:
        clearance: distances of the mechanism.
        safety: safety distance, m.
        acceleration: (nv,) limits, rad/s^2 and m/s^2; infinite where there is none.
        evasion: prediction of obstacles that move.

    Attributes:
        v: (nv,) velocity of the last tick, rad/s and m/s.
        basis: (k, nv) motions that the loops allow; None without loops.
        is_released: whether there are no bounds: it evades an obstacle, or comes to a stop wherever it does.
        is_met: whether the last step that was tested is refused because an obstacle that moves would hit.
    """

    def __init__(self, clearance: Clearance, safety: float, acceleration: Array, evasion: Evasion) -> None:
        super().__init__(clearance, safety)
        self.acceleration, self._evasion = acceleration, evasion
        self.v = np.zeros(clearance.mechanism.model.nv)
        self.basis: Array | None = None
        self.is_released = self.is_met = False
        self._distances = np.zeros(0)
        self._clusters = [cluster.columns for cluster in clusters(clearance.mechanism.structure.system)]
        self._is_tied = np.zeros(len(self.v), dtype=bool)
        self._is_tied[[j for columns in self._clusters for j in columns]] = True

    # --- bounds --------------------------------------------------------------------------------------------------

    def bounds(self, state: State) -> Bounds:
        """Return the bounds rows @ v <= most of the next tick's velocity v (nv,), rad/s and m/s.

        A pair at the distance d, with the gradient -row by q, comes nearer at row @ v, m/s. This is bounded by the
        speed from which the pair can still brake before the stop distance (`_allowed`). Pairs that no velocity within
        the joints' limits, low <= v <= high, brings beyond their bound have none. Each bound admits the velocity by
        which the mechanism brakes and retreats (`_retreat`), so that the bounds never contradict each other.
        """
        if self.is_released:
            self.pairs = np.zeros(0, dtype=np.int64)
            return Bounds(np.zeros((0, len(self.v))), np.zeros(0))
        self._distances = self.clearance.distances(state.q)
        near = self.clearance.near(state.q, self.stop + _RANGE * self.clearance.mechanism.length)
        low, high = self._box(state)
        most = self._allowed(near.rows, near.distances - self.stop, state.dt)
        with np.errstate(invalid="ignore"):
            fastest = np.where(near.rows == 0.0, 0.0, near.rows * np.where(near.rows > 0.0, high, low)).sum(axis=1)
        matters = most < fastest
        rows, most, self.pairs = near.rows[matters], most[matters], near.pairs[matters]
        if self.basis is not None:
            passive = self._passive_limits(state)
            rows, most = np.vstack([rows, passive.rows]), np.concatenate([most, passive.most])
        if not len(rows):
            return Bounds(rows, most)
        return Bounds(rows, np.maximum(most, rows @ self._retreat(state.dt, rows, most, low, high) + 1e-9))

    def _allowed(self, rows: Array, remaining: Array, dt: float) -> Array:
        """Return the largest rates (m,) at which the joints may use up what remains (m,) of what rows (m, nv) give."""
        room, capacity = np.abs(remaining), _CAPACITY * self._separations(rows)
        damped = np.where(remaining < 0.0, _RETREAT, -np.expm1(-self.approach * dt)) * room / dt
        change = capacity * dt
        with np.errstate(invalid="ignore"):
            braked = np.sqrt(0.25 * change * change + 2.0 * capacity * room) - 0.5 * change
            return np.asarray(np.sign(remaining) * np.fmin(damped, np.where(np.isfinite(braked), braked, np.inf)))

    def _passive_limits(self, state: State) -> Bounds:
        """Return the bounds by which passive joints stay within their limits of position."""
        mechanism = self.clearance.mechanism
        limits, (at_q, at_v) = mechanism.limits, mechanism.structure.scalar_joints
        rows, room = [], []
        for i, j in zip(at_q.tolist(), at_v.tolist(), strict=True):
            towards = 1.0 if self.v[j] > 0.0 else -1.0
            left = limits.upper[i] - state.q[i] if towards > 0.0 else state.q[i] - limits.lower[i]
            if self.v[j] != 0.0 and np.isinf(self.acceleration[j]) and left < abs(self.v[j]):  # s
                rows.append(towards * np.eye(1, len(self.v), j)[0])
                room.append(max(left, 0.0))
        signs = np.array(rows).reshape(-1, len(self.v))
        return Bounds(mechanism.length * signs, mechanism.length * self._allowed(signs, np.array(room), state.dt))

    def _separations(self, rows: Array) -> Array:
        """Return the largest rate (m,) at which joints within their limits of acceleration can change what rows (m, nv)
        give."""
        limits = self.acceleration
        if self.basis is not None:
            limited = np.isfinite(limits)
            rows, limits = rows @ self.basis.T @ np.linalg.pinv(self.basis[:, limited].T, rcond=1e-3), limits[limited]
        with np.errstate(invalid="ignore"):
            return np.asarray(np.where(rows == 0.0, 0.0, np.abs(rows) * limits).sum(axis=1))

    def _retreat(self, dt: float, rows: Array, most: Array, low: Array, high: Array) -> Array:
        """Return a velocity (nv,) within the limits of acceleration: the braked one, changed towards bounds that it
        violates. What it does not reach, no bound asks for."""
        braked = self._braked(dt)
        violated = rows @ braked > most
        if not violated.any():
            return braked
        active, lack = rows[violated], (most - rows @ braked)[violated]
        if self.basis is not None:
            active = active @ self.basis.T
        gram = active @ active.T
        change = active.T @ np.linalg.solve(gram + (1e-6 * np.trace(gram) + 1e-12) * np.eye(len(gram)), lack)
        if self.basis is None:
            return np.clip(braked + change, np.minimum(low, braked), np.maximum(high, braked))
        change = self.basis.T @ change
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(change == 0.0, np.inf, (np.where(change > 0.0, high, low) - braked) / change)
        return np.asarray(braked + change * max(0.0, min(1.0, float(room.min(initial=1.0)))))

    def _box(self, state: State) -> tuple[Array, Array]:
        """Return the least and the largest velocity (nv,) of the next tick, by limits of position, velocity and
        acceleration."""
        limits, change = state.mechanism.limits, _USABLE * self.acceleration * state.dt
        low, high = np.maximum(self.v - change, -limits.velocity), np.minimum(self.v + change, limits.velocity)
        at_q, at_v = state.mechanism.structure.scalar_joints
        slow = np.where(np.isfinite(self.acceleration[at_v]), self.acceleration[at_v], 1e6)
        up = np.sqrt(2.0 * slow * np.maximum(limits.upper[at_q] - state.q[at_q], 0.0))
        down = np.sqrt(2.0 * slow * np.maximum(state.q[at_q] - limits.lower[at_q], 0.0))
        low[at_v], high[at_v] = np.maximum(low[at_v], -0.9 * down), np.minimum(high[at_v], 0.9 * up)
        return low, high

    def _braked(self, dt: float) -> Array:
        """Return the velocity (nv,) after a tick of braking in the direction of the motion of all joints."""
        seconds = float(self._braking_times(self.v).max(initial=0.0))
        return np.asarray(self.v * max(0.0, 1.0 - _USABLE * dt / max(seconds, 1e-12)))

    def _braking_times(self, v: Array) -> Array:
        """Return the times (nv,) in which joints brake from a velocity (nv,) to rest, s: those that loops or couplings
        tie together in the direction of their motion, the others as fast as they can."""
        times = np.abs(v) / self.acceleration
        for columns in self._clusters:
            times[columns] = times[columns].max(initial=0.0)
        return np.asarray(times)

    # --- steps ---------------------------------------------------------------------------------------------------

    def clear(self, state: State, q: Array) -> float:
        """Return 1 if the motion from the state to q (nq,) is clear, and so is a braking motion after it; else a
        smaller fraction."""
        self.is_met = False
        if self.is_released:
            return 1.0
        v = self.clearance.mechanism.difference(state.q, q) / state.dt
        try:
            path = [state.q, q, *self._stop(q, v, state.dt)]
        except ClosureError:  # where it would stop is not known
            return _REFUSED
        if not self._is_clear(path):
            return _REFUSED
        self.is_met = not self._evasion.stays_clear(q, v)
        return _REFUSED if self.is_met else 1.0

    def _is_clear(self, path: list[Array]) -> bool:
        """Return whether a path of straight segments, on which no joint reverses, keeps the safety distance.

        All configurations between two of the path are in the box between these, as no joint reverses. A pair that keeps
        its distance in the whole box (`Clearance.uncertain`) is done; for the others the part of the path is halved,
        and single segments are tested as straight motions and halved `_HALVINGS` times.

        Args:
            path: configurations (nq,). Pairs that are too near at the first must not be nearer at the second and the
                last.
        """
        clearance, first = self.clearance, self._distances
        pairs, near = np.flatnonzero(first >= self.safety), np.flatnonzero(first < self.safety)
        if len(near) and any((clearance.distances(q)[near] < first[near] - 1e-9).any() for q in (path[1], path[-1])):
            return False
        parts = [(0, len(path) - 1, pairs)] if len(pairs) else []
        segments = []
        while parts:
            i, k, pairs = parts.pop()
            if k == i + 1:
                segments.append((path[i], path[k], pairs, 0))
                continue
            middle, half = self._middle(path[i], path[k])
            unsure = clearance.uncertain(middle, np.abs(half), self.safety, pairs)
            if unsure is None or len(unsure):
                left = pairs if unsure is None else unsure
                parts += [(i, (i + k) // 2, left), ((i + k) // 2, k, left)]
        while segments:
            begin, end, pairs, depth = segments.pop()
            middle, half = self._middle(begin, end)
            unsure = clearance.uncertain(middle, np.abs(half), self.safety, pairs, half)
            if unsure is None or (len(unsure) and depth == _HALVINGS):
                return False
            if len(unsure):
                segments += [(begin, middle, unsure, depth + 1), (middle, end, unsure, depth + 1)]
        return True

    def _middle(self, begin: Array, end: Array) -> tuple[Array, Array]:
        """Return the middle (nq,) of a straight motion, and the half (nv,) of it."""
        middle = self.clearance.mechanism.interpolate(begin, end, 0.5)
        return middle, self.clearance.mechanism.difference(middle, end)

    def _stop(self, q: Array, v: Array, dt: float) -> list[Array]:
        """Return configurations on the motion of braking from q (nq,) and v (nv,) to rest; the last is at rest."""
        times, change = self._braking_times(v), self.acceleration * dt
        ticks, seconds = int(np.ceil(times.max(initial=0.0) / dt - 1e-9)), np.maximum(times, 1e-12)
        path = []
        for count in sorted({-(-ticks * part // _PARTS) for part in range(1, _PARTS + 1)} - {0}):
            braked = np.minimum(count, np.floor(np.abs(v) / change + 1e-9))
            with np.errstate(invalid="ignore"):
                lost = np.where(np.isfinite(change), 0.5 * change * braked * (braked + 1.0), 0.0)
            moved = np.sign(v) * (np.abs(v) * braked - lost) * dt
            part = np.minimum(1.0, count * dt / seconds)
            moved = np.where(self._is_tied, v * seconds * (part - 0.5 * part * part), moved)
            path.append(self._closed(self.clearance.mechanism.integrate(q, moved)))
        return path

    def _closed(self, q: Array) -> Array:
        """Return a configuration (nq,) with closed loops, as braking reaches it.

        Raises:
            ClosureError: they can't be closed.
        """
        return q if self.basis is None else self.clearance.mechanism.close(q)
