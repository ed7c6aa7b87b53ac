"""`Descent`: down the potential of all that attracts and repels, in the space of the joints."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body
from cinegen.collision.clearance import Clearance
from cinegen.collision.scene import Scene
from cinegen.ik.objectives import State
from cinegen.ik.resolve import free_motions
from cinegen.ik.task import FrameTask
from cinegen.joints import supporting_columns
from cinegen.model import Mechanism
from cinegen.planning.fields import Elliptical, Firas, Spherical, line_search
from cinegen.planning.keep import stop
from cinegen.planning.planar import plane_of
from cinegen.planning.planner.field import Field, Gains, Outline, axis_of

Array = NDArray[np.float64]

GAINS = {Field.FIRAS: Gains(0.1), Field.SPHERICAL: Gains(0.1), Field.ELLIPTICAL: Gains(0.1)}
"""How strong each is unless it is said.

Tried on 40 scenes of a planar 3R and 40 of a mobile point: tasks of 0.01 to 3 lengths (FIRAS, also with a half and a
quarter of the range), 0.03 to 1 with exponents of 0.5, 1 and 2 (spherical), 0.01 to 1 with decays of 1 to 8
(elliptical). Between neighbours of these nothing differs by more than a few scenes; strong ones are worse for arms.
"""

LONGEST = 0.06
"""Rad or lengths: a step of a joint, at most."""

FADING = 0.2
"""Rad or lengths from the goal: from there on repulsion fades. Without that, a spherical potential, which never ends,
reached 23 of those 40 goals of a mobile point instead of 37."""

_FLAT = 1e-12  # a gradient without unit that leads nowhere
_AT_LIMIT = 1e-9  # rad or lengths
_ALONG = 9  # points of a link's axis


class Goal:
    """Equation 1, without unit: half the square of what is left, in lengths and rad.

    Args:
        scene: whose goal it is.
    """

    def __init__(self, scene: Scene) -> None:
        self._mechanism, self._node = scene.mechanism, scene.node
        self._task = FrameTask(scene.node, scene.goal, scene.translation, scene.rotation, axes="world")
        self._units = np.repeat([1.0 / scene.mechanism.length, 1.0], [scene.translation, scene.rotation])

    def value(self, q: Array) -> float:
        """At q (nq,)."""
        error = self._units * np.concatenate(self._task.errors(self._placement(q), np.eye(3)))
        return 0.5 * float(error @ error)

    def gradient(self, q: Array) -> Array:
        """(nv,) by rad and lengths."""
        jacobian = self._mechanism.jacobian(q, self._node)
        error, rows = self._task.equations(self._placement(q), jacobian, np.eye(3))
        return np.asarray(-(self._units**2 * error) @ rows * self._mechanism.scale)

    def way(self, q: Array) -> Array:
        """(3,) from the node to where it is to go, as far as that counts, m."""
        straight, _ = self._task.errors(self._placement(q), np.eye(3))
        return np.pad(straight, (0, 3 - len(straight)))

    def _placement(self, q: Array) -> pin.SE3:
        return self._mechanism.placement(q, self._node)


class Near(NamedTuple):
    """Where links are nearest to an obstacle.

    Attributes:
        joints: (m,) that the links move with.
        distances: (m,) m.
        normals: (m, 3) out of the obstacle.
        points: (m, 3) L_i of the links, m.
    """

    joints: NDArray[np.int64]
    distances: Array
    normals: Array
    points: Array

    @property
    def offsets(self) -> Array:
        """(m, 3) from the nearest points of the obstacle; 0 in it."""
        return self.distances[:, None].clip(0.0) * self.normals


class Links:
    """One point of each link for each obstacle. A link is all that moves with a joint.

    Args:
        mechanism: whose links.
        bodies: of these.
        obstacles: bodies of the world.
    """

    def __init__(self, mechanism: Mechanism, bodies: Sequence[Body], obstacles: Sequence[Body]) -> None:
        self._clearance = clearance = Clearance(mechanism, bodies, obstacles)
        self.mechanism = mechanism

        def met(pair: int) -> tuple[int, int]:
            link, obstacle = clearance.pairs[pair].tolist()
            return obstacle - len(bodies), bodies[link].joint

        ordered = sorted(range(len(clearance.pairs)), key=met)
        self._pairs = [(*key, np.array(list(pairs))) for key, pairs in groupby(ordered, met)]

    def near(self, q: Array) -> Iterator[Near]:
        """Of each obstacle in turn, at q (nq,)."""
        clearance = self._clearance
        distances = clearance.distances(q)
        for _, links in groupby(self._pairs, lambda one: one[0]):
            joints, nearest = [], []
            for _, joint, pairs in links:
                joints.append(joint)
                nearest.append(int(pairs[distances[pairs].argmin()]))
            found = [clearance.points(pair) for pair in nearest]
            yield Near(
                np.array(joints),
                distances[nearest],
                np.array([-normal for _, _, normal in found]),
                np.array([one for one, _, _ in found]),
            )

    def moved(self, near: Near, forces: Array) -> Array:
        """(nv,) the sum of J_i' f_i of forces (m, 3) on these points, by rad and lengths; q as it was seen last."""
        columns = self._clearance.jacobian
        torques = forces @ columns[:3] + np.cross(near.points, forces) @ columns[3:]
        return np.asarray((torques * self._clearance.moved_by[near.joints]).sum(axis=0) * self.mechanism.scale)


