"""`Clearance`: distances of a mechanism's links from obstacles and from each other, at a configuration and along a
motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numba import types

from cinegen.arrays import Array, Integers
from cinegen.collision._kernels.memory import ClearanceMemory
from cinegen.collision._kernels.near import approach
from cinegen.collision._kernels.sweep import advance, remember, separate, sweep
from cinegen.collision.body import Body, geometry_model
from cinegen.collision.errors import PlanningError
from cinegen.collision.obstacle import Obstacle
from cinegen.collision.refined_distances import UP_TO, ExactDistances
from cinegen.collision.scene import Scene
from cinegen.collision.self_collision import PairReason, link_pairs
from cinegen.collision.shapes import bounding_box_corners, rounded_hull
from cinegen.jit.compiled import prepare
from cinegen.jit.foreign import (
    DISTANCE,
    FIRST_POINT,
    NORMAL,
    RESULT_WIDTH,
    SECOND_POINT,
    DistanceResults,
    JointKinematics,
)
from cinegen.jit.one_thread import OneThread, in_one_thread
from cinegen.joints import kinematic_data, supporting_columns
from cinegen.model import Mechanism

EXACT_WITHIN = 0.02
"""Of the characteristic length: default of `Clearance.exact_within`."""

_FURTHER = 1.5  # times the distance asked about is measured, so that the next motion need not be
_LEAST = 1e-300  # m: bodies that are less apart than this touch


class NearPairs(NamedTuple):
    """Short distances, and how joints shorten them. A pair has a row for its nearest points, and one for each other end
    of a capsule near the obstacle.

    Attributes:
        pairs: (m,) pair of each row.
        distances: (m,) m; for an end of a capsule, its distance from the plane that separates the two bodies.
        rows: (m, nv) rate at which joint velocities shorten the distance, m/s by rad/s and m/s.
    """

    pairs: Integers
    distances: Array
    rows: Array


class Clearance(OneThread):
    """Distances of a mechanism among obstacles. It has Pinocchio data of its own: one thread at a time.

    Distances are those of the convex bodies; where these are nearer to each other than `exact_within`, those of the
    exact shapes that they contain, up to a few times as far. So no distance is overestimated, and those below
    `exact_within` are exact: to 3e-6 m between shapes that coal iterates (hulls, boxes), to 1e-9 m between meshes and
    between capsules (tests/collision/test_exact_distances.py). Longer ones are too short by the excess of both convex
    bodies at most, which `cinegen info --collision` lists as measured. Where meshes overlap, the distance is the
    negative penetration depth of the convex bodies, which is at least as deep.

    Args:
        mechanism: robot.
        links: bodies of its links.
        obstacles: obstacles in the world.
        pairs: pairs of links that may collide, indices into `links`.
        exact_within: distance (with offset) of convex bodies below which exact shapes are measured, m; above any safety
            distance. By default 0.02 characteristic lengths.
        self_offset: difference between the clearances from obstacles and between links, m. It is added to distances
            between links that do not touch, so that a single safety distance applies to all pairs.

    Attributes:
        mechanism: as given.
        links: as given.
        obstacles: as given; `move` changes only the poses for which distances are measured.
        bodies: links, then all pieces of obstacles.
        pairs: (pairs, 2) indices into `bodies`: pairs of links first, then each moving link with each piece.
        groups: (pairs,) index of the obstacle of each pair; beyond these, a number for each pair of joints whose links
            may collide.
        every_pair: (pairs,) indices of all pairs.

    Raises:
        PlanningError: a moving link is a half-space.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        links: Sequence[Body],
        obstacles: Sequence[Obstacle] = (),
        pairs: Sequence[tuple[int, int]] = (),
        exact_within: float | None = None,
        self_offset: float = 0.0,
    ) -> None:
        self.mechanism, self.links, self.obstacles = mechanism, tuple(links), tuple(obstacles)
        pieces = [piece for obstacle in obstacles for piece in obstacle.bodies]
        self.bodies = (*links, *pieces)
        for body in links:
            if body.joint != 0 and not np.isfinite(body.radius):
                raise PlanningError(f"'{body.name}' moves and is unbounded: a link can't be a half-space")
        model = self._model = mechanism.model
        self._data = kinematic_data(model)
        self._geometry = geometry_model(mechanism, links, pieces, pairs)
        checked = [(pair.first, pair.second) for pair in self._geometry.collisionPairs]
        self.pairs = np.array(checked, dtype=np.int64).reshape(-1, 2)
        self.groups = _groups(self.pairs, self.links, self.obstacles)
        self.results = DistanceResults(self._geometry.createData())
        self._exact = ExactDistances(self.bodies, self.pairs)
        self.exact_within = EXACT_WITHIN * mechanism.length if exact_within is None else exact_within
        self._offsets = np.where((self.pairs < len(self.links)).all(axis=1), self_offset, 0.0)
        self._within = np.maximum(self.exact_within - self._offsets, 0.0)
        self._kinematics = JointKinematics(self._data)
        ends, radii = _capsule_ends(self.bodies)
        most = len(checked) + 2 * int((radii[self.pairs] >= 0.0).sum())  # rows, if all pairs are near
        hulls = [_hull(body) for body in self.bodies]
        last = np.cumsum([0, *(len(corners) for corners, _ in hulls)])
        memory = self.memory = ClearanceMemory(
            nv=model.nv, columns=model.nv + 1, joints=model.njoints, bodies=len(self.bodies), pairs=len(checked),
            corners=int(last[-1]), most=most,
        )  # fmt: skip
        memory.corner[:] = np.vstack([np.zeros((0, 3)), *(corners for corners, _ in hulls)])
        memory.hull[:], memory.rounding[:] = np.column_stack([last[:-1], last[1:]]), [radius for _, radius in hulls]
        memory.pair[:], memory.joint[:] = self.pairs, [body.joint for body in self.bodies]
        memory.ends[:], memory.radius[:] = ends, radii
        memory.ball[:], memory.known[:] = [body.radius for body in self.bodies], -np.inf
        memory.box[:] = np.reshape([_bounding_box(body) for body in self.bodies], (-1, 5, 3))
        memory.moved_by[:] = [supporting_columns(model, joint) for joint in range(model.njoints)]
        memory.point_at("results", self.results.table)
        memory.point_at("frames", self._kinematics.frames)
        memory.point_at("screws", self._kinematics.screws)
        self.joints, self.moved_by = memory.joint, memory.moved_by
        kernels = prepare_clearance()
        self._approach, self._sweep, self._advance, self._remember, self._separate = kernels
        self.every_pair, self._still = np.arange(len(self.pairs)), np.zeros(model.nv)
        self._row, self._safety = np.zeros(RESULT_WIDTH), np.nan  # for which `needed` is
        self._placed: dict[int, pin.SE3] = {}  # exact shapes, at the present configuration
        self._at: Array | None = None

    # --- distances -----------------------------------------------------------------------------------------------

    @in_one_thread
    def move(self, obstacle: int, placement: pin.SE3) -> None:
        """Move an obstacle, by its index, to another pose in the world."""
        first = len(self.links) + sum(len(before.pieces) for before in self.obstacles[:obstacle])
        for i, piece in enumerate(self.obstacles[obstacle].pieces, first):
            moved = replace(piece, placement=placement * piece.placement)
            self._geometry.geometryObjects[i].placement = moved.placement
            self._exact.move(i, moved.as_described.placement)
            self.memory.box[i] = _bounding_box(moved)
        self._at = None

    @in_one_thread
    def update(self, q: Array) -> None:
        """Measure all distances at q (nq,)."""
        if self._at is not None and np.array_equal(self._at, q):
            return
        if self._model.nv:
            pin.computeJointJacobians(self._model, self._data, q)
        self._kinematics.read()
        if len(self.pairs):
            pin.updateGeometryPlacements(self._model, self._data, self._geometry, self.results.shapes)
            pin.computeDistances(self._geometry, self.results.shapes)
            self.results.read()
            table = self.results.table
            convex = table[:, DISTANCE].copy()
            self._exact.refine(table, self._within, self._data.oMi)
            self.memory.known[:] = table[:, DISTANCE]
            self.memory.point_at("results", table)
            self._remember(self.memory.handle)
            table[:, DISTANCE] += np.where(table[:, DISTANCE] > 0.0, self._offsets, 0.0)
            self.memory.excess[:] = table[:, DISTANCE] - convex
        self._at = q.copy()

    def distances(self, q: Array) -> Array:
        """Return the distances (pairs,) at q (nq,), m; negative penetration depths."""
        self.update(q)
        return self.results.table[:, DISTANCE].copy()

    def least(self, q: Array) -> float:
        """Return the shortest distance at q (nq,), m; infinite without pairs."""
        self.update(q)
        return float(self.results.table[:, DISTANCE].min(initial=np.inf))

    def nearest_points(self, pair: int) -> tuple[Array, Array, Array]:
        """Return the nearest points (3,) of a pair on the first and the second body, and the unit normal (3,) from the
        first to the second, in the world, at the last update."""
        row = self.results.table[pair]
        first, second = row[FIRST_POINT : FIRST_POINT + 3], row[SECOND_POINT : SECOND_POINT + 3]
        return first.copy(), second.copy(), row[NORMAL : NORMAL + 3].copy()

    def offset(self, pair: int) -> float:
        """Return how much is added to the distance of a pair that does not touch, m."""
        return float(self._offsets[pair])

    def placement(self, body: int) -> pin.SE3:
        """Return the pose of a body's shape in the world, by its index in `bodies`, at the last update."""
        return self.results.shapes.oMg[body]

    def joint_pose(self, joint: int) -> pin.SE3:
        """Return the pose of a joint in the world, by Pinocchio's index, at the last update."""
        return self._data.oMi[joint]

    def names(self, pair: int) -> tuple[str, str]:
        """Return the names of the two bodies of a pair."""
        first, second = self.pairs[pair]
        return self.bodies[first].name, self.bodies[second].name

    @property
    def jacobian(self) -> Array:
        """(6, nv) Jacobian of all joints in the world, at the last update: velocities at the origin, then angular."""
        return np.asarray(self._data.J)

    # --- motion --------------------------------------------------------------------------------------------------

    @in_one_thread
    def near(self, q: Array, within: float) -> NearPairs:
        """Return the pairs whose distance at q (nq,) is below `within`, m. Views: the next call overwrites them."""
        self.update(q)
        memory, count = self.memory, 0
        if len(self.pairs) and self._model.nv:
            count = self._approach(memory.handle, within)
        return NearPairs(memory.which[:count], memory.room[:count], memory.rows[:count])

    @in_one_thread
    def motion_bounds(self, q: Array, end: Array) -> tuple[Array, Array]:
        """Return the distances (pairs,) at q (nq,), and bounds (pairs,) of their change anywhere on the straight motion
        to another configuration (nq,), m. Views: the next call overwrites them."""
        self.update(q)
        self.memory.motion[:] = pin.difference(self._model, q, end)
        if len(self.pairs) and self._model.nv:
            self._sweep(self.memory.handle)
        return self.memory.before, self.memory.bounds

    @in_one_thread
    def uncertain(
        self, q: Array, motion: Array, safety: float, pairs: Integers, straight: Array | None = None
    ) -> Integers | None:
        """Return the pairs that may come nearer than a distance on a motion about a configuration.

        Distances are measured only where neither bounding volumes decide, nor the last distance that was measured, less
        the displacement since then, nor the plane that separated the convex bodies then.

        Args:
            q: (nq,) configuration.
            motion: (nv,) by how much each joint moves at most from q, rad and m.
            safety: the distance, m.
            pairs: pairs that are tested, such as `every_pair`.
            straight: (nv,) if the motion is straight, the half of it from q to its end; or as much of it: each joint
                moves by the remainder of `motion` at most from there. Fewer pairs are uncertain then.

        Returns:
            pairs that were not shown to keep the distance on the motion; None if one of them is nearer at q.
        """
        if not len(pairs):
            return pairs
        uncertain = []
        for pair in self._undecided(q, motion, safety, pairs, straight):
            distance, is_kept = self._measure(pair)
            if distance < self.memory.needed[pair]:
                return None
            if not is_kept:
                uncertain.append(pair)
        return np.array(uncertain, dtype=np.int64)

    @in_one_thread
    def nearer(self, q: Array, distance: float) -> Integers:
        """Return the pairs (n,) whose distance at q (nq,) is below a distance, m: faster than `distances`."""
        if not len(self.pairs):
            return self.every_pair
        left = self._undecided(q, self._still, distance, self.every_pair)
        return np.array([pair for pair in left if self._measure(pair)[0] < self.memory.needed[pair]], dtype=np.int64)

    def _undecided(
        self, q: Array, motion: Array, safety: float, pairs: Integers, straight: Array | None = None
    ) -> list[int]:
        """Return the pairs that are decided by measuring only, those that may be nearest first; see `uncertain`."""
        pin.computeJointJacobians(self._model, self._data, q)
        self._kinematics.read()
        self._at, memory = None, self.memory
        memory.motion[:], memory.asked[: len(pairs)] = motion, pairs
        memory.straight[:] = 0.0 if straight is None else straight
        if safety != self._safety:
            memory.needed[:], self._safety = np.maximum(safety - self._offsets, min(safety, _LEAST)), safety
        left = memory.asked[: self._advance(memory.handle, len(pairs))]
        if len(left):
            pin.updateGeometryPlacements(self._model, self._data, self._geometry, self.results.shapes)
            self._placed.clear()
        return [int(pair) for pair in left[memory.lower[left].argsort()]]

    def _measure(self, pair: int) -> tuple[float, bool]:
        """Measure a pair that `_undecided` left; return its distance without offset, m, and whether it keeps the one
        asked about."""
        memory, row = self.memory, self._row
        needed, change = memory.needed[pair], memory.bounds[pair]
        result = pin.computeDistance(self._geometry, self.results.shapes, pair)
        memory.known[pair] = row[DISTANCE] = result.min_distance
        memory.normal[pair] = result.normal
        if self._separate(memory.handle, pair) >= needed or row[DISTANCE] - change >= needed:
            return max(float(row[DISTANCE]), float(needed)), True
        if row[DISTANCE] < self._within[pair]:  # a query is the shorter, the smaller the distance that matters
            within = float(self._within[pair])
            up_to = min(max(_FURTHER * float(needed + change), within), UP_TO * within)
            self._exact.refine_pair(pair, row, up_to, self._data.oMi, self._placed)
        memory.known[pair] = row[DISTANCE]
        return float(row[DISTANCE]), bool(row[DISTANCE] - change >= needed)


