"""Which links of a mechanism may collide with each other.

An SRDF lists such pairs, written by hand or found by sampling (S. Chitta, I. Sucan and S. Cousins, "MoveIt!", IEEE
Robotics and Automation Magazine 19(1), 2012: adjacent links, links in collision by default, always, or never). Here
they are computed for any mechanism.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body, Pairs, geometry_model
from cinegen.ik.local_ik import LocalIK
from cinegen.joints import kinematic_data, translations
from cinegen.model.mechanism import Mechanism
from raff2urdf.raff.document import LoopKind

Array = NDArray[np.float64]

_Hinge = dict[int, Array]
"""A point shared by several bodies: for the joint of each body, the point in that joint's frame, m, where it is
fixed."""

_TOUCHING = 1e-3  # of the characteristic length: smaller distances count as contact
_CONSTANT = 1e-6  # of the characteristic length
_SAME = 1e-6  # of the characteristic length
_SAMPLES = 400  # configurations
_FEW = 40  # of these, in which points are compared


def collision_pairs(mechanism: Mechanism, bodies: Sequence[Body]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of bodies that move relative to each other and may collide.

    A pair is left out only for one of these reasons:

    - Both bodies are on the same joint, or on joints that are adjacent by structure (see `adjacent_joints`).
    - They touch in every one of 400 configurations sampled within the limits, loops closed. Contact in one
      configuration, such as home, is no reason.
    - They cannot move relative to each other, or only rotate about a common axis.

    Args:
        mechanism: any.
        bodies: bodies on its joints; convex or meshes.

    Returns:
        indices into `bodies`, the smaller first, in lexical order.
    """
    return classified_pairs(mechanism, bodies)[0]


def classified_pairs(
    mechanism: Mechanism, bodies: Sequence[Body]
) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """Return the pairs that may collide, as `collision_pairs` does, and those that touch in all sampled
    configurations."""
    adjacent = adjacent_joints(mechanism)
    joints = [body.joint for body in bodies]
    candidates = [
        (i, k)
        for i, k in combinations(range(len(bodies)), 2)
        if joints[i] != joints[k] and _ordered(joints[i], joints[k]) not in adjacent
    ]
    if not candidates:
        return (), ()
    samples = LocalIK(mechanism).samples(_SAMPLES, np.random.default_rng(0))
    always = _always_touching(mechanism, bodies, candidates, samples)
    points, length = _body_points(mechanism, bodies, samples[:_FEW]), mechanism.length
    free = tuple(pair for pair in candidates if pair not in always)
    return tuple((i, k) for i, k in free if not _rigid(points[i], points[k], length)), tuple(sorted(always))


def _always_touching(
    mechanism: Mechanism, bodies: Sequence[Body], pairs: Pairs, samples: Array
) -> set[tuple[int, int]]:
    """Return the pairs that touch in all samples (n, nq). A pair found apart once is not measured again."""
    geometry, data = geometry_model(mechanism, bodies, pairs=pairs), kinematic_data(mechanism.model)
    shapes, left = geometry.createData(), set(range(len(pairs)))
    for q in samples:
        if not left:
            break
        pin.computeDistances(mechanism.model, data, geometry, shapes, q)
        for pair in [one for one in left if shapes.distanceResults[one].min_distance > _TOUCHING * mechanism.length]:
            shapes.deactivateCollisionPair(pair)
            left.discard(pair)
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
    found: list[list[Array]] = [[] for _ in bodies]
    for q in configurations:
        pin.forwardKinematics(mechanism.model, data, q)
        for body, own, placed in zip(bodies, points, found, strict=True):
            pose = data.oMi[body.joint]
            placed.append(own @ pose.rotation.T + pose.translation)
    return [np.array(placed) for placed in found]


def _points_of(body: Body) -> Array:
    """Return points (n, 3) in the frame of the joint, m: the ends of the axis of a body of revolution, the centre of a
    sphere, four points of anything else."""
    match body.shape:
        case coal.Sphere():
            points = np.zeros((1, 3))
        case coal.Capsule() | coal.Cylinder():
            points = np.array([[0.0, 0.0, body.shape.halfLength], [0.0, 0.0, -body.shape.halfLength]])
        case _:
            points = body.radius * np.vstack([np.zeros(3), np.eye(3)])
    return np.asarray(points @ body.placement.rotation.T + body.placement.translation)


# --- adjacent joints ---------------------------------------------------------------------------------------------


def adjacent_joints(mechanism: Mechanism) -> frozenset[tuple[int, int]]:
    """Return the pairs of joints, each with the smaller index first, whose bodies are adjacent.

    Bodies are adjacent where one joint carries the other, where a loop was cut between them, and where they share a
    point: two or three revolute joints through one point are a universal joint or a ball joint, and the links on its
    two sides meet there as they would at one joint. A rigid loop joins two parts of one link: what is adjacent to one
    part is adjacent to both.
    """
    model = mechanism.model
    found = {(int(model.parents[j]), j) for j in range(1, model.njoints)}
    found |= {_ordered(first, second) for first, _, second, _ in mechanism.system.anchors}
    for hinge in _hinges(mechanism):
        found.update(combinations(sorted(hinge), 2))
    parts = _parts_of_links(mechanism)
    found = {_ordered(i, j) for pair in found for i, j in product(*(parts[joint] for joint in pair))}
    return frozenset((i, j) for i, j in found if i != j)


def _parts_of_links(mechanism: Mechanism) -> list[set[int]]:
    """Return for each joint the joints that carry parts of the same link: itself, and those joined by rigid loops."""
    parts = [{joint} for joint in range(mechanism.model.njoints)]
    for loop, (first, _, second, _) in zip(mechanism.loops, mechanism.system.anchors, strict=True):
        if loop.kind == LoopKind.RIGID:
            joined = parts[first] | parts[second]
            for joint in joined:
                parts[joint] = joined
    return parts


def _hinges(mechanism: Mechanism) -> list[_Hinge]:
    """Return the points about which links rotate; coincident points are merged, whichever joints they belong to."""
    near = _SAME * mechanism.length
    found: list[_Hinge] = []
    for new in _joint_centres(mechanism):
        same = [hinge for hinge in found if any(np.linalg.norm(hinge[j] - new[j]) <= near for j in hinge.keys() & new)]
        found = [hinge for hinge in found if not any(hinge is other for other in same)]
        found.append({joint: point for hinge in (*same, new) for joint, point in hinge.items()})
    return found


def _joint_centres(mechanism: Mechanism) -> Iterator[_Hinge]:
    """Yield for each joint that rotates, cut or not, a point of its axis."""
    model = mechanism.model
    for j in range(1, model.njoints):
        if translations(model.joints[j]) == 0:
            yield {int(model.parents[j]): np.array(model.jointPlacements[j].translation), j: np.zeros(3)}
    for loop, (first, first_placement, second, second_placement) in zip(
        mechanism.loops, mechanism.system.anchors, strict=True
    ):
        if loop.kind != LoopKind.PRISMATIC and first != second:
            yield {first: np.array(first_placement.translation), second: np.array(second_placement.translation)}


def _ordered(first: int, second: int) -> tuple[int, int]:
    return (first, second) if first < second else (second, first)
