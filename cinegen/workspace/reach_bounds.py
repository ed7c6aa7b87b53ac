"""`ReachBounds`: what a node can't leave, as links are only so long and so short, and joints go only so far.

From the base to the node leads at least one chain of bodies, with loops several. Along each chain the distance between
two points of neighbouring bodies goes from a least to a largest value; the triangle inequality says what follows for
the distance from the chain's beginning to its end (bound smoothing: G. M. Crippen and T. F. Havel, "Distance geometry
and molecular conformation", 1988). So the node is between two spheres for each chain. It is certain, but not all that
is to be said: what is in all shells may be out of reach all the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.joints import axis, translations
from cinegen.model import Mechanism
from raff2urdf.document import LoopKind

Array = NDArray[np.float64]

_CHAINS = 40  # that are looked at, of one node
_BODIES = 60  # of one chain
_ROUNDING = 1e-9  # part of a length
_ON_AXIS = 1e-9  # lengths

_TURN, _SLIDE, _FREE, _RIGID = range(4)


class _Link(NamedTuple):
    """Between two bodies, in the direction from `first` to `second`."""

    first: int
    second: int
    at_first: pin.SE3  # the joint's frame on each of them; the second is moved along or about the axis
    at_second: pin.SE3
    kind: int  # _FREE turns in any way about the common origin
    axis: Array
    low: float
    high: float

    def reversed(self) -> _Link:
        return _Link(
            self.second, self.first, self.at_second, self.at_first, self.kind, self.axis, -self.high, -self.low
        )

    def bounds(self, before: Array, after: Array) -> tuple[float, float]:
        """The least and the largest distance between a point of the first body and one of the second."""
        u, w = self.at_first.actInv(before), self.at_second.actInv(after)
        if self.kind == _SLIDE:
            return _along(self.axis, u - w, self.low, self.high)
        if self.kind == _FREE:
            one, other = float(np.linalg.norm(u)), float(np.linalg.norm(w))
            return abs(one - other), one + other
        return _about(self.axis, u, w, self.low, self.high)


def _along(axis: Array, away: Array, low: float, high: float) -> tuple[float, float]:
    """Of |axis v - away|, for v from low to high."""
    foot = float(axis @ away)
    aside = math.sqrt(max(float(away @ away) - foot * foot, 0.0))
    least = min(max(foot, low), high) - foot
    return math.hypot(aside, least), math.hypot(aside, max(abs(low - foot), abs(high - foot)))


def _about(axis: Array, u: Array, w: Array, low: float, high: float) -> tuple[float, float]:
    """Of |R(angle) w - u|, for angles from low to high: its square is k - 2 (a cos + b sin)."""
    a = float(u @ w - (axis @ u) * (axis @ w))
    b = float(u @ np.cross(axis, w))
    k = float(u @ u + w @ w - 2.0 * (axis @ u) * (axis @ w))
    size, turned = math.hypot(a, b), math.atan2(b, a)
    ends = [math.cos(angle - turned) for angle in (low, high)] if high - low < 2.0 * math.pi else []
    most = 1.0 if not ends or _within(turned, low, high) else max(ends)
    least = -1.0 if not ends or _within(turned + math.pi, low, high) else min(ends)
    return math.sqrt(max(k - 2.0 * size * most, 0.0)), math.sqrt(max(k - 2.0 * size * least, 0.0))


def _within(angle: float, low: float, high: float) -> bool:
    """Whether an angle, or one whole turns away, is between two others."""
    return (angle - low) % (2.0 * math.pi) <= high - low


class ReachBounds:
    """Between which spheres a node is in every configuration.

    Args:
        mechanism: whose.
        node: base, link or frame.
        limits: whether joints keep to their position limits.
        rotation: how much of the node's orientation will be given: 0, 2 (the direction of its z) or 3.

    Attributes:
        centres: (k, 3) m, of each chain's spheres.
        inner: (k,) m, the radius of the inner sphere.
        outer: (k,) m, that of the outer one; infinite where a slide has no limits.
        offsets: (k, 3) m, the chain's end in the node's axes: its origin, unless its orientation will be given.
    """

    def __init__(self, mechanism: Mechanism, node: str, limits: bool = True, rotation: int = 0) -> None:
        model = mechanism.model
        frame = model.frames[mechanism.frame_id(node)]
        found = []
        for whole in _chains(_links(mechanism, limits), frame.parentJoint):
            chain, last = _folded(whole)
            if not chain:  # it is a part of the base
                continue
            placement = last * frame.placement
            entered = placement.actInv(np.asarray(chain[-1].at_second.translation))
            on_axis = math.hypot(entered[0], entered[1]) <= _ON_AXIS * mechanism.length
            known = rotation == 3 or (rotation == 2 and on_axis)
            end = None if known else np.asarray(placement.translation)
            found.append((chain[0].at_first.translation, *_smoothed(chain, end), entered if known else np.zeros(3)))
        self.centres = np.array([one[0] for one in found]).reshape(-1, 3)
        slack = _ROUNDING * mechanism.length
        self.inner = np.array([one[1] for one in found]) * (1.0 - _ROUNDING) - slack
        self.outer = np.array([one[2] for one in found]) * (1.0 + _ROUNDING) + slack
        self.offsets = np.array([one[3] for one in found]).reshape(-1, 3)

    def exclude(self, points: Array, rotations: Array) -> NDArray[np.bool_]:
        """(n,) whether the node can't be there, for certain.

        Args:
            points: (n, 3) m, of its origin in the world.
            rotations: (n, 3, 3) or (1, 3, 3) its orientations, of which as much counts as was said.
        """
        out = np.zeros(len(points), dtype=bool)
        for centre, inner, outer, offset in zip(self.centres, self.inner, self.outer, self.offsets, strict=True):
            away = np.linalg.norm(points + rotations @ offset - centre, axis=1)
            out |= (away < inner) | (away > outer)
        return out


def bounds(mechanism: Mechanism, node: str, axis: int) -> tuple[float, float]:
    """Between which values of x (0), y or z (2) a node certainly is, m, joints within their limits; infinite where
    nothing is certain."""
    shells = ReachBounds(mechanism, node)
    at, reach = shells.centres[:, axis], shells.outer
    return float((at - reach).max(initial=-math.inf)), float((at + reach).min(initial=math.inf))


def radius_about(mechanism: Mechanism, node: str, centre: Sequence[float]) -> float:
    """Of a ball about a centre (3,), m, that a node certainly can't leave, likewise."""
    shells = ReachBounds(mechanism, node)
    away = np.linalg.norm(shells.centres - np.asarray(centre), axis=1)
    return float((away + shells.outer).min(initial=math.inf))


