"""`Clearance`: distances of a mechanism's links from obstacles and from each other, at a configuration and along a
motion."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision._kernels.near import DISTANCE, FIRST_POINT, NORMAL, RESULT_WIDTH, SECOND_POINT, approach
from cinegen.collision._kernels.sweep import sweep
from cinegen.collision.body import Body, geometry_model
from cinegen.collision.errors import PlanningError
from cinegen.collision.links import link_bodies
from cinegen.collision.obstacle import Obstacle
from cinegen.collision.scene import Scene
from cinegen.collision.self_collision import collision_pairs
from cinegen.jit.compiled import TABLE, prepare
from cinegen.joints import supporting_columns
from cinegen.loops._kernels.memory import address, placements_address
from cinegen.model import Mechanism

Array = NDArray[np.float64]
Table = NDArray[np.int64]

_KEPT = 8  # mechanisms


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
        self._data = model.createData()
        self._geometry = geometry_model(mechanism, links, pieces, pairs)
        found = [(pair.first, pair.second) for pair in self._geometry.collisionPairs]
        self.pairs = np.array(found, dtype=np.int64).reshape(-1, 2)
        self.groups = _groups(self.pairs, self.links, self.obstacles)
        self._shapes = self._geometry.createData()
        self.results = DistanceResults(self._shapes, len(found))
        self.flat_pairs = self.pairs.ravel().copy()
        self.joints = np.array([body.joint for body in self.bodies], dtype=np.int64)
        self.moved_by = np.array([supporting_columns(model, j) for j in range(model.njoints)])
        self._balls = np.array([[*body.centre, body.radius] for body in self.bodies]).reshape(-1, 4)
        self._ends, self._radii = _capsule_ends(self.bodies)
        self._placements = placements_address(self._data) if model.njoints > 1 else 0
        most = len(found) + 2 * int((self._radii[self.pairs] >= 0.0).sum())  # rows, if all pairs are near
        self._which, self._room = np.zeros(most, dtype=np.int64), np.zeros(most)
        self._rows, self._scratch = np.zeros((most, model.nv)), np.zeros((2, 3))
        self._before, self._bounds = np.zeros(len(found)), np.zeros(len(found))
        self._at: Array | None = None
        prepare_clearance()

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
            pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._shapes)
            pin.computeDistances(self._geometry, self._shapes)
            self.results.read()
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
        count = 0
        if len(self.pairs) and self._model.nv:
            count = approach(
                self.results.address, self.flat_pairs, self.joints, self._ends, self._radii, self.moved_by,
                self._placements, address(self._data.J), within, self._which, self._room, self._rows, self._scratch,
            )  # fmt: skip
        return NearPairs(self._which[:count], self._room[:count], self._rows[:count])

    def motion_bounds(self, q: Array, end: Array) -> tuple[Array, Array]:
        """Return the distances (pairs,) at q (nq,), and bounds (pairs,) of their change anywhere on the straight motion
        to another configuration (nq,), m. Views: the next call overwrites them."""
        self.update(q)
        motion = np.ascontiguousarray(self.mechanism.difference(q, end))
        if len(self.pairs) and self._model.nv:
            sweep(
                self.results.address, self.flat_pairs, self.joints, self._balls, self.moved_by, self._placements,
                address(self._data.J), motion, self._before, self._bounds, self._scratch,
            )  # fmt: skip
        return self._before, self._bounds


def clearance_of(scene: Scene) -> Clearance:
    """Return the clearance of a scene's robot among its obstacles, without the pairs that the scene allows to
    collide."""
    links, pairs = links_of(scene.mechanism) if scene.bodies is None else (scene.bodies, ())
    return Clearance(scene.mechanism, links, scene.obstacles, scene.checked_pairs(links, pairs))


@lru_cache(maxsize=_KEPT)
def links_of(mechanism: Mechanism) -> tuple[tuple[Body, ...], tuple[tuple[int, int], ...]]:
    """Return a mechanism's bodies, and the pairs of them that may collide; kept, because they take a while."""
    bodies = link_bodies(mechanism)
    return bodies, collision_pairs(mechanism, bodies)


def _groups(pairs: Table, links: Sequence[Body], obstacles: Sequence[Obstacle]) -> Table:
    """Return `Clearance.groups`."""
    owner = [i for i, obstacle in enumerate(obstacles) for _ in obstacle.pieces]
    met = dict[tuple[int, int], int]()
    found = []
    for first, second in pairs.tolist():
        if second >= len(links):
            found.append(owner[second - len(links)])
        else:
            joints = links[first].joint, links[second].joint
            found.append(met.setdefault(joints, len(obstacles) + len(met)))
    return np.array(found, dtype=np.int64)


class DistanceResults:
    """Coal's results as one array, which reads them in place where this build of coal stores them as expected.

    Attributes:
        table: (pairs, `RESULT_WIDTH`) results.
        address: address of the table.
    """

    def __init__(self, shapes: pin.GeometryData, count: int) -> None:
        self._shapes, self._in_place = shapes, False
        self.table = np.zeros((count, RESULT_WIDTH))
        self.address = address(self.table)
        if count:
            begin = [address(shapes.distanceResults[i].normal) - 8 * NORMAL for i in range(count)]
            if begin == list(range(begin[0], begin[0] + 8 * RESULT_WIDTH * count, 8 * RESULT_WIDTH)):
                numbers = ctypes.cast(begin[0], ctypes.POINTER(ctypes.c_double))
                self.table = np.ctypeslib.as_array(numbers, (count, RESULT_WIDTH))
                self._in_place, self.address = True, begin[0]

    def read(self) -> None:
        """Copy the results, unless they are read in place."""
        if self._in_place:
            return
        for i, row in enumerate(self.table):
            one = self._shapes.distanceResults[i]
            row[DISTANCE], row[NORMAL : NORMAL + 3] = one.min_distance, one.normal
            row[FIRST_POINT : FIRST_POINT + 3] = one.getNearestPoint1()
            row[SECOND_POINT : SECOND_POINT + 3] = one.getNearestPoint2()


def _capsule_ends(bodies: Sequence[Body]) -> tuple[Array, Array]:
    """Return the centres of both ends (bodies, 6) of moving capsules, in the frames of their joints, and the radii
    (bodies,), -1 for other bodies."""
    ends, radii = np.zeros((len(bodies), 6)), np.full(len(bodies), -1.0)
    for i, body in enumerate(bodies):
        if body.joint and isinstance(body.shape, coal.Capsule):
            half = body.shape.halfLength * body.placement.rotation[:, 2]
            ends[i] = np.concatenate([body.placement.translation - half, body.placement.translation + half])
            radii[i] = body.shape.radius
    return ends, radii


def prepare_clearance() -> None:
    """Compile the kernels, or load them from disk."""
    from numba import types

    vector, matrix = types.float64[::1], types.float64[:, ::1]
    prepare(
        approach, types.int64, TABLE, TABLE, matrix, vector, matrix, types.int64, types.int64, types.float64, TABLE,
        vector, matrix, matrix,
    )  # fmt: skip
    prepare(sweep, types.int64, TABLE, TABLE, matrix, matrix, types.int64, types.int64, vector, vector, vector, matrix)
