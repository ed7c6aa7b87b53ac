"""`Encounters`: distances of a mechanism from moving obstacles during a manoeuvre; and how these obstacles move."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, Integers
from cinegen.collision.clearance import Clearance
from cinegen.errors import ClosureError
from cinegen.jit.foreign import DISTANCE, FIRST_POINT, NORMAL, SECOND_POINT, DistanceResults
from cinegen.joints import kinematic_data
from cinegen.planning.manoeuvres import Manoeuvre, ReactingJoints


class ObstacleMotion:
    """Velocity of an obstacle, constant from one of its poses to the next, and after the last one.

    An obstacle that gets no new pose for more ticks than lay between its last two poses is at rest.

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
        self._pose, self._tick = placement.copy(), tick

    def twist(self, tick: int) -> tuple[Array, Array]:
        """Return the velocity (3,) of its origin, m/s, and the angular one (3,), rad/s, at a tick."""
        if tick - self._tick > self._interval + 1:
            return np.zeros(3), np.zeros(3)
        return self._linear, self._angular

    def pose(self, tick: int, seconds: float) -> pin.SE3:
        """Return the pose that it will have some seconds after a tick."""
        linear, angular = self.twist(tick)
        rotation = self._pose.rotation
        if angular.any():
            rotation = pin.exp3(angular * seconds) @ rotation
        return pin.SE3(rotation, self._pose.translation + linear * seconds)

    def velocity(self, point: Array, tick: int) -> Array:
        """Return the velocity (3,) of a point (3,) of the obstacle at a tick, m/s."""
        linear, angular = self.twist(tick)
        return np.asarray(linear + np.cross(angular, point - self._pose.translation))

    def speed(self, radius: float, tick: int) -> float:
        """Return a bound of the speed of all points within a radius (m) of its origin at a tick, m/s."""
        linear, angular = self.twist(tick)
        return float(np.linalg.norm(linear) + np.linalg.norm(angular) * radius)


HORIZON = 1.0
"""Collisions that are further away are not predicted, s."""

_STRIDE = 5e-3  # m by which bodies may approach between two instants of a prediction
_FEWEST, _MOST = 25, 500  # instants of a prediction, if each were measured
_DOUBLED = 50  # instants that are measured, after which the stride is doubled: a prediction must end in time
_PARTS = 4  # of a manoeuvre that is checked against what is at rest
_HALVINGS = 5  # of each of them: what is not known to be clear then, is refused
_TOUCH = 1e-9  # m
_REST = 3  # instants that take as long as a test of what is at rest


class Place(NamedTuple):
    """A pair of bodies, where they are nearest.

    Attributes:
        points: (2, 3) nearest points on the link and on the obstacle in the mechanism's world, m.
        names: names of the two bodies.
        joint: joint of the link.
        obstacle: index of the obstacle.
    """

    points: Array
    names: tuple[str, str]
    joint: int
    obstacle: int


class Meeting(NamedTuple):
    """The least distance from obstacles that move during a manoeuvre.

    Attributes:
        least: m; negative where bodies overlap.
        now: m, at the beginning.
        first: s until the distance is first too small; infinite if it never is.
        place: the pair then, that of the least distance if it never is; None if loops can't be closed at the beginning.
    """

    least: float
    now: float
    first: float
    place: Place | None