def _links(mechanism: Mechanism, limits: bool) -> list[_Link]:
    """All joints and all loops."""
    model = mechanism.model
    found = []
    for number in range(1, model.njoints):
        joint = model.joints[number]
        moving = translations(joint)
        if joint.nq == 1:
            low, high, *_ = mechanism.limits[model.names[number]] if limits else (-math.inf, math.inf)
            kind = _SLIDE if moving else _TURN
        elif moving:
            continue  # it goes anywhere
        else:
            low, high, kind = -math.inf, math.inf, _FREE
        found.append(
            _Link(
                model.parents[number], number, model.jointPlacements[number], pin.SE3.Identity(), kind,
                axis(joint) if joint.nq == 1 else np.zeros(3), low, high,
            )
        )  # fmt: skip
    for loop, (first, at_first, second, at_second) in zip(mechanism.loops, mechanism.system.anchors, strict=True):
        if loop.kind is not LoopKind.PRISMATIC:
            kind = _RIGID if loop.kind is LoopKind.RIGID else _FREE
            found.append(_Link(first, second, at_first, at_second, kind, np.zeros(3), -math.inf, math.inf))
    return found


def _chains(links: Sequence[_Link], last: int) -> Iterator[list[_Link]]:
    """Chains of links from the base to a body, none through a body twice."""
    from_body: dict[int, list[_Link]] = {}
    for link in links:
        from_body.setdefault(link.first, []).append(link)
        from_body.setdefault(link.second, []).append(link.reversed())
    count = 0
    waiting: list[list[_Link]] = [[link] for link in from_body.get(0, ())] if last != 0 else []
    while waiting and count < _CHAINS:
        chain = waiting.pop(0)  # short ones first
        if chain[-1].second == last:
            count += 1
            yield chain
        elif len(chain) < _BODIES:
            met = {0, *(link.second for link in chain)}
            waiting += [[*chain, link] for link in from_body.get(chain[-1].second, ()) if link.second not in met]


def _folded(chain: Sequence[_Link]) -> tuple[list[_Link], pin.SE3]:
    """A chain without what is rigid; and where its last body's frame is then, in what that has become a part of."""
    found, moved = [], pin.SE3.Identity()
    for link in chain:
        if link.kind == _RIGID:
            moved = moved * link.at_first * link.at_second.inverse()
        else:
            found.append(link._replace(at_first=moved * link.at_first))
            moved = pin.SE3.Identity()
    return found, moved


def _smoothed(chain: Sequence[_Link], end: Array | None) -> tuple[float, float]:
    """The least and the largest distance between a chain's beginning, in the base, and its end, a point of the last
    body: where that is entered, unless given.

    Of each link's joint there is a point; those of neighbours have distances that one body fixes, or one joint bounds.
    """
    count = len(chain) + 1 + (end is not None)
    least, most = np.zeros((count, count)), np.full((count, count), np.inf)
    np.fill_diagonal(most, 0.0)
    before: Array = np.asarray(chain[0].at_first.translation)
    for k, link in enumerate(chain):
        entered = np.asarray(link.at_second.translation)
        least[k, k + 1], most[k, k + 1] = link.bounds(before, entered)
        after = end
        if k + 1 < len(chain):  # the next joint's point is fixed here, unless it slides
            after = None if chain[k + 1].kind == _SLIDE else np.asarray(chain[k + 1].at_first.translation)
        if after is not None:
            least[k, k + 2], most[k, k + 2] = link.bounds(before, after)
        before = entered
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
