"""Which links of a mechanism may collide with each other.

An SRDF lists pairs that may not, written by hand or found by sampling (S. Chitta, I. Sucan and S. Cousins, "MoveIt!",
IEEE Robotics and Automation Magazine 19(1), 2012: adjacent links, links in collision by default, always, or never). It
is obeyed if there is one. Other pairs are left out only for reasons that are verified, for any mechanism.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import combinations, product

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.body import Body, Pairs, geometry_model
from cinegen.collision.links import link_bodies
from cinegen.collision.shapes import kind_of
from cinegen.ik.local_ik import LocalIK
from cinegen.joints import kinematic_data, translations
from cinegen.model.mechanism import Mechanism
from cinegen.model.shapes import has_collision_shapes
from raff2urdf.raff.document import LoopKind
from raff2urdf.readers.urdf_file import parse

SAMPLES = 2000
"""Configurations in which a pair must touch to be left out."""

FREE_AT_MOST = 1.96**2 / (SAMPLES + 1.96**2)
"""Wilson's upper bound, with 95 % confidence, of the part of all configurations in which such a pair is free."""

_Hinge = dict[int, Array]
"""A point shared by several bodies: for the joint of each body, the point in that joint's frame, m, where it is
fixed."""

_TOUCHING = 1e-3  # of the characteristic length: smaller distances count as contact
_CONSTANT = 1e-6  # of the characteristic length
_SAME = 1e-6  # of the characteristic length
_FIRST_SAMPLES = 400  # configurations
_FEW = 40  # of these, in which points are compared


class PairReason(Enum):
    """Why a pair of bodies is checked for collisions, or not."""

    CHECKED = "checked"
    ADJACENT = "adjacent: connected by a joint or a loop, or at a common point"
    SRDF = "disabled by the SRDF"
    ALWAYS = "in contact in all sampled configurations"
    RIGID = "no relative motion, or only about a common axis"


@dataclass(frozen=True, eq=False)
class LinkPairs:
    """The bodies of a mechanism's links and all their pairs on different joints.

    Attributes:
        bodies: see `link_bodies`.
        reasons: of each pair of indices into `bodies`, the smaller first, in lexical order.
    """

    bodies: tuple[Body, ...]
    reasons: Mapping[tuple[int, int], PairReason]

    def of(self, reason: PairReason) -> tuple[tuple[int, int], ...]:
        """Return the pairs with a reason."""
        return tuple(pair for pair, why in self.reasons.items() if why is reason)


def link_pairs(mechanism: Mechanism) -> LinkPairs:
    """Return the bodies of a mechanism's links and their pairs, to be kept with it (`Structure.derived`)."""
    bodies = link_bodies(mechanism)
    return LinkPairs(bodies, pair_reasons(mechanism, bodies))


def pair_reasons(mechanism: Mechanism, bodies: Sequence[Body]) -> dict[tuple[int, int], PairReason]:
    """Return for each pair of bodies on different joints why it is checked for collisions, or not.

    A pair is left out only for one of these reasons:

    - The joints are adjacent by structure (see `adjacent_joints`). Where the description has shapes for collisions,
      only links that a joint or a loop connects are adjacent: those with a common point, and those that are fixed to
      them, may collide. Drawings meet at common points.
    - The SRDF of the mechanism disables the pair of links.
    - The bodies touch in every one of 2000 configurations sampled within the limits, loops closed. Contact in one
      configuration, such as home, is no reason. If 2000 of 2000 are in contact, more than 99.8 % of all are, with 95 %
      confidence (`FREE_AT_MOST`).
    - They cannot move relative to each other, or only rotate about a common axis.

    Args:
        mechanism: any.
        bodies: bodies on its joints; contact is that of their exact shapes.

    Returns:
        by indices into `bodies`, the smaller first, in lexical order.
    """
    joints = [body.joint for body in bodies]
    is_drawn = not has_collision_shapes(parse(mechanism.source.urdf, mechanism.source.name))
    adjacent = adjacent_joints(mechanism, common_points=is_drawn)
    apart = set() if is_drawn else _unconnected(mechanism, bodies)
    all_pairs = [pair for pair in combinations(range(len(bodies)), 2) if joints[pair[0]] != joints[pair[1]]]
    named = {(i, k): frozenset((bodies[i].name, bodies[k].name)) for i, k in all_pairs}
    distant = [
        pair for pair in all_pairs if _ordered(joints[pair[0]], joints[pair[1]]) not in adjacent or named[pair] in apart
    ]
    disabled = disabled_by_srdf(mechanism)
    candidates = [pair for pair in distant if named[pair] not in disabled]
    known = dict.fromkeys(all_pairs, PairReason.ADJACENT) | dict.fromkeys(distant, PairReason.SRDF)
    if not candidates:
        return known
    local, rng = LocalIK(mechanism), np.random.default_rng(0)
    samples = local.samples(_FIRST_SAMPLES, rng)
    always = _always_touching(mechanism, bodies, candidates, samples)
    if always:
        more = local.samples(SAMPLES - _FIRST_SAMPLES, rng)
        always = _always_touching(mechanism, bodies, sorted(always), more)
    points, length = _body_points(mechanism, bodies, samples[:_FEW]), mechanism.length

    def reason(pair: tuple[int, int]) -> PairReason:
        if pair in always:
            return PairReason.ALWAYS
        first, second = pair
        return PairReason.RIGID if _rigid(points[first], points[second], length) else PairReason.CHECKED

    return known | {pair: reason(pair) for pair in candidates}