def clearance_of(scene: Scene, is_exact: bool = False) -> Clearance:
    """Return the clearance of a scene's robot among its obstacles, without the pairs that the scene allows to collide.

    Args:
        scene: scene.
        is_exact: whether exact shapes are measured at all distances, without an offset between links, for maps and
            reports. Otherwise the offset is `safety` - `self_clearance`: for motion.
    """
    mechanism = scene.mechanism
    links, pairs = links_of(mechanism) if scene.bodies is None else (scene.bodies, ())
    bodies, checked = scene.with_attached(links, scene.checked_pairs(links, pairs))
    within = 1.5 * scene.safety + 2e-3 * mechanism.length  # above the distances at which motions stop
    return Clearance(
        mechanism,
        bodies,
        scene.obstacles,
        checked,
        np.inf if is_exact else within,
        0.0 if is_exact else scene.safety - scene.self_clearance,
    )


def links_of(mechanism: Mechanism) -> tuple[tuple[Body, ...], tuple[tuple[int, int], ...]]:
    """Return a mechanism's bodies, and the pairs of them that may collide."""
    links = mechanism.structure.derived(link_pairs)
    return links.bodies, links.of(PairReason.CHECKED)


def _groups(pairs: Integers, links: Sequence[Body], obstacles: Sequence[Obstacle]) -> Integers:
    """Return `Clearance.groups`."""
    joints = np.array([link.joint for link in links], dtype=np.int64)
    owner = np.array([i for i, obstacle in enumerate(obstacles) for _ in obstacle.pieces], dtype=np.int64)
    of_links, groups = pairs[:, 1] < len(links), np.zeros(len(pairs), dtype=np.int64)
    groups[~of_links] = owner[pairs[~of_links, 1] - len(links)]
    groups[of_links] = len(obstacles) + np.unique(joints[pairs[of_links]], axis=0, return_inverse=True)[1].ravel()
    return groups


