"""`ReachBounds`: spheres that bound where a node can be, from the lengths of the links and the limits of the joints.

One chain of bodies or, with loops, several lead from the base to the node. Along each chain the distance between two
points of neighbouring bodies has a minimum and a maximum; triangle inequalities bound the distance from the chain's
beginning to its end (bound smoothing: G. M. Crippen and T. F. Havel, "Distance geometry and molecular conformation",
1988). So each chain bounds the node by two spheres. What is outside is proved to be unreachable; not everything inside
is reachable.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike, Bools
from cinegen.joints import axis, translations
from cinegen.model import Mechanism
from raff2urdf.raff.document import LoopKind

_CHAINS = 40  # of a node, at most
_BODIES = 60  # of a chain, at most
_ROUNDING = 1e-9  # of a length
_ON_AXIS = 1e-9  # characteristic lengths

_REVOLUTE, _PRISMATIC, _SPHERICAL, _RIGID = range(4)


class _Connection(NamedTuple):
    """A joint or a loop between two bodies, in the direction from `first` to `second`."""

    first: int
    second: int
    at_first: pin.SE3  # the joint's frame on each body; the second one moves along or about the axis
    at_second: pin.SE3
    kind: int
    axis: Array
    low: float
    high: float

    def reversed(self) -> _Connection:
        return _Connection(
            self.second, self.first, self.at_second, self.at_first, self.kind, self.axis, -self.high, -self.low
        )

    def bounds(self, before: Array, after: Array) -> tuple[float, float]:
        """Return the minimum and the maximum distance between a point of the first body and one of the second."""
        u, w = self.at_first.actInv(before), self.at_second.actInv(after)
        if self.kind == _PRISMATIC:
            return _prismatic_bounds(self.axis, u - w, self.low, self.high)
        if self.kind == _SPHERICAL:
            first, second = float(np.linalg.norm(u)), float(np.linalg.norm(w))
            return abs(first - second), first + second
        return _revolute_bounds(self.axis, u, w, self.low, self.high)


def _prismatic_bounds(axis: Array, away: Array, low: float, high: float) -> tuple[float, float]:
    """Return the minimum and the maximum of |axis v - away| for v from low to high."""
    foot = float(axis @ away)
    aside = math.sqrt(max(float(away @ away) - foot * foot, 0.0))
    least = min(max(foot, low), high) - foot
    return math.hypot(aside, least), math.hypot(aside, max(abs(low - foot), abs(high - foot)))


def _revolute_bounds(axis: Array, u: Array, w: Array, low: float, high: float) -> tuple[float, float]:
    """Return the minimum and the maximum of |R(angle) w - u| for angles from low to high.

    The square is k - 2 (a cos(angle) + b sin(angle)).
    """
    a = float(u @ w - (axis @ u) * (axis @ w))
    b = float(u @ np.cross(axis, w))
    k = float(u @ u + w @ w - 2.0 * (axis @ u) * (axis @ w))
    size, nearest = math.hypot(a, b), math.atan2(b, a)
    ends = [math.cos(angle - nearest) for angle in (low, high)] if high - low < 2.0 * math.pi else []
    most = 1.0 if not ends or _within(nearest, low, high) else max(ends)
    least = -1.0 if not ends or _within(nearest + math.pi, low, high) else min(ends)
    return math.sqrt(max(k - 2.0 * size * most, 0.0)), math.sqrt(max(k - 2.0 * size * least, 0.0))


def _within(angle: float, low: float, high: float) -> bool:
    """Return whether an angle, up to whole revolutions, is between two others."""
    return (angle - low) % (2.0 * math.pi) <= high - low


class ReachBounds:
    """Pairs of spheres between which a node is in every configuration.

    Args:
        mechanism: the robot.
        node: base, link or frame.
        limits: whether joints stay within their position limits.
        rotation: how much of the node's orientation will be given: 0, 2 (the direction of its z axis) or 3.

    Attributes:
        centres: (k, 3) m, of the spheres of each chain.
        inner: (k,) m, radius of the inner sphere.
        outer: (k,) m, radius of the outer sphere; infinite where a prismatic joint has no limits.
        offsets: (k, 3) m, end of the chain in the node's axes: its origin, unless its orientation will be given.
    """

    def __init__(self, mechanism: Mechanism, node: str, limits: bool = True, rotation: int = 0) -> None:
        model = mechanism.model
        frame = model.frames[mechanism.frame_id(node)]
        rows = []
        for whole in _chains(_connections(mechanism, limits), frame.parentJoint):
            chain, last = _without_rigid(whole)
            if not chain:  # the node is part of the base
                continue
            placement = last * frame.placement
            entry = placement.actInv(np.asarray(chain[-1].at_second.translation))
            on_axis = math.hypot(entry[0], entry[1]) <= _ON_AXIS * mechanism.length
            known = rotation == 3 or (rotation == 2 and on_axis)
            end = None if known else np.asarray(placement.translation)
            rows.append((chain[0].at_first.translation, *_smoothed(chain, end), entry if known else np.zeros(3)))
        self.centres = np.array([row[0] for row in rows]).reshape(-1, 3)
        slack = _ROUNDING * mechanism.length
        self.inner = np.array([row[1] for row in rows]) * (1.0 - _ROUNDING) - slack
        self.outer = np.array([row[2] for row in rows]) * (1.0 + _ROUNDING) + slack
        self.offsets = np.array([row[3] for row in rows]).reshape(-1, 3)

    def exclude(self, points: Array, rotations: Array) -> Bools:
        """Return (n,) whether poses are proved to be unreachable.

        Args:
            points: (n, 3) m, positions of the node in the world.
            rotations: (n, 3, 3) or (1, 3, 3) its orientations, as far as they are given.
        """
        out = np.zeros(len(points), dtype=bool)
        for centre, inner, outer, offset in zip(self.centres, self.inner, self.outer, self.offsets, strict=True):
            away = np.linalg.norm(points + rotations @ offset - centre, axis=1)
            out |= (away < inner) | (away > outer)
        return out

    def interval(self, axis: int) -> tuple[float, float]:
        """Return the bounds of the node's x (0), y or z (2), m, for a free orientation; infinite without bound."""
        at = self.centres[:, axis]
        return float((at - self.outer).max(initial=-math.inf)), float((at + self.outer).min(initial=math.inf))

    def radius(self, centre: ArrayLike) -> float:
        """Return the radius, m, of a ball about a centre (3,), m, that holds the node, likewise."""
        away = np.linalg.norm(self.centres - np.asarray(centre), axis=1)
        return float((away + self.outer).min(initial=math.inf))