class Nearest:
    """What repels links by their distance, equation 5: L_i is the nearest point of each link.

    Args:
        links: and the obstacles, or the balls around them.
        fields: of these, in their order.
    """

    def __init__(self, links: Links, fields: Sequence[Firas | Spherical]) -> None:
        self._links, self._fields = links, fields

    def value(self, q: Array) -> float:
        """At q (nq,); infinite at contact."""
        found = 0.0
        for near, field in zip(self._links.near(q), self._fields, strict=True):
            values = field.value(near.distances) if isinstance(field, Firas) else field.value(near.offsets)
            found += float(values.sum())
        return found

    def gradient(self, q: Array) -> Array:
        """(nv,) by rad and lengths; nan at contact."""
        found = np.zeros_like(self._links.mechanism.scale)
        for near, field in zip(self._links.near(q), self._fields, strict=True):
            if isinstance(field, Firas):
                found += self._links.moved(near, field.gradient(near.distances, near.normals))
            else:
                found += self._links.moved(near, field.gradient(near.offsets))
        return found


class Greatest:
    """What repels links by more than their distance, equation 5: L_i is where the potential of a link is greatest.

    The nearest point would not do: from one end of a link to the other it leaps between contours, and the potential
    with it. So links are the capsules around them, and L_i lies straight from a point of the axis towards the box; that
    is found among `_ALONG` points, and by a parabola through the best of them and those beside it.

    Args:
        mechanism: whose links.
        bodies: of these.
        fields: around obstacles.
    """

    def __init__(self, mechanism: Mechanism, bodies: Sequence[Body], fields: Sequence[Elliptical]) -> None:
        self._mechanism, self._fields = mechanism, fields
        self._model, self._data = mechanism.model, mechanism.model.createData()
        moving = sorted((body for body in bodies if body.joint != 0), key=lambda body: body.joint)
        self._joints = [body.joint for body in moving]
        self._links = [list(links) for _, links in groupby(range(len(moving)), lambda i: self._joints[i])]
        self._axes = [axis_of(body) for body in moving]
        self._moves = np.array([supporting_columns(self._model, joint) for joint in self._joints])

    def value(self, q: Array) -> float:
        """At q (nq,); infinite at contact."""
        pin.forwardKinematics(self._model, self._data, q)
        return float(sum(field.value(self._greatest(field)[1]).sum() for field in self._fields))

    def gradient(self, q: Array) -> Array:
        """(nv,) by rad and lengths; nan at contact."""
        pin.computeJointJacobians(self._model, self._data, q)
        columns, found = np.asarray(self._data.J), np.zeros(self._model.nv)
        for field in self._fields:
            axis, points, turns, which = self._greatest(field)
            forces = np.einsum("mji,mj->mi", turns, field.gradient(points))
            torques = forces @ columns[:3] + np.cross(axis, forces) @ columns[3:]
            found += (torques * self._moves[which]).sum(axis=0)
        return found * self._mechanism.scale

    def _greatest(self, field: Elliptical) -> tuple[Array, Array, Array, list[int]]:
        """Of each link: (m, 3) the point of its axis, (m, 3) L_i, (m, 3, 3) how this follows that, and which body."""
        placed = [self._data.oMi[joint] for joint in self._joints]
        ends = np.array(
            [axis @ at.rotation.T + at.translation for (axis, _), at in zip(self._axes, placed, strict=True)]
        )
        radii = np.array([radius for _, radius in self._axes])
        begin, along = ends[:, 0], ends[:, 1] - ends[:, 0]
        if len(self._links) == len(ends) and not along.any():  # balls: there is nothing to look for
            return begin, *_towards(field, begin, radii), list(range(len(ends)))
        parts = np.linspace(0.0, 1.0, _ALONG)
        axis = begin[:, None] + parts[:, None] * along[:, None]
        apart = field.pseudo_distance(_towards(field, axis, radii[:, None])[0])
        every, at = np.arange(len(begin)), apart.argmin(axis=1)
        inner = at.clip(1, _ALONG - 2)
        before, here, after = apart[every, inner - 1], apart[every, inner], apart[every, inner + 1]
        bend = before - 2.0 * here + after
        aside = np.where(bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), 0.0).clip(-1.0, 1.0)
        best = axis[every, at]
        between = begin + ((inner + aside) / (_ALONG - 1.0))[:, None] * along
        there = field.pseudo_distance(_towards(field, between, radii)[0])
        best = np.where((there < apart.min(axis=1))[:, None], between, best)
        least = np.minimum(there, apart.min(axis=1))
        which = [min(link, key=lambda i: float(least[i])) for link in self._links]
        points, turns = _towards(field, best[which], radii[which])
        return best[which], points, turns, which


