"""Whether points are the outline of a simple polygon: one that does not cross or touch itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.scene.table import LEAST

Array = NDArray[np.float64]

_MOST = 2000  # points: each edge is held against each


def area(points: Array) -> float:
    """Of a polygon (n, 2), m²; below 0 if its points run clockwise."""
    from_first = points - points[0]
    return float(cross(from_first, np.roll(from_first, -1, axis=0)).sum()) / 2.0


def cross(a: Array, b: Array) -> Array:
    """Of vectors of the plane (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def why_none(points: Array) -> str | None:
    """Why points (n, 2) enclose nothing, or cross each other; None if they are a simple polygon."""
    count = len(points)
    if count < 3:
        return f"must be at least 3, not {count}"
    if count > _MOST:
        return f"are {count}: at most {_MOST} can be read"
    ahead = np.roll(points, -1, axis=0)
    for i in np.flatnonzero(np.linalg.norm(ahead - points, axis=1) < LEAST).tolist():
        return f"say {points[i].tolist()} twice (points {i + 1} and {(i + 1) % count + 1})"
    if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] < LEAST:
        return "enclose no area: they lie on one line"
    met = _first_meeting(points, ahead)
    if met is None:
        return None
    i, j = met
    return f"cross or touch each other: the side from point {i + 1} meets the side from point {j + 1}"


def _first_meeting(start: Array, end: Array) -> tuple[int, int] | None:
    """Two sides that have a point in common, a corner between neighbours apart; None if there are none."""
    count = len(start)
    side = end - start
    # Which side of line i the start of side j lies on, and its end.
    before = cross(side[:, None], start[None] - start[:, None])
    after = cross(side[:, None], end[None] - start[:, None])
    slack = 1e-12 * np.linalg.norm(side, axis=1)[:, None] * (np.ptp(start, axis=0).max() or 1.0)
    parted = (np.minimum(before, after) > slack) | (np.maximum(before, after) < -slack)
    meet = ~parted & ~parted.T
    # Sides on one line: apart unless their boxes overlap.
    low, high = np.minimum(start, end), np.maximum(start, end)
    meet &= ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=2)
    i = np.arange(count)
    meet[i, i] = False
    following = (i + 1) % count
    back = (np.abs(cross(side, side[following])) <= slack[:, 0]) & ((side * side[following]).sum(axis=1) < 0.0)
    meet[i, following] = meet[following, i] = back  # neighbours share a corner; they may not run back
    found = np.argwhere(np.triu(meet))
    return None if len(found) == 0 else (int(found[0][0]), int(found[0][1]))
