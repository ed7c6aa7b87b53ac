"""Descent of a total potential in joint space: the attraction of the goal and the repulsion of all obstacles.

Equations 1 and 5 of C. De Medio and G. Oriolo, "Robot obstacle avoidance using vortex fields", Advances in Robot
Kinematics, Springer 1991.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import groupby
from typing import NamedTuple, NoReturn

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body
from cinegen.collision.clearance import Clearance
from cinegen.collision.errors import PlanningError
from cinegen.collision.obstacle import Obstacle
from cinegen.collision.scene import Scene
from cinegen.ik.equations import free_motions
from cinegen.ik.objectives import State
from cinegen.ik.task import FrameTask
from cinegen.joints import supporting_columns
from cinegen.model import Mechanism
from cinegen.model.motion_plane import motion_plane
from cinegen.planning.clearance_barrier import stop_distance
from cinegen.planning.enclosures import BoundingBox, Enclosure, capsule_axis
from cinegen.planning.potential_fields import Elliptical, Firas, Spherical

Array = NDArray[np.float64]

LONGEST = 0.06
"""Largest step of a joint, rad or characteristic lengths."""

FADING = 0.2
"""Distance from the goal below which repulsion fades, rad or characteristic lengths. Without fading, a spherical
potential, which never ends, reached 23 of 40 goals of a mobile point instead of 37."""

_FLAT = 1e-12  # dimensionless gradient that counts as 0
_AT_LIMIT = 1e-9  # rad or characteristic lengths
_ALONG = 9  # points of a link's axis
_ARMIJO = 1e-4  # fraction of the decrease promised by the slope that a step must achieve
_LEAST_FACTOR = 0.1  # smallest factor by which a step that was too long is shortened
_MOST_TRIALS = 50  # of a line search


class AvoidanceField(Enum):
    """Field that `plan` follows around obstacles. Potentials make one attempt only."""

    VORTEX = "vortex"
    """Vortex fields."""
    FIRAS = "firas"
    """Antigradient of equation 3."""
    SPHERICAL = "spherical"
    """Antigradient of equation 2, around the bounding ball of an obstacle."""
    ELLIPTICAL = "elliptical"
    """Antigradient of Volpe and Khosla's potential, around the bounding box of an obstacle."""
    NONE = "none"
    """No field: only the safety distance is kept. Makes attempts as `VORTEX` does."""

    @classmethod
    def _missing_(cls, value: object) -> NoReturn:
        raise PlanningError(f"unknown field {value!r}; use one of {', '.join(field.value for field in cls)}")


@dataclass(frozen=True)
class Gains:
    """Strength of repulsive potentials, in characteristic lengths of the robot and in ranges: the same for all scenes.

    Attributes:
        strength: characteristic lengths: at half its range an obstacle repels a point as strongly as a goal at that
            distance attracts it.
        exponent: gamma, of a spherical potential.
        decay: of an elliptical potential: within its range it falls by e^-decay, and by its 1/K.
    """

    strength: float
    exponent: float = 1.0
    decay: float = 2.0

    def firas(self, reach: float, length: float) -> Firas:
        """Return a FIRAS potential with a range (m), for a robot of a characteristic length (m). Potentials are
        dimensionless: that of a goal at one characteristic length is 1/2."""
        half = 0.5 * reach
        return Firas(self._slope(length) * half**2 / (1.0 / half - 1.0 / reach), reach)

    def spherical(self, reach: float, length: float) -> Spherical:
        """Return a spherical potential. It never ends, and is as strong at half of the range as the others."""
        double = 2.0 * self.exponent
        return Spherical(self._slope(length) * (0.5 * reach) ** (double + 1.0) / double, self.exponent)

    def elliptical(self, box: BoundingBox, reach: float, length: float) -> Elliptical:
        """Return an elliptical potential around a box. It never ends, and is as strong as the others half of the range
        beyond the end of its longest edge."""
        longest = float(box.half[np.isfinite(box.half)].max())
        k, decay = 0.5 * reach / longest, self.decay * longest / reach
        strength = self._slope(length) * longest * k**2 * math.exp(decay * k) / (decay * k + 1.0)
        return Elliptical(box.middle, box.half, strength, decay, axes=box.axes)

    def _slope(self, length: float) -> float:
        """Return the slope (1/m) of the goal's potential at `strength` characteristic lengths."""
        return self.strength / length


