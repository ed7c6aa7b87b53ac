"""Errors of distances, and what `cinegen info --collision` reports of them: by closed forms and brute force."""

from __future__ import annotations

from itertools import product

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from mesh_contact import tree_of
from test_exact_distances import PANDA, clearance_among_links, configurations, load

from cinegen.collision.body import Body, PlacedShape
from cinegen.collision.report import _distances, collision_report, depth_at_least, excess

HERE = pin.SE3.Identity()


def moved(rng, size):
    return pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3) * size)


# --- brute force -----------------------------------------------------------------------------------------------------


def between_segments(one, other):
    """The distance of two segments (2, 3): at the common perpendicular, or at an end."""
    (a, b), (c, d) = one, other
    found = [np.linalg.norm(p - (s + np.clip((p - s) @ (e - s) / ((e - s) @ (e - s)), 0, 1) * (e - s)))
             for p, (s, e) in ((a, other), (b, other), (c, one), (d, one))]  # fmt: skip
    u, v, w = b - a, d - c, a - c
    rows = np.array([[u @ u, -u @ v], [-u @ v, v @ v]])
    if abs(np.linalg.det(rows)) > 1e-12:
        s, t = np.linalg.solve(rows, [-u @ w, v @ w])
        if 0 <= s <= 1 and 0 <= t <= 1:
            found.append(np.linalg.norm(w + s * u - t * v))
    return min(found)


def brute(one, other):
    """The distance of two meshes apart: between edges, and between corners and triangles."""
    corners = [
        np.linalg.norm(
            trimesh.triangles.closest_point(b.triangles, np.tile(p, (len(b.triangles), 1))) - p, axis=1
        ).min()
        for a, b in ((one, other), (other, one))
        for p in a.vertices
    ]
    edges = [mesh.vertices[mesh.edges_unique] for mesh in (one, other)]
    return min(*corners, *(between_segments(a, b) for a, b in product(*edges)))


def coal_distance(one, other, there):
    return coal.distance(one, coal.Transform3s(), other, there, coal.DistanceRequest(), coal.DistanceResult())


def test_distances_of_meshes_are_exact_to_a_nanometre_and_of_hulls_to_three_micrometres():
    rng, worst, worst_hull = np.random.default_rng(3), 0.0, 0.0
    for _ in range(4):
        meshes = []
        for _ in range(2):
            mesh = trimesh.creation.icosphere(subdivisions=0, radius=0.1)
            mesh.vertices = mesh.vertices * rng.uniform(0.3, 2.0, 3)
            meshes.append(mesh)
        placed = moved(rng, 0.2)
        second = meshes[1].copy()
        second.apply_transform(placed.homogeneous)
        least = brute(meshes[0], second)
        if least < 1e-3:
            continue
        there = coal.Transform3s(placed.rotation, placed.translation)
        shapes = [tree_of(mesh.vertices, mesh.faces) for mesh in meshes]
        found = coal.distance(
            shapes[0], coal.Transform3s(), shapes[1], there, coal.DistanceRequest(), coal.DistanceResult()
        )
        worst = max(worst, abs(found - least))
        for shape in shapes:
            shape.buildConvexHull(True, "Qt")
        hulls = [shape.convex for shape in shapes]
        found = coal.distance(
            hulls[0], coal.Transform3s(), hulls[1], there, coal.DistanceRequest(), coal.DistanceResult()
        )
        worst_hull = max(worst_hull, abs(found - least))
    assert 0.0 < worst < 1e-9
    assert worst_hull < 3e-6


# --- how much convex bodies exceed exact ones ------------------------------------------------------------------------


def test_a_capsule_exceeds_the_cylinder_in_it_by_its_round_ends():
    capsule, cylinder = coal.Capsule(0.1, 0.5), coal.Cylinder(0.1, 0.5)
    assert excess(Body("rod", 1, HERE, capsule, PlacedShape(HERE, cylinder))) == pytest.approx(0.1, rel=0.01)
    assert excess(Body("rod", 1, HERE, capsule)) == 0.0


