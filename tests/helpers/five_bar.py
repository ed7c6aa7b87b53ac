"""Arms of two bars, and a symmetric planar five-bar, in closed form, by plane geometry and numpy alone.

The base joints are at (-half, 0) and (half, 0). Each leg has an inner bar on its base joint and an outer bar; both legs
meet at the tool. Elbows point outward.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def two_bar_angles(x, y, first, second, elbow):
    """Both angles of an arm of two bars whose end is at x and y, the second one positive for an elbow of 1 and negative
    for -1, and whether it reaches."""
    c = (x * x + y * y - first**2 - second**2) / (2.0 * first * second)
    two = elbow * np.arccos(np.clip(c, -1.0, 1.0))
    return np.arctan2(y, x) - np.arctan2(second * np.sin(two), first + second * np.cos(two)), two, np.abs(c) <= 1.0


@dataclass(frozen=True)
class FiveBar:
    """Lengths in m."""

    inner: float
    outer: float
    half: float

    def elbows(self, points: Array) -> Array:
        """(n, 2 legs, 2) intersections of the circles around base joint and tool (n, 2); NaN where there are none."""
        bases = np.array([[-self.half, 0.0], [self.half, 0.0]])
        across = points[:, None] - bases
        distance = np.linalg.norm(across, axis=2)
        with np.errstate(invalid="ignore", divide="ignore"):
            along = (distance**2 + self.inner**2 - self.outer**2) / (2.0 * distance)
            height = np.sqrt(self.inner**2 - along**2)
            unit = across / distance[..., None]
        normal = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
        return bases + along[..., None] * unit + np.array([1.0, -1.0])[:, None] * height[..., None] * normal

    def singular_values(self, points: Array) -> Array:
        """(n, 2) largest and smallest speed of the tool for unit velocities of the base joints, m/rad; the smallest is
        negative beyond a singularity of type 2; NaN where the tool can't be."""
        elbows = self.elbows(points)
        bases = np.array([[-self.half, 0.0], [self.half, 0.0]])
        outer, inner = points[:, None] - elbows, elbows - bases
        # (P - C) . dP = (P - C) . (-(C - A)_y, (C - A)_x) dq, one equation a leg
        by_joint = outer[..., 1] * inner[..., 0] - outer[..., 0] * inner[..., 1]
        det = outer[:, 0, 0] * outer[:, 1, 1] - outer[:, 0, 1] * outer[:, 1, 0]
        with np.errstate(invalid="ignore", divide="ignore"):
            first = np.stack([outer[:, 1, 1], -outer[:, 1, 0]], axis=1) * (by_joint[:, 0] / det)[:, None]
            second = np.stack([-outer[:, 0, 1], outer[:, 0, 0]], axis=1) * (by_joint[:, 1] / det)[:, None]
            squares = (first**2).sum(1) + (second**2).sum(1)
            product = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
            largest = np.sqrt((squares + np.sqrt(np.maximum(squares**2 - 4.0 * product**2, 0.0))) / 2.0)
            return np.stack([largest, np.sign(det) * np.abs(product) / largest], axis=1)

    def condition(self, points: Array) -> Array:
        """(n,) ratio of the singular values; infinite where the tool can't be, or only beyond a singularity."""
        largest, smallest = self.singular_values(points).T
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(smallest > 0.0, largest / smallest, np.inf)
