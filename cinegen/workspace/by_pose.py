"""`ByPose`: configurations in which a node is where the cells of a piece want it, by a wave from those that are known.

Each piece is settled for itself, so that the order of pieces makes no difference: a first cell is come to on a straight
way from home; from there the wave goes from neighbour to neighbour. Where it stops each cell that is left is looked for
from configurations that are spread over all that can be reached, and where one is found a new wave begins. So a cell is
called out of reach only after a search, unless the lengths of the links rule it out.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik.batch import Evaluations, Sampler
from cinegen.ik.seeker import Seeker
from cinegen.ik.task import FrameTask
from cinegen.workspace.neighbours import neighbours
from cinegen.workspace.reach_bounds import ReachBounds
from cinegen.workspace.settled import How, Settled
from cinegen.workspace.specification import MapSpecification

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

_NOT_YET, _TOO_FAR, _NOT_FOUND = int(How.NOT_YET), int(How.TOO_FAR), int(How.NOT_FOUND)
_SEARCH, _NEIGHBOUR = int(How.SEARCH), int(How.NEIGHBOUR)  # numpy is slow to compare others

_GOAL = 1e-10  # rad or lengths that may be left
_JUMP = 0.7  # rad or lengths: a neighbour's solution that is further away is on another branch
_SAME = 1e-4  # rad or lengths: two solutions that are nearer are one
_SURE = 0.2  # part of the way to the next solution: a neighbour's that is nearer is the one that this one leads to
_MEET = 1e-4  # smallest singular value of type 1, where branches meet
_WAVES = 4  # until none goes through such a cell
_WAY = 12  # steps from home to the first cell
_SPREAD, _SPREAD_CLOSED = 600, 400  # configurations that starts are taken from
_TRIES = 300  # random starts of a piece, at least, where solutions are counted
_SEED = 0


class ByPose:
    """For one specification; used for piece after piece.

    Args:
        specification: over poses.
        sampler: of its mechanism and node.
    """

    def __init__(self, spec: MapSpecification, sampler: Sampler) -> None:
        self.spec, self.mechanism, self._sampler = spec, spec.mechanism, sampler
        self._seeker = self._seeker_of(spec.rotation)
        rng = np.random.default_rng(_SEED)
        closer = Seeker(self.mechanism, (), spec.limits)
        self._spread = closer.spread(_SPREAD_CLOSED if self.mechanism.loops else _SPREAD, rng)
        places = [self.mechanism.placement(q, spec.node) for q in self._spread]
        self._features = np.array([_feature(at.translation, at.rotation, self._weights) for at in places])
        self.shells = ReachBounds(self.mechanism, spec.node, spec.limits, spec.rotation)
        self._axis = self._seeker_of(2) if "solid_angle" in spec.quantities else None
        self._neutral = pin.neutral(self.mechanism.model)
        self._turning = np.zeros(self.mechanism.model.nv, dtype=bool)
        turning = [name for name in self.mechanism.joints if not self.mechanism.is_prismatic(name)]
        self._turning[[self.mechanism.v_index(name) for name in turning]] = True

    def _seeker_of(self, rotation: int) -> Seeker:
        spec = self.spec
        return Seeker(spec.mechanism, (FrameTask(spec.node, pin.SE3.Identity(), 3, rotation),), spec.limits)

    @property
    def _weights(self) -> tuple[float, float, float]:
        """How much place, z and the other axes count for what is near."""
        turn = {0: (0.0, 0.0), 2: (0.5, 0.0), 3: (0.5, 0.5)}[self.spec.rotation]
        return 1.0 / self.mechanism.length, *turn

    def settle(self, piece: tuple[slice, ...]) -> tuple[Settled, Evaluations]:
        """All cells of a piece of the specification's region."""
        points, rotations = self.spec.region.poses(self.spec.home, piece)
        near = neighbours([len(range(*s.indices(10**18))) for s in piece])
        dead_ends: frozenset[int] = frozenset()
        for _ in range(_WAVES):
            wave = _Wave(self, points, rotations, near, dead_ends)
            wave.run()
            done = self._evaluated(wave.q)
            singular = self._singular(done)
            everywhere = 10 * len(singular) > np.isfinite(wave.q[:, 0]).sum()  # then nothing is told by it
            if everywhere or not wave.came_from & singular:
                break
            dead_ends |= singular
        solutions = _Solutions(wave).count() if "solutions" in self.spec.quantities else None
        angle = self._solid_angles(wave.q, points) if self._axis is not None else None
        return Settled(wave.q, wave.how, solutions, angle), done

    def _evaluated(self, configurations: Array) -> Evaluations:
        """At each of these; not a number where there is no configuration."""
        good = np.isfinite(configurations[:, 0])
        done = self._sampler.at(configurations[good])
        if good.all():
            return done
        spread = []
        for name in done.__dataclass_fields__:
            values = getattr(done, name)
            full = np.full((len(good), *values.shape[1:]), np.nan)
            full[good] = values
            spread.append(full)
        return Evaluations(*spread)

    def _singular(self, done: Evaluations) -> frozenset[int]:
        """Cells where two branches meet: whoever goes on from there may be on another than whoever came."""
        if self.spec.freedoms > self.spec.rank:  # there is no telling branches apart
            return frozenset()
        width = done.singular_values.shape[1]
        with np.errstate(invalid="ignore"):
            return frozenset(np.flatnonzero(done.singular_values[:, min(self.spec.rank, width) - 1] < _MEET).tolist())

    # --- one cell ------------------------------------------------------------------------------------------------

    def seek(self, start: Array, target: pin.SE3) -> Array | None:
        """(nq,) from a start; None where it leads nowhere."""
        self._seeker.tasks[0].target = target
        return self._seeker.best if self._seeker.seek(start, _GOAL) else None

    def away(self, q: Array, other: Array) -> float:
        """How far the joint that is farthest goes, rad or lengths."""
        return self.mechanism.distance(q, other)

    def marks(self, q: Array) -> Array:
        """(nv,) what tells a configuration from others: what each joint does, rad or lengths."""
        return self.mechanism.scaled_difference(self._neutral, q)

    def apart(self, marks: Array, known: Array, joints: NDArray[np.intp]) -> Array:
        """(k,) how far some joints of configurations are from those of known ones (k, nv), whole turns left out."""
        gaps = (known - marks)[:, joints]
        turns = np.where(self._turning[joints], np.rint(gaps / (2.0 * np.pi)), 0.0)
        return np.asarray(np.abs(gaps - 2.0 * np.pi * turns).max(axis=1, initial=0.0))

    def starts(self, target: pin.SE3) -> Iterable[Array]:
        """Configurations in which the node is near to a target, the nearest first: as many as are to be tried."""
        point = _feature(target.translation, target.rotation, self._weights)
        away = ((self._features - point) ** 2).sum(axis=1)
        count = min(self.spec.starts, len(away))
        nearest = np.argpartition(away, count - 1)[:count] if count else np.zeros(0, dtype=int)
        return list(self._spread[nearest[np.argsort(away[nearest], kind="stable")]])

    def anywhere(self, rng: np.random.Generator) -> Array:
        """(nq,) all joints at random, loops open."""
        return self._seeker.anywhere(rng)

    def from_home(self, target: pin.SE3) -> Array | None:
        """(nq,) on a straight way from home; None where that ends."""
        home = self.spec.home
        q: Array | None = self.mechanism.q_home
        for part in np.linspace(0.0, 1.0, _WAY + 1)[1:]:
            point = home.translation + part * (target.translation - home.translation)
            turned = home.rotation @ pin.exp3(part * pin.log3(home.rotation.T @ target.rotation))
            q = self.seek(q, pin.SE3(turned, point)) if q is not None else None
        return q

    # --- directions ----------------------------------------------------------------------------------------------

    def _solid_angles(self, configurations: Array, points: Array) -> Array:
        """(n,) sr: that part of all directions that the node's z can have at a point."""
        directions = sphere(self.spec.directions)
        return np.array(
            [
                self._solid_angle(q, point, directions) if np.isfinite(q[0]) else 0.0
                for q, point in zip(configurations, points, strict=True)
            ]
        )

    def _solid_angle(self, q: Array, point: Array, directions: Array) -> float:
        """That direction is tried next which is nearest to one that is known, from there, then from other starts."""
        seeker = self._axis
        assert seeker is not None
        known, axes = [q], [self.mechanism.placement(q, self.spec.node).rotation[:, 2]]
        nearness, by = directions @ axes[0], np.zeros(len(directions), dtype=int)
        left = np.ones(len(directions), dtype=bool)
        for _ in directions:
            at = int(np.argmax(np.where(left, nearness, -np.inf)))
            left[at] = False
            target = seeker.tasks[0].target = pin.SE3(_turned_to(directions[at]), point)
            if any(seeker.seek(start, _GOAL) for start in (known[by[at]], *self.starts(target))):
                known.append(seeker.best)
                nearer = directions @ directions[at]
                by[nearer > nearness] = len(known) - 1
                nearness = np.maximum(nearness, nearer)
        return float(4.0 * np.pi * (len(known) - 1) / len(directions))


