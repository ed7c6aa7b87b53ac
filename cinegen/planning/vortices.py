"""`Vortices`: deflect the motion of a mechanism around the obstacles that obstruct it."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from typing import Any

import numpy as np

from cinegen.arrays import Array, ArrayLike, Indices, Integers
from cinegen.collision._kernels.memory import ClearanceMemory
from cinegen.collision.clearance import Clearance
from cinegen.collision.errors import PlanningError
from cinegen.jit.compiled import prepare
from cinegen.jit.one_thread import OneThread, in_one_thread
from cinegen.loops.motions import free_motions
from cinegen.model.motion_plane import motion_plane
from cinegen.planning._kernels.memory import VortexMemory
from cinegen.planning._kernels.vortex import ACTIVE, AXIS, deflect
from cinegen.planning.clearance_barrier import stop_distance

STRENGTH = 1.5
"""Strength of a vortex relative to the attraction at the same point, at the stop distance: above 1, or links would not
get around."""

_PARALLEL = 1e-9  # sine of the angle to the normal below which a direction does not determine an axis
_FALLBACK = (np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))


class DetourDirection(Enum):
    """Direction in which links pass an obstacle; the value is its description."""

    FOLDING = "toward the base"
    SHORTER = "along the shorter side"
    LONGER = "along the longer side"
    UP = "upward"
    DOWN = "downward"
    ASIDE = "sideways"


class Vortices(OneThread):
    """One vortex around each obstacle, which acts while the obstacle obstructs the motion.

    What the paper leaves open, and what experience added:

    - Only obstructing obstacles have an active vortex. It is activated when a link within its reach moves toward the
      obstacle, and the motion without it would come too near. It is deactivated when no link moves toward the obstacle
      any more: the paper's point Q.
    - The axis is chosen at activation, and kept. All links pass an obstacle about the same axis.
    - The attraction at a link's nearest point is how the mechanism's motion moves that point, J_i dq, not the tool's.
    - The strength is relative to that attraction: there is no gain to tune, and it does not depend on units.

    Args:
        clearance: distances of the mechanism.
        reach: distance at which vortices start to act, m.
        safety: safety distance, m.
        direction: direction in which links pass obstacles.
        strength: relative strength; 0 disables vortices.
        up: (3,) direction upward; along z unless given.

    Attributes:
        states: (vortices, 4) whether each is active, and its axis; numbered as `Clearance.groups`.
        direction: direction of vortices that are activated from now on.
        plane: (3,) normal of the plane of motion; None in space.
    """

    def __init__(
        self,
        clearance: Clearance,
        reach: float,
        safety: float,
        direction: DetourDirection = DetourDirection.SHORTER,
        strength: float = STRENGTH,
        up: Array | None = None,
    ) -> None:
        self._add_vortices = prepare_vortices()
        self.clearance, self.direction, self.strength, self.safety = clearance, direction, strength, safety
        mechanism = clearance.mechanism
        self.stop = stop_distance(mechanism, safety)
        self.reach = max(reach, 2.0 * self.stop)
        model = mechanism.model
        memory = self._memory = VortexMemory(
            nv=model.nv, pairs=len(clearance.pairs), vortices=int(clearance.groups.max(initial=-1)) + 1
        )
        memory.vortex[:], memory.scale[:] = clearance.groups, mechanism.scale
        self.states = memory.states
        self.plane = motion_plane(mechanism)
        self._up = np.array([0.0, 0.0, 1.0]) if up is None else np.asarray(up)
        self._base = np.array(model.jointPlacements[min(1, model.njoints - 1)].translation)

    @property
    def active(self) -> Indices:
        """Indices of the active vortices."""
        return np.flatnonzero(self.states[:, ACTIVE])

    def deactivate(self) -> None:
        """Deactivate all vortices."""
        self.states[:] = 0.0

    @in_one_thread
    def deflect(self, q: Array, motion: Array, obstructing: Callable[[], frozenset[int]]) -> Array:
        """Return a motion (nv,), deflected around obstructing obstacles.

        Args:
            q: (nq,) present configuration.
            motion: (nv,) undeflected motion, rad and m.
            obstructing: called if a vortex may have to be activated: returns the groups (see `Clearance.groups`) to
                which the undeflected motion would come too near.
        """
        deflected, candidates = self._deflected(q, motion)
        if not (candidates >= 0).any():
            return deflected
        activated = sorted(set(np.flatnonzero(candidates >= 0).tolist()) & obstructing())
        if not activated:
            return deflected
        self.clearance.update(q)
        for g in activated:
            self.states[g, AXIS:] = self._axis(int(candidates[g]), motion)
            self.states[g, ACTIVE] = 1.0
        return self._deflected(q, motion)[0]

    def violated(self, q: Array) -> frozenset[int]:
        """Return the groups nearer than the safety distance at q (nq,)."""
        return frozenset(self.clearance.groups[self.clearance.nearer(q, self.safety)].tolist())

    def _deflected(self, q: Array, motion: Array) -> tuple[Array, Integers]:
        """Return the motion with the active vortices, and for each inactive one the nearest pair that moves toward it,
        else -1."""
        clearance, mechanism = self.clearance, self.clearance.mechanism
        clearance.update(q)
        memory = self._memory
        if not len(clearance.pairs) or not mechanism.model.nv:
            return motion.copy(), np.full(len(self.states), -1, dtype=np.int64)
        if mechanism.is_constrained:
            loops = mechanism.structure.system.evaluate(q)[1]
            free = free_motions(loops, mechanism.loop_rank)[0].T
            memory.resize(free=len(free))
            memory.null_space[:] = free
        memory.motion[:], memory.reach, memory.stop, memory.strength = motion, self.reach, self.stop, self.strength
        self._add_vortices(memory.handle, clearance.memory.handle)
        return memory.deflected.copy(), memory.candidates.copy()

    def _axis(self, pair: int, motion: Array) -> Array:
        """Return the axis (3,) of a vortex that is activated by a pair."""
        point, _, normal = self.clearance.nearest_points(pair)
        attraction = self.point_motion(pair, motion)
        towards = {
            DetourDirection.FOLDING: folding(point, self._base, self.plane),
            DetourDirection.SHORTER: attraction,
            DetourDirection.LONGER: attraction,
            DetourDirection.UP: self._up,
            DetourDirection.DOWN: -self._up,
            DetourDirection.ASIDE: np.cross(normal, attraction),
        }[self.direction]
        axis = rotation_axis(-normal, towards, attraction, plane=self.plane)
        return -axis if self.direction is DetourDirection.LONGER else axis

    def point_motion(self, pair: int, motion: Array) -> Array:
        """Return how a joint motion (nv,) moves a pair's nearest point on the first body relative to the second (3,),
        m, at the clearance's last update."""
        clearance, shift = self.clearance, np.zeros(3)
        points = clearance.nearest_points(pair)[:2]
        for body, point, sign in zip(clearance.pairs[pair], points, (1.0, -1.0), strict=True):
            twist = clearance.jacobian @ (motion * clearance.moved_by[clearance.joints[body]])
            shift += sign * (twist[:3] + np.cross(twist[3:], point))
        return shift


