"""`Clearance`: distances of a mechanism's links from obstacles and from each other, at a configuration and along a
motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numba import types
from numpy.typing import NDArray

from cinegen.collision._kernels.memory import ClearanceMemory
from cinegen.collision._kernels.near import approach
from cinegen.collision._kernels.sweep import sweep
from cinegen.collision.body import Body, geometry_model
from cinegen.collision.errors import PlanningError
from cinegen.collision.links import link_bodies
from cinegen.collision.obstacle import Obstacle
from cinegen.collision.scene import Scene
from cinegen.collision.self_collision import collision_pairs
from cinegen.jit.compiled import prepare
from cinegen.jit.foreign import DISTANCE, FIRST_POINT, NORMAL, SECOND_POINT, DistanceResults, JointKinematics
from cinegen.joints import kinematic_data, supporting_columns
from cinegen.model import Mechanism

Array = NDArray[np.float64]
Table = NDArray[np.int64]


class NearPairs(NamedTuple):
    """Short distances, and how joints shorten them. A pair has a row for its nearest points, and one for each other end
    of a capsule near the obstacle.

    Attributes:
        pairs: (m,) pair of each row.
        distances: (m,) m; for an end of a capsule, its distance from the plane that separates the two bodies.
        rows: (m, nv) rate at which joint velocities shorten the distance, m/s by rad/s and m/s.
    """

    pairs: Table
    distances: Array
    rows: Array


class Clearance:
    """Distances of a mechanism among obstacles. It has Pinocchio data of its own: one thread at a time.

    Args:
        mechanism: robot.
        links: bodies of its links.
        obstacles: obstacles in the world.
        pairs: pairs of links that may collide, indices into `links`.

    Attributes:
        mechanism: as given.
        links: as given.
        obstacles: as given; `move` changes only the poses for which distances are measured.
        bodies: links, then all pieces of obstacles.
        pairs: (pairs, 2) indices into `bodies`: pairs of links first, then each moving link with each piece.
        groups: (pairs,) index of the obstacle of each pair; beyond these, a number for each pair of joints whose links
            may collide.

    Raises:
        PlanningError: a moving link is a half-space.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        links: Sequence[Body],
        obstacles: Sequence[Obstacle] = (),
        pairs: Sequence[tuple[int, int]] = (),
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
        found = [(pair.first, pair.second) for pair in self._geometry.collisionPairs]
        self.pairs = np.array(found, dtype=np.int64).reshape(-1, 2)
        self.groups = _groups(self.pairs, self.links, self.obstacles)
        self.results = DistanceResults(self._geometry.createData())
        self._kinematics = JointKinematics(self._data)
        ends, radii = _capsule_ends(self.bodies)
        most = len(found) + 2 * int((radii[self.pairs] >= 0.0).sum())  # rows, if all pairs are near
        memory = self.memory = ClearanceMemory(
            nv=model.nv, joints=model.njoints, bodies=len(self.bodies), pairs=len(found), most=most
        )
        memory.pair[:], memory.joint[:] = self.pairs, [body.joint for body in self.bodies]
        memory.ends[:], memory.radius[:] = ends, radii
        memory.ball[:] = np.reshape([[*body.centre, body.radius] for body in self.bodies], (-1, 4))
        memory.moved_by[:] = [supporting_columns(model, joint) for joint in range(model.njoints)]
        memory.point_at("results", self.results.table)
        memory.point_at("frames", self._kinematics.frames)
        memory.point_at("screws", self._kinematics.screws)
        self.joints, self.moved_by = memory.joint, memory.moved_by
        self._approach, self._sweep = prepare_clearance()
        self._at: Array | None = None

    # --- distances -----------------------------------------------------------------------------------------------

    def move(self, obstacle: int, placement: pin.SE3) -> None:
        """Move an obstacle, by its index, to another pose in the world."""
        first = len(self.links) + sum(len(one.pieces) for one in self.obstacles[:obstacle])
        for i, piece in enumerate(self.obstacles[obstacle].pieces, first):
            self._geometry.geometryObjects[i].placement = placement * piece.placement
        self._at = None

    def update(self, q: Array) -> None:
        """Measure all distances at q (nq,)."""
        if self._at is not None and np.array_equal(self._at, q):
            return
        if self._model.nv:
            pin.computeJointJacobians(self._model, self._data, q)
        if len(self.pairs):
            pin.updateGeometryPlacements(self._model, self._data, self._geometry, self.results.shapes)
            pin.computeDistances(self._geometry, self.results.shapes)
            self.results.read()
            self.memory.point_at("results", self.results.table)
        self._kinematics.read()
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

    def names(self, pair: int) -> tuple[str, str]:
        """Return the names of the two bodies of a pair."""
        first, second = self.pairs[pair]
        return self.bodies[first].name, self.bodies[second].name

    @property
    def jacobian(self) -> Array:
        """(6, nv) Jacobian of all joints in the world, at the last update: velocities at the origin, then angular."""
        return np.asarray(self._data.J)

    # --- motion --------------------------------------------------------------------------------------------------

    def near(self, q: Array, within: float) -> NearPairs:
        """Return the pairs whose distance at q (nq,) is below `within`, m. Views: the next call overwrites them."""
        self.update(q)
        memory, count = self.memory, 0
        if len(self.pairs) and self._model.nv:
            count = self._approach(memory.handle, within)
        return NearPairs(memory.which[:count], memory.room[:count], memory.rows[:count])

    def motion_bounds(self, q: Array, end: Array) -> tuple[Array, Array]:
        """Return the distances (pairs,) at q (nq,), and bounds (pairs,) of their change anywhere on the straight motion
        to another configuration (nq,), m. Views: the next call overwrites them."""
        self.update(q)
        self.memory.motion[:] = pin.difference(self._model, q, end)
        if len(self.pairs) and self._model.nv:
            self._sweep(self.memory.handle)
        return self.memory.before, self.memory.bounds