def _turned_to(axis: Array) -> Array:
    """(3, 3) axes whose z is this one."""
    return np.asarray(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix())


class _Wave:
    """Goes through the cells of a piece."""

    def __init__(
        self, of: ByPose, points: Array, rotations: Array, near: Ints, dead_ends: Collection[int] = ()
    ) -> None:
        self.of, self.points, self.near = of, points, near
        self._dead_ends = dead_ends  # cells that no others are come to from
        self.came_from: set[int] = set()
        self.rotations = rotations
        self.q = np.full((len(points), of.mechanism.model.nq), np.nan)
        self.how = np.zeros(len(points), dtype=np.uint8)
        self._elsewhere: dict[int, Array] = {}  # on another branch than the neighbour's

    def target(self, cell: int) -> pin.SE3:
        return pin.SE3(self.rotations[cell if len(self.rotations) > 1 else 0], self.points[cell])

    def run(self) -> None:
        """Settles all cells."""
        self.how[self.of.shells.exclude(self.points, self.rotations)] = _TOO_FAR
        left = np.flatnonzero(self.how == _NOT_YET)
        if len(left) == 0:
            return
        first = int(left[np.argmin(((self.points[left] - self.of.spec.home.translation) ** 2).sum(axis=1))])
        self._begin(first, self.of.from_home(self.target(first)))
        for cell in left.tolist():
            if self.how[cell] != _NOT_YET:
                continue
            found = self._elsewhere.get(cell)
            if found is None:
                target = self.target(cell)
                tries = (self.of.seek(start, target) for start in self.of.starts(target))
                found = next((q for q in tries if q is not None), None)
            if found is None:
                self.how[cell] = _NOT_FOUND
            else:
                self._begin(cell, found)
        for cell in sorted(self._elsewhere):  # of those that had been looked for in vain before
            if self.how[cell] == _NOT_FOUND:
                self._begin(cell, self._elsewhere[cell])

    def _begin(self, cell: int, q: Array | None) -> None:
        """A wave from a cell."""
        if q is None:
            return
        self.q[cell], self.how[cell] = q, _SEARCH
        waiting = deque([cell] if cell not in self._dead_ends else [])
        while waiting:
            here = waiting.popleft()
            for near in self.near[here].tolist():
                if near < 0 or self.how[near] not in (_NOT_YET, _NOT_FOUND):
                    continue
                found = self.of.seek(self.q[here], self.target(near))
                if found is None:
                    continue
                if self.of.away(self.q[here], found) > _JUMP:
                    self._elsewhere.setdefault(near, found)
                    continue
                self.q[near], self.how[near] = found, _NEIGHBOUR
                self.came_from.add(here)
                if near not in self._dead_ends:
                    waiting.append(near)


