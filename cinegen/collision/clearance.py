"""`Clearance`: how far a mechanism's links are from obstacles and from each other, here and all along a motion."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision._kernels.near import DISTANCE, FIRST_POINT, NORMAL, RESULT_WIDTH, SECOND_POINT, approach
from cinegen.collision._kernels.sweep import sweep
from cinegen.collision._kernels.turn import turn
from cinegen.collision.bodies import geometry_model
from cinegen.collision.body import Body
from cinegen.collision.errors import AvoidError
from cinegen.ik.resolve import free_motions
from cinegen.jit.compiled import TABLE, prepare
from cinegen.joints import supporting_columns
from cinegen.loops._kernels.memory import address, placements_address
from cinegen.model import Mechanism

Array = NDArray[np.float64]
Table = NDArray[np.int64]


class Nearness(NamedTuple):
    """Distances that are short, and how joints shorten them. A pair has a row for its nearest points, then one for each
    other end of a link that lies along what is near.

    Attributes:
        pairs: (m,) the pair that each row is of.
        distances: (m,) m; of an end, from the plane that parts the two.
        rows: (m, nv) m/s by rad/s and m/s: the speed at which velocities shorten the distance.
    """

    pairs: Table
    distances: Array
    rows: Array


class Clearance:
    """Of a mechanism among obstacles. Has Pinocchio's data of its own; one thread at a time.

    Args:
        mechanism: whose links these are.
        bodies: of its links.
        obstacles: bodies of the world.
        own: pairs of numbers of bodies: links that may meet each other.

    Attributes:
        mechanism: as given.
        bodies: of links, then of obstacles.
        pairs: (pairs, 2) numbers of bodies: links first, each link that moves with each obstacle.

    Raises:
        AvoidError: a link that moves is a half-space.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        bodies: Sequence[Body],
        obstacles: Sequence[Body],
        own: Sequence[tuple[int, int]] = (),
    ) -> None:
        self.mechanism = mechanism
        self.bodies = (*bodies, *obstacles)
        for body in bodies:
            if body.joint != 0 and not np.isfinite(body.radius):
                raise AvoidError(f"'{body.name}' moves, and reaches without end: a link can't be a half-space")
        model = self._model = mechanism.model
        self._data = model.createData()
        self._geometry = geometry_model(mechanism, bodies, obstacles, own)
        found = [(pair.first, pair.second) for pair in self._geometry.collisionPairs]
        self.pairs = np.array(found, dtype=np.int64).reshape(-1, 2)
        self._solids = self._geometry.createData()
        self._results = _Results(self._solids, len(found))
        self._flat = self.pairs.ravel().copy()
        self._joints = np.array([body.joint for body in self.bodies], dtype=np.int64)
        self._moves = np.array([supporting_columns(model, j) for j in range(model.njoints)])
        self._balls = np.array([[*body.centre, body.radius] for body in self.bodies]).reshape(-1, 4)
        self._ends, self._radii = _ends(self.bodies)
        self._placements = placements_address(self._data) if model.njoints > 1 else 0
        most = len(found) + 2 * int((self._radii[self.pairs] >= 0.0).sum())  # rows, if all are near
        self._which, self._room = np.zeros(most, dtype=np.int64), np.zeros(most)
        self._rows, self._scratch = np.zeros((most, model.nv)), np.zeros((2, 3))
        self._square, self._by = np.zeros((3, 3)), np.zeros((3, model.nv))
        self._scale, self._all_free = np.ascontiguousarray(mechanism.scale), np.zeros((0, model.nv))
        self._before, self._ways = np.zeros(len(found)), np.zeros(len(found))
        self._at: Array | None = None
        prepare_clearance()

    # --- where things are ----------------------------------------------------------------------------------------

    def move(self, body: int, placement: pin.SE3) -> None:
        """Puts a body of the world elsewhere.

        Args:
            body: its number.
            placement: of its shape in the world.
        """
        self._geometry.geometryObjects[body].placement = placement
        self._at = None

    def see(self, q: Array) -> None:
        """Looks at all distances at q (nq,)."""
        if self._at is not None and np.array_equal(self._at, q):
            return
        if self._model.nv:
            pin.computeJointJacobians(self._model, self._data, q)
        if len(self.pairs):
            pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._solids)
            pin.computeDistances(self._geometry, self._solids)
            self._results.read()
        self._at = q.copy()

    def distances(self, q: Array) -> Array:
        """(pairs,) m; below 0 how deep two bodies are in each other."""
        self.see(q)
        return self._results.table[:, DISTANCE].copy()

    def least(self, q: Array) -> float:
        """The shortest distance at q (nq,), m; infinite where there is nothing to meet."""
        self.see(q)
        return float(self._results.table[:, DISTANCE].min(initial=np.inf))

    def points(self, pair: int) -> tuple[Array, Array, Array]:
        """Of a pair, where it was last looked at: the nearest points (3,) on the first and on the second body, and the
        normal (3,) from the first to the second, in the world."""
        row = self._results.table[pair]
        one, other = row[FIRST_POINT : FIRST_POINT + 3], row[SECOND_POINT : SECOND_POINT + 3]
        return one.copy(), other.copy(), row[NORMAL : NORMAL + 3].copy()

    def names(self, pair: int) -> tuple[str, str]:
        """Of the two bodies."""
        first, second = self.pairs[pair]
        return self.bodies[first].name, self.bodies[second].name

    @property
    def jacobian(self) -> Array:
        """(6, nv) of all joints, in the world, where it was last looked at: velocities at the origin, then angular."""
        return np.asarray(self._data.J)

    @property
    def moved_by(self) -> Array:
        """(joints, nv) 1 where a column moves a joint."""
        return self._moves

    # --- what is near --------------------------------------------------------------------------------------------

    def near(self, q: Array, within: float) -> Nearness:
        """What is nearer than so many m at q (nq,). Views: the next call overwrites them."""
        self.see(q)
        count = 0
        if len(self.pairs) and self._model.nv:
            count = approach(
                self._results.address, self._flat, self._joints, self._ends, self._radii, self._moves,
                self._placements, address(self._data.J), within, self._which, self._room, self._rows, self._scratch,
            )  # fmt: skip
        return Nearness(self._which[:count], self._room[:count], self._rows[:count])

    # --- all along a motion --------------------------------------------------------------------------------------

    def bounds(self, q: Array, to: Array) -> tuple[Array, Array]:
        """Distances (pairs,) at q (nq,), and by how much they may change at most on the way to another q (nq,), m.
        Views: the next call overwrites them."""
        self.see(q)
        motion = np.ascontiguousarray(pin.difference(self._model, q, to))
        if len(self.pairs) and self._model.nv:
            sweep(
                self._results.address, self._flat, self._joints, self._balls, self._moves, self._placements,
                address(self._data.J), motion, self._before, self._ways, self._scratch,
            )  # fmt: skip
        return self._before, self._ways

    # --- going round ---------------------------------------------------------------------------------------------

    def motion_of(self, pair: int, motion: Array) -> Array:
        """(3,) how joints that do a motion (nv,) move a pair's first nearest point, seen from its second body, m."""
        one, other, _ = self.points(pair)
        columns, found = np.asarray(self._data.J), np.zeros(3)
        for body, at, sign in zip(self.pairs[pair], (one, other), (1.0, -1.0), strict=True):
            led = columns @ (motion * self._moves[self.bodies[body].joint])
            found += sign * (led[:3] + np.cross(led[3:], at))
        return found

    def turned(
        self, q: Array, motion: Array, around: Table, states: Array, reach: float, stop: float, strength: float
    ) -> tuple[Array, Table]:
        """A motion at q (nq,) with what vortices make of it: see `cinegen.collision._kernels.turn`.

        Args:
            q: where the mechanism is.
            motion: (nv,) of the attraction, rad and m.
            around: (pairs,) the vortex of each pair.
            states: (vortices, 4) of these; changed.
            reach: where they begin, m.
            stop: where links are stopped, m.
            strength: of vortices.

        Returns:
            (nv,) the motion, and for each vortex that rests the nearest pair that is led into it, else -1.
        """
        self.see(q)
        found, asks = motion.copy(), np.full(len(states), -1, dtype=np.int64)
        free = self._free(q)
        if len(self.pairs) and self._model.nv:
            turn(
                self._results.address, self._flat, self._joints, self._moves, address(self._data.J), motion,
                self._scale, free, around, states, reach, stop, strength, asks, found, self._by, self._square,
            )  # fmt: skip
        return found, asks

    def _free(self, q: Array) -> Array:
        """(motions, nv) orthonormal, without unit, that keep loops closed at q; none where there are no loops."""
        if not self.mechanism.loops:
            return self._all_free
        loops = self.mechanism.system.evaluate(q)[1]
        return np.ascontiguousarray(free_motions(loops, self.mechanism.loop_rank)[0].T)