class Potential:
    """The total potential of a mechanism, U = U_a + w(U_a) sum_i sum_o U_o(L_io), without unit: equations 1 and 5 of De
    Medio and Oriolo 1991. L_io is the point of link i that obstacle o repels; a link is all that moves with a joint.
    Links don't repel each other: that is left to the barrier.

    Close to the goal w takes repulsion away; otherwise no goal could be reached that is in reach of an obstacle, and
    none at all where a potential never ends (S. S. Ge and Y. J. Cui, "New potential functions for mobile robot path
    planning", IEEE Transactions on Robotics and Automation 16(5), 2000).

    A half-space, which has neither ball nor box around it, repels by FIRAS. So does an obstacle whose ball or box holds
    the goal, or part of the robot at the start: with all of that forbidden, nothing could be tried.

    Args:
        scene: what is where.
        bodies: of the robot.
        field: FIRAS, SPHERICAL or ELLIPTICAL.
        reach: m, of FIRAS; the others have no end.
        gains: how strong it is; those of the field in `GAINS` unless given.
        fading: rad or lengths from the goal, from where on repulsion fades; above 0.

    Attributes:
        goal: the attraction.
        fields: of all obstacles' bodies.
    """

    def __init__(
        self,
        scene: Scene,
        bodies: Sequence[Body],
        field: Field,
        reach: float,
        gains: Gains | None = None,
        fading: float = FADING,
    ) -> None:
        self.goal, self._fading = Goal(scene), fading
        mechanism, plane, gains = scene.mechanism, plane_of(scene.mechanism), gains or GAINS[field]
        obstacles = [body for obstacle in scene.obstacles for body in obstacle.bodies]
        firas = GAINS[Field.FIRAS].firas(reach, mechanism.length)
        kept = stop(scene.mechanism, scene.safety)
        stand, self.fields = list(obstacles), list[Firas | Spherical | Elliptical]()
        for i, body in enumerate(obstacles):
            self.fields.append(gains.firas(reach, mechanism.length) if field is Field.FIRAS else firas)
            if field is Field.FIRAS or not np.isfinite(body.radius):
                continue
            outline = Outline(body, plane)
            around = outline.round if field is Field.SPHERICAL else outline.boxed
            near = next(Links(mechanism, bodies, [around]).near(scene.start))
            if near.distances.min() <= kept or _holds(around, scene.goal.translation):
                continue
            stand[i] = around
            if field is Field.SPHERICAL:
                self.fields[i] = gains.spherical(reach, mechanism.length)
            else:
                self.fields[i] = gains.elliptical(outline.box, reach, mechanism.length)
        boxes = [one for one in self.fields if isinstance(one, Elliptical)]
        others = [(body, one) for body, one in zip(stand, self.fields, strict=True) if not isinstance(one, Elliptical)]
        self._parts: list[Nearest | Greatest] = []
        if others:
            links = Links(mechanism, bodies, [body for body, _ in others])
            self._parts.append(Nearest(links, [one for _, one in others]))
        if boxes:
            self._parts.append(Greatest(mechanism, bodies, boxes))

    def value(self, q: Array) -> float:
        """At q (nq,); infinite at contact."""
        attraction = self.goal.value(q)
        weight, _ = self._weight(attraction)
        return attraction + weight * self._repulsion(q) if weight > 0.0 else attraction

    def gradient(self, q: Array) -> Array:
        """(nv,) by rad and lengths; nan at contact."""
        led, (weight, slope) = self.goal.gradient(q), self._weight(self.goal.value(q))
        if slope > 0.0:
            led = led + slope * self._repulsion(q) * led
        return sum((weight * part.gradient(q) for part in self._parts), led)

    def _repulsion(self, q: Array) -> float:
        return sum(part.value(q) for part in self._parts)

    def _weight(self, attraction: float) -> tuple[float, float]:
        """w = 1 - (1 - u)^2, with u the square of what is left by that where it begins, and its derivative by U_a."""
        by = 2.0 / self._fading**2
        rest = max(1.0 - by * attraction, 0.0)
        return 1.0 - rest * rest, 2.0 * by * rest


