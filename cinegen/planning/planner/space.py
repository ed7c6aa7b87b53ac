"""`Space`: a mechanism's configurations as points of a box, in which a planner may look for a way."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.clearance import Clearance
from cinegen.collision.scene import Scene

Array = NDArray[np.float64]

_TURN = 2.0 * np.pi
_WINDINGS = 16  # by which one posture is aimed at, at most
_BESIDE = 0.1  # of what a scene takes up, left free around it
_THINNEST = 1e-9  # rad or lengths between limits


class Space:
    """Configurations as points x (nv,): how each joint differs from the start, in rad or characteristic lengths.

    Joints go as far as their limits. A rotation without limits goes one turn to either side, so that a goal can be
    reached both ways round; a slide, and a base that can move, as far as the scene goes, and round what stands there.

    Args:
        scene: what is where.
        clearance: of its robot.

    Attributes:
        low: (nv,) of the box.
        high: (nv,), above `low`.
    """

    def __init__(self, scene: Scene, clearance: Clearance) -> None:
        self._start, mechanism = scene.start, scene.mechanism
        self._mechanism, self._scale = mechanism, mechanism.scale
        low, high = np.full(mechanism.model.nv, -np.inf), np.full(mechanism.model.nv, np.inf)
        first, last = _room(scene, clearance)
        begin, end = (np.resize(far, mechanism.model.nv) for far in (first, last))
        self._endless = np.zeros(mechanism.model.nv, dtype=bool)
        for name in mechanism.joints:
            i, k = mechanism.q_index(name), mechanism.v_index(name)
            low[k], high[k] = np.array(mechanism.limits[name][:2]) - scene.start[i]
            if not mechanism.is_prismatic(name):
                begin[k], end[k] = -_TURN, _TURN
                self._endless[k] = np.isinf(low[k]) and np.isinf(high[k])
        if mechanism.floating:  # moved by its first three numbers, turned by the other three
            begin[3:6], end[3:6] = -np.pi, np.pi
        self.low = np.minimum(np.where(np.isinf(low), begin, low), 0.0) / self._scale
        self.high = np.maximum(np.where(np.isinf(high), end, high), 0.0) / self._scale + _THINNEST

    def at(self, x: Array) -> Array:
        """(nq,) the configuration of a point (nv,)."""
        return self._mechanism.integrate(self._start, x * self._scale)

    def point(self, q: Array) -> Array:
        """(nv,) of a configuration (nq,)."""
        return self._mechanism.scaled_difference(self._start, q)

    def points(self, q: Array) -> list[Array]:
        """(nv,) each, inside the box: of a configuration (nq,), and with whole turns; nearest to the start first."""
        x = self.point(q)
        x[self._endless] = np.remainder(x[self._endless] + np.pi, _TURN) - np.pi
        turned = [(value, value - np.copysign(_TURN, value)) for value in x[self._endless].tolist()]
        found = []
        for values in itertools.islice(itertools.product(*turned), _WINDINGS):
            point = x.copy()
            point[self._endless] = values
            found.append(np.clip(point, self.low, self.high))
        return sorted(found, key=lambda point: float(np.linalg.norm(point)))


def _room(scene: Scene, clearance: Clearance) -> tuple[Array, Array]:
    """How far what slides may go down and up from the start, m: (2,) along x and y of a mobile robot, else (1,)."""
    here = np.array(scene.mechanism.placement(scene.start, scene.node).translation)
    places = [np.array(scene.goal.translation)[None], here[None]]
    for body in (body for obstacle in scene.obstacles for body in obstacle.bodies if np.isfinite(body.radius)):
        body.shape.computeLocalAABB()
        box = body.shape.aabb_local
        corners = np.array(list(itertools.product(*zip(box.min_, box.max_, strict=True))))
        places.append(corners @ body.placement.rotation.T + body.placement.translation)
    ways = np.vstack(places) - here
    widest = max((body.radius for body in clearance.bodies if body.joint), default=0.0)
    beside = _BESIDE * float(np.ptp(ways, axis=0).max()) + 2.0 * (widest + scene.safety)
    if scene.mobile is not None:
        return ways.min(axis=0)[:2] - beside, ways.max(axis=0)[:2] + beside
    far = np.linalg.norm(ways, axis=1).max(keepdims=True) + beside
    return -far, far
