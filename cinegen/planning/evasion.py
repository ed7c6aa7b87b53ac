"""`Evasion`: finds motions that avoid obstacles which will hit a mechanism."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance
from cinegen.joints import kinematic_data
from cinegen.planning.clearance_barrier import stop_distance
from cinegen.planning.encounters import HORIZON, Encounters, Meeting, ObstacleMotion, Place
from cinegen.planning.manoeuvres import Manoeuvre, ReactingJoints, driven_motions

_EFFORT = 20_000  # 1/s: instants of the period of a tick that a search may measure; an instant takes 15 to 30 us
_FOLLOWED = 1e-4  # rad/s and m/s by which joints may miss the velocity of a manoeuvre that was tested
_ENOUGH = 60  # manoeuvres that are tried before a collision is reported
_DURATIONS = 0.45, 0.7, 1.0  # of accelerating, as fractions of the time to the contact
_LEAST_DURATION = 0.1  # s
_IDLE = 0.15  # a joint that can do less than this fraction of what the best one can, is not moved
_RANDOM = 0.3, 1.2  # the same, at random
_MOVED = 0.6  # probability that a joint is moved at random
_BETTER = 1e-3  # m: another manoeuvre is made if it is better by this
_TOUCH = 1e-9  # m
_PUSHES = 0.5  # m/s: a slower obstacle at the stop distance pushes; the barrier retreats from it
_CHANGED = 0.2  # relative change of a velocity that is a new situation


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


class Evasion:
    """Reacts to obstacles that move, by prediction: they go on at constant velocity, the mechanism moves within its
    limits of acceleration and velocity.

    A mechanism that could brake to rest without being hit does not need to react. Otherwise manoeuvres are tried, a few
    in each tick, as its period allows, while it brakes: away from the obstacle, across its path, and in random
    directions. The best one that avoids contact is made, as long as braking is not enough; it is replaced while it does
    not keep the safety distance and a better one is found. A collision that none of many avoids is a threat; that it is
    inevitable is not proved (T. Fraichard and H. Asama, "Inevitable collision states: a step towards safer robots?",
    Advanced Robotics 18, 2004), and the search goes on.

    Args:
        clearance: distances of the mechanism.
        safety: safety distance, m.
        acceleration: (nv,) limits, rad/s^2 and m/s^2; infinite where there is none.

    Attributes:
        joints: joints that react.
        motions: motion of each obstacle that was moved, by its index.
        tick: number of the tick.
        threat: the collision that no motion was found to avoid; None without one.
        manoeuvre: motion that is made to evade; None without one.
        obstacle: index of the obstacle that would hit if the mechanism only braked.
    """

    def __init__(self, clearance: Clearance, safety: float, acceleration: Array) -> None:
        self.clearance = clearance
        self.joints = ReactingJoints(clearance.mechanism, clearance.links, acceleration)
        self.motions: dict[int, ObstacleMotion] = {}
        self.tick, self.obstacle = 0, -1
        self.threat: Threat | None = None
        self.manoeuvre: Manoeuvre | None = None
        self._encounters = Encounters(clearance, safety, self.joints)
        self._data = kinematic_data(clearance.mechanism.model)
        self._pushing = stop_distance(clearance.mechanism, safety)
        self._is_pushed = False
        self._search: Iterator[tuple[Array, float]] | None = None
        self._tried = 0  # manoeuvres since the last one that avoids contact
        self._next = np.zeros(0)  # velocity (joints,) that the manoeuvre has after the tick
        self._seen: list[Array] = []  # velocities of obstacles for which the search was begun
        self._known: tuple[int, Array, list[Array]] | None = None  # tick, configuration and obstacles: that is clear

    def move(self, obstacle: int, placement: pin.SE3, dt: float, jumps: bool) -> None:
        """Take over the pose of an obstacle for a tick of dt (s).

        Args:
            obstacle: its index.
            placement: its pose in the mechanism's world.
            dt: period of a tick, s.
            jumps: whether it was put there, instead of moved: it has no velocity.
        """
        if obstacle in self.motions and not jumps:
            self.motions[obstacle].update(placement, self.tick, dt)
        else:
            self.motions[obstacle] = ObstacleMotion(placement, self.tick)

    # --- what to do ----------------------------------------------------------------------------------------------

    def react(self, q: Array, v: Array, dt: float) -> Array | None:
        """Return the velocity (joints,) that the joints must have after the next tick of dt (s); None if no reaction is
        needed.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity, rad/s and m/s.
            dt: period of a tick, s.
        """
        self.threat, self._is_pushed, self.joints.dt = None, False, dt
        encounters, joints = self._encounters, self.joints
        meeting = None
        if encounters.follow(self.motions, self.tick) and not self._is_known_clear(q):
            meeting = encounters.meet(q, v, joints.braking)
        if meeting is None or meeting.place is None or meeting.first == math.inf:
            self.manoeuvre, self._search, self._seen, self._tried = None, None, [], 0
            return None
        self.obstacle = meeting.place.obstacle
        kept = self._keep(q, v, dt)
        if self.manoeuvre is None and meeting.now < self._pushing and encounters.speed() < _PUSHES:
            self._is_pushed = True
            return None
        if kept is None or (kept.first < math.inf and self._tried < _ENOUGH):
            self._try_some(q, v, meeting, kept)
        exhausted = self._tried >= _ENOUGH or not len(joints.columns)
        if self.manoeuvre is None and exhausted and meeting.least <= 0.0:
            place = meeting.place
            self.threat = Threat(place.names, place.points, self.clearance.least(q), False, True)
        self._next = joints.next_velocity(v, self.manoeuvre or joints.braking)
        return self._next

    def stays_clear(self, q: Array, v: Array) -> bool:
        """Return whether a mechanism that brakes from q (nq,) and a velocity (nv,) at the next tick is not hit by
        obstacles that move.

        True while one is so near that it pushes the mechanism, and no manoeuvre is known: the barrier retreats then.
        """
        if self._is_pushed or not self._encounters.follow(self.motions, self.tick):
            return True
        ahead = self._encounters.meet(q, v, self.joints.braking, ahead=self.joints.dt)
        clear = ahead.first == math.inf
        self._known = (self.tick, q, self._encounters.velocities()) if clear else None
        return clear

    def contact(self, q: Array) -> Threat | None:
        """Return the deepest contact at q (nq,); None without one."""
        clearance, still = self.clearance, np.zeros(self.clearance.mechanism.model.nv)
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

    def _is_known_clear(self, q: Array) -> bool:
        """Return whether this was found for the last step, and obstacles go on as they did then."""
        if self._known is None or self._known[0] != self.tick - 1 or not np.array_equal(self._known[1], q):
            return False
        return not _differ(self._known[2], self._encounters.velocities(), 0.0)

    # --- search --------------------------------------------------------------------------------------------------

    def _keep(self, q: Array, v: Array, dt: float) -> Meeting | None:
        """Return the meeting during what remains of the manoeuvre; None, and forget it, if it no longer avoids
        contact. What is at rest is tested again only where joints did not follow it."""
        if self.manoeuvre is None:
            return None
        self.manoeuvre = self.manoeuvre.after(dt)
        kept = self._encounters.meet(q, v, self.manoeuvre)
        is_followed = float(np.abs(v[self.joints.columns] - self._next).max(initial=0.0)) <= _FOLLOWED
        if kept.least > 0.0 and (is_followed or self._encounters.is_clear_of_rest(q, v, self.manoeuvre)):
            return kept
        self.manoeuvre, self._search, self._tried = None, None, 0
        return None

    def _try_some(self, q: Array, v: Array, meeting: Meeting, kept: Meeting | None) -> None:
        """Try some manoeuvres, and take the best one if it avoids contact.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity, rad/s and m/s.
            meeting: what would happen if the mechanism braked.
            kept: what will happen by the present manoeuvre; None without one.
        """
        velocities = self._encounters.velocities()
        if self._search is None or _differ(self._seen, velocities, _CHANGED):
            self._search, self._seen, self._tried = self._patterns(q, v, meeting), velocities, 0
        least = max(meeting.least, 0.0) if kept is None else kept.least + _BETTER
        contact = max(meeting.first, _LEAST_DURATION)
        last = self._encounters.effort + _EFFORT * self.joints.dt
        for fractions, part in self._search:
            self._tried += 1
            manoeuvre = self.joints.manoeuvre(q, v, fractions, part * contact)
            outcome = self._encounters.meet(q, v, manoeuvre, least)
            if outcome.least > least and self._encounters.is_clear_of_rest(q, v, manoeuvre):
                self.manoeuvre, least = manoeuvre, outcome.least + _BETTER
                if outcome.first == math.inf:
                    break
            if self._encounters.effort >= last:
                break

    def _patterns(self, q: Array, v: Array, meeting: Meeting) -> Iterator[tuple[Array, float]]:
        """Yield fractions (joints,) of the accelerations, and of the time to the contact in which they are applied:
        those that move the link in some directions, in turn with random ones, which do not end."""
        count, rng = len(self.joints.columns), np.random.default_rng(0)
        if not count or meeting.place is None:
            return
        directed = itertools.product(_DURATIONS, list(self._directed(q, v, meeting.first, meeting.place)))
        while True:
            for part, fractions in itertools.islice(directed, 1):
                yield fractions, part
            moved = np.where(rng.random(count) < _MOVED, rng.choice([-1.0, 1.0], count), 0.0)
            yield moved if rng.random() < 0.5 else rng.uniform(-1.0, 1.0, count), rng.uniform(*_RANDOM)

    def _directed(self, q: Array, v: Array, seconds: float, place: Place) -> Iterator[Array]:
        """Yield fractions (joints,) of the accelerations that move the link of a meeting away from the obstacle, and
        across its course: of all joints that can contribute, and of each as much as it can.

        Args:
            q: (nq,) configuration.
            v: (nv,) velocity, rad/s and m/s.
            seconds: time to the meeting if the mechanism brakes, s.
            place: the meeting.
        """
        joints, (link, obstacle) = self.joints, place.points
        moved = joints.roll_out(v, joints.braking, np.array([min(seconds, HORIZON)])).moved[0]
        rates = self._rates(joints.configuration(q, moved, q), place)
        away, course = link - obstacle, self._encounters.course(obstacle)
        across = away - course * (away @ course)
        if np.linalg.norm(across) < 1e-6 * (1.0 + np.linalg.norm(away)):
            across = np.cross(course, [0.0, 0.0, 1.0] if abs(course[2]) < 0.9 else [1.0, 0.0, 0.0])
        other = np.cross(course, across)
        for direction in (across, away, course, other, -other, -across):
            rate = joints.limits * (direction @ rates)
            largest = float(np.abs(rate).max())
            if largest > 1e-9:
                yield np.where(np.abs(rate) > _IDLE * largest, np.sign(rate), 0.0)
                yield rate / largest

    def _rates(self, q: Array, place: Place) -> Array:
        """Return the velocities (3, joints) that joints give the nearest point of a link at q (nq,)."""
        mechanism = self.clearance.mechanism
        jacobian = pin.computeJointJacobians(mechanism.model, self._data, q)
        moved = jacobian * self.clearance.moved_by[place.joint]
        rates = moved[:3] - pin.skew(place.points[0]) @ moved[3:]
        if not mechanism.is_constrained:
            return np.asarray(rates[:, self.joints.columns])
        return np.asarray(rates @ driven_motions(mechanism, q, self.joints.columns))


def _differ(before: list[Array], now: list[Array], fraction: float) -> bool:
    """Return whether velocities differ by more than a fraction of them, or 1 mm/s."""
    return len(before) != len(now) or any(
        float(np.linalg.norm(a - b)) > fraction * float(np.linalg.norm(a)) + 1e-3
        for a, b in zip(before, now, strict=True)
    )
