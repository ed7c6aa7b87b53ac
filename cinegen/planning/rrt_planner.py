"""`rrt_connect`: a path to a goal around obstacles, by sampling: for what vortices cannot do."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.body import bounding_box_corners
from cinegen.collision.clearance import Clearance, clearance_of
from cinegen.collision.errors import PlanningError
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.scene import Scene
from cinegen.errors import ClosureError
from cinegen.model import Mechanism
from cinegen.planning.attempt import Attempt, PlanStatus, checked
from cinegen.planning.goal_configurations import Refusal, free_goals
from cinegen.planning.planner import Plan
from cinegen.tolerances import CLOSURE
from raff2urdf.extras import needs

Array = NDArray[np.float64]

_LABEL = "RRT-Connect"
_LONGEST = 0.8  # rad or characteristic lengths: to a new configuration
_REVOLUTION = 2.0 * np.pi
_MOST_WINDINGS = 16  # of one goal configuration
_MARGIN = 0.1  # of the extent of a scene, free space around it
_THINNEST = 1e-9  # rad or characteristic lengths between limits
_SHORTEST = 1e-4  # rad or characteristic lengths: half of a segment that is not divided any more
_MOST_CURVATURE = 5e-4  # rad or characteristic lengths: how far closing the loops may move the middle of a segment


def rrt_connect(
    scene: Scene, *, seconds: float = 10.0, seed: int = 0, report: Callable[[str], None] = lambda text: None
) -> Plan:
    """Plan a path to a scene's goal by sampling configurations: RRT-Connect of OMPL, on the distances of `plan`.

    It has no local minima, and given time it finds a path if there is one that is not too narrow; but never a proof
    that there is none. The path differs between seeds, and has corners, although it is shortened.

    - No motion is tested at samples only: each motion of the trees, and each shortcut, is one for which `clear_motion`
      shows that the safety distance is kept everywhere. The path of the plan is fine enough for `Plan.clearance` to
      show it again.
    - Mechanisms with loops are sampled on the constraint manifold, by OMPL's projection with our closing of loops.
      Actuated and passive joints stay within their limits, and the assembly mode is kept from step to step.
    - All collision-free configurations at the goal are goals, joints without limits on both sides.

    Args:
        scene: scene.
        seconds: time limit of the search, once start and goal are tested; shortening the path takes longer.
        seed: seed of the random numbers.
        report: called with a text about what is done.

    Returns:
        a plan that is REACHED, IN_COLLISION where the meshes touch on the path, or TIME_LIMIT; or without a search, as
        by `plan`, START_IN_COLLISION, GOAL_IN_COLLISION or OUT_OF_REACH. Without a path, `path` is the start alone.

    Raises:
        MissingExtraError: OMPL is not installed.
        PlanningError: seconds or seed is invalid.
    """
    with needs("sampling", "sampling planners"):
        from cinegen.planning.ompl_trees import connect
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise PlanningError(f"seconds must be above 0, not {seconds}")
    if seed < 0:
        raise PlanningError(f"seed must be 0 or above, not {seed}")
    clearance, check = clearance_of(scene), MeshCheck(scene)

    def made(status: PlanStatus, path: Array, reason: str) -> Plan:
        found = checked(Attempt(_LABEL, status, path, (), reason), check)
        return Plan(scene, found.status, found.path, (found,), found.reason, clearance, check, None)

    start = scene.start[None].copy()
    goals = free_goals(scene, clearance, check, report)
    if isinstance(goals, Refusal):
        return Plan(scene, goals.status, start, (), goals.reason, clearance, check, None)
    mechanism = scene.mechanism
    if mechanism.model.nv == 0:
        return made(PlanStatus.REACHED, start, "")
    space = SamplingSpace(scene, clearance)

    def between(begin: Array, end: Array) -> Array | None:
        return clear_motion(clearance, space.at(begin), space.at(end), scene.safety)

    def close(point: Array) -> Array | None:
        try:
            return space.point(mechanism.close(space.at(point)))
        except ClosureError:
            return None

    report(f"{_LABEL}, {seconds:g} s at most")
    paths = connect(
        space.low, space.high, np.zeros(mechanism.model.nv), [point for q in goals for point in space.points(q)],
        lambda begin, end: between(begin, end) is not None, _LONGEST, seconds, seed,
        close if mechanism.is_constrained else None, mechanism.loop_rank,
    )  # fmt: skip
    for path in paths:
        segments = [between(begin, end) for begin, end in itertools.pairwise(path)]
        clear = [segment for segment in segments if segment is not None]
        if len(clear) == len(segments):
            return made(PlanStatus.REACHED, np.vstack([start, *(segment[1:] for segment in clear)]), "")
    return made(PlanStatus.TIME_LIMIT, start, f"{_LABEL} found no path in {seconds:g} s")


# --- the space that is sampled -----------------------------------------------------------------------------------


class SamplingSpace:
    """Configurations as points x (nv,) of a box: the difference of each joint from the start, rad or characteristic
    lengths.

    Joints are bounded by their limits. A revolute joint without limits has one revolution to either side, so that a
    goal can be reached both ways around; a prismatic one, and a floating base, the extent of the scene and a margin;
    the rotations of a ball joint and of a floating base, half a revolution.

    Args:
        scene: scene.
        clearance: distances of its robot.

    Attributes:
        low: (nv,) lower bounds.
        high: (nv,) upper bounds, above `low`.
    """

    def __init__(self, scene: Scene, clearance: Clearance) -> None:
        self._start, mechanism = scene.start, scene.mechanism
        self._mechanism, self._scale = mechanism, mechanism.scale
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
        self.low = np.minimum(np.where(np.isinf(low), begin, low), 0.0) / self._scale
        self.high = np.maximum(np.where(np.isinf(high), end, high), 0.0) / self._scale + _THINNEST

    def at(self, x: Array) -> Array:
        """Return the configuration (nq,) of a point (nv,)."""
        return self._mechanism.integrate(self._start, x * self._scale)

    def point(self, q: Array) -> Array:
        """Return the point (nv,) of a configuration (nq,)."""
        return self._mechanism.scaled_difference(self._start, q)

    def points(self, q: Array) -> list[Array]:
        """Return the points (nv,) inside the box of a configuration (nq,), also with whole revolutions; the nearest to
        the start first."""
        x = self.point(q)
        x[self._unlimited] = np.remainder(x[self._unlimited] + np.pi, _REVOLUTION) - np.pi
        wound = [(value, value - np.copysign(_REVOLUTION, value)) for value in x[self._unlimited].tolist()]
        found = []
        for values in itertools.islice(itertools.product(*wound), _MOST_WINDINGS):
            point = x.copy()
            point[self._unlimited] = values
            found.append(np.clip(point, self.low, self.high))
        return sorted(found, key=lambda point: float(np.linalg.norm(point)))


def _room(scene: Scene, clearance: Clearance) -> tuple[Array, Array]:
    """Return how far translations may go down and up from the start, m: (2,) along x and y for a mobile robot, else
    (1,)."""
    here = np.array(scene.mechanism.placement(scene.start, scene.node).translation)
    points = [np.array(scene.goal.translation)[None], here[None]]
    for body in (body for obstacle in scene.obstacles for body in obstacle.bodies if np.isfinite(body.radius)):
        points.append(bounding_box_corners(body.shape, body.placement))
    offsets = np.vstack(points) - here
    widest = max((body.radius for body in clearance.bodies if body.joint), default=0.0)
    margin = _MARGIN * float(np.ptp(offsets, axis=0).max()) + 2.0 * (widest + scene.safety)
    if scene.mobile is not None:
        return offsets.min(axis=0)[:2] - margin, offsets.max(axis=0)[:2] + margin
    far = np.linalg.norm(offsets, axis=1).max(keepdims=True) + margin
    return -far, far


# --- motions that are clear everywhere ---------------------------------------------------------------------------


def clear_motion(clearance: Clearance, begin: Array, end: Array, safety: float) -> Array | None:
    """Return the simplest motion between two configurations that keeps the safety distance: joints straight; with
    loops, actuated joints straight, and the others by closing the loops.

    It is clear everywhere, not at samples: at the middle of each segment all distances must exceed the safety distance
    by more than anything can move from there to the ends of the segment; else the segment is halved (F. Schwarzer, M.
    Saha and J.-C. Latombe, "Exact collision checking of robot paths", 2004). Long segments are tested first, so that
    collisions are found early.

    With loops, each middle is closed with its actuated joints locked. Closing must not move it by more than
    `_MOST_CURVATURE`, and that motion is added to how far things can move. So no motion passes a singularity of type 2
    to another assembly mode: no segment of such a motion becomes so short.

    Args:
        clearance: distances of the mechanism.
        begin: (nq,) configuration within all limits, loops closed.
        end: (nq,) configuration.
        safety: safety distance, m.

    Returns:
        both ends and all middles (n, nq), loops closed, joints straight in between. None if something is too near, a
        joint would leave its limits, or loops can't be closed.
    """
    mechanism = clearance.mechanism
    if not all(_is_valid(mechanism, q) and clearance.least(q) >= safety for q in (begin, end)):
        return None
    known = {0.0: begin, 1.0: end}  # by the part of the motion
    segments = deque([(0.0, 1.0)])
    while segments:
        first, last = segments.popleft()
        middle = _middle(mechanism, known[first], known[last])
        if middle is None or clearance.least(middle.q) < safety:
            return None
        known[part := (first + last) / 2.0] = middle.q
        distances, change = clearance.motion_bounds(middle.q, mechanism.integrate(middle.q, middle.reach))
        if middle.curvature <= _MOST_CURVATURE and (distances - change >= safety).all():
            continue
        if float(np.abs(middle.reach / mechanism.scale).max(initial=0.0)) < _SHORTEST:
            return None
        segments += [(first, part), (part, last)]
    return np.array([known[part] for part in sorted(known)])


class _Middle(NamedTuple):
    """Attributes:
    q: (nq,) middle of a segment, loops closed.
    reach: (nv,) largest difference of each joint from q anywhere on the segment, rad and m.
    curvature: distance by which closing the loops moved the middle, rad or characteristic lengths.
    """

    q: Array
    reach: Array
    curvature: float


def _middle(mechanism: Mechanism, begin: Array, end: Array) -> _Middle | None:
    """Return the middle; None if loops can't be closed, or only far away, or beyond a limit."""
    straight = mechanism.interpolate(begin, end, 0.5)
    half = np.abs(mechanism.difference(straight, end))
    if not mechanism.is_constrained:
        return _Middle(straight, half, 0.0)
    # more actuated joints than DoF can't all be chosen
    locked = mechanism.actuated if len(mechanism.actuated) <= mechanism.mobility else ()
    try:
        q = mechanism.close(straight, locked=locked)
    except ClosureError:
        return None
    moved = np.abs(mechanism.difference(straight, q))
    curvature = float((moved / mechanism.scale).max())
    if curvature > float((half / mechanism.scale).max()) or not _is_valid(mechanism, q):
        return None
    # from closed loops back to the straight motion, half of it, and as far again to closed loops
    return _Middle(q, half + 2.0 * moved, curvature)


def _is_valid(mechanism: Mechanism, q: Array) -> bool:
    """Return whether a configuration is within all limits, loops closed."""
    return bool(mechanism.limits.within(q)) and mechanism.closure(q) <= CLOSURE