GAINS = {AvoidanceField.FIRAS: Gains(0.1), AvoidanceField.SPHERICAL: Gains(0.1), AvoidanceField.ELLIPTICAL: Gains(0.1)}
"""Default strength of each potential.

Tried on 40 scenes of a planar 3R and 40 of a mobile point: strengths of 0.01 to 3 characteristic lengths (FIRAS, also
with a half and a quarter of the range), 0.03 to 1 with exponents of 0.5, 1 and 2 (spherical), 0.01 to 1 with decays of
1 to 8 (elliptical). Neighbouring values differ by no more than a few scenes; larger ones are worse for arms.
"""


class GoalPotential:
    """Attraction of a scene's goal (equation 1), dimensionless: half the squared error, in characteristic lengths and
    rad."""

    def __init__(self, scene: Scene) -> None:
        self._mechanism, self._node = scene.mechanism, scene.node
        self._task = FrameTask(scene.node, scene.goal, scene.translation, scene.rotation, axes="world")
        self._units = np.repeat([1.0 / scene.mechanism.length, 1.0], [scene.translation, scene.rotation])

    def value(self, q: Array) -> float:
        """Return the potential at q (nq,)."""
        distance, angle = self._task.distances(self._mechanism, q)
        return 0.5 * ((distance / self._mechanism.length) ** 2 + angle**2)

    def gradient(self, q: Array) -> Array:
        """Return the gradient (nv,) by rad and characteristic lengths."""
        jacobian = self._mechanism.jacobian(q, self._node)
        error, rows = self._task.equations(self._mechanism.placement(q, self._node), jacobian, np.eye(3))
        return np.asarray(-(self._units**2 * error) @ rows * self._mechanism.scale)


class NearestPoints(NamedTuple):
    """Points of links that are nearest to an obstacle.

    Attributes:
        joints: (m,) joints of the links.
        distances: (m,) m.
        normals: (m, 3) outward unit normals of the obstacle.
        points: (m, 3) L_i of the links, m.
    """

    joints: NDArray[np.int64]
    distances: Array
    normals: Array
    points: Array


class LinkPoints:
    """One point of each link for each body of an obstacle. A link is everything that moves with a joint.

    Args:
        mechanism: robot.
        links: bodies of its links.
        bodies: bodies in the world.
    """

    def __init__(self, mechanism: Mechanism, links: Sequence[Body], bodies: Sequence[Body]) -> None:
        obstacles = [Obstacle(body.name, (body,)) for body in bodies]
        self._clearance = clearance = Clearance(mechanism, links, obstacles)
        self.mechanism = mechanism

        def key(pair: int) -> tuple[int, int]:
            return int(clearance.groups[pair]), int(clearance.joints[clearance.pairs[pair, 0]])

        ordered = sorted(range(len(clearance.pairs)), key=key)
        self._pairs = [(*keys, np.array(list(pairs))) for keys, pairs in groupby(ordered, key)]

    def near(self, q: Array) -> Iterator[NearestPoints]:
        """Yield the nearest points for each body in turn, at q (nq,)."""
        clearance = self._clearance
        distances = clearance.distances(q)
        for _, links in groupby(self._pairs, lambda one: one[0]):
            joints, nearest = [], []
            for _, joint, pairs in links:
                joints.append(joint)
                nearest.append(int(pairs[distances[pairs].argmin()]))
            found = [clearance.nearest_points(pair) for pair in nearest]
            yield NearestPoints(
                np.array(joints),
                distances[nearest],
                np.array([-normal for _, _, normal in found]),
                np.array([point for point, _, _ in found]),
            )

    def torques(self, near: NearestPoints, forces: Array) -> Array:
        """Return the sum (nv,) of J_i' f_i of forces (m, 3) on these points, by rad and characteristic lengths, at the
        configuration of the last `near`."""
        columns = self._clearance.jacobian
        torques = forces @ columns[:3] + np.cross(near.points, forces) @ columns[3:]
        return np.asarray((torques * self._clearance.moved_by[near.joints]).sum(axis=0) * self.mechanism.scale)