def _connections(mechanism: Mechanism, limits: bool) -> list[_Connection]:
    """Return all joints and all loops that bound distances."""
    model = mechanism.model
    edges = []
    for number in range(1, model.njoints):
        joint = model.joints[number]
        moving, along, low, high, kind = translations(joint), np.zeros(3), -math.inf, math.inf, _SPHERICAL
        if joint.nq == 1:
            kind, along = _PRISMATIC if moving else _REVOLUTE, axis(joint)
            if limits:
                low, high, *_ = mechanism.limits[model.names[number]]
        elif moving:
            continue  # bounds nothing
        placement = model.jointPlacements[number]
        edges.append(_Connection(model.parents[number], number, placement, pin.SE3.Identity(), kind, along, low, high))
    for loop, (first, at_first, second, at_second) in zip(
        mechanism.loops, mechanism.structure.system.anchors, strict=True
    ):
        if loop.kind is not LoopKind.PRISMATIC:
            kind = _RIGID if loop.kind is LoopKind.RIGID else _SPHERICAL
            edges.append(_Connection(first, second, at_first, at_second, kind, np.zeros(3), -math.inf, math.inf))
    return edges


def _chains(connections: Sequence[_Connection], last: int) -> Iterator[list[_Connection]]:
    """Yield chains from the base to a body, none through a body twice, short ones first."""
    from_body: dict[int, list[_Connection]] = {}
    for connection in connections:
        from_body.setdefault(connection.first, []).append(connection)
        from_body.setdefault(connection.second, []).append(connection.reversed())
    count = 0
    waiting = [[connection] for connection in from_body.get(0, ())] if last != 0 else []
    while waiting and count < _CHAINS:
        chain = waiting.pop(0)
        if chain[-1].second == last:
            count += 1
            yield chain
        elif len(chain) < _BODIES:
            met = {0, *(step.second for step in chain)}
            waiting += [[*chain, step] for step in from_body.get(chain[-1].second, ()) if step.second not in met]


def _without_rigid(chain: Sequence[_Connection]) -> tuple[list[_Connection], pin.SE3]:
    """Return a chain without rigid connections, and the placement of its last body in the one that it is joined to."""
    jointed, moved = [], pin.SE3.Identity()
    for connection in chain:
        if connection.kind == _RIGID:
            moved = moved * connection.at_first * connection.at_second.inverse()
        else:
            jointed.append(connection._replace(at_first=moved * connection.at_first))
            moved = pin.SE3.Identity()
    return jointed, moved


def _smoothed(chain: Sequence[_Connection], end: Array | None) -> tuple[float, float]:
    """Return the minimum and the maximum distance between a chain's beginning, in the base, and its end.

    Each joint has a point; the points of neighbours have distances that one body fixes or one joint bounds. The end is
    a point (3,) of the last body; None for the point of the last joint.
    """
    count = len(chain) + 1 + (end is not None)
    least, most = np.zeros((count, count)), np.full((count, count), np.inf)
    np.fill_diagonal(most, 0.0)
    before: Array = np.asarray(chain[0].at_first.translation)
    for k, connection in enumerate(chain):
        entry = np.asarray(connection.at_second.translation)
        least[k, k + 1], most[k, k + 1] = connection.bounds(before, entry)
        after = end
        if k + 1 < len(chain):  # the next joint's point is fixed to this body, unless that joint is prismatic
            after = None if chain[k + 1].kind == _PRISMATIC else np.asarray(chain[k + 1].at_first.translation)
        if after is not None:
            least[k, k + 2], most[k, k + 2] = connection.bounds(before, after)
        before = entry
    if end is not None:
        least[-2, -1] = most[-2, -1] = np.linalg.norm(end - before)
    for width in range(2, count):
        for i in range(count - width):
            j, inner = i + width, slice(i + 1, i + width)
            most[i, j] = min(most[i, j], (most[i, inner] + most[inner, j]).min())
            with np.errstate(invalid="ignore"):
                gaps = np.r_[least[i, inner] - most[inner, j], least[inner, j] - most[i, inner], least[i, j]]
            least[i, j] = np.nanmax(np.r_[gaps, 0.0])
    return float(least[0, -1]), float(most[0, -1])