class _Results:
    """Coal's results as one array, read where coal keeps them if that is where this build is known to."""

    def __init__(self, solids: pin.GeometryData, count: int) -> None:
        self._solids, self._in_place = solids, False
        self.table = np.zeros((count, RESULT_WIDTH))
        self.address = address(self.table)
        if count:
            begin = [address(solids.distanceResults[i].normal) - 8 * NORMAL for i in range(count)]
            if begin == list(range(begin[0], begin[0] + 8 * RESULT_WIDTH * count, 8 * RESULT_WIDTH)):
                numbers = ctypes.cast(begin[0], ctypes.POINTER(ctypes.c_double))
                self.table = np.ctypeslib.as_array(numbers, (count, RESULT_WIDTH))
                self._in_place, self.address = True, begin[0]

    def read(self) -> None:
        """Takes over what coal has found."""
        if self._in_place:
            return
        for i, row in enumerate(self.table):
            one = self._solids.distanceResults[i]
            row[DISTANCE], row[NORMAL : NORMAL + 3] = one.min_distance, one.normal
            row[FIRST_POINT : FIRST_POINT + 3] = one.getNearestPoint1()
            row[SECOND_POINT : SECOND_POINT + 3] = one.getNearestPoint2()


def _ends(bodies: Sequence[Body]) -> tuple[Array, Array]:
    """(bodies, 6) both ends of those that are capsules and move, in the frames of their joints, and (bodies,) their
    radii: below 0 for all others."""
    ends, radii = np.zeros((len(bodies), 6)), np.full(len(bodies), -1.0)
    for i, body in enumerate(bodies):
        if body.joint and isinstance(body.shape, coal.Capsule):
            half = body.shape.halfLength * body.placement.rotation[:, 2]
            ends[i] = np.concatenate([body.placement.translation - half, body.placement.translation + half])
            radii[i] = body.shape.radius
    return ends, radii


def prepare_clearance() -> None:
    """Compiles the kernels, or loads them from disk."""
    from numba import types

    vector, matrix = types.float64[::1], types.float64[:, ::1]
    prepare(
        approach, types.int64, TABLE, TABLE, matrix, vector, matrix, types.int64, types.int64, types.float64, TABLE,
        vector, matrix, matrix,
    )  # fmt: skip
    prepare(sweep, types.int64, TABLE, TABLE, matrix, matrix, types.int64, types.int64, vector, vector, vector, matrix)
    prepare(
        turn, types.int64, TABLE, TABLE, matrix, types.int64, vector, vector, matrix, TABLE, matrix, types.float64,
        types.float64, types.float64, TABLE, vector, matrix, matrix,
    )  # fmt: skip
