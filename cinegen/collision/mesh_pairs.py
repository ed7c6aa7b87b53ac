"""Pairs of links that `MeshCheck` checks: found apart from those of `Clearance`, so that an error of one is noticed.

All pairs of links that can move relative to each other are checked, but those that are adjacent by the structure of the
description, those whose meshes touch in configurations sampled here, and those that an SRDF disables for a reason that
is verified here, or that only its author can know.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.body import Body
from cinegen.joints import kinematic_data
from cinegen.model import Mechanism
from cinegen.model.shapes import has_collision_shapes
from raff2urdf.raff.document import LoopKind
from raff2urdf.readers.urdf_file import parse

Pair = tuple[int, int]
_Touching = Callable[[Array, Sequence[Pair]], set[Pair]]

_SAMPLES = 300  # configurations
_ALWAYS = 0.99  # of these: pairs in contact in so many are left out
_TOUCHING = 1e-3  # of the characteristic length: smaller distances count as contact in these samples
_SAME = 1e-6  # of the characteristic length: points that coincide
_FAR = np.full(3, np.nan)  # a point that coincides with none


class _Connection(Enum):
    """Connection of two links."""

    FIXED = 0
    TURNING = 1  # about a point of both
    SLIDING = 2
    RIGID = 3  # by a loop: they are one link, cut


_CONNECTIONS = {
    "fixed": _Connection.FIXED,
    "revolute": _Connection.TURNING,
    "continuous": _Connection.TURNING,
    "ball": _Connection.TURNING,
}
"""Of joints in URDFs; others slide."""

_LOOPS = {LoopKind.RIGID: _Connection.RIGID, LoopKind.PRISMATIC: _Connection.SLIDING}
"""Of loops; others turn."""


@dataclass(frozen=True, eq=False)
class MeshPairs:
    """The shapes of a mechanism as described, and which of their pairs are checked.

    Attributes:
        bodies: the shapes.
        pairs: indices into `bodies`.
        unchecked: pairs of links, by name, that are left out though they are not adjacent, and why.
    """

    bodies: tuple[Body, ...]
    pairs: tuple[Pair, ...]
    unchecked: Mapping[tuple[str, str], str]


def mesh_pairs(mechanism: Mechanism) -> MeshPairs:
    """Return the shapes of a mechanism and their pairs, to be kept with it: `mechanism.structure.derived(mesh_pairs)`.

    The reasons of an SRDF are verified: "Adjacent" by the structure, "Always" by the samples, "Default" in the home
    configuration and that of all joints at 0. "Never" leaves out nothing, since checking such a pair verifies it. Any
    other reason, such as "User", is that of the SRDF's author, and is accepted.
    """
    frames = mechanism.model.frames
    bodies = tuple(
        Body(frames[shape.parentFrame].name, shape.parentJoint, shape.placement, shape.geometry)
        for shape in mechanism.collision.geometryObjects
    )
    adjacent = adjacent_links(mechanism, {body.name for body in bodies})
    names = [frozenset((bodies[i].name, bodies[k].name)) for i, k in combinations(range(len(bodies)), 2)]
    pairs = [
        (i, k)
        for (i, k), named in zip(combinations(range(len(bodies)), 2), names, strict=True)
        if bodies[i].joint != bodies[k].joint and named not in adjacent
    ]
    touching = _touching(mechanism, bodies, _TOUCHING * mechanism.length)
    always = _always(mechanism, pairs, touching)
    srdf = mechanism.source.srdf
    listed = {} if srdf is None else {frozenset(links): reason for *links, reason in srdf["disabled"]}
    zero = pin.neutral(mechanism.model)
    unchecked: dict[tuple[str, str], str] = {}
    checked = []
    for i, k in pairs:
        link, other = bodies[i].name, bodies[k].name
        reason = listed.get(frozenset((link, other)))
        if (i, k) in always:
            why = "in contact in all sampled configurations"
        elif reason is None or reason in ("Never", "Adjacent", "Always"):
            why = ""
        elif reason == "Default":
            is_default = any(touching(q, [(i, k)]) for q in (mechanism.q_home, zero))
            why = "disabled by the SRDF: Default" if is_default else ""
        else:
            why = f"disabled by the SRDF: {reason or 'no reason given'}"
        if why:
            unchecked[link, other] = why
        else:
            checked.append((i, k))
    return MeshPairs(bodies, tuple(checked), unchecked)


def adjacent_links(mechanism: Mechanism, shaped: set[str]) -> set[frozenset[str]]:
    """Return the pairs of links with shapes that are connected by one joint or loop, or by several through one point.

    Links without shapes in between are passed: those fixed to a link, and those of universal and ball joints. Where the
    description has no shapes for collisions, so are others, since drawings of links meet at their common points. Both
    parts of a link that a rigid loop joins are one.

    Args:
        mechanism: any.
        shaped: names of the links with shapes.
    """
    tree = parse(mechanism.source.urdf, mechanism.source.name)
    is_drawn = not has_collision_shapes(tree)
    ends: dict[str, list[tuple[str, _Connection, pin.SE3, pin.SE3]]] = {}

    def connect(first: str, second: str, kind: _Connection, on_first: pin.SE3, on_second: pin.SE3) -> None:
        ends.setdefault(first, []).append((second, kind, on_first, on_second))
        ends.setdefault(second, []).append((first, kind, on_second, on_first))

    for joint in tree.iterchildren("joint"):
        parent, child, origin = (joint.find(tag) for tag in ("parent", "child", "origin"))
        xyz, rpy = (
            np.array([float(x) for x in ("0 0 0" if origin is None else origin.get(key, "0 0 0")).split()])
            for key in ("xyz", "rpy")
        )
        kind = _CONNECTIONS.get(joint.get("type"), _Connection.SLIDING)
        connect(parent.get("link"), child.get("link"), kind, pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz), pin.SE3.Identity())
    for loop in mechanism.loops:
        kind = _LOOPS.get(loop.kind, _Connection.TURNING)
        connect(loop.first, loop.second, kind, loop.first_placement, loop.second_placement)

    def near(point: Array, other: Array) -> bool:
        return bool(np.linalg.norm(point - other) <= _SAME * mechanism.length)

    adjacent = set()
    for link in shaped:
        visited, left = {link}, list[tuple[str, Array | None, bool, bool]]([(link, None, False, False)])
        while left:  # point: about which the last joint turns; is_part: of one link; is_behind: a fixed one
            at, point, is_part, is_behind = left.pop()
            for other, kind, on_link, on_other in ends.get(at, ()):
                is_moving = kind in (_Connection.TURNING, _Connection.SLIDING)
                meets = kind is _Connection.TURNING and point is not None and near(point, on_link.translation)
                if other in visited or (is_moving and ((is_behind and not is_part) or not (point is None or meets))):
                    continue
                visited.add(other)
                if is_moving:
                    after = on_other.translation if kind is _Connection.TURNING else _FAR
                else:
                    after = None if point is None else on_other.act(on_link.actInv(point))
                part = after is None and (is_part or kind is _Connection.RIGID)
                if other in shaped and (after is not None or part):
                    adjacent.add(frozenset((link, other)))
                if after is None or other not in shaped or is_drawn:
                    left.append((other, after, part, is_behind or (after is None and other in shaped)))
    return adjacent


def _touching(
    mechanism: Mechanism, bodies: Sequence[Body], margin: float
) -> Callable[[Array, Sequence[Pair]], set[Pair]]:
    """Return a function that returns which of some pairs are nearer than a margin, m, at a configuration (nq,)."""
    data, request = kinematic_data(mechanism.model), coal.CollisionRequest()
    request.security_margin = margin

    def touching(q: Array, pairs: Sequence[Pair]) -> set[Pair]:
        pin.forwardKinematics(mechanism.model, data, q)
        poses = {i: data.oMi[bodies[i].joint] * bodies[i].placement for pair in pairs for i in pair}
        at = {i: coal.Transform3s(pose.rotation, pose.translation) for i, pose in poses.items()}
        return {
            (i, k)
            for i, k in pairs
            if coal.collide(bodies[i].shape, at[i], bodies[k].shape, at[k], request, coal.CollisionResult())
        }

    return touching


def _always(mechanism: Mechanism, pairs: Sequence[Pair], touching: _Touching) -> set[Pair]:
    """Return the pairs in contact in nearly all samples, of those in contact at home."""
    free = dict.fromkeys(sorted(touching(mechanism.q_home, pairs)), 0)
    samples = _samples(mechanism) if free else []
    for q in samples:
        left = [pair for pair, count in free.items() if count <= (1.0 - _ALWAYS) * len(samples)]
        if not left:
            break
        for pair in set(left) - touching(q, left):
            free[pair] += 1
    return {pair for pair, count in free.items() if samples and count <= (1.0 - _ALWAYS) * len(samples)}


def _samples(mechanism: Mechanism) -> list[Array]:
    """Return random configurations (nq,), loops closed; of a robot without loops within its limits, and with angles
    without limits anywhere."""
    if mechanism.is_constrained:
        low, high = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
        walk = mechanism.random_closed(4 * _SAMPLES, seed=11)
        inside = [q for q in walk if ((q >= low) & (q <= high)).all()]
        return (inside or walk)[:: max(1, len(inside or walk) // _SAMPLES)]
    model = pin.Model(mechanism.model)
    far = 1.0 if mechanism.floating else np.pi
    model.lowerPositionLimit = np.maximum(model.lowerPositionLimit, -far)
    model.upperPositionLimit = np.minimum(model.upperPositionLimit, far)
    rng = np.random.default_rng(11)
    low, high = model.lowerPositionLimit, np.maximum(model.upperPositionLimit, model.lowerPositionLimit)
    samples = rng.uniform(low, high, (_SAMPLES, model.nq))
    return [pin.normalize(model, q) for q in samples]
