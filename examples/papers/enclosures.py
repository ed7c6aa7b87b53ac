"""Balls and boxes around obstacles, which `enclosing_potentials.py` uses in place of their shapes; capsules around
links."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.body import Body
from cinegen.collision.capsule import bounding_capsule, perpendicular
from cinegen.collision.obstacle_kinds import HEIGHT
from cinegen.collision.shapes import rounded_hull

_SIDES = 64  # of the prism around a cylinder
_ITERATIONS = 400  # of the bounding ball, which is then a few thousandths too large
_THIN = 1e-6  # m: least half edge of a box
_PARALLEL = 1e-9  # sine of the angle between a cylinder and the normal of the plane


class BoundingBox(NamedTuple):
    """Box around an obstacle.

    Attributes:
        middle: (3,) m.
        half: (3,) half its edges, m; infinite along the normal of a plane.
        axes: (3, 3) directions of its edges, in columns.
    """

    middle: Array
    half: Array
    axes: Array


class Enclosure:
    """Ball and box around an obstacle; in the plane, circle and rectangle around its projection along the normal.

    Args:
        body: body in the world, not a half-space.
        plane: (3,) normal of the plane of motion; None in space.
    """

    def __init__(self, body: Body, plane: Array | None) -> None:
        self._body, self._plane = body, plane
        points, self._radius = rounded_hull(body.shape, _SIDES)
        if plane is not None and isinstance(body.shape, coal.Cylinder) and _is_disc(body, plane):
            points, self._radius = np.zeros((1, 3)), float(body.shape.radius)
        self._points = np.asarray(points @ body.placement.rotation.T + body.placement.translation)

    @cached_property
    def ball(self) -> Body:
        """Ball; in the plane an upright capsule, which is a disc there: distances to it are exact."""
        if self._plane is None:
            middle, radius = _bounding_ball(self._points)
            return replace(self._body, placement=pin.SE3(np.eye(3), middle), shape=coal.Sphere(radius + self._radius))
        axes = np.column_stack([perpendicular(self._plane), self._plane])
        local = self._points @ axes
        middle, radius = _bounding_ball(local[:, :2])
        place = pin.SE3(axes, axes @ np.append(middle, local[:, 2].mean()))
        height = self._height(place.translation, self._plane)
        return replace(self._body, placement=place, shape=coal.Capsule(radius + self._radius, height))

    @cached_property
    def box(self) -> BoundingBox:
        """Box: in space the smaller of the one along the body's axes and the one along its principal axes; in the plane
        the smallest rectangle, which is along a side of the convex hull (H. Freeman and R. Shapira, 1975)."""
        boxes = []
        for axes in self._frames():
            local = self._points @ axes
            low, high = local.min(axis=0) - self._radius, local.max(axis=0) + self._radius
            half = np.maximum((high - low) / 2.0, _THIN)
            if self._plane is not None:
                half[2] = np.inf
            boxes.append((float(half[np.isfinite(half)].prod()), axes @ (low + high) / 2.0, half, axes))
        _, middle, half, axes = min(boxes, key=lambda box: box[0])
        return BoundingBox(middle, half, axes)

    @cached_property
    def box_body(self) -> Body:
        """Box as a body, as high as the obstacle where it is unbounded."""
        middle, half, axes = self.box
        edges = [2.0 * h if np.isfinite(h) else self._height(middle, axes[:, 2]) for h in half]
        return replace(self._body, placement=pin.SE3(axes, middle), shape=coal.Box(*edges))

    def _height(self, middle: Array, normal: Array) -> float:
        """Return a height along the normal of the plane, m, that covers everything given in the plane."""
        return max(HEIGHT, 2.0 * float(np.abs((self._points - middle) @ normal).max()))

    def _frames(self) -> Iterator[Array]:
        """Yield candidate axes (3, 3) of the box."""
        if self._plane is None:
            yield np.asarray(self._body.placement.rotation)
            axes = np.linalg.svd(self._points - self._points.mean(axis=0))[2].T
            yield axes * np.linalg.det(axes)
            return
        upright = np.column_stack([perpendicular(self._plane), self._plane])
        yield upright
        projected = np.unique(np.round(self._points @ upright[:, :2], 9), axis=0)
        for i in range(len(projected)):
            for side in projected[i + 1 :] - projected[i]:
                along = upright[:, :2] @ (side / np.linalg.norm(side))
                yield np.column_stack([along, np.cross(self._plane, along), self._plane])


def capsule_axis(body: Body) -> tuple[Array, float]:
    """Return the ends (2, 3) of the axis of the capsule around a body, in the frame of its joint, and its radius, m."""
    points, radius = rounded_hull(body.shape, _SIDES)
    if len(points) > 2:
        capsule = bounding_capsule(points)
        half = 0.5 * capsule.length * capsule.axis
        points, radius = np.array([capsule.middle - half, capsule.middle + half]), capsule.radius + radius
    ends = points[[0, -1]] @ body.placement.rotation.T + body.placement.translation
    return np.asarray(ends), radius


def _is_disc(body: Body, plane: Array) -> bool:
    return bool(np.linalg.norm(np.cross(body.placement.rotation[:, 2], plane)) < _PARALLEL)


def _bounding_ball(points: Array) -> tuple[Array, float]:
    """Return the centre (k,) and the radius of a ball around points (n, k), close to the smallest: M. Bădoiu and K. L.
    Clarkson, "Smaller core-sets for balls", 14th ACM-SIAM Symposium on Discrete Algorithms, 2003."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    best, least = middle, math.inf
    for i in range(1, _ITERATIONS):
        away = np.linalg.norm(points - middle, axis=1)
        if away.max() < least:
            best, least = middle, float(away.max())
        middle = middle + (points[int(away.argmax())] - middle) / (i + 1.0)
    return best, least
