"""`View`: from where a picture is seen; all views of a figure have one scale."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_AZIMUTH, _ELEVATION = math.radians(-62.0), math.radians(24.0)  # of the eye that sees in perspective
_FAR = 4.0  # radii of all that is drawn: how far away that eye is


@dataclass(frozen=True, eq=False)
class View:
    """A picture's plane.

    Attributes:
        name: for people.
        axes: (3, 3) rows in the world: to the right, up, towards the eye.
        centre: (3,) in the world, m: the middle of the picture, where its scale is 1.
        distance: of the eye from there, m; infinite for parallel rays.
    """

    name: str
    axes: Array
    centre: Array
    distance: float = math.inf

    def project(self, points: Array) -> tuple[Array, Array]:
        """Points (n, 3) of the world in the picture, (n, 2), and how near each is to the eye, (n,); m."""
        seen = (points - self.centre) @ self.axes.T
        nearer = 1.0 / (1.0 - seen[:, 2:] / self.distance)
        return seen[:, :2] * nearer, seen[:, 2]

    def shows_front(self, point: Array, normal: Array) -> bool:
        """Whether one looks at the side of a plate that its normal (3,) points out of; (3,) is any point on it."""
        towards = self.axes[2]
        if math.isfinite(self.distance):
            towards = self.centre + self.distance * self.axes[2] - point
        return bool(normal @ towards > 0.0)


def views(points: Array, plane: Array | None = None) -> tuple[View, ...]:
    """Perspective, top view (x to the right, y up) and side view (x to the right, z up) of points (n, 3); of what moves
    in a plane with a normal (3,), one view along that."""
    low, high = points.min(axis=0), points.max(axis=0)
    centre = (low + high) / 2.0
    if plane is not None:
        up = np.eye(3)[1 if abs(plane[2]) > 0.9 else 2]
        up = up - plane * (up @ plane)
        up /= np.linalg.norm(up)
        return (View("", np.array([np.cross(up, plane), up, plane]), centre),)
    towards = np.array([math.cos(_AZIMUTH), math.sin(_AZIMUTH), 0.0]) * math.cos(_ELEVATION)
    towards[2] = math.sin(_ELEVATION)
    right = np.array([-math.sin(_AZIMUTH), math.cos(_AZIMUTH), 0.0])
    radius = float(np.linalg.norm(points - centre, axis=1).max()) or 1.0
    x, y, z = np.eye(3)
    return (
        View("perspective", np.array([right, np.cross(towards, right), towards]), centre, _FAR * radius),
        View("top", np.array([x, y, z]), centre),
        View("side", np.array([x, z, -y]), centre),
    )