class NearestRepulsion:
    """Repulsion of links by their distance (equation 5): L_i is the nearest point of each link.

    Args:
        links: points of links for each body of an obstacle, or the ball around it.
        fields: field of each body.
    """

    def __init__(self, links: LinkPoints, fields: Sequence[Firas | Spherical]) -> None:
        self._links, self._fields = links, fields

    def value(self, q: Array) -> float:
        """Return the potential at q (nq,); infinite at contact."""
        pairs = zip(self._links.near(q), self._fields, strict=True)
        return float(sum(field.value(near.distances).sum() for near, field in pairs))

    def gradient(self, q: Array) -> Array:
        """Return the gradient (nv,) by rad and characteristic lengths; NaN at contact."""
        found = np.zeros_like(self._links.mechanism.scale)
        for near, field in zip(self._links.near(q), self._fields, strict=True):
            found += self._links.torques(near, field.gradient(near.distances, near.normals))
        return found


class GreatestRepulsion:
    """Repulsion of links by more than their distance (equation 5): L_i is where the potential of a link is greatest.

    The nearest point will not do: it jumps from one end of a link to the other between contours, and the potential with
    it. So links are replaced by the capsules around them, and L_i is on the line from a point of the axis towards the
    box; that point is found among `_ALONG` points, and by a parabola through the best of them and its neighbours.

    Args:
        mechanism: robot.
        links: bodies of its links.
        fields: fields around obstacles.
    """

    def __init__(self, mechanism: Mechanism, links: Sequence[Body], fields: Sequence[Elliptical]) -> None:
        self._mechanism, self._fields = mechanism, fields
        self._model, self._data = mechanism.model, mechanism.model.createData()
        moving = sorted((body for body in links if body.joint != 0), key=lambda body: body.joint)
        self._joints = [body.joint for body in moving]
        self._links = [list(bodies) for _, bodies in groupby(range(len(moving)), lambda i: self._joints[i])]
        self._axes = [capsule_axis(body) for body in moving]
        self._moves = np.array([supporting_columns(self._model, joint) for joint in self._joints])

    def value(self, q: Array) -> float:
        """Return the potential at q (nq,); infinite at contact."""
        pin.forwardKinematics(self._model, self._data, q)
        return float(sum(field.value(self._greatest(field)[1]).sum() for field in self._fields))

    def gradient(self, q: Array) -> Array:
        """Return the gradient (nv,) by rad and characteristic lengths; NaN at contact."""
        pin.computeJointJacobians(self._model, self._data, q)
        columns, found = np.asarray(self._data.J), np.zeros(self._model.nv)
        for field in self._fields:
            axis, points, derivatives, which = self._greatest(field)
            forces = np.einsum("mji,mj->mi", derivatives, field.gradient(points))
            torques = forces @ columns[:3] + np.cross(axis, forces) @ columns[3:]
            found += (torques * self._moves[which]).sum(axis=0)
        return found * self._mechanism.scale

    def _greatest(self, field: Elliptical) -> tuple[Array, Array, Array, list[int]]:
        """Return for each link the point of its axis (m, 3), L_i (m, 3), the derivative (m, 3, 3) of L_i by that point,
        and the body."""
        placed = [self._data.oMi[joint] for joint in self._joints]
        ends = np.array(
            [axis @ pose.rotation.T + pose.translation for (axis, _), pose in zip(self._axes, placed, strict=True)]
        )
        radii = np.array([radius for _, radius in self._axes])
        begin, along = ends[:, 0], ends[:, 1] - ends[:, 0]
        if len(self._links) == len(ends) and not along.any():  # balls
            return begin, *_towards(field, begin, radii), list(range(len(ends)))
        parts = np.linspace(0.0, 1.0, _ALONG)
        axis = begin[:, None] + parts[:, None] * along[:, None]
        distances = field.pseudo_distance(_towards(field, axis, radii[:, None])[0])
        every, at = np.arange(len(begin)), distances.argmin(axis=1)
        inner = at.clip(1, _ALONG - 2)
        before, here, after = distances[every, inner - 1], distances[every, inner], distances[every, inner + 1]
        curvature = before - 2.0 * here + after
        convex = curvature > 0.0
        aside = np.where(convex, 0.5 * (before - after) / np.where(convex, curvature, 1.0), 0.0).clip(-1.0, 1.0)
        best = axis[every, at]
        between = begin + ((inner + aside) / (_ALONG - 1.0))[:, None] * along
        refined = field.pseudo_distance(_towards(field, between, radii)[0])
        best = np.where((refined < distances.min(axis=1))[:, None], between, best)
        least = np.minimum(refined, distances.min(axis=1))
        which = [min(link, key=lambda i: float(least[i])) for link in self._links]
        points, derivatives = _towards(field, best[which], radii[which])
        return best[which], points, derivatives, which