def _capsule_ends(bodies: Sequence[Body]) -> tuple[Array, Array]:
    """Return the centres of both ends (bodies, 2, 3) of moving capsules, in the frames of their joints, and the radii
    (bodies,), -1 for other bodies."""
    ends, radii = np.zeros((len(bodies), 2, 3)), np.full(len(bodies), -1.0)
    for i, body in enumerate(bodies):
        points, radius = rounded_hull(body.shape) if body.joint else (ends[i], -1.0)
        if len(points) == 2 and radius > 0.0:
            ends[i] = points @ body.placement.rotation.T + body.placement.translation
            radii[i] = radius
    return ends, radii


def _bounding_box(body: Body) -> Array:
    """Return the bounding box (5, 3) of a body in the frame of its joint: three axes, the centre, which is that of the
    bounding ball, and half of the size along them, m; infinite for a half-space."""
    axes = body.placement.rotation.T
    if not np.isfinite(body.radius):
        return np.vstack([axes, body.centre, np.full(3, np.inf)])
    offsets = bounding_box_corners(body.shape) - body.placement.actInv(body.centre)
    return np.vstack([axes, body.centre, np.abs(offsets).max(axis=0)])


def _hull(body: Body) -> tuple[Array, float]:
    """Return corners (n, 3) in the bounding box of a body and a radius, m: their hull, grown by the radius, contains
    the body; no corners for a half-space."""
    if not np.isfinite(body.radius):
        return np.zeros((0, 3)), 0.0
    corners, radius = rounded_hull(body.shape)
    return corners - body.placement.actInv(body.centre), radius


def prepare_clearance() -> tuple[Callable[..., Any], ...]:
    """Compile the kernels, or load them from disk."""
    return (
        prepare(approach, ClearanceMemory, types.float64),
        prepare(sweep, ClearanceMemory),
        prepare(advance, ClearanceMemory, types.int64),
        prepare(remember, ClearanceMemory),
        prepare(separate, ClearanceMemory, types.int64),
    )
