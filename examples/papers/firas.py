"""Descent of a total potential in joint space: the attraction of the goal and the repulsion of all obstacles.

Equations 1, 3 and 5 of C. De Medio and G. Oriolo, "Robot obstacle avoidance using vortex fields", Advances in Robot
Kinematics, Springer 1991. FIRAS, the repulsion: O. Khatib, "Real-time obstacle avoidance for manipulators and mobile
robots", The International Journal of Robotics Research 5(1), 1986. Its potentials are in J and its gradients in N, of
forces that act on nothing: only their ratios matter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, ArrayLike, Integers
from cinegen.collision.body import Body
from cinegen.collision.clearance import Clearance
from cinegen.collision.errors import PlanningError
from cinegen.collision.obstacle import Obstacle
from cinegen.collision.scene import Scene
from cinegen.ik.state import State
from cinegen.ik.task import FrameTask
from cinegen.loops.motions import free_motions
from cinegen.model import Mechanism

LONGEST = 0.06
"""Largest step of a joint, rad or characteristic lengths."""

FADING = 0.2
"""Distance from the goal below which repulsion fades, rad or characteristic lengths."""

STRENGTH = 0.1
"""Characteristic lengths: at half its range an obstacle repels a point as strongly as a goal at that distance attracts
it.

Tried on 40 scenes of a planar 3R and 40 of a mobile point: 0.01 to 3, also with a half and a quarter of the range.
Neighbouring values differ by no more than a few scenes; larger ones are worse for arms.
"""

CONTACT = 1e-12
"""Largest distance, m, that counts as contact."""

_FLAT = 1e-12  # dimensionless gradient that counts as 0
_AT_LIMIT = 1e-9  # rad or characteristic lengths
_ARMIJO = 1e-4  # fraction of the decrease promised by the slope that a step must achieve
_LEAST_FACTOR = 0.1  # smallest factor by which a step that was too long is shortened
_MOST_TRIALS = 50  # of a line search


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


def nan_at_contact(distances: ArrayLike) -> Array:
    """Return distances (m,), m; NaN at contact (up to 1e-12 m) and below, where no field is defined."""
    d = np.asarray(distances, dtype=float)
    return np.where(d > CONTACT, d, np.nan)


def closeness(distances: ArrayLike, reach: float) -> Array:
    """Return 1/d - 1/d_r (m,), 1/m, for distances d < d_r; 0 beyond and NaN at contact.

    The bracket of the FIRAS potential (equation 3): continuous, and unbounded toward the obstacle.
    """
    return np.maximum(1.0 / nan_at_contact(distances) - 1.0 / reach, 0.0)


@dataclass(frozen=True)
class Firas:
    """FIRAS potential: U_f = k/2 (1/d - 1/d_r)^2 for 0 < d < d_r, and 0 beyond. It and its gradient are continuous.

    It needs only the distance and the normal, so it fits an obstacle of any shape. Along a flat side its contours are
    flat at every distance: there the total field has local minima.

    Attributes:
        strength: k, J m^2, above 0.
        reach: d_r, m, above 0: range of influence.
    """

    strength: float
    reach: float

    def value(self, distances: ArrayLike) -> Array:
        """Return the potential (m,), J, at distances (m,), m; infinite at contact."""
        value = 0.5 * self.strength * closeness(distances, self.reach) ** 2
        return np.where(np.isnan(value), np.inf, value)

    def gradient(self, distances: ArrayLike, normals: ArrayLike) -> Array:
        """Return -k (1/d - 1/d_r) / d^2 n (m, 3), N; NaN at contact.

        Args:
            distances: (m,) from the obstacle, m.
            normals: (m, 3) unit vectors from the nearest point of the obstacle: the gradient of the distance.
        """
        slope = -self.strength * closeness(distances, self.reach) / nan_at_contact(distances) ** 2
        return np.asarray(slope[..., None] * np.asarray(normals, dtype=float))


class NearestPoints(NamedTuple):
    """Points of links that are nearest to an obstacle.

    Attributes:
        joints: (m,) joints of the links.
        distances: (m,) m.
        normals: (m, 3) outward unit normals of the obstacle.
        points: (m, 3) L_i of the links, m.
    """

    joints: Integers
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
        joints = clearance.joints[clearance.pairs[:, 0]]
        of_bodies = [np.flatnonzero(clearance.groups == k) for k in range(len(bodies))]
        self._pairs = [
            {int(joint): pairs[joints[pairs] == joint] for joint in np.unique(joints[pairs])}
            for pairs in of_bodies
            if len(pairs)
        ]

    def near(self, q: Array) -> Iterator[NearestPoints]:
        """Yield the nearest points for each body in turn, at q (nq,)."""
        clearance = self._clearance
        distances = clearance.distances(q)
        for by_joint in self._pairs:
            nearest = [int(pairs[distances[pairs].argmin()]) for pairs in by_joint.values()]
            points = [clearance.nearest_points(pair) for pair in nearest]
            yield NearestPoints(
                np.array(list(by_joint)),
                distances[nearest],
                np.array([-normal for _, _, normal in points]),
                np.array([point for point, _, _ in points]),
            )

    def torques(self, near: NearestPoints, forces: Array) -> Array:
        """Return the sum (nv,) of J_i' f_i of forces (m, 3) on these points, by rad and characteristic lengths, at the
        configuration of the last `near`."""
        columns = self._clearance.jacobian
        torques = forces @ columns[:3] + np.cross(near.points, forces) @ columns[3:]
        return np.asarray((torques * self._clearance.moved_by[near.joints]).sum(axis=0) * self.mechanism.scale)


class Potential:
    """Total potential of a mechanism, U = U_a + w(U_a) sum_i sum_o U_o(L_io), dimensionless (equations 1 and 5). U_o is
    the FIRAS potential of obstacle o, L_io the point of link i that is nearest to it. Links do not repel each other:
    that is left to the barrier.

    Close to the goal w removes the repulsion: otherwise no goal within the range of an obstacle could be reached (S. S.
    Ge and Y. J. Cui, "New potential functions for mobile robot path planning", IEEE Transactions on Robotics and
    Automation 16(5), 2000).

    Args:
        scene: scene.
        links: bodies of the robot.
        reach: range of the repulsion, m.
        fading: distance from the goal below which repulsion fades, rad or characteristic lengths, above 0.

    Attributes:
        goal: attraction.
        firas: repulsion of each body. Dimensionless, as the attraction is: that of a goal at one characteristic length
            is 1/2.
    """

    def __init__(self, scene: Scene, links: Sequence[Body], reach: float, fading: float = FADING) -> None:
        mechanism, half = scene.mechanism, 0.5 * reach
        bodies = [body for obstacle in scene.obstacles for body in obstacle.bodies]
        if hollow := [each.name for each in scene.obstacles if any(piece.interior for piece in each.pieces)]:
            raise PlanningError(f"repulsive potentials need convex obstacles: '{hollow[0]}' is not; use vortices")
        self.goal, self._links, self._fading = GoalPotential(scene), LinkPoints(mechanism, links, bodies), fading
        self.firas = Firas(STRENGTH / mechanism.length * half**2 / (1.0 / half - 1.0 / reach), reach)

    def value(self, q: Array) -> float:
        """Return the potential at q (nq,); infinite at contact."""
        attraction = self.goal.value(q)
        weight, _ = self._weight(attraction)
        return attraction + weight * self.repulsion(q) if weight > 0.0 else attraction

    def gradient(self, q: Array) -> Array:
        """Return the gradient (nv,) by rad and characteristic lengths; NaN at contact."""
        attraction, (weight, slope) = self.goal.gradient(q), self._weight(self.goal.value(q))
        if slope > 0.0:
            attraction = attraction + slope * self.repulsion(q) * attraction
        return np.asarray(attraction + weight * self.repulsion_gradient(q))

    def repulsion(self, q: Array) -> float:
        """Return the sum of the obstacles' potentials at q (nq,), unfaded; infinite at contact."""
        return float(sum(self.firas.value(near.distances).sum() for near in self._links.near(q)))

    def repulsion_gradient(self, q: Array) -> Array:
        """Return the gradient (nv,) of that sum by rad and characteristic lengths; NaN at contact."""
        gradient = np.zeros_like(self._links.mechanism.scale)
        for near in self._links.near(q):
            gradient += self._links.torques(near, self.firas.gradient(near.distances, near.normals))
        return gradient

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

    repels = True  # a plan that ends there names the obstacle

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
        at_q, at_v = mechanism.structure.scalar_joints
        near = _AT_LIMIT * mechanism.scale[at_v]
        low = np.where(q[at_q] <= limits.lower[at_q] + near, 0.0, -np.inf)
        high = np.where(q[at_q] >= limits.upper[at_q] - near, 0.0, np.inf)
        direction = direction.copy()
        direction[at_v] = np.minimum(np.maximum(direction[at_v], low), high)
        if not mechanism.is_constrained:
            return direction
        motions, _ = free_motions(mechanism.structure.system.evaluate(q)[1], mechanism.loop_rank)
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


def firas(scene: Scene, clearance: Clearance, reach: float) -> Descent:
    """Return the objective that descends a `Potential`: `plan(scene, field=firas)`."""
    potential = Potential(scene, clearance.links, reach)
    return Descent(scene.mechanism, potential.value, potential.gradient)
