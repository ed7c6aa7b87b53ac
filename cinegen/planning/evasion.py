"""`Evasion`: predicts whether obstacles that move will hit a mechanism, and finds motions that avoid it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body
from cinegen.collision.clearance import Clearance
from cinegen.errors import ClosureError
from cinegen.jit.foreign import DISTANCE, FIRST_POINT, NORMAL, SECOND_POINT, DistanceResults
from cinegen.joints import kinematic_data
from cinegen.loops.motions import free_motions
from cinegen.model import Mechanism
from cinegen.planning.clearance_barrier import stop_distance

Array = NDArray[np.float64]

_HORIZON = 1.0  # s: collisions that are further away are not predicted
_STRIDE = 0.03  # m: motion of an obstacle between two instants of a prediction, at most
_FEWEST, _MOST = 25, 200  # instants of a prediction
_TELEPORT = 10.0  # m/s: an obstacle that is faster was put somewhere else
_USABLE = 0.98  # of limits: closing loops, and the solver's tick, need the remainder
_FASTEST = 0.9  # of the limits of velocity, as for redundancy
_DURATIONS = 0.45, 0.7, 1.0  # of accelerating, as fractions of the time to the contact
_LEAST_DURATION = 0.1  # s
_SEARCH = 0.25  # fraction of the time to the contact in which a search ends
_IDLE = 0.15  # a joint that can do less than this fraction of what the best one can, is not moved
_RANDOM = 16  # manoeuvres in random directions
_INSTANTS = 4  # at which a manoeuvre is checked against what is at rest
_TOUCH = 1e-9  # m
_PUSHES = 0.5  # m/s: a slower obstacle at the stop distance pushes; the barrier retreats from it
_CHANGED = 0.2  # relative change of a velocity that is a new situation


def driven_motions(mechanism: Mechanism, q: Array, columns: NDArray[np.intp]) -> Array:
    """Return the velocities (nv, columns) of all joints of a mechanism with loops at q (nq,), by those of some."""
    free, _ = free_motions(mechanism.system.evaluate(q)[1], mechanism.loop_rank)
    basis = mechanism.scale[:, None] * free
    return np.asarray(basis @ np.linalg.pinv(basis[columns], rcond=1e-3))


class Threat(NamedTuple):
    """A collision, or one that no motion was found to avoid.

    Attributes:
        pair: names of the two bodies.
        points: (2, 3) their nearest points in the mechanism's world, m, now or when they will meet.
        distance: m, now; negative where they overlap.
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

    def twist(self, tick: int) -> tuple[Array, Array]:
        """Return the velocity (3,) of its origin, m/s, and the angular one (3,), rad/s, at a tick; 0 if it has
        stopped."""
        if tick - self._tick > self._interval + 1:
            return np.zeros(3), np.zeros(3)
        return self._linear, self._angular

    def pose(self, tick: int, seconds: float) -> pin.SE3:
        """Return the pose that it will have some seconds after a tick."""
        linear, angular = self.twist(tick)
        rotation = pin.exp3(angular * seconds) @ self._pose.rotation
        return pin.SE3(rotation, self._pose.translation + linear * seconds)

    def velocity(self, point: Array, tick: int) -> Array:
        """Return the velocity (3,) of a point (3,) of the obstacle at a tick, m/s."""
        linear, angular = self.twist(tick)
        return np.asarray(linear + np.cross(angular, point - self._pose.translation))


class Manoeuvre(NamedTuple):
    """Motion of joints that accelerate for a time, and brake then.

    Attributes:
        acceleration: (joints,) rad/s^2 and m/s^2.
        seconds: (joints,) time in which each joint accelerates, s.
    """

    acceleration: Array
    seconds: Array


class _Place(NamedTuple):
    """Nearest points (2, 3) and names of two bodies, and the index of the obstacle."""

    points: Array
    names: tuple[str, str]
    obstacle: int


class Meeting(NamedTuple):
    """The least distance on a predicted motion.

    Attributes:
        least: m; negative where bodies overlap.
        now: m, at the beginning.
        first: s until the distance is first too small; infinite if it never is.
        where: the place then, that of the least distance if it never is.
    """

    least: float
    now: float
    first: float
    where: _Place | None


