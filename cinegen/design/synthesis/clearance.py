"""Distances between the bars of a mechanism, and from obstacles, with their derivatives by a design's columns.

Bars are capsules around the segments of `DimensionedBars`. Where two segments are nearest, at fractions u and v of
them, the derivative of the distance is that of the two points there, with u and v at rest (envelope theorem).
"""

from __future__ import annotations

import numpy as np

from cinegen.arrays import Array
from cinegen.design.dimensions import DimensionedBars
from cinegen.design.errors import DesignError
from cinegen.design.evaluation import DesignEvaluation
from cinegen.design.synthesis.reaching import Reaching
from cinegen.design.synthesis.task import DesignClearance

_MEETING = 1e-9  # characteristic lengths
_LEAST = 1e-300


class BarClearance:
    """Distances between bars of one mechanism, and between them and obstacles.

    Pairs that are on one body, or that meet in all sampled configurations, as neighbours do at their joint, are left
    out. So are obstacles and bars that do not move.

    Args:
        wanted: distances, radius of the bars, obstacles.
        reaching: of the mechanism.

    Attributes:
        least: distance that is wanted, m.
        names: of the pairs.

    Raises:
        DesignError: there is nothing whose distance could be too small.
    """

    def __init__(self, wanted: DesignClearance, reaching: Reaching) -> None:
        self.least = wanted.least
        self.bars = DimensionedBars(reaching.parameters)
        mechanism, count = reaching.mechanism, len(self.bars.bars)
        joints = [
            tuple(mechanism.model.frames[mechanism.frame_id(node)].parentJoint for node in bar.nodes)
            for bar in self.bars.bars
        ]
        self._obstacles = np.array([[a, b] for a, b, _ in wanted.obstacles]).reshape(-1, 2, 3)
        radii = np.array([wanted.radius] * count + [radius for _, _, radius in wanted.obstacles])
        samples = np.array([mechanism.q_home, *mechanism.random_closed(8)])
        ends = self._ends(reaching.evaluate(reaching.parameters.values, samples), reaching.parameters.values)
        first, second = np.triu_indices(count + len(self._obstacles), 1)
        apart = segment_distances(ends[:, first], ends[:, second])[0] > _MEETING * mechanism.length
        kept = [
            k
            for k, (a, b) in enumerate(zip(first.tolist(), second.tolist(), strict=True))
            if a < count and apart[:, k].any()
            and ((b < count and not set(joints[a]) & set(joints[b])) or (b >= count and joints[a] != (0, 0)))
        ]  # fmt: skip
        if not kept:
            raise DesignError(f"clearance: {mechanism.name} has no two bars that could come near each other")
        self._first, self._second = first[kept], second[kept]
        self._sum = radii[self._first] + radii[self._second]
        labels = [bar.name for bar in self.bars.bars] + [f"obstacle {i}" for i in range(1, len(wanted.obstacles) + 1)]
        self.names = [f"{labels[a]}, {labels[b]}" for a, b in zip(self._first, self._second, strict=True)]

    def at(self, evaluation: DesignEvaluation, p: Array, free: list[int]) -> tuple[Array, Array]:
        """Return the distances (count, pairs) between surfaces, m, and their derivatives (count, pairs, columns).

        Args:
            evaluation: of a design at configurations.
            p: (parameters,) m and rad.
            free: columns of the design that are the parameters.
        """
        local, by_p = self.bars.at(p)
        ends, velocities = self._ends(evaluation, p), self._velocities(evaluation, local, by_p, free)
        i, j = self._first, self._second
        distance, u, v, unit = segment_distances(ends[:, i], ends[:, j])
        first = _between(velocities[:, i], u[..., None])
        second = _between(velocities[:, j], v[..., None])
        return distance - self._sum, np.einsum("cpx,cpxk->cpk", unit, first - second)

    def _ends(self, evaluation: DesignEvaluation, p: Array) -> Array:
        """Return both ends (count, bars and obstacles, 2, 3) in the world, m."""
        local = self.bars.at(p)[0]
        placed = {node: evaluation.placements(node) for bar in self.bars.bars for node in bar.nodes}
        ends = np.zeros((len(evaluation), len(local), 2, 3))
        for b, bar in enumerate(self.bars.bars):
            for e, node in enumerate(bar.nodes):
                ends[:, b, e] = placed[node][:, :3, :3] @ local[b, e] + placed[node][:, :3, 3]
        obstacles = np.broadcast_to(self._obstacles, (len(evaluation), *self._obstacles.shape))
        return np.concatenate([ends, obstacles], axis=1)

    def _velocities(self, evaluation: DesignEvaluation, local: Array, by_p: Array, free: list[int]) -> Array:
        """Return the derivatives (count, bars and obstacles, 2, 3, columns) of the ends."""
        nodes = {node for bar in self.bars.bars for node in bar.nodes}
        placed, twists = ({node: of(node) for node in nodes} for of in (evaluation.placements, evaluation.node_twists))
        columns = len(evaluation.design.names)
        velocities = np.zeros((len(evaluation), len(local) + len(self._obstacles), 2, 3, columns))
        for b, bar in enumerate(self.bars.bars):
            for e, node in enumerate(bar.nodes):
                rotation, twist = placed[node][:, :3, :3], twists[node]
                point = rotation @ local[b, e] + placed[node][:, :3, 3]
                moved = twist[..., :3] + np.cross(twist[..., 3:], point[:, None])
                velocities[:, b, e] = np.swapaxes(moved, 1, 2)
                velocities[:, b, e][..., free] += rotation @ by_p[b, e]
        return velocities


def segment_distances(first: Array, second: Array) -> tuple[Array, Array, Array, Array]:
    """Return the distances (...) of segments (..., 2, 3), the fractions u and v (...) of them where they are nearest,
    and the unit vector (..., 3) from the second to the first there (0 where they meet).

    C. Ericson, "Real-Time Collision Detection", 2005, section 5.1.9.
    """
    a, b = first[..., 1, :] - first[..., 0, :], second[..., 1, :] - second[..., 0, :]
    r = first[..., 0, :] - second[..., 0, :]

    def dot(x: Array, y: Array) -> Array:
        return np.asarray((x * y).sum(axis=-1))

    aa, bb, ab, ar, br = dot(a, a), dot(b, b), dot(a, b), dot(a, r), dot(b, r)
    determinant = aa * bb - ab * ab
    parallel = determinant <= 1e-12 * aa * bb
    u = np.where(parallel, 0.0, np.clip((ab * br - ar * bb) / np.where(parallel, 1.0, determinant), 0.0, 1.0))
    v = (ab * u + br) / np.maximum(bb, _LEAST)
    v = np.clip(np.where(bb > _LEAST, v, 0.0), 0.0, 1.0)
    u = np.clip(np.where(aa > _LEAST, (ab * v - ar) / np.maximum(aa, _LEAST), 0.0), 0.0, 1.0)
    apart = r + u[..., None] * a - v[..., None] * b
    distance = np.linalg.norm(apart, axis=-1)
    return distance, u, v, apart / np.maximum(distance, _LEAST)[..., None]


def _between(ends: Array, fraction: Array) -> Array:
    """Return what lies at fractions (..., 1) between both ends (..., 2, 3, columns)."""
    part = fraction[..., None]
    return np.asarray((1.0 - part) * ends[..., 0, :, :] + part * ends[..., 1, :, :])