class Encounters:
    """Distances of a mechanism from obstacles that go on at constant velocity, and from what is at rest, during a
    manoeuvre.

    Distances from obstacles that move are predicted by conservative advancement, at instants between which bodies that
    are too near approach by 5 mm at most (by more, if that took more than 50 measured instants, or 500 in all; with
    loops, whose speeds are estimated, by 5 mm about). Those from all else, its own links
    included, are bounded along the whole manoeuvre; loops, closed at its instants, open in between to second order.

    Args:
        clearance: distances of the mechanism.
        safety: safety distance, m.
        joints: joints that make the manoeuvres.

    Attributes:
        effort: what was computed so far, in instants at which distances were measured.
    """

    def __init__(self, clearance: Clearance, safety: float, joints: ReactingJoints) -> None:
        self.clearance, self.safety, self.joints = clearance, safety, joints
        self._links = [body for body in clearance.links if body.joint != 0]
        self._data = kinematic_data(clearance.mechanism.model)
        self._geometry = pin.GeometryModel()
        self._motions: dict[int, ObstacleMotion] = {}
        self._at_rest = clearance.every_pair
        self._tick, self._reach = 0, 0.0
        self.effort = 0

    # --- obstacles that move -------------------------------------------------------------------------------------

    def follow(self, motions: Mapping[int, ObstacleMotion], tick: int) -> bool:
        """Take over the motions of obstacles, by index, at a tick; return whether any of them moves."""
        self._tick, before = tick, tuple(self._motions)
        self._motions = {i: moves for i, moves in motions.items() if max(map(np.linalg.norm, moves.twist(tick))) > 1e-6}
        if self._motions and tuple(self._motions) != before:
            self._arrange()
        if self._motions:
            twist = {i: motion.twist(tick) for i, motion in self._motions.items()}
            linear = np.array([twist[i][0] for i, _ in self._pieces])
            spin = [np.linalg.norm(twist[i][1]) * (np.linalg.norm(p.centre) + p.radius) for i, p in self._pieces]
            self._linear, self._spin = (np.repeat(part, len(self._links), axis=0) for part in (linear, np.array(spin)))
        return bool(self._motions)

    def velocities(self) -> list[Array]:
        """Return the linear and angular velocities (3,) of the obstacles that move, m/s and rad/s."""
        return [part.copy() for motion in self._motions.values() for part in motion.twist(self._tick)]

    def speed(self) -> float:
        """Return a bound of the speeds of all points of obstacles, m/s."""
        return max(motion.speed(self._reach, self._tick) for motion in self._motions.values())

    def course(self, point: Array) -> Array:
        """Return the direction (3,) in which the fastest obstacle moves at a point (3,)."""
        velocities = [motion.velocity(point, self._tick) for motion in self._motions.values()]
        fastest = max(velocities, key=lambda velocity: float(np.linalg.norm(velocity)))
        return np.asarray(fastest / max(float(np.linalg.norm(fastest)), 1e-12))

    def meet(self, q: Array, v: Array, manoeuvre: Manoeuvre, bar: float = -math.inf, ahead: float = 0.0) -> Meeting:
        """Return how near obstacles that move come during a manoeuvre from q (nq,) and v (nv,).

        Too small is a distance below the safety distance; where it is that now, below half of the distance now, which
        takes a while to grow, or below all of it if the mechanism brakes.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity, rad/s and m/s.
            manoeuvre: manoeuvre.
            bar: m; a least distance below is not found more exactly.
            ahead: s after the tick at which it begins.
        """
        speed, joints = self.speed(), self.joints
        most = speed + float(joints.fastest_between(v, manoeuvre, 0.0, HORIZON) @ joints.reach)
        count = int(min(max(most * HORIZON / _STRIDE, _FEWEST), _MOST))
        times = np.linspace(0.0, HORIZON, count + 1)
        moved, velocities = joints.roll_out(v, manoeuvre, times)
        rates = np.maximum.accumulate((np.abs(velocities) @ joints.reach)[::-1])[::-1]  # of links, from then on
        now = least = first = math.inf
        k, enough, guess, measured = 0, self.safety, q, 0
        nearest: tuple[int, Array] | None = None
        while k <= count:
            try:
                guess = joints.configuration(q, moved[k], guess)
            except ClosureError:
                place = None if nearest is None else self._place(*nearest)
                return Meeting(-math.inf, now, float(times[k]), place)
            pair = self._measure(guess, float(times[k]) + ahead)
            distance = float(self._results.table[pair, DISTANCE])
            if k == 0:
                now, enough = distance, min(self.safety, (0.5 if manoeuvre.seconds.any() else 1.0) * distance) - 1e-6
            if distance < least:
                least = distance
                if first == math.inf:
                    nearest = pair, self._results.table[pair].copy()
                    first = float(times[k]) if distance < enough else math.inf
            if distance <= 0.0 or least <= bar:
                break
            measured += 1
            stride = _STRIDE * 2 ** (measured // _DOUBLED)
            k += max(1, self._skipped(enough, stride, float(rates[k]) * times[1], float(times[1]), count))
        return Meeting(least, now, first, None if nearest is None else self._place(*nearest))

    def _arrange(self) -> None:
        """Measure distances from the obstacles that move from now on."""
        self._geometry = pin.GeometryModel()
        for number, body in enumerate(self._links):
            self._geometry.addGeometryObject(pin.GeometryObject(f"{number}", body.joint, body.placement, body.shape))
        self._pieces = [(i, piece) for i in self._motions for piece in self.clearance.obstacles[i].pieces]
        for number, (_, piece) in enumerate(self._pieces, len(self._links)):
            self._geometry.addGeometryObject(pin.GeometryObject(f"{number}", 0, piece.placement, piece.shape))
            for link in range(len(self._links)):
                self._geometry.addCollisionPair(pin.CollisionPair(link, number))
        self._moving = list(self._geometry.geometryObjects)[len(self._links) :]
        self._results = DistanceResults(self._geometry.createData())
        self._reach = max(float(np.linalg.norm(piece.centre)) + piece.radius for _, piece in self._pieces)
        self._at_rest = np.flatnonzero(~np.isin(self.clearance.groups, tuple(self._motions)))

    def _measure(self, q: Array, seconds: float) -> int:
        """Measure the distances of all links at q (nq,) from obstacles after some seconds; return the nearest pair."""
        self.effort += 1
        poses = {i: motion.pose(self._tick, seconds) for i, motion in self._motions.items()}
        for shape, (i, piece) in zip(self._moving, self._pieces, strict=True):
            shape.placement = poses[i] * piece.placement
        model = self.clearance.mechanism.model
        pin.forwardKinematics(model, self._data, q)
        pin.updateGeometryPlacements(model, self._data, self._geometry, self._results.shapes)
        pin.computeDistances(self._geometry, self._results.shapes)
        self._results.read()
        return int(self._results.table[:, DISTANCE].argmin())

    def _skipped(self, enough: float, stride: float, moved: float, dt: float, most: int) -> int:
        """Return after how many instants any distance may be too small.

        Seen from a link that stays where it is, the distance of a convex body that moves straight on is a convex
        function of time: never below its tangent. Rotations, and what links move, are bounded.

        Args:
            enough: distance that is not too small, m.
            stride: by which bodies that are nearer may approach, m.
            moved: by which links move in an instant at most, m.
            dt: time between instants, s.
            most: number of instants at most.
        """
        table = self._results.table
        closing = np.maximum(-(table[:, NORMAL : NORMAL + 3] * self._linear).sum(axis=1), 0.0) + self._spin
        room = np.maximum(table[:, DISTANCE] - enough, stride)
        return int(min((room / (closing * dt + moved + 1e-12)).min(), most + 1.0))

    def _place(self, pair: int, row: Array) -> Place:
        """Return a pair, by its row of results."""
        bodies = self._geometry.collisionPairs[pair]
        points = np.array([row[FIRST_POINT : FIRST_POINT + 3], row[SECOND_POINT : SECOND_POINT + 3]])
        if np.linalg.norm(points[1] - points[0]) < 1e-9:
            points[1] += 1e-6 * row[NORMAL : NORMAL + 3]
        link, (obstacle, piece) = self._links[bodies.first], self._pieces[bodies.second - len(self._links)]
        return Place(points, (link.name, piece.name), link.joint, obstacle)

    # --- what is at rest -----------------------------------------------------------------------------------------

    def is_clear_of_rest(self, q: Array, v: Array, manoeuvre: Manoeuvre) -> bool:
        """Return whether a manoeuvre from q (nq,) and v (nv,) is known to keep the mechanism clear of itself and of
        obstacles at rest until it has stopped: at the safety distance, and where it is nearer now, without contact."""
        if not len(self._at_rest):
            return True
        distances = self.clearance.distances(q)[self._at_rest]
        groups = [
            (self._at_rest[distances >= self.safety], self.safety),
            (self._at_rest[distances < self.safety], _TOUCH),
        ]
        try:
            return all(self._keeps(q, v, manoeuvre, pairs, least) for pairs, least in groups if len(pairs))
        except ClosureError:
            return False

    def _keeps(self, q: Array, v: Array, manoeuvre: Manoeuvre, pairs: Integers, least: float) -> bool:
        """Return whether pairs keep a least distance (m) during a manoeuvre, by bounds of their change in parts of it,
        which are halved where they do not suffice."""

        def at(seconds: float, guess: Array) -> Array:
            moved = self.joints.roll_out(v, manoeuvre, np.array([seconds])).moved[0]
            return self.joints.configuration(q, moved, guess)

        mechanism, times = self.clearance.mechanism, np.linspace(0.0, self.joints.duration(v, manoeuvre), _PARTS + 1)
        ends = [q]
        for time in times[1:]:
            ends.append(at(float(time), ends[-1]))
        parts = [(*times[i : i + 2].tolist(), ends[i], ends[i + 1], pairs, 0) for i in range(_PARTS)]
        while parts:
            begin, end, first, last, pairs, depth = parts.pop()
            half = 0.5 * (begin + end)
            middle = at(half, first)
            change = np.maximum(*(np.abs(mechanism.difference(middle, other)) for other in (first, last)))
            change[self.joints.columns] = self.joints.fastest_between(v, manoeuvre, begin, end) * (half - begin)
            unsure = self.clearance.uncertain(middle, change, least, pairs)
            self.effort += _REST
            if unsure is None or (len(unsure) and depth == _HALVINGS):
                return False
            if len(unsure):
                parts += [(begin, half, first, middle, unsure, depth + 1), (half, end, middle, last, unsure, depth + 1)]
        return True