class Potential:
    """Total potential of a mechanism, U = U_a + w(U_a) sum_i sum_o U_o(L_io), dimensionless (equations 1 and 5). L_io
    is the point of link i that obstacle o repels. Links do not repel each other: that is left to the barrier.

    Close to the goal w removes the repulsion: otherwise no goal within the range of an obstacle could be reached, and
    none at all where a potential never ends (S. S. Ge and Y. J. Cui, "New potential functions for mobile robot path
    planning", IEEE Transactions on Robotics and Automation 16(5), 2000).

    A half-space, which has no bounding ball or box, repels by FIRAS. So does an obstacle whose ball or box contains the
    goal, or part of the robot at the start.

    Args:
        scene: scene.
        links: bodies of the robot.
        field: FIRAS, SPHERICAL or ELLIPTICAL.
        reach: range of FIRAS, m; the others never end.
        gains: strength; the field's default in `GAINS` unless given.
        fading: distance from the goal below which repulsion fades, rad or characteristic lengths, above 0.

    Attributes:
        goal: attraction.
        fields: fields of all obstacles' bodies.
    """

    def __init__(
        self,
        scene: Scene,
        links: Sequence[Body],
        field: AvoidanceField,
        reach: float,
        gains: Gains | None = None,
        fading: float = FADING,
    ) -> None:
        self.goal, self._fading = GoalPotential(scene), fading
        mechanism, plane, gains = scene.mechanism, motion_plane(scene.mechanism), gains or GAINS[field]
        bodies = [body for obstacle in scene.obstacles for body in obstacle.bodies]
        firas = GAINS[AvoidanceField.FIRAS].firas(reach, mechanism.length)
        kept = stop_distance(scene.mechanism, scene.safety)
        self.fields = list[Firas | Spherical | Elliptical]()
        for i, body in enumerate(bodies):
            self.fields.append(gains.firas(reach, mechanism.length) if field is AvoidanceField.FIRAS else firas)
            if field is AvoidanceField.FIRAS or not np.isfinite(body.radius):
                continue
            enclosure = Enclosure(body, plane)
            around = enclosure.ball if field is AvoidanceField.SPHERICAL else enclosure.box_body
            near = next(LinkPoints(mechanism, links, [around]).near(scene.start))
            if near.distances.min() <= kept or _contains(around, scene.goal.translation):
                continue
            bodies[i] = around
            if field is AvoidanceField.SPHERICAL:
                self.fields[i] = gains.spherical(reach, mechanism.length)
            else:
                self.fields[i] = gains.elliptical(enclosure.box, reach, mechanism.length)
        boxes = [one for one in self.fields if isinstance(one, Elliptical)]
        others = [(body, one) for body, one in zip(bodies, self.fields, strict=True) if not isinstance(one, Elliptical)]
        self._parts: list[NearestRepulsion | GreatestRepulsion] = []
        if others:
            points = LinkPoints(mechanism, links, [body for body, _ in others])
            self._parts.append(NearestRepulsion(points, [one for _, one in others]))
        if boxes:
            self._parts.append(GreatestRepulsion(mechanism, links, boxes))

    def value(self, q: Array) -> float:
        """Return the potential at q (nq,); infinite at contact."""
        attraction = self.goal.value(q)
        weight, _ = self._weight(attraction)
        return attraction + weight * self._repulsion(q) if weight > 0.0 else attraction

    def gradient(self, q: Array) -> Array:
        """Return the gradient (nv,) by rad and characteristic lengths; NaN at contact."""
        attraction, (weight, slope) = self.goal.gradient(q), self._weight(self.goal.value(q))
        if slope > 0.0:
            attraction = attraction + slope * self._repulsion(q) * attraction
        return sum((weight * part.gradient(q) for part in self._parts), attraction)

    def _repulsion(self, q: Array) -> float:
        return sum(part.value(q) for part in self._parts)

    def _weight(self, attraction: float) -> tuple[float, float]:
        """Return w = 1 - (1 - u)^2, with u the squared error relative to that at which fading starts, and its
        derivative by U_a."""
        by = 2.0 / self._fading**2
        rest = max(1.0 - by * attraction, 0.0)
        return 1.0 - rest * rest, 2.0 * by * rest


