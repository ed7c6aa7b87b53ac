"""Leg lengths at which a triangle may move while its legs rest, though the elimination finds isolated roots only.

On a curve of configurations along which the eliminated angle varies, the determinant vanishes identically, which the
elimination notices. One along which that angle stays does not show in the determinant: it needs a distance equation
that holds for every value of an angle, that is, a platform point on the axis of another one's circle. There are two
ways:

- one point is on the axes of both others, which then move on their circles at their distance, or
- two points are on the axis of the third, about which the platform turns.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly.triangle._kernels import circles as c

Array = NDArray[np.float64]

_NEAR = 1e-6  # of the manipulator's size: a point that is on an axis
_PARALLEL = 1e-6  # an axis in the plane of a circle: its sine


def may_move(circles: Array, sides: Array) -> bool:
    """Return whether a curve of configurations with a constant angle is possible.

    Args:
        circles: (3, CIRCLES_WIDTH) of the platform points, as `find_circles` writes them.
        sides: (3,) distances of platform points 0 and 1, 0 and 2, 1 and 2.
    """
    circles = circles[np.argsort(circles[:, c.PAIR])]
    reach = np.ptp(circles[:, c.CENTRE : c.CENTRE + 3], axis=0).max()
    tolerance = _NEAR * float(max(reach, circles[:, c.RADIUS].max(), sides.max()))
    for i, j, k in permutations(range(3)):
        mine, third = circles[i], circles[k]
        on_third = _on_axis(mine, third, tolerance)
        on_other = _on_axis(mine, circles[j], tolerance)
        if any(np.linalg.norm(x - y) <= tolerance for x in on_third for y in on_other):
            return True
        others = _on_axis(circles[j], third, tolerance)
        if any(abs(np.linalg.norm(x - y) - sides[i + j - 1]) <= tolerance for x in on_third for y in others):
            return True
    return False


def _on_axis(circle: Array, other: Array, tolerance: float) -> list[Array]:
    """Return the points (3,) of a circle that are on the axis of another one; two at most."""
    centre, e, f, radius = (
        circle[c.CENTRE : c.CENTRE + 3],
        circle[c.E : c.E + 3],
        circle[c.F : c.F + 3],
        circle[c.RADIUS],
    )
    through, along = other[c.CENTRE : c.CENTRE + 3], np.cross(other[c.E : c.E + 3], other[c.F : c.F + 3])
    # (centre + radius (e cos p + f sin p) - through) x along = 0
    u, sigma, vt = np.linalg.svd(np.column_stack([np.cross(e, along), np.cross(f, along)]), full_matrices=False)
    right = u.T @ np.cross(through - centre, along) / radius
    if sigma[1] > _PARALLEL:
        found = [vt.T @ (right / sigma)]
    else:
        nearest = right[0] / sigma[0]
        half = np.sqrt(max(0.0, 1.0 - nearest**2))
        found = [nearest * vt[0] + half * vt[1], nearest * vt[0] - half * vt[1]]
    points = []
    for x in found:
        cosine, sine = x / max(float(np.linalg.norm(x)), 1e-300)
        point = centre + radius * (cosine * e + sine * f)
        if np.linalg.norm(np.cross(point - through, along)) <= tolerance:
            points.append(point)
    return points
