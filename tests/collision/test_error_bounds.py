"""Errors of distances, and what `cinegen info --collision` reports of them: by closed forms and brute force."""

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from mesh_contact import tree_of
from reference import PANDA, load
from test_exact_distances import clearance_among_links, configurations

from cinegen.collision.body import Body, PlacedShape
from cinegen.collision.report import collision_report, depth_at_least, excess

HERE = pin.SE3.Identity()


# --- brute force -----------------------------------------------------------------------------------------------------


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