def disabled_by_srdf(mechanism: Mechanism) -> dict[frozenset[str], str]:
    """Return the pairs of links that the SRDF of a mechanism disables, and the reason it gives; none without one."""
    srdf = mechanism.source.srdf
    return {} if srdf is None else {frozenset((link, other)): reason for link, other, reason in srdf["disabled"]}


def _unconnected(mechanism: Mechanism, bodies: Sequence[Body]) -> set[frozenset[str]]:
    """Return the pairs of links on the two sides of a joint, by name, that the joint does not connect: one of them is
    fixed to a connected link that has a shape of its own."""
    model, names = mechanism.model, dict[int, set[str]]()
    for body in bodies:
        names.setdefault(body.joint, set()).add(body.name)
    frames = {frame.parentJoint: i for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.JOINT}
    looped = {_ordered(first, second) for first, _, second, _ in mechanism.structure.system.anchors}
    unconnected = set[frozenset[str]]()
    for j in range(1, model.njoints):
        parent = int(model.parents[j])
        if (parent, j) in looped or j not in frames:
            continue
        joint = frames[j]
        on_parent, on_joint = names.get(parent, set()), names.get(j, set())
        before = _with_shapes(mechanism, model.frames[model.frames[joint].parentFrame].name, on_parent)
        after = _with_shapes(mechanism, _link_behind(mechanism, joint), on_joint)
        connected = product(before or on_parent, after or on_joint)
        unconnected |= set(map(frozenset, product(on_parent, on_joint))) - set(map(frozenset, connected))
    return unconnected


def _link_behind(mechanism: Mechanism, joint: int) -> str:
    """Return the link that the joint of a frame, by its index, moves."""
    frames = mechanism.model.frames
    return next(str(frame.name) for frame in frames if frame.type == pin.FrameType.BODY and frame.parentFrame == joint)


def _with_shapes(mechanism: Mechanism, link: str, shaped: set[str]) -> set[str]:
    """Return a link if it has shapes, else the nearest links with shapes that are fixed to it, by way of others."""
    frames, fixed = mechanism.model.frames, dict[str, list[str]]()
    for i, frame in enumerate(frames):
        if frame.type == pin.FrameType.FIXED_JOINT:
            ends = frames[frame.parentFrame].name, _link_behind(mechanism, i)
            for name, other in (ends, ends[::-1]):
                fixed.setdefault(name, []).append(other)
    with_shapes, visited, left = set[str](), {link}, [link]
    while left:
        name = left.pop()
        if name in shaped:
            with_shapes.add(name)
            continue
        new = set(fixed.get(name, ())) - visited
        visited |= new
        left += new
    return with_shapes


def _always_touching(
    mechanism: Mechanism, bodies: Sequence[Body], pairs: Pairs, samples: Array
) -> set[tuple[int, int]]:
    """Return the pairs whose exact shapes touch in all samples (n, nq). A pair found apart once is not measured again;
    nor are exact shapes where the convex bodies around them are apart."""
    data, near = kinematic_data(mechanism.model), _TOUCHING * mechanism.length
    models = [geometry_model(mechanism, each, pairs=pairs) for each in (bodies, [body.as_described for body in bodies])]
    levels, left = [(model, model.createData()) for model in models], set(range(len(pairs)))
    for q in samples:
        if not left:
            break
        pin.forwardKinematics(mechanism.model, data, q)
        touching = left
        for geometry, shapes in levels:
            pin.updateGeometryPlacements(mechanism.model, data, geometry, shapes)
            touching = {pair for pair in touching if pin.computeDistance(geometry, shapes, pair).min_distance <= near}
        left = touching
    return {pairs[pair] for pair in left}