class Descent:
    """An objective: the antigradient of a potential, as far as a line search goes, `LONGEST` at most.

    Args:
        mechanism: which moves.
        value: of the potential at q (nq,).
        gradient: (nv,) of it, by rad and lengths.
    """

    def __init__(
        self, mechanism: Mechanism, value: Callable[[Array], float], gradient: Callable[[Array], Array]
    ) -> None:
        self._mechanism, self._value, self._gradient = mechanism, value, gradient

    def velocity(self, state: State) -> Array:
        """(nv,) rad/s and m/s."""
        mechanism, scale, q = self._mechanism, self._mechanism.scale, state.q
        gradient = self._gradient(q)
        way = self._free(q, -gradient)
        largest = float(np.abs(way).max(initial=0.0))
        if not largest > _FLAT:  # nan too: in what the potential takes for the obstacle
            return np.zeros_like(gradient)

        def along(step: float) -> float:
            return self._value(mechanism.integrate(q, step * way * scale))

        return line_search(along, float(gradient @ way), LONGEST / largest) * way * scale / state.dt

    def _free(self, q: Array, way: Array) -> Array:
        """(nv,) what of a way neither loops nor limits forbid, by rad and lengths."""
        mechanism, limits = self._mechanism, self._mechanism.limits
        at_q, at_v = mechanism.scalar_joints
        near = _AT_LIMIT * mechanism.scale[at_v]
        low = np.where(q[at_q] <= limits.lower[at_q] + near, 0.0, -np.inf)
        high = np.where(q[at_q] >= limits.upper[at_q] - near, 0.0, np.inf)
        way = way.copy()
        way[at_v] = np.minimum(np.maximum(way[at_v], low), high)
        if not mechanism.loops:
            return way
        motions, _ = free_motions(mechanism.system.evaluate(q)[1], mechanism.loop_rank)
        return np.asarray(motions @ (motions.T @ way))


def _towards(field: Elliptical, axis: Array, radii: Array) -> tuple[Array, Array]:
    """From points of axes (..., 3) straight towards a box, by the radius of a capsule (...): (..., 3) where that leads,
    the middle of the box where it leads in; and (..., 3, 3) the derivative of it by the point."""
    local = (axis - field.centre) @ field.axes
    off = local - np.clip(local, -field.half, field.half)
    apart = np.linalg.norm(off, axis=-1)
    clear = apart > radii
    normal = off / np.where(clear, apart, 1.0)[..., None]
    part = (radii / np.where(clear, apart, 1.0))[..., None]
    points = np.where(clear[..., None], local - radii[..., None] * normal, 0.0)
    across = (off != 0.0)[..., None] * np.eye(3) - normal[..., :, None] * normal[..., None, :]
    turns = field.axes @ (np.eye(3) - part[..., None] * across) @ field.axes.T
    return points @ field.axes.T + field.centre, turns


def _holds(body: Body, point: Array) -> bool:
    """Whether a body of the world holds a point (3,)."""
    place, request = body.placement, coal.DistanceRequest()
    own, at = coal.Transform3s(place.rotation, place.translation), coal.Transform3s(np.eye(3), point)
    return bool(coal.distance(body.shape, own, coal.Sphere(0.0), at, request, coal.DistanceResult()) <= 0.0)
