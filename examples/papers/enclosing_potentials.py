"""Two repulsive potentials, for comparison with `cinegen.planning.plan`: spherical around the bounding ball of an
obstacle, and elliptical around its bounding box.

    python examples/papers/enclosing_potentials.py robots/scenes/rod.toml --field spherical --plot rod.png

The spherical potential is equation 2 of C. De Medio and G. Oriolo, "Robot obstacle avoidance using vortex fields",
Advances in Robot Kinematics, Springer 1991; the elliptical one is Volpe and Khosla's (`elliptical_potential.py`). As
with FIRAS the robot follows the antigradient by line search, in one attempt, and keeps the same safety distance.
`benchmarks/avoidance.py` compares them.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import coal
import numpy as np
import pinocchio as pin
from elliptical_potential import Elliptical
from enclosures import BoundingBox, Enclosure, capsule_axis
from firas import FADING, STRENGTH, Descent, LinkPoints, Potential, nan_at_contact
from numpy.typing import ArrayLike, NDArray
from vortex_field import require_positive

from cinegen.collision import Clearance, Scene, load_scene
from cinegen.collision.body import Body
from cinegen.collision.obstacle import Obstacle
from cinegen.joints import supporting_columns
from cinegen.model import Mechanism
from cinegen.model.motion_plane import motion_plane
from cinegen.planning import plan
from cinegen.planning.clearance_barrier import stop_distance

Array = NDArray[np.float64]

_ALONG = 9  # points of a link's axis


@dataclass(frozen=True)
class Spherical:
    """Spherical potential: U_r1 = k / d^(2 gamma), which is equation 2 for a point.

    "Potential (2) can be easily modified for the case of obstacles with center in A and maximum radius r, by letting it
    go to infinity at a distance r from A": d is the distance from the ball around the obstacle. Its contours have a
    higher curvature than those of the attraction, so one such obstacle creates no minimum; but the whole ball is
    forbidden, also around a long rod. The potential has no range: it decreases, and never ends.

    Attributes:
        strength: k, J m^(2 gamma).
        exponent: gamma; the larger, the faster the potential decreases.

    Raises:
        FieldError: the strength or the exponent is not a finite number above 0.
    """

    strength: float
    exponent: float = 1.0

    def __post_init__(self) -> None:
        require_positive("the strength of a spherical potential", self.strength)
        require_positive("the exponent of a spherical potential", self.exponent)

    def value(self, distances: ArrayLike) -> Array:
        """Return the potential (m,), J, at distances (m,) from the ball, m; infinite at contact."""
        value = self.strength / nan_at_contact(distances) ** (2.0 * self.exponent)
        return np.where(np.isnan(value), np.inf, value)

    def gradient(self, distances: ArrayLike, normals: ArrayLike) -> Array:
        """Return -2 gamma k / d^(2 gamma + 1) n (m, 3), N; NaN at contact.

        Args:
            distances: (m,) from the ball, m.
            normals: (m, 3) unit vectors from the nearest point of the ball.
        """
        double = 2.0 * self.exponent
        slope = -double * self.strength / nan_at_contact(distances) ** (double + 1.0)
        return np.asarray(slope[..., None] * np.asarray(normals, dtype=float))


@dataclass(frozen=True)
class Gains:
    """Strength of both potentials, in characteristic lengths of the robot and in ranges: the same for all scenes.

    Tried on 40 scenes of a planar 3R and 40 of a mobile point: strengths of 0.03 to 1 characteristic lengths with
    exponents of 0.5, 1 and 2 (spherical), 0.01 to 1 with decays of 1 to 8 (elliptical). Neighbouring values differ by
    no more than a few scenes; larger ones are worse for arms.

    Attributes:
        strength: characteristic lengths: at half its range an obstacle repels a point as strongly as a goal at that
            distance attracts it.
        exponent: gamma, of a spherical potential.
        decay: of an elliptical potential: within its range it falls by e^-decay, and by its 1/K.
    """

    strength: float = STRENGTH
    exponent: float = 1.0
    decay: float = 2.0

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


class SphericalPotential(Potential):
    """Total potential with spherical repulsion. A half-space, which has no bounding ball, repels by FIRAS. So does an
    obstacle whose ball contains the goal, or part of the robot at the start.

    The repulsion never ends, so it must fade near the goal: without fading it reached 23 of 40 goals of a mobile point
    instead of 37.

    Args:
        scene: scene.
        links: bodies of the robot.
        reach: range of FIRAS, m.
        gains: strength.
        fading: distance from the goal below which repulsion fades, rad or characteristic lengths, above 0.

    Attributes:
        spherical: potential around each ball.
        balls: balls around obstacles.
    """

    def __init__(
        self, scene: Scene, links: Sequence[Body], reach: float, gains: Gains | None = None, fading: float = FADING
    ) -> None:
        others, enclosed = _separate(scene, links, lambda enclosure: enclosure.ball)
        super().__init__(others, links, reach, fading)
        self.spherical = (gains or Gains()).spherical(reach, scene.mechanism.length)
        self.balls = [enclosure.ball for enclosure in enclosed]
        self._points = LinkPoints(scene.mechanism, links, self.balls)

    def repulsion(self, q: Array) -> float:
        """Return the sum of the obstacles' potentials at q (nq,), unfaded; infinite at contact."""
        points = self._points.near(q)
        return super().repulsion(q) + float(sum(self.spherical.value(near.distances).sum() for near in points))

    def repulsion_gradient(self, q: Array) -> Array:
        """Return the gradient (nv,) of that sum by rad and characteristic lengths; NaN at contact."""
        gradient = super().repulsion_gradient(q)
        for near in self._points.near(q):
            gradient += self._points.torques(near, self.spherical.gradient(near.distances, near.normals))
        return gradient


