"""Sampling planners: a path to a goal around obstacles, for what vortices cannot do."""

from __future__ import annotations

import itertools
import time
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance
from cinegen.collision.scene import Scene
from cinegen.collision.shapes import bounding_box_corners
from cinegen.errors import ClosureError
from cinegen.planning.clear_motion import clear_motion
from cinegen.planning.goal_configurations import TOLERANCE
from cinegen.planning.path_constraints import Kept, equations_of, projection
from raff2urdf.command.extras import needs

RRT_CONNECT, LBKPIECE = "RRT-Connect", "LBKPIECE"
_TURN = 30.0  # tests of motions: in a turn of each method
_LONGEST = 0.03  # of the diagonal of the box: to a new configuration
_REVOLUTION = 2.0 * np.pi
_MOST_WINDINGS = 16  # of one goal configuration
_MARGIN = 0.1  # of the extent of a scene, free space around it
_THINNEST = 1e-9  # rad or characteristic lengths between limits


class PathSampler:
    """A path to one of the goals, by RRT-Connect of OMPL, or by RRT-Connect and LBKPIECE in turn.

    It has no local minima, and given time it finds a path if there is one that is not too narrow; but never a proof
    that there is none. The path differs between seeds.

    Each method takes several times as long as the other in some scenes: LBKPIECE in mazes, RRT-Connect in cages and
    thin shelves. Turns are equal in tests of motions, not in time, so that the same seed finds the same path.

    - No motion is tested at samples only: for each motion of the path, `clear_motion` shows that the safety distance is
      kept everywhere.
    - Mechanisms with loops, and constraints along the path, are sampled on the constraint manifold, by OMPL's
      projection with our closing of loops, or with local inverse kinematics.
      Actuated and passive joints stay within their limits, and the assembly mode is kept from step to step.
    - All collision-free configurations at the goal are goals, joints without limits on both sides.

    Args:
        scene: scene, its locked joints without motion (`with_joints_locked`).
        clearance: distances of its robot.
        goals: (nq,) each, free of collisions.
        seed: seed of the random numbers, from 0.
        is_alternating: RRT-Connect and LBKPIECE in turn; with loops or constraints along the path RRT-Connect only.
        tasks: tasks and ranges that are kept all along the path.

    Attributes:
        method: name of the planner that found the path; as long as there is none, of all.
        path: (n, nq), the start first, safety distance kept between each two; with loops or constraints, as fine as
            `clear_motion` returns motions. None as long as `search` has found none.

    Raises:
        MissingExtraError: OMPL is not installed.
    """

    path: Array | None = None

    def __init__(
        self, scene: Scene, clearance: Clearance, goals: Sequence[Array], seed: int, is_alternating: bool = False,
        tasks: Kept = (),
    ) -> None:  # fmt: skip
        with needs("sampling", "sampling planners"):
            from cinegen.planning.sampling.ompl_trees import Trees
        self._scene, self._clearance, mechanism = scene, clearance, scene.mechanism
        space = self._space = SamplingSpace(scene, clearance)
        project = self._project = projection(scene, tasks)
        equations = equations_of(scene, tasks)
        self._is_curved, self._trees = bool(equations) or project is not None, dict[str, Trees]()
        methods = (RRT_CONNECT, LBKPIECE) if is_alternating and not self._is_curved else (RRT_CONNECT,)
        self.method = " and ".join(methods)
        if len(space.low) <= equations:  # nothing can move
            if any(np.array_equal(q, scene.start) for q in goals):
                self.path = scene.start[None].copy()
            return

        def free(begin: Array, end: Array) -> bool:
            if project is not None and not equations:  # ranges only: points are not projected
                q = space.at(end)
                near = project(q)
                if near is None or mechanism.distance(q, near) > TOLERANCE:
                    return False
            return clear_motion(clearance, space.at(begin), space.at(end), scene.safety, project=project) is not None

        def close(point: Array) -> Array | None:
            guess = space.at(point)
            try:
                q = mechanism.close(guess, locked=scene.locked) if project is None else project(guess)
            except ClosureError:
                return None
            return None if q is None else space.point(q)

        ends = [point for q in goals for point in space.points(q)]
        longest = _LONGEST * float(np.linalg.norm(space.high - space.low))
        for method in methods:
            self._trees[method] = Trees(
                space.low, space.high, space.point(scene.start), ends, free, longest, seed,
                close if equations else None, equations, is_lazy=method == LBKPIECE,
            )  # fmt: skip

    def search(self, deadline: float) -> bool:
        """Search on, until there is a path or a value of `time.monotonic` is reached; return whether there is one."""
        while self.path is None and self._trees and time.monotonic() < deadline:
            turns = {method: trees.work // _TURN for method, trees in self._trees.items()}  # that are complete
            method = min(turns, key=turns.__getitem__)
            points = self._trees[method].grow(deadline, (turns[method] + 1.0) * _TURN)
            self.path = None if points is None else self._motion(points)
            if self.path is not None:
                self.method = method
        return self.path is not None

    def _motion(self, points: Array) -> Array | None:
        """Return the path along points of the space; None if it is not clear by rounding, at the edge of what is."""
        scene, clearance = self._scene, self._clearance
        path = np.array([scene.start, *map(self._space.at, points[1:])])
        if not self._is_curved:
            return path
        motions = [clear_motion(clearance, *ends, scene.safety, project=self._project) for ends in pairwise(path)]
        if any(motion is None for motion in motions):
            return None
        return np.vstack([path[:1], *(motion[1:] for motion in motions if motion is not None)])


# --- the space that is sampled -----------------------------------------------------------------------------------


class SamplingSpace:
    """Configurations as points x (n,) of a box: the difference of each joint from the start, in the scene's metric: rad
    or characteristic lengths, multiplied by `weights`.

    Joints are bounded by their limits. A revolute joint without limits has one revolution to either side, so that a
    goal can be reached in both directions; a prismatic one, and a floating base, the extent of the scene and a margin;
    the rotations of a ball joint and of a floating base, half a revolution. Locked joints are no dimensions.

    Args:
        scene: scene.
        clearance: distances of its robot.

    Attributes:
        low: (n,) lower bounds.
        high: (n,) upper bounds, above `low`.
    """

    def __init__(self, scene: Scene, clearance: Clearance) -> None:
        self._start, mechanism = scene.start, scene.mechanism
        self._mechanism, self._scale = mechanism, scene.metric
        low, high = np.full(mechanism.model.nv, -np.inf), np.full(mechanism.model.nv, np.inf)
        first, last = _room(scene, clearance)
        begin, end = (np.resize(far, mechanism.model.nv) for far in (first, last))
        self._unlimited = np.zeros(mechanism.model.nv, dtype=bool)
        for name in mechanism.joints:
            i, k = mechanism.q_index(name), mechanism.v_index(name)
            low[k], high[k] = np.array(mechanism.limits[name][:2]) - scene.start[i]
            if not mechanism.is_prismatic(name):
                begin[k], end[k] = -_REVOLUTION, _REVOLUTION
                self._unlimited[k] = np.isinf(low[k]) and np.isinf(high[k])
        rotations = [3] * mechanism.floating + [mechanism.v_index(ball) for ball in mechanism.balls]
        for k in rotations:  # those of a floating base follow its three translations
            begin[k : k + 3], end[k : k + 3] = -np.pi, np.pi
        self._columns = np.flatnonzero(low < high)
        self.low = (np.minimum(np.where(np.isinf(low), begin, low), 0.0) / self._scale)[self._columns]
        self.high = (np.maximum(np.where(np.isinf(high), end, high), 0.0) / self._scale + _THINNEST)[self._columns]

    def at(self, x: Array) -> Array:
        """Return the configuration (nq,) of a point (n,)."""
        motion = np.zeros(len(self._scale))
        motion[self._columns] = x * self._scale[self._columns]
        return self._mechanism.integrate(self._start, motion)

    def point(self, q: Array) -> Array:
        """Return the point (n,) of a configuration (nq,)."""
        return np.asarray((self._mechanism.difference(self._start, q) / self._scale)[self._columns])

    def points(self, q: Array) -> list[Array]:
        """Return the points (n,) inside the box of a configuration (nq,), also with whole revolutions; the nearest to
        the start first."""
        x, unlimited = self.point(q), self._unlimited[self._columns]
        scale = self._scale[self._columns][unlimited]
        angles = np.remainder(x[unlimited] * scale + np.pi, _REVOLUTION) - np.pi
        x[unlimited] = angles / scale
        wound = np.column_stack([angles, angles - np.copysign(_REVOLUTION, angles)]) / scale[:, None]
        points = []
        for values in itertools.islice(itertools.product(*wound), _MOST_WINDINGS):
            point = x.copy()
            point[unlimited] = values
            points.append(np.clip(point, self.low, self.high))
        return sorted(points, key=lambda point: float(np.linalg.norm(point)))


def _room(scene: Scene, clearance: Clearance) -> tuple[Array, Array]:
    """Return how far translations may go down and up from the start, m: (2,) along x and y for a mobile robot, else
    (1,)."""
    start = np.array(scene.mechanism.placement(scene.start, scene.node).translation)
    points = [np.array(scene.goal.translation)[None], start[None]]
    for body in (body for obstacle in scene.obstacles for body in obstacle.bodies if np.isfinite(body.radius)):
        points.append(bounding_box_corners(body.shape, body.placement))
    offsets = np.vstack(points) - start
    widest = max((body.radius for body in clearance.bodies if body.joint), default=0.0)
    margin = _MARGIN * float(np.ptp(offsets, axis=0).max()) + 2.0 * (widest + scene.safety)
    if scene.mobile is not None:
        return offsets.min(axis=0)[:2] - margin, offsets.max(axis=0)[:2] + margin
    far = np.linalg.norm(offsets, axis=1).max(keepdims=True) + margin
    return -far, far
