"""Which field leads round obstacles, how strong it is, and what stands for obstacles in it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import NamedTuple, NoReturn

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.bodies.capsule import around
from cinegen.collision.body import Body
from cinegen.collision.errors import AvoidError
from cinegen.collision.scene.solid import HEIGHT
from cinegen.planning.fields import Elliptical, Firas, Spherical

Array = NDArray[np.float64]

_SIDES = 64  # of the prism that stands for a cylinder that lies
_ROUNDS = 400  # in which the smallest ball around points is found, to a few thousandths of its radius
_THIN = 1e-6  # m: half the least edge of a box
_UPRIGHT = 1e-9  # sine of the angle between a cylinder and the normal of the plane


class Field(Enum):
    """What `plan` follows round obstacles. Potentials and the paper's letter make one attempt only."""

    VORTEX = "vortex"
    """The paper's vortices, with what experience added."""
    FIRAS = "firas"
    """The antigradient of equation 3."""
    SPHERICAL = "spherical"
    """The antigradient of equation 2, around the ball that holds an obstacle."""
    ELLIPTICAL = "elliptical"
    """The antigradient of Volpe and Khosla's potential, around the box that holds an obstacle."""
    LITERAL = "literal"
    """The paper's vortices as they are printed."""
    NONE = "none"
    """Nothing turns: what leads is held clear, and that is all. Makes as many attempts as `VORTEX`."""

    @classmethod
    def _missing_(cls, value: object) -> NoReturn:
        raise AvoidError(f"there is no field {value!r}; there are {', '.join(field.value for field in cls)}")


@dataclass(frozen=True)
class Gains:
    """How strong potentials are: in lengths of the robot and in ranges, the same for all scenes.

    Attributes:
        task: lengths: in the middle of its range an obstacle pushes a point as hard as a goal so far away tasks it.
        exponent: gamma, of a spherical potential.
        decay: of an elliptical one: in a range it falls by e^-decay, and by its 1/K.
    """

    task: float
    exponent: float = 1.0
    decay: float = 2.0

    def firas(self, reach: float, length: float) -> Firas:
        """With a range (m), for a robot of a length (m). Potentials are without unit: that of a goal one length away is
        1/2."""
        half = 0.5 * reach
        return Firas(self._slope(length) * half**2 / (1.0 / half - 1.0 / reach), reach)

    def spherical(self, reach: float, length: float) -> Spherical:
        """Of offsets (m, 3) from the nearest point of a ball, m. It never ends, and is as strong at half of the range
        as the others."""
        double = 2.0 * self.exponent
        strength = self._slope(length) * (0.5 * reach) ** (double + 1.0) / double
        return Spherical(np.zeros(3), 0.0, strength, self.exponent)

    def elliptical(self, box: Box, reach: float, length: float) -> Elliptical:
        """Around a box. It never ends, and is as strong at half of the range as the others: so far beyond the end of
        its longest edge."""
        longest = float(box.half[np.isfinite(box.half)].max())
        k, decay = 0.5 * reach / longest, self.decay * longest / reach
        strength = self._slope(length) * longest * k**2 * math.exp(decay * k) / (decay * k + 1.0)
        return Elliptical(box.middle, box.half, strength, decay, axes=box.axes)

    def _slope(self, length: float) -> float:
        """1/m, of the goal's potential where it is `task` lengths away."""
        return self.task / length


class Box(NamedTuple):
    """Attributes:
    middle: (3,) m.
    half: (3,) half its edges, m; infinite along the normal of a plane.
    axes: (3, 3) its edges are along the columns.
    """

    middle: Array
    half: Array
    axes: Array