class EllipticalPotential(Potential):
    """Total potential with elliptical repulsion. A half-space, which has no bounding box, repels by FIRAS. So does an
    obstacle whose box contains the goal, or part of the robot at the start.

    Args:
        scene: scene.
        links: bodies of the robot.
        reach: range of FIRAS, m.
        gains: strength.
        fading: distance from the goal below which repulsion fades, rad or characteristic lengths, above 0.

    Attributes:
        boxes: potentials around boxes.
    """

    def __init__(
        self, scene: Scene, links: Sequence[Body], reach: float, gains: Gains | None = None, fading: float = FADING
    ) -> None:
        others, enclosed = _separate(scene, links, lambda enclosure: enclosure.box_body)
        super().__init__(others, links, reach, fading)
        gains, length = gains or Gains(), scene.mechanism.length
        self.boxes = [gains.elliptical(enclosure.box, reach, length) for enclosure in enclosed]
        self._capsules = LinkCapsules(scene.mechanism, links, self.boxes)

    def repulsion(self, q: Array) -> float:
        """Return the sum of the obstacles' potentials at q (nq,), unfaded; infinite at contact."""
        return super().repulsion(q) + self._capsules.value(q)

    def repulsion_gradient(self, q: Array) -> Array:
        """Return the gradient (nv,) of that sum by rad and characteristic lengths; NaN at contact."""
        return super().repulsion_gradient(q) + self._capsules.gradient(q)


class LinkCapsules:
    """Repulsion of links by elliptical potentials (equation 5): L_i is where the potential of a link is greatest.

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
        columns, gradient = np.asarray(self._data.J), np.zeros(self._model.nv)
        for field in self._fields:
            axis, points, derivatives, which = self._greatest(field)
            forces = np.einsum("mji,mj->mi", derivatives, field.gradient(points))
            torques = forces @ columns[:3] + np.cross(axis, forces) @ columns[3:]
            gradient += (torques * self._moves[which]).sum(axis=0)
        return gradient * self._mechanism.scale

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
        before, middle, after = distances[every, inner - 1], distances[every, inner], distances[every, inner + 1]
        curvature = before - 2.0 * middle + after
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


def spherical(scene: Scene, clearance: Clearance, reach: float) -> Descent:
    """Return the objective that descends a `SphericalPotential`: `plan(scene, field=spherical)`."""
    potential = SphericalPotential(scene, clearance.links, reach)
    return Descent(scene.mechanism, potential.value, potential.gradient)


def elliptical(scene: Scene, clearance: Clearance, reach: float) -> Descent:
    """Return the objective that descends an `EllipticalPotential`: `plan(scene, field=elliptical)`."""
    potential = EllipticalPotential(scene, clearance.links, reach)
    return Descent(scene.mechanism, potential.value, potential.gradient)


FIELDS = {function.__name__: function for function in (spherical, elliptical)}


def _separate(scene: Scene, links: Sequence[Body], shape: Callable[[Enclosure], Body]) -> tuple[Scene, list[Enclosure]]:
    """Return the scene with only those bodies that have to repel by FIRAS, and the enclosures of all others."""
    plane, kept = motion_plane(scene.mechanism), stop_distance(scene.mechanism, scene.safety)
    others, enclosed = list[Obstacle](), list[Enclosure]()
    for body in (body for obstacle in scene.obstacles for body in obstacle.bodies):
        if np.isfinite(body.radius):
            enclosure = Enclosure(body, plane)
            around = shape(enclosure)
            near = next(LinkPoints(scene.mechanism, links, [around]).near(scene.start))
            if near.distances.min() > kept and not _contains(around, scene.goal.translation):
                enclosed.append(enclosure)
                continue
        others.append(Obstacle(body.name, (body,)))
    return replace(scene, obstacles=tuple(others)), enclosed


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
    placement, at = coal.Transform3s(pose.rotation, pose.translation), coal.Transform3s(np.eye(3), point)
    return bool(coal.distance(body.shape, placement, coal.Sphere(0.0), at, request, coal.DistanceResult()) <= 0.0)


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Plan with a potential around the bounding balls or boxes of obstacles."
    )
    parser.add_argument("scenes", nargs="+", metavar="SCENE", help="a .toml or .json file")
    parser.add_argument("--field", choices=tuple(FIELDS), default="spherical")
    parser.add_argument("--plot", metavar="FILE", help="draw the path of the last scene (.png, .svg, .pdf)")
    options = parser.parse_args()
    for path in options.scenes:
        planned = plan(load_scene(path), field=FIELDS[options.field])
        print(f"{path}: {planned}")
        print(f"  {len(planned.path) - 1} steps, path of the node {1e3 * planned.length:.0f} mm, ", end="")
        print(f"clearance {1e3 * planned.clearance:.3g} mm ({1e3 * planned.scene.safety:.3g} mm required)")
    if options.plot:
        from cinegen.plotting import draw_plan

        draw_plan(planned).savefig(options.plot)


if __name__ == "__main__":
    main()