def test_a_hull_exceeds_a_mesh_by_the_depth_of_its_dent():
    """An angle of two bars of unit length: the middle of the hull's slanted side is 0.35 sqrt(2) from the corner."""
    bars = [trimesh.creation.box(bounds=[[0, 0, 0], size]) for size in ([1, 0.3, 0.2], [0.3, 1, 0.2])]
    angle = trimesh.boolean.union(bars)
    corners = coal.StdVec_Vec3s()
    corners.extend(list(np.asarray(angle.convex_hull.vertices)))
    exact = tree_of(angle.vertices, angle.faces)
    body = Body("angle", 1, HERE, coal.Convex.convexHull(corners, True, "Qt"), PlacedShape(HERE, exact))
    assert excess(body) == pytest.approx(0.35, abs=0.02)


def test_no_distance_is_too_short_by_more_than_the_excess_of_both_bodies():
    mechanism = load(PANDA)
    plain, exact = clearance_among_links(mechanism, 0.0), clearance_among_links(mechanism, np.inf)
    exceeds = np.array([excess(body) for body in plain.links])[plain.pairs].sum(axis=1)
    tightest = np.inf
    for q in configurations(mechanism, 20, 8):
        least, real = plain.distances(q), exact.distances(q)
        apart = least > 1e-3
        assert (real >= least - 5e-6)[apart].all()
        room = (exceeds + 0.05 * exceeds.max() - (real - least))[apart]
        assert (room >= 0.0).all()
        tightest = min(tightest, room.min())
    assert tightest < 0.5 * exceeds.max()


# --- depth at home ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("depth", "deepest"), [(0.001, 0.001), (0.02, 0.02), (0.1, 0.06)])
def test_the_depth_of_two_boxes_is_no_less_than_that_of_the_deepest_corner(depth, deepest):
    box, small = trimesh.creation.box((0.4, 0.4, 0.4)), trimesh.creation.box((0.3, 0.3, 0.3))
    bodies = [Body("box", 1, HERE, tree_of(mesh.vertices, mesh.faces)) for mesh in (box, small)]
    poses = [HERE, pin.SE3(np.eye(3), np.array([0.35 - depth, 0.01, 0.02]))]
    assert depth_at_least(bodies, poses, np.inf) == pytest.approx(deepest, abs=1e-9)
    poses[1].translation = np.array([0.36, 0.0, 0.0])
    assert depth_at_least(bodies, poses, np.inf) == 0.0


def test_the_report_has_the_depth_at_home_of_the_panda_and_no_other_pair():
    """The hand is some centimetres inside of link 5 in the URDF's zero configuration."""
    pairs = collision_report(load(PANDA))["pairs"]
    touching = {frozenset(one["links"]): one for one in pairs if "depth_at_home" in one}
    assert all(0.0 <= one["depth_at_home_at_least"] <= one["depth_at_home"] for one in touching.values())
    hand = touching[frozenset(("panda_link5", "panda_hand"))]
    assert 0.03 < hand["depth_at_home_at_least"] < hand["depth_at_home"] < 0.06
    fingers = touching[frozenset(("panda_leftfinger", "panda_rightfinger"))]
    assert fingers["depth_at_home"] == pytest.approx(4e-5, abs=1e-5)
    assert len(touching) == 3


def test_distances_of_many_points_are_those_of_the_box():
    """coal only refers to the point that it measures from: it was freed while it was used."""
    points = np.random.default_rng(0).uniform(1.0, 3.0, size=(2000, 3))
    found = _distances(points, coal.Box(1.0, 2.0, 1.0), pin.SE3.Identity())
    assert found == pytest.approx(np.linalg.norm(np.maximum(points - [0.5, 1.0, 0.5], 0.0), axis=1), abs=1e-9)