class Descent:
    """Objective: the antigradient of a potential, as far as a line search goes, `LONGEST` at most.

    Args:
        mechanism: robot.
        value: potential at q (nq,).
        gradient: its gradient (nv,), by rad and characteristic lengths.
    """

    def __init__(
        self, mechanism: Mechanism, value: Callable[[Array], float], gradient: Callable[[Array], Array]
    ) -> None:
        self._mechanism, self._value, self._gradient = mechanism, value, gradient

    def velocity(self, state: State) -> Array:
        """Return the joint velocity (nv,), rad/s and m/s."""
        mechanism, scale, q = self._mechanism, self._mechanism.scale, state.q
        gradient = self._gradient(q)
        direction = self._feasible(q, -gradient)
        largest = float(np.abs(direction).max(initial=0.0))
        if not largest > _FLAT:  # NaN too: inside of what the potential takes for the obstacle
            return np.zeros_like(gradient)

        def along(step: float) -> float:
            return self._value(mechanism.integrate(q, step * direction * scale))

        return line_search(along, float(gradient @ direction), LONGEST / largest) * direction * scale / state.dt

    def _feasible(self, q: Array, direction: Array) -> Array:
        """Return the part (nv,) of a direction that limits and loops allow, by rad and characteristic lengths."""
        mechanism, limits = self._mechanism, self._mechanism.limits
        at_q, at_v = mechanism.scalar_joints
        near = _AT_LIMIT * mechanism.scale[at_v]
        low = np.where(q[at_q] <= limits.lower[at_q] + near, 0.0, -np.inf)
        high = np.where(q[at_q] >= limits.upper[at_q] - near, 0.0, np.inf)
        direction = direction.copy()
        direction[at_v] = np.minimum(np.maximum(direction[at_v], low), high)
        if not mechanism.loops:
            return direction
        motions, _ = free_motions(mechanism.system.evaluate(q)[1], mechanism.loop_rank)
        return np.asarray(motions @ (motions.T @ direction))


def line_search(function: Callable[[float], float], slope: float, longest: float) -> float:
    """Return a step in [0, longest] at which a function of one variable has decreased sufficiently.

    "A line search procedure may be included to better convergence, naturally preventing oscillations about the minimum
    point" (De Medio and Oriolo 1991, after equation 1). Backtracking to the lowest point of the parabola through what
    is known (J. Nocedal and S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006, section 3.5). It finds the
    minimum of a parabola to 1e-4 of the step.

    Args:
        function: function of the step; may be infinite or NaN where it is undefined, at contact for instance, but not
            at 0.
        slope: its derivative at 0.
        longest: longest step allowed.

    Returns:
        the step; 0 if the slope is not negative, or no step decreases the function.
    """
    if not slope < 0.0:
        return 0.0
    start, step = function(0.0), longest
    for _ in range(_MOST_TRIALS):
        value = function(step)
        curvature = value - start - slope * step
        is_convex = math.isfinite(curvature) and curvature > 0.0
        lowest = -slope * step * step / (2.0 * curvature) if is_convex else math.nan
        if value <= start + _ARMIJO * slope * step:
            return lowest if lowest < step and function(lowest) < value else step
        step = max(lowest, _LEAST_FACTOR * step) if math.isfinite(lowest) else _LEAST_FACTOR * step
    return 0.0


def _towards(field: Elliptical, axis: Array, radii: Array) -> tuple[Array, Array]:
    """Move points of axes (..., 3) straight towards a box by the radius of a capsule (...).

    Returns:
        the points (..., 3) reached, the middle of the box for those that reach it; and the derivative (..., 3, 3) of
        the point reached by the point of the axis.
    """
    local = (axis - field.centre) @ field.axes
    off = local - np.clip(local, -field.half, field.half)
    distance = np.linalg.norm(off, axis=-1)
    clear = distance > radii
    normal = off / np.where(clear, distance, 1.0)[..., None]
    part = (radii / np.where(clear, distance, 1.0))[..., None]
    points = np.where(clear[..., None], local - radii[..., None] * normal, 0.0)
    across = (off != 0.0)[..., None] * np.eye(3) - normal[..., :, None] * normal[..., None, :]
    derivatives = field.axes @ (np.eye(3) - part[..., None] * across) @ field.axes.T
    return points @ field.axes.T + field.centre, derivatives


def _contains(body: Body, point: Array) -> bool:
    """Return whether a body in the world contains a point (3,)."""
    pose, request = body.placement, coal.DistanceRequest()
    own, at = coal.Transform3s(pose.rotation, pose.translation), coal.Transform3s(np.eye(3), point)
    return bool(coal.distance(body.shape, own, coal.Sphere(0.0), at, request, coal.DistanceResult()) <= 0.0)
