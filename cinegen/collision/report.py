"""Reports of which links are checked against each other, and how exactly."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin
from trimesh.remesh import subdivide

from cinegen.arrays import Array
from cinegen.collision.body import Body
from cinegen.collision.clearance import Clearance
from cinegen.collision.self_collision import LinkPairs, PairReason, disabled_by_srdf, link_pairs
from cinegen.collision.shapes import kind_of, rounded_hull
from cinegen.model import Mechanism

_POINTS = 1000  # of a surface, at least, whose distances are measured
_MOST = 200  # points of a mesh whose depth in another one is measured


def collision_report(mechanism: Mechanism) -> dict[str, Any]:
    """Return the shapes with which a mechanism's links collide, and why each pair is checked, or not.

    Returns:
        `shapes`: the link of each, its exact shape, the convex shape around it, and `excess`, see there.
            `exact_within`: default distance of convex shapes, m, below which exact shapes are measured; further away a
            distance is too short by the excess of both shapes at most. `pairs`: two links, the reason, and for checked
            ones in contact at home the bounds `depth_at_home_at_least` and `depth_at_home` of their depth, m: by how
            much one of them would have to move. `not_checked`: links whose meshes are lost, and why.
    """
    links: LinkPairs = mechanism.structure.derived(link_pairs)
    checked = links.of(PairReason.CHECKED)
    clearance = Clearance(mechanism, links.bodies, (), checked)
    depths = -clearance.distances(mechanism.q_home)
    srdf, disabled = mechanism.source.srdf, disabled_by_srdf(mechanism)
    pairs = []
    for pair, reason in links.reasons.items():
        names = [links.bodies[i].name for i in pair]
        entry: dict[str, Any] = {"links": names, "reason": reason.value}
        if srdf is not None and reason is PairReason.SRDF:
            entry["reason"] = f"disabled by {srdf['file']}: {disabled[frozenset(names)] or 'no reason given'}"
        if reason is PairReason.CHECKED and (depth := depths[checked.index(pair)]) >= 0.0:
            bodies = [links.bodies[i].as_described for i in pair]
            poses = [clearance.joint_pose(body.joint) * body.placement for body in bodies]
            entry["depth_at_home"] = depth
            entry["depth_at_home_at_least"] = min(depth_at_least(bodies, poses, depth), depth)
        pairs.append(entry)
    shapes = [
        {
            "link": body.name,
            "shape": kind_of(body.as_described.shape).text(body.as_described.shape),
            "around": kind_of(body.shape).text(body.shape) if body.exact else None,
            "excess": excess(body),
        }
        for body in links.bodies
    ]
    lost = dict(mechanism.unchecked_links)
    return {"shapes": shapes, "exact_within": clearance.exact_within, "pairs": pairs, "not_checked": lost}


# --- how much convex shapes exceed exact ones --------------------------------------------------------------------


def excess(body: Body) -> float:
    """Return the largest distance of the surface of a body's convex shape from its exact shape, m; measured at more
    than a thousand points of the surface."""
    if body.exact is None:
        return 0.0
    corners, faces = kind_of(body.shape).surface(body.shape)
    while len(faces) < _POINTS:
        corners, faces = subdivide(corners, faces)
    points = np.concatenate([corners[faces].mean(axis=1), corners])
    return float(_distances(points, body.exact.shape, body.exact.placement).max())


def _distances(points: Array, shape: coal.CollisionGeometry, placement: pin.SE3) -> Array:
    """Return the distances (n,) of points (n, 3) from a shape, m; those of points inside of convex shapes are
    negative."""
    point = coal.Sphere(0.0)  # coal only refers to it
    measure, request = coal.ComputeDistance(point, shape), coal.DistanceRequest()
    pose = coal.Transform3s(placement.rotation, placement.translation)
    places = (coal.Transform3s(np.eye(3), position) for position in points)
    return np.array([measure(place, pose, request, coal.DistanceResult()) for place in places])


# --- how deep meshes overlap -------------------------------------------------------------------------------------


def depth_at_least(bodies: list[Body], poses: list[pin.SE3], depth: float) -> float:
    """Return a lower bound of the depth by which the exact shapes of two bodies overlap, m: the depth of the deepest
    measured corner of one of them inside the other; 0 if none is inside.

    Args:
        bodies: two.
        poses: of their shapes in the world.
        depth: that of convex shapes around them; it is that of the exact shapes, too, where these are convex.
    """
    if all(body.mesh is None for body in bodies):
        return depth
    deepest = 0.0
    for inner, outer in ((0, 1), (1, 0)):
        if kind_of(bodies[inner].shape).is_polyhedron:
            move = poses[outer].actInv(poses[inner])
            corners = np.unique(rounded_hull(bodies[inner].shape)[0], axis=0) @ move.rotation.T + move.translation
            deepest = max(deepest, _deepest(corners, bodies[outer]))
    return deepest


def _deepest(points: Array, body: Body) -> float:
    """Return how deep the deepest of some points (n, 3), in the frame of a shape, is inside of it, m; 0 if none is."""
    mesh = body.mesh
    if mesh is not None:
        points = points[(points @ mesh.hull.normals.T <= mesh.hull.offsets).all(axis=1)]
    points = points[np.linspace(0, len(points) - 1, min(len(points), _MOST)).astype(int)]
    distances = _distances(points, body.shape, pin.SE3.Identity())
    if mesh is None:
        return float(-distances.min(initial=0.0))
    for deepest in np.argsort(-distances):
        if mesh.contains(points[deepest]):
            return float(distances[deepest])
    return 0.0