class _Solutions:
    """All solutions of a piece's cells that differ in what the motors do.

    Passive joints may have several values for the same motors (a universal joint can lie in two ways, and the rod
    between is where it was): that is one solution. Where joints have limits both ways are followed all the same, for
    one may be stopped where the other goes on.
    """

    def __init__(self, wave: _Wave) -> None:
        self._wave, self._of = wave, wave.of
        mechanism = self._of.mechanism
        self._motors = np.array([mechanism.v_index(name) for name in mechanism.actuated], dtype=np.intp)
        self._told = np.arange(mechanism.model.nv) if self._of.spec.limits else self._motors
        self._known = [np.zeros((0, mechanism.model.nv)) for _ in wave.q]  # marks of each cell's solutions
        self._waiting: deque[tuple[int, int, Array]] = deque()

    def count(self) -> NDArray[np.int32]:
        """(n,) of each cell: each solution that is found spreads as the first did."""
        wave, of = self._wave, self._of
        reached = np.flatnonzero(np.isfinite(wave.q[:, 0])).tolist()
        rng = np.random.default_rng(_SEED)
        tries = max(1, _TRIES // max(1, len(reached)))
        for cell in reached:
            self._note(cell, wave.q[cell])
        for cell in reached:
            target = wave.target(cell)
            anywhere = (of.anywhere(rng) for _ in range(tries))
            for start in (*of.starts(target), *anywhere):
                self._note(cell, of.seek(start, target))
        while self._waiting:
            here, number, q = self._waiting.popleft()
            own = self._known[here]
            others = of.apart(own[number], np.delete(own, number, axis=0), self._told)
            sure = _SURE * others.min(initial=_JUMP)
            for near in wave.near[here].tolist():
                if near < 0 or not len(self._known[near]):
                    continue
                if of.apart(own[number], self._known[near], self._told).min() > sure:
                    self._note(near, of.seek(q, wave.target(near)))
        return np.array([self._distinct(known) for known in self._known], dtype=np.int32)

    def _note(self, cell: int, q: Array | None) -> None:
        if q is None:
            return
        marks, known = self._of.marks(q), self._known[cell]
        if self._of.apart(marks, known, self._told).min(initial=np.inf) > _SAME:
            self._waiting.append((cell, len(known), q))
            self._known[cell] = np.vstack([known, marks])

    def _distinct(self, known: Array) -> int:
        """How many of these differ in what the motors do."""
        if len(known) < 2 or len(self._told) == len(self._motors):
            return len(known)
        kept = known[:0]
        for marks in known:
            if self._of.apart(marks, kept, self._motors).min(initial=np.inf) > _SAME:
                kept = np.vstack([kept, marks])
        return len(kept)


def sphere(count: int) -> Array:
    """(count, 3) directions, as even as may be (a spiral of golden angles: R. Swinbank and R. J. Purser, "Fibonacci
    grids", 2006)."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - z**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])


def _feature(point: Array, rotation: Array, weights: tuple[float, float, float]) -> Array:
    place, axis, others = weights
    return np.concatenate([place * point, axis * rotation[:, 2], others * rotation[:, :2].ravel()])