class Outline:
    """A ball and a box around an obstacle; in the plane a circle and a rectangle around what is seen along its normal.

    Args:
        body: of the world, not a half-space.
        plane: (3,) its normal, None in space.
    """

    def __init__(self, body: Body, plane: Array | None) -> None:
        self._body, self._plane = body, plane
        corners, self._swept = _corners(body, plane)
        self._corners = np.asarray(corners @ body.placement.rotation.T + body.placement.translation)

    @cached_property
    def round(self) -> Body:
        """A ball; in the plane an upright capsule, which is a disc there: distances to it are exact."""
        if self._plane is None:
            middle, radius = _ball(self._corners)
            shape = coal.Sphere(radius + self._swept)
            return replace(self._body, placement=pin.SE3(np.eye(3), middle), shape=shape)
        axes = _upright(self._plane)
        seen = self._corners @ axes
        middle, radius = _ball(seen[:, :2])
        place = pin.SE3(axes, axes @ np.append(middle, seen[:, 2].mean()))
        height = self._height(place.translation, self._plane)
        return replace(self._body, placement=place, shape=coal.Capsule(radius + self._swept, height))

    @cached_property
    def box(self) -> Box:
        """In space the smaller one of that along the body's own and that along its principal axes; in the plane the
        smallest rectangle, which lies along a side of the convex hull (H. Freeman and R. Shapira, 1975)."""
        found = []
        for axes in self._frames():
            seen = self._corners @ axes
            low, high = seen.min(axis=0) - self._swept, seen.max(axis=0) + self._swept
            half = np.maximum((high - low) / 2.0, _THIN)
            if self._plane is not None:
                half[2] = np.inf
            found.append((float(half[np.isfinite(half)].prod()), axes @ (low + high) / 2.0, half, axes))
        _, middle, half, axes = min(found, key=lambda one: one[0])
        return Box(middle, half, axes)

    @cached_property
    def boxed(self) -> Body:
        """The box, as high as the obstacle where it has no end."""
        middle, half, axes = self.box
        edges = [2.0 * h if np.isfinite(h) else self._height(middle, axes[:, 2]) for h in half]
        return replace(self._body, placement=pin.SE3(axes, middle), shape=coal.Box(*edges))

    def _height(self, middle: Array, normal: Array) -> float:
        """m, along the normal of the plane: all that is drawn in it lies between the ends."""
        return max(HEIGHT, 2.0 * float(np.abs((self._corners - middle) @ normal).max()))

    def _frames(self) -> Iterator[Array]:
        """(3, 3) that a box may lie along."""
        if self._plane is None:
            yield np.asarray(self._body.placement.rotation)
            axes = np.linalg.svd(self._corners - self._corners.mean(axis=0))[2].T
            yield axes * np.linalg.det(axes)
            return
        upright = _upright(self._plane)
        yield upright
        seen = np.unique(np.round(self._corners @ upright[:, :2], 9), axis=0)
        for i in range(len(seen)):
            for side in seen[i + 1 :] - seen[i]:
                along = upright[:, :2] @ (side / np.linalg.norm(side))
                yield np.column_stack([along, np.cross(self._plane, along), self._plane])


def axis_of(body: Body) -> tuple[Array, float]:
    """The ends (2, 3) of the axis of the capsule around a body, in the frame of its joint, and its radius, m."""
    corners, radius = _corners(body, None)
    if len(corners) > 2:
        capsule = around(corners)
        half = 0.5 * capsule.length * capsule.axis
        corners, radius = np.array([capsule.middle - half, capsule.middle + half]), capsule.radius
    ends = corners[[0, -1]] @ body.placement.rotation.T + body.placement.translation
    return np.asarray(ends), radius


def _corners(body: Body, plane: Array | None) -> tuple[Array, float]:
    """Points (n, 3) in the frame of a shape, and the radius of a ball around each, m: their hull is the shape, or a
    little more."""
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    shape = body.shape
    match shape:
        case coal.Sphere():
            return np.zeros((1, 3)), float(shape.radius)
        case coal.Capsule():
            return np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]) * shape.halfLength, float(shape.radius)
        case coal.Box():
            return signs * np.array(shape.halfSide), 0.0
        case coal.Convex():
            return np.array(shape.points()), 0.0
        case coal.Cylinder():
            if plane is not None and np.linalg.norm(np.cross(body.placement.rotation[:, 2], plane)) < _UPRIGHT:
                return np.zeros((1, 3)), float(shape.radius)  # a disc
            angles = (np.arange(_SIDES) + 0.5) * 2.0 * np.pi / _SIDES
            ring = np.column_stack([np.cos(angles), np.sin(angles)]) * shape.radius / np.cos(np.pi / _SIDES)
            return np.vstack([np.column_stack([ring, np.full(_SIDES, z * shape.halfLength)]) for z in (-1, 1)]), 0.0
    shape.computeLocalAABB()
    low, high = np.array(shape.aabb_local.min_), np.array(shape.aabb_local.max_)
    return (low + high) / 2.0 + signs * (high - low) / 2.0, 0.0


def _ball(points: Array) -> tuple[Array, float]:
    """The middle (k,) and the radius of a ball around points (n, k), next to the smallest: M. Bădoiu and K. L.
    Clarkson, "Smaller core-sets for balls", 14th ACM-SIAM Symposium on Discrete Algorithms, 2003."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    best, least = middle, np.inf
    for i in range(1, _ROUNDS):
        away = np.linalg.norm(points - middle, axis=1)
        if away.max() < least:
            best, least = middle, float(away.max())
        middle = middle + (points[int(away.argmax())] - middle) / (i + 1.0)
    return best, least


def _upright(normal: Array) -> Array:
    """(3, 3) a rotation whose last column is the normal of a plane."""
    first = np.eye(3)[int(np.abs(normal).argmin())]
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(normal, first), normal])
