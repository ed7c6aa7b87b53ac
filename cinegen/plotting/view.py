"""Views of a picture: projections onto its plane. All views of a figure have one scale."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cinegen.arrays import Array

_AZIMUTH, _ELEVATION = math.radians(-62.0), math.radians(24.0)  # of the eye of the perspective view
_FAR = 4.0  # distance of that eye, radii of the drawing


@dataclass(frozen=True, eq=False)
class Projection:
    """Projection onto a picture's plane.

    Attributes:
        name: name of the view.
        axes: (3, 3) rows: directions to the right, up and towards the eye, in the world.
        centre: (3,) middle of the picture in the world, m, where its scale is 1.
        distance: distance of the eye from there, m; infinite for parallel projection.
    """

    name: str
    axes: Array
    centre: Array
    distance: float = math.inf

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return the projections (n, 2) of points (n, 3), and their depths towards the eye, (n,); m."""
        seen = (points - self.centre) @ self.axes.T
        nearer = 1.0 / (1.0 - seen[:, 2:] / self.distance)
        return seen[:, :2] * nearer, seen[:, 2]

    def shows_front(self, point: Array, normal: Array) -> bool:
        """Return whether the eye sees the front of a plate with a point (3,) and a normal (3,)."""
        towards = self.axes[2]
        if math.isfinite(self.distance):
            towards = self.centre + self.distance * self.axes[2] - point
        return bool(normal @ towards > 0.0)


def parallel(name: str, right: Array, up: Array, centre: Array | None = None) -> Projection:
    """Return a parallel projection.

    Args:
        name: name of the view.
        right: (3,) unit vector of the world that points to the right.
        up: (3,) unit vector that points up.
        centre: (3,) middle of the picture, m; the origin unless given.
    """
    return Projection(name, np.array([right, up, np.cross(right, up)]), np.zeros(3) if centre is None else centre)


def along(normal: Array, centre: Array | None = None) -> Projection:
    """Return the view of a plane along its normal (3,): y, or else z, is up, and the axis to the right is positive."""
    up = np.eye(3)[1 if abs(normal[2]) > 0.9 else 2]
    up = up - normal * (up @ normal)
    up = up / np.linalg.norm(up)
    right = np.cross(up, normal)
    return parallel("", right * np.sign(right[np.abs(right).argmax()]), up, centre)


def views(points: Array, plane: Array | None = None) -> tuple[Projection, ...]:
    """Return a perspective, a top view (x to the right, y up) and a side view (x to the right, z up) of points (n, 3);
    for a planar mechanism with a normal (3,), one view along the normal."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    if plane is not None:
        return (along(plane, centre),)
    towards = np.array([math.cos(_AZIMUTH), math.sin(_AZIMUTH), 0.0]) * math.cos(_ELEVATION)
    towards[2] = math.sin(_ELEVATION)
    right = np.array([-math.sin(_AZIMUTH), math.cos(_AZIMUTH), 0.0])
    radius = float(np.linalg.norm(points - centre, axis=1).max()) or 1.0
    x, y, z = np.eye(3)
    return (
        Projection("perspective", np.array([right, np.cross(towards, right), towards]), centre, _FAR * radius),
        parallel("top", x, y, centre),
        parallel("side", x, z, centre),
    )