def _rigid(first: Array, second: Array, length: float) -> bool:
    """Return whether all points of a body keep their distances to all of another: (configurations, points, 3) each.

    The shortest distance alone is not enough: it may stay constant, between the nearest ends of two bars, until one is
    folded back along the other. The distance of two points is an analytic function of the joints: if it is constant in
    some random configurations, it is constant everywhere.
    """
    between = np.linalg.norm(first[:, :, None] - second[:, None], axis=3)
    return bool(np.ptp(between, axis=0).max() <= _CONSTANT * length)


def _body_points(mechanism: Mechanism, bodies: Sequence[Body], configurations: Array) -> list[Array]:
    """Return for each body the points (configurations, points, 3) in the world, m, that determine its pose."""
    data, points = kinematic_data(mechanism.model), [_points_of(body) for body in bodies]
    by_body: list[list[Array]] = [[] for _ in bodies]
    for q in configurations:
        pin.forwardKinematics(mechanism.model, data, q)
        for body, local, placed in zip(bodies, points, by_body, strict=True):
            pose = data.oMi[body.joint]
            placed.append(local @ pose.rotation.T + pose.translation)
    return [np.array(placed) for placed in by_body]


def _points_of(body: Body) -> Array:
    """Return points (n, 3) in the frame of the joint, m: the ends of the axis of a body of revolution, the centre of a
    sphere, four points of anything else."""
    axis = kind_of(body.shape).axis(body.shape)
    points = body.radius * np.vstack([np.zeros(3), np.eye(3)]) if axis is None else axis
    return np.asarray(points @ body.placement.rotation.T + body.placement.translation)


# --- adjacent joints ---------------------------------------------------------------------------------------------


def adjacent_joints(mechanism: Mechanism, common_points: bool = True) -> frozenset[tuple[int, int]]:
    """Return the pairs of joints, each with the smaller index first, whose bodies are adjacent.

    Bodies are adjacent where one joint carries the other, where a loop was cut between them, and where they share a
    point: two or three revolute joints through one point are a universal joint or a ball joint, and the links on its
    two sides meet there as they would at one joint. A rigid loop joins two parts of one link: what is adjacent to one
    part is adjacent to both.

    Args:
        mechanism: any.
        common_points: whether bodies that share a point are adjacent.
    """
    model = mechanism.model
    adjacent = {(int(model.parents[j]), j) for j in range(1, model.njoints)}
    adjacent |= {_ordered(first, second) for first, _, second, _ in mechanism.structure.system.anchors}
    for hinge in _hinges(mechanism) if common_points else ():
        adjacent.update(combinations(sorted(hinge), 2))
    parts = _parts_of_links(mechanism)
    adjacent = {_ordered(i, j) for pair in adjacent for i, j in product(*(parts[joint] for joint in pair))}
    return frozenset((i, j) for i, j in adjacent if i != j)


def _parts_of_links(mechanism: Mechanism) -> list[set[int]]:
    """Return for each joint the joints that carry parts of the same link: itself, and those joined by rigid loops."""
    parts = [{joint} for joint in range(mechanism.model.njoints)]
    for loop, (first, _, second, _) in zip(mechanism.loops, mechanism.structure.system.anchors, strict=True):
        if loop.kind == LoopKind.RIGID:
            joined = parts[first] | parts[second]
            for joint in joined:
                parts[joint] = joined
    return parts


def _hinges(mechanism: Mechanism) -> list[_Hinge]:
    """Return the points about which links rotate; coincident points are merged, whichever joints they belong to."""
    near = _SAME * mechanism.length
    hinges: list[_Hinge] = []
    for new in _joint_centres(mechanism):
        same = [hinge for hinge in hinges if any(np.linalg.norm(hinge[j] - new[j]) <= near for j in hinge.keys() & new)]
        hinges = [hinge for hinge in hinges if not any(hinge is other for other in same)]
        hinges.append({joint: point for hinge in (*same, new) for joint, point in hinge.items()})
    return hinges


def _joint_centres(mechanism: Mechanism) -> Iterator[_Hinge]:
    """Yield for each joint that rotates, cut or not, a point of its axis."""
    model = mechanism.model
    for j in range(1, model.njoints):
        if translations(model.joints[j]) == 0:
            yield {int(model.parents[j]): np.array(model.jointPlacements[j].translation), j: np.zeros(3)}
    for loop, (first, first_placement, second, second_placement) in zip(
        mechanism.loops, mechanism.structure.system.anchors, strict=True
    ):
        if loop.kind != LoopKind.PRISMATIC and first != second:
            yield {first: np.array(first_placement.translation), second: np.array(second_placement.translation)}


def _ordered(first: int, second: int) -> tuple[int, int]:
    return (first, second) if first < second else (second, first)
