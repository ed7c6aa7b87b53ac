"""`ByPose`: evaluates cells over poses of a node by a wavefront that continues known configurations.

Each chunk is evaluated for itself, so that the order of chunks makes no difference. The first cell is solved along a
straight line from the home pose; from there a wavefront goes from neighbour to neighbour. Where it stops, every
remaining cell is searched from samples of all reachable configurations, and a new wavefront begins where one is found.
So a cell counts as unreachable only after a search, unless the lengths of the links exclude it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from dataclasses import fields

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.arrays import Array, Indices
from cinegen.ik.batch import BatchEvaluator, Evaluations
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.task import FrameTask
from cinegen.singularities.branch import JUMP, flood, neighbours
from cinegen.workspace.cells import Cells, CellStatus
from cinegen.workspace.continuation import GOAL, Continuation
from cinegen.workspace.reach_bounds import ReachBounds
from cinegen.workspace.specification import MapSpecification

_NOT_EVALUATED, _REACHABLE, _BY_SEARCH, _PROVED, _NOT_FOUND, *_ = map(int, CellStatus)  # numpy compares these faster

_SAME = 1e-4  # rad or lengths: two solutions that are nearer are one
_SURE = 0.2  # of the distance to the next solution: a neighbour's that is nearer continues this one
_SINGULAR = 1e-4  # smallest singular value of type 1, below which branches meet
_ROUNDS = 4  # until no wavefront goes through such a cell
_STEPS = 12  # from the home pose to the first cell
_SAMPLES, _SAMPLES_CLOSED = 600, 400  # configurations that starts are taken from, without and with loops
_TRIES = 300  # random starts of a chunk, at least, where solutions are counted
_SEED = 0


class ByPose(Continuation):
    """Evaluates chunk after chunk.

    Args:
        spec: a specification over poses.
        batch: evaluator of its mechanism and node.
    """

    def __init__(self, spec: MapSpecification, batch: BatchEvaluator) -> None:
        super().__init__(spec)
        mechanism = spec.mechanism
        self._batch = batch
        self.local = LocalIK(mechanism, (), spec.limits, holds_base=True)
        count = _SAMPLES_CLOSED if mechanism.is_constrained else _SAMPLES
        self._samples = self.local.samples(count, np.random.default_rng(_SEED))
        self._features = np.array([self._feature(mechanism.placement(q, spec.node)) for q in self._samples])
        self.bounds = ReachBounds(mechanism, spec.node, spec.limits, spec.rotation)
        axis = (FrameTask(spec.node, pin.SE3.Identity(), 3, 2),)
        self._axis = LocalIK(mechanism, axis, spec.limits, True) if "solid_angle" in spec.quantities else None
        self._neutral = pin.neutral(mechanism.model)
        revolute = [mechanism.v_index(name) for name in mechanism.joints if not mechanism.is_prismatic(name)]
        self._revolute = np.isin(np.arange(mechanism.model.nv), revolute)

    def cells(self, chunk: tuple[slice, ...]) -> Cells:
        """Evaluate the cells of a chunk."""
        spec, region = self.spec, self.spec.region
        points, rotations = region.poses(spec.home, region.values(chunk))
        near = neighbours([cells.stop - cells.start for cells in chunk]).tolist()
        dead_ends: frozenset[int] = frozenset()
        for _ in range(_ROUNDS):
            front = _Wavefront(self, points, rotations, near, dead_ends)
            front.run()
            done = self._evaluated(front.q)
            singular = self._singular(done)
            everywhere = 10 * len(singular) > np.isfinite(front.q[:, 0]).sum()  # then it says nothing about branches
            if everywhere or not front.sources & singular:
                break
            dead_ends |= singular
        solutions = _Solutions(front).count() if "solutions" in spec.quantities else None
        angle = None
        if self._axis is not None:
            directions, pairs = fibonacci_sphere(spec.directions), zip(front.q, points, strict=True)
            angle = np.array(
                [self._solid_angle(*pair, directions) if np.isfinite(pair[0][0]) else 0.0 for pair in pairs]
            )
        return Cells(spec, front.status, done, solutions, angle)

    def _evaluated(self, configurations: Array) -> Evaluations:
        """Evaluate the node at configurations (n, nq); NaN where they are."""
        finite = np.isfinite(configurations[:, 0])
        done = self._batch.at(configurations[finite])
        full = {}
        for name in (field.name for field in fields(done)):
            values = getattr(done, name)
            full[name] = np.full((len(finite), *values.shape[1:]), np.nan)
            full[name][finite] = values
        return Evaluations(**full | {"q": configurations})

    def _singular(self, done: Evaluations) -> frozenset[int]:
        """Return the cells where two branches meet, which a wavefront might leave on another branch."""
        if self.spec.dof > self.spec.rank:  # branches can't be told apart
            return frozenset()
        width = done.singular_values.shape[1]
        with np.errstate(invalid="ignore"):
            low = done.singular_values[:, min(self.spec.rank, width) - 1] < _SINGULAR
        return frozenset(np.flatnonzero(low).tolist())

    # --- one cell ------------------------------------------------------------------------------------------------

    def marks(self, q: Array) -> Array:
        """Return the joint values (nv,) of a configuration, rad or lengths."""
        return self.mechanism.scaled_difference(self._neutral, q)

    def apart(self, marks: Array, known: Array, joints: Indices) -> Array:
        """Return how far (k,) some joints are from those of known configurations (k, nv), up to whole revolutions."""
        gaps = (known - marks)[:, joints]
        turns = np.where(self._revolute[joints], np.rint(gaps / (2.0 * np.pi)), 0.0)
        return np.asarray(np.abs(gaps - 2.0 * np.pi * turns).max(axis=1, initial=0.0))

    def starts(self, target: pin.SE3) -> list[Array]:
        """Return `spec.starts` samples in which the node is near a target, the nearest first."""
        away = ((self._features - self._feature(target)) ** 2).sum(axis=1)
        count = min(self.spec.starts, len(away))
        nearest = np.argpartition(away, count - 1)[:count] if count else np.zeros(0, dtype=int)
        return list(self._samples[nearest[np.argsort(away[nearest], kind="stable")]])

    def _feature(self, pose: pin.SE3) -> Array:
        """Return numbers that are near for near poses, as far as these are given."""
        axis, others = {0: (0.0, 0.0), 2: (0.5, 0.0), 3: (0.5, 0.5)}[self.spec.rotation]
        rotation = np.asarray(pose.rotation)
        position = pose.translation / self.mechanism.length
        return np.concatenate([position, axis * rotation[:, 2], others * rotation[:, :2].ravel()])

    def from_home(self, target: pin.SE3) -> Array | None:
        """Return a configuration (nq,) at the end of a straight line from the home pose; None where it breaks off."""
        home = self.spec.home
        q: Array | None = self.mechanism.q_home
        for part in np.linspace(0.0, 1.0, _STEPS + 1)[1:]:
            point = home.translation + part * (target.translation - home.translation)
            rotation = home.rotation @ pin.exp3(part * pin.log3(home.rotation.T @ target.rotation))
            q = self.solve(pin.SE3(rotation, point), q) if q is not None else None
        return q

    # --- directions ----------------------------------------------------------------------------------------------

    def _solid_angle(self, q: Array, point: Array, directions: Array) -> float:
        """Return the solid angle, sr, of the directions (n, 3) that the node's z axis can have at a point (3,).

        The direction nearest to a known one is tried next: from there, then from other starts.
        """
        local = self._axis
        assert local is not None
        known, axis = [q], self.mechanism.placement(q, self.spec.node).rotation[:, 2]
        nearness, by = directions @ axis, np.zeros(len(directions), dtype=int)
        left = np.ones(len(directions), dtype=bool)
        for _ in directions:
            at = int(np.argmax(np.where(left, nearness, -np.inf)))
            left[at] = False
            rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), directions[at]).matrix()
            target = local.tasks[0].target = pin.SE3(rotation, point)
            if any(local.solve(start, GOAL) for start in (known[by[at]], *self.starts(target))):
                known.append(local.best)
                nearer = directions @ directions[at]
                by[nearer > nearness] = len(known) - 1
                nearness = np.maximum(nearness, nearer)
        return float(4.0 * np.pi * (len(known) - 1) / len(directions))


class _Wavefront:
    """Goes through the cells of a chunk."""

    def __init__(
        self, of: ByPose, points: Array, rotations: Array, near: list[list[int]], dead_ends: Collection[int]
    ) -> None:
        self.of, self.near = of, near
        self._points, self._rotations = points, rotations
        self._dead_ends = dead_ends  # cells from which no others are solved
        self.sources: set[int] = set()  # cells from which others were solved
        self.q = np.full((len(points), of.mechanism.model.nq), np.nan)
        self.status = np.full(len(points), _NOT_EVALUATED, dtype=np.uint8)
        self._other_branch: dict[int, Array] = {}  # configurations on another branch than the neighbour's

    def target(self, cell: int) -> pin.SE3:
        return pin.SE3(self._rotations[cell if len(self._rotations) > 1 else 0], self._points[cell])

    def run(self) -> None:
        """Evaluate all cells."""
        of, status, points = self.of, self.status, self._points
        status[of.bounds.exclude(points, self._rotations)] = _PROVED
        left = np.flatnonzero(status == _NOT_EVALUATED)
        if len(left) == 0:
            return
        first = int(left[np.argmin(((points[left] - of.spec.home.translation) ** 2).sum(axis=1))])
        self._begin(first, of.from_home(self.target(first)))
        for cell in left.tolist():
            if status[cell] != _NOT_EVALUATED:
                continue
            solution = self._other_branch.get(cell)
            if solution is None:
                target = self.target(cell)
                tries = (of.solve(target, start) for start in of.starts(target))
                solution = next((q for q in tries if q is not None), None)
            if solution is None:
                status[cell] = _NOT_FOUND
            self._begin(cell, solution)
        for cell in sorted(self._other_branch):
            if status[cell] == _NOT_FOUND:  # it was searched in vain before
                self._begin(cell, self._other_branch[cell])

    def _begin(self, cell: int, q: Array | None) -> None:
        """Start at a cell, unless it has no configuration."""
        if q is None:
            return
        self.q[cell], self.status[cell] = q, _BY_SEARCH
        if cell not in self._dead_ends:
            flood([cell], self.near, self._reach)

    def _reach(self, cell: int, near: int) -> bool:
        if self.status[near] not in (_NOT_EVALUATED, _NOT_FOUND):
            return False
        q = self.of.solve(self.target(near), self.q[cell])
        if q is None:
            return False
        if self.of.mechanism.distance(self.q[cell], q) > JUMP:
            self._other_branch.setdefault(near, q)
            return False
        self.q[near], self.status[near] = q, _REACHABLE
        self.sources.add(cell)
        return near not in self._dead_ends


class _Solutions:
    """All solutions of a chunk's cells that differ in their actuated joints.

    Passive joints may have several values for the same actuated joints (a universal joint has two, and the rod between
    stays where it is): that is one solution. Where joints have limits, each is followed all the same, because one may
    be stopped where the other goes on.
    """

    def __init__(self, front: _Wavefront) -> None:
        self._front, self._of = front, front.of
        mechanism = self._of.mechanism
        self._actuated = np.array([mechanism.v_index(name) for name in mechanism.actuated], dtype=np.intp)
        self._compared = np.arange(mechanism.model.nv) if self._of.spec.limits else self._actuated
        self._known = [np.zeros((0, mechanism.model.nv)) for _ in front.q]  # marks of each cell's solutions
        self._waiting: deque[tuple[int, int, Array]] = deque()

    def count(self) -> NDArray[np.int32]:
        """Return the number (n,) of solutions of each cell. Every one that is found is continued like the first."""
        front, of = self._front, self._of
        reached = np.flatnonzero(np.isfinite(front.q[:, 0])).tolist()
        rng = np.random.default_rng(_SEED)
        tries = max(1, _TRIES // max(1, len(reached)))
        for cell in reached:
            self._note(cell, front.q[cell])
        for cell in reached:
            target = front.target(cell)
            for start in (*of.starts(target), *(of.local.random_start(rng) for _ in range(tries))):
                self._note(cell, of.solve(target, start))
        while self._waiting:
            current, number, q = self._waiting.popleft()
            solutions = self._known[current]
            others = of.apart(solutions[number], np.delete(solutions, number, axis=0), self._compared)
            sure = _SURE * others.min(initial=JUMP)
            for near in front.near[current]:
                if near < 0 or not len(self._known[near]):
                    continue
                if of.apart(solutions[number], self._known[near], self._compared).min() > sure:
                    self._note(near, of.solve(front.target(near), q))
        return np.array([self._distinct(known) for known in self._known], dtype=np.int32)

    def _note(self, cell: int, q: Array | None) -> None:
        if q is None:
            return
        marks, known = self._of.marks(q), self._known[cell]
        if self._of.apart(marks, known, self._compared).min(initial=np.inf) > _SAME:
            self._waiting.append((cell, len(known), q))
            self._known[cell] = np.vstack([known, marks])

    def _distinct(self, known: Array) -> int:
        """Return how many of these differ in their actuated joints."""
        kept = known[:0]
        for marks in known:
            if self._of.apart(marks, kept, self._actuated).min(initial=np.inf) > _SAME:
                kept = np.vstack([kept, marks])
        return len(kept)


def fibonacci_sphere(count: int) -> Array:
    """Return evenly distributed directions (count, 3) (R. Swinbank and R. J. Purser, "Fibonacci grids", 2006)."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - z**2)
    return np.column_stack([flat * np.cos(angle), flat * np.sin(angle), z])