class Evasion:
    """Reacts to obstacles that move, by prediction: they go on at constant velocity, the mechanism moves within its
    limits of acceleration and velocity.

    A mechanism that could brake to rest without being hit does not need to react. Otherwise motions are rolled out that
    accelerate at constant rates and brake then: away from the obstacle, across its path, and in random directions; the
    first one that keeps the safety distance is made, as long as braking is not enough. A collision that none of them
    avoids is a threat; that it is inevitable is not proved (T. Fraichard and H. Asama, "Inevitable collision states: a
    step towards safer robots?", Advanced Robotics 18, 2004). A search is spread over several ticks.

    Args:
        clearance: distances of the mechanism.
        safety: safety distance, m.
        acceleration: (nv,) limits, rad/s^2 and m/s^2; infinite where there is none.

    Attributes:
        motions: motion of each obstacle that was moved, by its index.
        tick: number of the tick.
        threat: the collision that no motion was found to avoid; None without one.
        manoeuvre: motion that is made to evade; None without one.
        obstacle: index of the obstacle that would hit if the mechanism only braked.
    """

    def __init__(self, clearance: Clearance, safety: float, acceleration: Array) -> None:
        self.clearance, self.safety = clearance, safety
        mechanism = self._mechanism = clearance.mechanism
        self.motions: dict[int, ObstacleMotion] = {}
        self.tick = 0
        self.threat: Threat | None = None
        self.manoeuvre: Manoeuvre | None = None
        self.obstacle = -1
        self._is_pushed, self._pushing = False, stop_distance(clearance.mechanism, safety)
        if mechanism.is_constrained:  # actuated joints determine the others
            self._columns = np.array([mechanism.v_index(joint) for joint in mechanism.actuated], dtype=np.intp)
        else:
            self._columns = np.flatnonzero(np.isfinite(acceleration))
        at = {int(j): int(i) for i, j in zip(*mechanism.scalar_joints, strict=True)}
        if mechanism.is_constrained and (len(self._columns) != mechanism.mobility or not set(self._columns) <= set(at)):
            self._columns = self._columns[:0]  # it only brakes
        self._at = np.array([at.get(int(j), -1) for j in self._columns], dtype=np.intp)
        self._limits = _USABLE * acceleration[self._columns]
        self._fastest = _FASTEST * mechanism.limits.velocity[self._columns]
        self._data = kinematic_data(mechanism.model)
        self._moving: tuple[int, ...] = ()
        self._geometry = pin.GeometryModel()
        self._search: Iterator[Manoeuvre] | None = None
        self._best: tuple[float, Manoeuvre] | None = None
        self._known: tuple[int, Array, list[Array]] | None = None  # tick, configuration and obstacles: that is clear
        self._seen: list[Array] = []  # velocities of obstacles for which the search was made

    def move(self, obstacle: int, placement: pin.SE3, dt: float) -> None:
        """Take over the pose of an obstacle, by its index, for a tick of dt (s)."""
        if obstacle in self.motions:
            self.motions[obstacle].update(placement, self.tick, dt)
        else:
            self.motions[obstacle] = ObstacleMotion(placement, self.tick)

    # --- what to do ----------------------------------------------------------------------------------------------

    def react(self, q: Array, v: Array, dt: float) -> Array | None:
        """Return the velocity (columns,) that the joints of `columns` must have after the next tick of dt (s); None if
        no reaction is needed.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity, rad/s and m/s.
            dt: period of a tick, s.
        """
        self.threat, self._is_pushed = None, False
        if not self._follow_obstacles():
            self._forget()
            return None
        braking = self._braking()
        if self._is_known_clear(q):
            self._forget()
            return None
        meeting = self._meet(q, v, braking)
        if meeting.first == math.inf or meeting.where is None:
            self._forget()
            return None
        self.obstacle = meeting.where.obstacle
        if self.manoeuvre is not None:
            self.manoeuvre = Manoeuvre(self.manoeuvre.acceleration, np.maximum(self.manoeuvre.seconds - dt, 0.0))
            if self._meet(q, v, self.manoeuvre).first < math.inf or not self._is_clear_of_rest(q, v, self.manoeuvre):
                self.manoeuvre, self._search = None, None
        if self.manoeuvre is None and meeting.now < self._pushing and self._speed() < _PUSHES:
            self._is_pushed = True
            return None
        if self.manoeuvre is None:
            self._look_for_manoeuvre(q, v, meeting, dt)
        if self.manoeuvre is None and self._search is None and meeting.least <= 0.0:
            where = meeting.where
            self.threat = Threat(where.names, where.points, self.clearance.least(q), False, True)
        self._is_pushed = self.manoeuvre is None and self.threat is None and meeting.now < self._pushing
        if self._is_pushed:
            return None
        return self._next_velocity(v[self._columns], self.manoeuvre or braking, dt)

    def stays_clear(self, q: Array, v: Array) -> bool:
        """Return whether a mechanism at q (nq,) with a velocity (nv,) that brakes is not hit by obstacles that move.

        True while one is so near that it pushes the mechanism, and no manoeuvre is known: the barrier retreats then.
        """
        if self._is_pushed or not self._follow_obstacles():
            return True
        clear = self._meet(q, v, self._braking()).first == math.inf
        self._known = (self.tick, q, self._velocities()) if clear else None
        return clear

    def contact(self, q: Array) -> Threat | None:
        """Return the deepest contact at q (nq,); None without one."""
        clearance, still = self.clearance, np.zeros(self._mechanism.model.nv)
        if clearance.uncertain(q, still, _TOUCH, clearance.every_pair) is not None:
            return None
        distances = clearance.distances(q)
        pair = int(distances.argmin())
        if distances[pair] > 0.0:
            return None
        first, second, normal = clearance.nearest_points(pair)
        motion = self.motions.get(int(clearance.groups[pair]))
        comes = motion is not None and float(normal @ motion.velocity(second, self.tick)) < -1e-3
        points = np.array([first, second])
        return Threat(clearance.names(pair), points, float(distances[pair]), True, comes)

    @property
    def columns(self) -> NDArray[np.intp]:
        """Columns of the joints that react."""
        return self._columns

    def _is_known_clear(self, q: Array) -> bool:
        """Return whether this was found for the last step, and obstacles go on as they did then."""
        if self._known is None or self._known[0] != self.tick - 1 or not np.array_equal(self._known[1], q):
            return False
        return not _differ(self._known[2], self._velocities(), 0.0)

    def _velocities(self) -> list[Array]:
        """Return the velocities of the obstacles that move."""
        return [part.copy() for i in self._moving for part in self.motions[i].twist(self.tick)]

    def _speed(self) -> float:
        """Return the largest speed of a point of an obstacle, m/s."""
        twists = [self.motions[i].twist(self.tick) for i in self._moving]
        return max(float(np.linalg.norm(linear) + np.linalg.norm(angular) * self._reach) for linear, angular in twists)

    def _forget(self) -> None:
        self.manoeuvre, self._search, self._best, self._seen = None, None, None, []

    def _braking(self) -> Manoeuvre:
        return Manoeuvre(np.zeros(len(self._columns)), np.zeros(len(self._columns)))

    def _look_for_manoeuvre(self, q: Array, v: Array, meeting: Meeting, dt: float) -> None:
        """Roll out some manoeuvres; at the end of the search, take the best one that avoids contact."""
        velocities = self._velocities()
        if _differ(self._seen, velocities, _CHANGED):
            self._seen, self._search, self._best = velocities, self._manoeuvres(q, v, meeting), None
        if self._search is None:
            return
        count = len(_DURATIONS) * 10 + _RANDOM
        for _ in range(math.ceil(min(count * dt / max(_SEARCH * meeting.first, dt), count))):
            one = next(self._search, None)
            if one is None:
                self._search = None
                if self._best is not None and self._best[0] > 0.0:
                    self.manoeuvre = self._best[1]
                return
            bar = max(meeting.least, 0.0) if self._best is None else self._best[0]
            found = self._meet(q, v, one, bar)
            if found.least > bar and self._is_clear_of_rest(q, v, one):
                self._best = found.least, one
                if found.first == math.inf:
                    self.manoeuvre = one
                    return

    def _manoeuvres(self, q: Array, v: Array, meeting: Meeting) -> Iterator[Manoeuvre]:
        """Yield manoeuvres that may avoid a meeting, gentle ones first."""
        if not len(self._columns) or meeting.where is None:
            return
        link, obstacle = meeting.where.points
        moved, _ = self._displacements(v, self._braking(), np.array([min(meeting.first, _HORIZON)]))
        at = self._path(q)(moved[0])
        rates = self._rates(at, meeting)
        if rates is None:
            return
        away = link - obstacle
        course = self._course(obstacle)
        across = away - course * (away @ course)
        if np.linalg.norm(across) < 1e-6 * (1.0 + np.linalg.norm(away)):
            across = np.cross(course, [0.0, 0.0, 1.0] if abs(course[2]) < 0.9 else [1.0, 0.0, 0.0])
        other = np.cross(course, across)
        directions = [across, away, course, other, -other, -across]
        seconds = max(meeting.first, _LEAST_DURATION)
        patterns = []
        for direction in directions:
            rate = self._limits * (direction @ rates)  # how much each joint can do
            largest = float(np.abs(rate).max(initial=0.0))
            if largest < 1e-9:
                continue
            patterns.append(np.where(np.abs(rate) > _IDLE * largest, np.sign(rate), 0.0))
            patterns.append(rate / largest)
        for part in _DURATIONS:
            for pattern in patterns:
                yield self._within_positions(q, v, pattern, part * seconds)
        rng = np.random.default_rng(0)
        for i in range(_RANDOM):
            pattern = rng.uniform(-1.0, 1.0, len(self._columns))
            pattern /= float(np.abs(pattern).max())
            yield self._within_positions(q, v, pattern, _DURATIONS[i % len(_DURATIONS)] * seconds)

    def _within_positions(self, q: Array, v: Array, pattern: Array, seconds: float) -> Manoeuvre:
        """Return the manoeuvre with fractions (columns,) of the accelerations, in which joints with limits of position
        can still brake before these."""
        acceleration, limits, own = pattern * self._limits, self._mechanism.limits, v[self._columns]
        times = np.full(len(own), seconds)
        for j, i in enumerate(self._at.tolist()):
            a, speed, limit = abs(acceleration[j]), own[j] * np.sign(acceleration[j]), self._limits[j]
            if i < 0 or a == 0.0:
                continue
            room = max(0.0, limits.upper[i] - q[i] if acceleration[j] > 0.0 else q[i] - limits.lower[i])
            if room < math.inf:  # accelerated for t, it stops after v t + a t^2 / 2 + (v + a t)^2 / (2 limit)
                square, linear = 0.5 * a * (1.0 + a / limit), speed * (1.0 + a / limit)
                rest = 0.5 * speed * abs(speed) / limit - 0.98 * room
                root = linear * linear - 4.0 * square * rest
                times[j] = min(seconds, max(0.0, (math.sqrt(root) - linear) / (2.0 * square)) if root > 0.0 else 0.0)
        return Manoeuvre(acceleration, times)

    def _rates(self, q: Array, meeting: Meeting) -> Array | None:
        """Return the velocities (3, columns) that joints give the nearest point of the link at q (nq,)."""
        assert meeting.where is not None
        point, name = meeting.where.points[0], meeting.where.names[0]
        model = self._mechanism.model
        jacobian = pin.computeJointJacobians(model, self._data, q)
        link = next(body for body in self._links() if body.name == name)
        moved = jacobian * self.clearance.moved_by[link.joint]
        rates = moved[:3] - pin.skew(point) @ moved[3:]
        if not self._mechanism.is_constrained:
            return np.asarray(rates[:, self._columns])
        return np.asarray(rates @ driven_motions(self._mechanism, q, self._columns))

    def _course(self, point: Array) -> Array:
        """Return the direction (3,) in which the fastest obstacle moves at a point (3,)."""
        velocities = [self.motions[i].velocity(point, self.tick) for i in self._moving]
        fastest = max(velocities, key=lambda one: float(np.linalg.norm(one)))
        return np.asarray(fastest / max(float(np.linalg.norm(fastest)), 1e-12))

    def _next_velocity(self, v: Array, manoeuvre: Manoeuvre, dt: float) -> Array:
        """Return the velocity (columns,) after a tick of a manoeuvre."""
        driven = np.minimum(manoeuvre.seconds, dt)
        faster = np.clip(v + manoeuvre.acceleration * driven, -self._fastest, self._fastest)
        with np.errstate(invalid="ignore"):
            slower = np.sign(faster) * np.maximum(np.abs(faster) - self._limits * (dt - driven), 0.0)
        return np.asarray(np.where(driven < dt, np.nan_to_num(slower), faster))

    # --- predictions ---------------------------------------------------------------------------------------------

    def _follow_obstacles(self) -> bool:
        """Return whether obstacles move; measure distances from these from now on."""
        moving = tuple(
            i
            for i, motion in self.motions.items()
            if any(np.abs(part).max() > 1e-6 for part in motion.twist(self.tick))
        )
        if not moving or moving == self._moving:
            return bool(moving)
        self._moving, self._geometry = moving, pin.GeometryModel()
        links = self._links()
        for number, body in enumerate(links):
            shape = pin.GeometryObject(f"{number}", body.joint, body.placement, body.shape)
            self._geometry.addGeometryObject(shape)
        self._pieces = [(i, piece) for i in moving for piece in self.clearance.obstacles[i].pieces]
        for number, (_, piece) in enumerate(self._pieces, len(links)):
            self._geometry.addGeometryObject(pin.GeometryObject(f"{number}", 0, piece.placement, piece.shape))
            for link in range(len(links)):
                self._geometry.addCollisionPair(pin.CollisionPair(link, number))
        self._results = DistanceResults(self._geometry.createData())
        self._reach = max(float(np.linalg.norm(piece.centre)) + piece.radius for _, piece in self._pieces)
        pairs = self.clearance.groups
        self._at_rest = np.flatnonzero(~np.isin(pairs, moving))
        return True

    def _links(self) -> list[Body]:
        return [body for body in self.clearance.links if body.joint != 0]

    def _measure(self, q: Array, seconds: float) -> int:
        """Measure the distances of all links at q (nq,) from obstacles after some seconds; return the nearest pair."""
        first = len(self._geometry.geometryObjects) - len(self._pieces)
        for number, (i, piece) in enumerate(self._pieces, first):
            pose = self.motions[i].pose(self.tick, seconds)
            self._geometry.geometryObjects[number].placement = pose * piece.placement
        pin.forwardKinematics(self._mechanism.model, self._data, q)
        pin.updateGeometryPlacements(self._mechanism.model, self._data, self._geometry, self._results.shapes)
        pin.computeDistances(self._geometry, self._results.shapes)
        self._results.read()
        return int(self._results.table[:, DISTANCE].argmin())

    def _meet(self, q: Array, v: Array, manoeuvre: Manoeuvre, bar: float = -math.inf) -> Meeting:
        """Return how near obstacles come during a manoeuvre from q (nq,) and v (nv,); no more exactly than to be below
        a bar, m, if it is."""
        speed = sum(
            float(np.linalg.norm(linear) + np.linalg.norm(angular) * self._reach)
            for linear, angular in (self.motions[i].twist(self.tick) for i in self._moving)
        )
        count = int(min(max(speed * _HORIZON / _STRIDE, _FEWEST), _MOST))
        times = np.linspace(0.0, _HORIZON, count + 1)
        moved, own = self._displacements(v, manoeuvre, times)
        path, least, first, where, k, enough = self._path(q), math.inf, math.inf, None, 0, self.safety
        now, moves = math.inf, bool(manoeuvre.seconds.any())
        while k <= count:
            try:
                pair = self._measure(path(moved[k]), float(times[k]))
            except ClosureError:
                return Meeting(-math.inf, now, float(times[k]), where)
            distance = float(self._results.table[pair, DISTANCE])
            if k == 0:  # a manoeuvre from too near takes a while to have an effect
                now, enough = distance, min(self.safety, (0.5 if moves else 1.0) * distance) - 1e-6
            if distance < least:
                least = distance
                if first == math.inf:
                    where = self._named(pair)
                    first = float(times[k]) if distance < enough else math.inf
            if distance <= 0.0 or least <= bar:
                break
            k += max(1, int((distance - enough) / (speed + own[k]) / times[1]))
        return Meeting(least, now, first, where)

    def _named(self, pair: int) -> _Place:
        """Return the place of a pair at the last measurement."""
        row, found = self._results.table[pair], self._geometry.collisionPairs[pair]
        links = self._links()
        points = np.array([row[FIRST_POINT : FIRST_POINT + 3], row[SECOND_POINT : SECOND_POINT + 3]])
        if np.linalg.norm(points[1] - points[0]) < 1e-9:
            points[1] += 1e-6 * row[NORMAL : NORMAL + 3]
        obstacle, piece = self._pieces[found.second - len(links)]
        return _Place(points, (links[found.first].name, piece.name), obstacle)

    def _displacements(self, v: Array, manoeuvre: Manoeuvre, times: Array) -> tuple[Array, Array]:
        """Return how far joints move during a manoeuvre from v (nv,) until some times (n,), (n, columns), and how fast
        links move from then on (n,), m/s, roughly."""
        limits, own, change, driven = self._limits, v[self._columns], manoeuvre.acceleration, manoeuvre.seconds
        fast = np.clip(own + change * driven, -self._fastest, self._fastest)
        size = np.abs(fast)
        rising = np.minimum(np.abs(fast - own) / np.where(change == 0.0, np.inf, np.abs(change)), driven)
        stopping = size / limits
        seconds = times[:, None]
        first = np.minimum(seconds, rising)
        last = np.clip(seconds - driven, 0.0, stopping)
        moved = own * first + 0.5 * change * first * first + fast * np.clip(seconds - rising, 0.0, driven - rising)
        moved += np.sign(fast) * (size - 0.5 * limits * last) * last
        speeds = np.maximum(size - limits * last, np.where(seconds < driven, np.abs(own), 0.0)).sum(axis=1)
        return moved, speeds * self._mechanism.length

    def _path(self, q: Array) -> Callable[[Array], Array]:
        """Return the function of the configurations (nq,) by how far joints have moved (columns,) from q (nq,).

        Raises (when called):
            ClosureError: loops can't be closed there.
        """
        mechanism, step, known = self._mechanism, np.zeros(self._mechanism.model.nv), q

        def at(moved: Array) -> Array:
            nonlocal known
            step[self._columns] = moved
            ahead = np.asarray(mechanism.integrate(q, step))
            if not mechanism.is_constrained:
                return ahead
            start = known.copy()
            start[self._at] = ahead[self._at]
            known = mechanism.close(start, locked=mechanism.actuated)
            return known

        return at

    def _is_clear_of_rest(self, q: Array, v: Array, manoeuvre: Manoeuvre) -> bool:
        """Return whether a manoeuvre keeps the mechanism clear of itself and of obstacles at rest, at a few instants:
        at the safety distance, and where it is nearer now, without contact."""
        pairs = self._at_rest
        if not len(pairs):
            return True
        distances = self.clearance.distances(q)[pairs]
        groups = ((pairs[distances >= self.safety], self.safety), (pairs[(distances < self.safety)], 0.0))
        path, still = self._path(q), np.zeros(self._mechanism.model.nv)
        end = float(np.max(2.0 * manoeuvre.seconds + np.abs(v[self._columns]) / self._limits, initial=0.0))
        times = min(end, _HORIZON) * np.linspace(0.0, 1.0, _INSTANTS + 1)[1:]
        for moved in self._displacements(v, manoeuvre, times)[0]:
            try:
                at = path(moved)
            except ClosureError:
                return False
            for checked, needed in groups:
                if len(checked) and self.clearance.uncertain(at, still, needed, checked) is None:
                    return False
        return True


def _differ(before: list[Array], now: list[Array], fraction: float) -> bool:
    """Return whether velocities differ by more than a fraction of them, or 1 mm/s."""
    return len(before) != len(now) or any(
        float(np.linalg.norm(a - b)) > fraction * float(np.linalg.norm(a)) + 1e-3
        for a, b in zip(before, now, strict=True)
    )