def clearance_of(scene: Scene) -> Clearance:
    """Return the clearance of a scene's robot among its obstacles, without the pairs that the scene allows to
    collide."""
    links, pairs = scene.mechanism.derived(links_of) if scene.bodies is None else (scene.bodies, ())
    return Clearance(scene.mechanism, links, scene.obstacles, scene.checked_pairs(links, pairs))


def links_of(mechanism: Mechanism) -> tuple[tuple[Body, ...], tuple[tuple[int, int], ...]]:
    """Return a mechanism's bodies, and the pairs of them that may collide."""
    bodies = link_bodies(mechanism)
    return bodies, collision_pairs(mechanism, bodies)


def _groups(pairs: Table, links: Sequence[Body], obstacles: Sequence[Obstacle]) -> Table:
    """Return `Clearance.groups`."""
    joints = np.array([link.joint for link in links], dtype=np.int64)
    owner = np.array([i for i, obstacle in enumerate(obstacles) for _ in obstacle.pieces], dtype=np.int64)
    own, found = pairs[:, 1] < len(links), np.zeros(len(pairs), dtype=np.int64)
    found[~own] = owner[pairs[~own, 1] - len(links)]
    found[own] = len(obstacles) + np.unique(joints[pairs[own]], axis=0, return_inverse=True)[1].ravel()
    return found


def _capsule_ends(bodies: Sequence[Body]) -> tuple[Array, Array]:
    """Return the centres of both ends (bodies, 2, 3) of moving capsules, in the frames of their joints, and the radii
    (bodies,), -1 for other bodies."""
    ends, radii = np.zeros((len(bodies), 2, 3)), np.full(len(bodies), -1.0)
    for i, body in enumerate(bodies):
        if body.joint and isinstance(body.shape, coal.Capsule):
            half = body.shape.halfLength * body.placement.rotation[:, 2]
            ends[i] = body.placement.translation - half, body.placement.translation + half
            radii[i] = body.shape.radius
    return ends, radii


def prepare_clearance() -> tuple[Callable[..., Any], ...]:
    """Compile the kernels, or load them from disk."""
    return prepare(approach, ClearanceMemory, types.float64), prepare(sweep, ClearanceMemory)