def folding(point: ArrayLike, base: ArrayLike, axis: ArrayLike | None = None) -> Array:
    """Return the direction toward the base (3,), m: "folding rather than stretching", which keeps the obstacle from
    catching the arm.

    Args:
        point: (3,) where the vortex acts, m.
        base: (3,) position of the robot's base, m.
        axis: (3,) axis of the base's joint, if that is revolute: the direction is then perpendicular to it.
    """
    offset: Array = np.asarray(base, dtype=float) - np.asarray(point, dtype=float)
    if axis is None:
        return offset
    along = np.asarray(axis, dtype=float)
    return np.asarray(offset - (offset @ along) / (along @ along) * along)


def rotation_axis(normal: ArrayLike, *directions: ArrayLike, plane: ArrayLike | None = None) -> Array:
    """Return the unit axis w (3,) of a vortex that starts along a direction.

    Args:
        normal: (3,) outward unit normal n of the obstacle.
        directions: (3,) directions tau of any size; the first that is not along n is used. If there is none, the vortex
            starts along z (along x where n is along z).
        plane: (3,) unit normal of the plane in which everything moves; w is then plus or minus that, plus where no
            direction is left.

    Raises:
        PlanningError: the normal is zero or not finite.
    """
    n = np.asarray(normal, dtype=float)
    if not (np.isfinite(n).all() and n.any()):
        raise PlanningError(f"the normal of an obstacle is {normal!r}; give a unit vector")
    candidates = (*directions, *(_FALLBACK if plane is None else ()))
    across = [_cross_unit(n, np.asarray(tau, dtype=float)) for tau in candidates]
    if plane is not None:
        up = np.asarray(plane, dtype=float)
        senses = (float(up @ axis) for axis in across)
        return np.asarray(math.copysign(1.0, next((s for s in senses if abs(s) > _PARALLEL), 1.0)) * up)
    sizes = [float(np.linalg.norm(axis)) for axis in across]
    return next(axis / size for axis, size in zip(across, sizes, strict=True) if size > _PARALLEL)


def _cross_unit(normal: Array, direction: Array) -> Array:
    """Return n x tau / |tau| (3,); 0 where tau is 0."""
    size = float(np.linalg.norm(direction))
    return np.cross(normal, direction / size) if size > 0.0 else np.zeros(3)


def prepare_vortices() -> Callable[..., Any]:
    """Compile the kernel, or load it from disk."""
    return prepare(deflect, VortexMemory, ClearanceMemory)
