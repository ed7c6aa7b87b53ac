"""Distances of links are those of their meshes, judged by coal's trees over meshes that trimesh reads."""

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from example_robots import PANDA, PANDA_READY, UR5, load
from mesh_contact import MeshContact, tree_of

import cinegen
from cinegen.collision import Clearance, scene_of
from cinegen.collision.body import Body, PlacedShape
from cinegen.collision.clearance import clearance_of
from cinegen.collision.report import collision_report, depth_at_least, excess
from cinegen.collision.self_collision import PairReason, link_pairs
from cinegen.collision.triangle_mesh import TriangleMesh


def configurations(mechanism, count, seed):
    low, high = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
    rng = np.random.default_rng(seed)
    return rng.uniform(np.maximum(low, -np.pi), np.minimum(high, np.pi), size=(count, len(low)))


def clearance_among_links(mechanism, within=None):
    links = mechanism.structure.derived(link_pairs)
    return Clearance(mechanism, links.bodies, (), links.of(PairReason.CHECKED), within)


def test_a_configuration_is_clear_by_a_margin_exactly_where_the_meshes_are():
    mechanism, margin = load(PANDA), 2e-3
    meshes = MeshContact(mechanism, configurations(mechanism, 100, 1))
    clearance = clearance_among_links(mechanism, 3e-3)
    touching = 0
    for q in configurations(mechanism, 100, 2):
        least = clearance.least(q)
        touching += bool(meshes.touching(q, first=True))
        assert (least <= 0.0) == bool(meshes.touching(q, first=True))
        if least < margin - 1e-5:
            assert meshes.touching(q, margin, first=True)
        elif least > margin + 1e-5:
            assert not meshes.touching(q, margin, first=True)
    assert 5 < touching < 80


def test_rows_of_exact_distances_are_how_they_change():
    mechanism, checked, step = load(UR5), 0, 1e-5
    clearance = clearance_among_links(mechanism)
    for q in configurations(mechanism, 20, 5):
        near = clearance.near(q, 0.1)
        first = {int(pair): i for i, pair in reversed(list(enumerate(near.pairs)))}
        distances, rows, excess = near.distances.copy(), near.rows.copy(), clearance.memory.excess.copy()
        for pair, i in first.items():
            if excess[pair] == 0.0 or not 1e-3 < distances[i] < 2.9 * clearance.exact_within:
                continue
            slopes, jumps = np.zeros(len(q)), np.zeros(len(q))
            for j, column in enumerate(step * np.eye(len(q))):
                ahead, behind = (clearance.distances(q + side * column)[pair] for side in (1.0, -1.0))
                slopes[j] = (ahead - behind) / (2.0 * step)
                jumps[j] = abs(ahead + behind - 2.0 * distances[i]) / step
            if jumps.max() < 1e-2:  # the nearest points stay on the same triangles
                assert rows[i] == pytest.approx(-slopes, abs=2e-4 * mechanism.length)
                checked += 1
    assert checked > 4


def test_no_pair_that_is_called_certain_on_a_motion_comes_nearer_by_its_meshes():
    """A robot walks in small steps, so that most is known from measurements of earlier ones."""
    mechanism, safety, rng = load(PANDA), 2e-3, np.random.default_rng(4)
    meshes = MeshContact(mechanism, configurations(mechanism, 100, 1))
    clearance = clearance_among_links(mechanism, 5e-3)
    near = certain = 0
    for start in configurations(mechanism, 12, 6):
        aim, q = 0.06 * rng.normal(size=len(start)), start
        for _ in range(8):
            q, half = q + aim, rng.choice([0.5, 3.0]) * aim
            left = clearance.uncertain(q, np.abs(half), safety, clearance.every_pair, half)
            if left is None:
                assert meshes.touching(q, safety + 1e-5, first=True)
                continue
            open_ = {frozenset(clearance.names(pair)) for pair in left.tolist()}
            certain += len(clearance.pairs) - len(left)
            for t in (-1.0, -0.4, 0.3, 1.0):
                touching = meshes.touching(q + t * half, safety - 1e-5)
                near += len(touching)
                assert {frozenset((meshes.names[i], meshes.names[k])) for i, k in touching} <= open_
    assert near > 0
    assert certain > 0


# --- bodies inside of meshes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mesh", "convex"),
    [
        (trimesh.creation.icosphere(subdivisions=3), True),
        (trimesh.creation.box((0.1, 0.5, 1.0)), True),
        (trimesh.creation.torus(0.3, 0.1), False),
        (trimesh.creation.icosphere(subdivisions=3).slice_plane([0, 0, 0], [0, 0, 1]), False),  # open
        (trimesh.creation.annulus(0.1, 0.3, 0.2), False),
    ],
)
def test_only_closed_meshes_without_dents_are_convex(mesh, convex):
    assert TriangleMesh(tree_of(mesh.vertices, mesh.faces)).is_convex == convex


# --- self-clearance ------------------------------------------------------------------------------------------------


def grasping(gap, **more):
    """A panda whose fingers are a gap apart, m."""
    start = PANDA_READY | {"panda_finger_joint1": gap / 2.0, "panda_finger_joint2": gap / 2.0}
    goal = {"point": load(PANDA).placement(load(PANDA).configuration(start), "panda_hand").translation.tolist()}
    return scene_of({"start": {"joints": start}, "goal": goal, "node": "panda_hand", **more}, mechanism=load(PANDA))


def test_a_gripper_may_be_almost_closed_while_obstacles_are_kept_away():
    scene = grasping(2e-3)
    assert (scene.safety, scene.self_clearance) == (0.01, 1e-3)
    assert clearance_of(scene).least(scene.start) >= scene.safety
    nearer = grasping(0.5e-3)
    assert clearance_of(nearer).least(nearer.start) < nearer.safety
    strict = grasping(2e-3, self_clearance=5e-3)
    assert clearance_of(strict).least(strict.start) < strict.safety
    closed = grasping(0.0)  # the pads overlap by 0.04 mm
    assert clearance_of(closed).least(closed.start) <= 0.0


def test_a_self_clearance_beyond_the_safety_distance_is_refused():
    with pytest.raises(cinegen.CinegenError, match="self_clearance"):
        grasping(0.05, self_clearance=0.02)
    assert grasping(0.05, self_clearance=0.0).document()["self_clearance"] == 0.0


# --- error bounds -----------------------------------------------------------------------------------------------------
# Errors of distances, and what `cinegen info --collision` reports of them: by closed forms and brute force.


HERE = pin.SE3.Identity()


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
    touching = {frozenset(pair["links"]): pair for pair in pairs if "depth_at_home" in pair}
    assert all(0.0 <= pair["depth_at_home_at_least"] <= pair["depth_at_home"] for pair in touching.values())
    hand = touching[frozenset(("panda_link5", "panda_hand"))]
    assert 0.03 < hand["depth_at_home_at_least"] < hand["depth_at_home"] < 0.06
    fingers = touching[frozenset(("panda_leftfinger", "panda_rightfinger"))]
    assert fingers["depth_at_home"] == pytest.approx(4e-5, abs=1e-5)
    assert len(touching) == 3
