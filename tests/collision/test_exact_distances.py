"""Distances of links are those of their meshes, judged by coal's trees over meshes that trimesh reads."""

from functools import cache
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from example_robots import PANDA, PANDA_READY, UR5, load
from mesh_contact import MeshContact, tree_of
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.collision import Clearance, clearance_of, scene_of
from cinegen.collision.body import Body, PlacedShape
from cinegen.collision.mesh_check import MeshCheck
from cinegen.collision.report import collision_report, depth_at_least, excess
from cinegen.collision.self_collision import PairReason, link_pairs
from cinegen.collision.triangle_mesh import TriangleMesh
from cinegen.ik.local_ik import LocalIK
from cinegen.planning import PlanStatus, plan


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
    check = MeshCheck(scene(panda(), READY, panda().configuration(READY)))
    touching = 0
    for q in configurations(mechanism, 100, 2):
        least, is_hit = clearance.least(q), bool(meshes.touching(q, first=True))
        touching += is_hit
        assert (least <= 0.0) == is_hit
        assert check.contact(q) or not is_hit
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


# --- check against the meshes -----------------------------------------------------------------------------------------
# No path is reported as reached on which the meshes touch, whatever the convex solids around them say.


READY = PANDA_READY | {"panda_finger_joint1": 0.04, "panda_finger_joint2": 0.04}
FOLDED = READY | {"panda_joint6": 0.15}  # the hand is inside of link 5


def panda():
    return load(PANDA)


def talos():
    return load("talos_data/robots/talos_left_arm.urdf")


def scene(mechanism, start, goal, **more):
    pose = mechanism.placement(goal, mechanism.end)
    aim = {"point": pose.translation.tolist(), "rpy": pin.rpy.matrixToRpy(pose.rotation).tolist()}
    return scene_of({"start": {"joints": start}, "goal": aim, "node": mechanism.end, **more}, mechanism=mechanism)


@cache
def meshes():
    model, rng = panda().model, np.random.default_rng(5)
    return MeshContact(panda(), rng.uniform(model.lowerPositionLimit, model.upperPositionLimit, size=(100, model.nq)))


def between(ends, count):
    return [pin.interpolate(panda().model, *ends, part) for part in np.linspace(0.0, 1.0, count + 1)]


# --- the check -----------------------------------------------------------------------------------------------------


def test_first_contact_is_where_coal_finds_it():
    check = MeshCheck(scene(panda(), READY, panda().configuration(READY)))
    path = np.array(between([panda().configuration(READY), panda().configuration(FOLDED)], 50))
    contact = check.first_contact(path)
    first = next(i for i, q in enumerate(path) if meshes().touches(q))
    assert contact is not None
    assert contact.index in (first - 1, first - 2)  # it may begin between two configurations
    assert "'panda_link5'" in contact.reason
    assert check.first_contact(path[: contact.index + 1]) is None


def test_links_whose_solids_always_overlap_are_checked_by_their_meshes():
    """The hull of Talos's arm_left_3 always holds a part of arm_left_5: only the meshes tell them apart."""
    problem = scene(talos(), {}, talos().q_home)
    clearance = clearance_of(problem)
    both = frozenset(("arm_left_3_link", "arm_left_5_link"))
    (pair,) = [pair for pair in range(len(clearance.pairs)) if both == set(clearance.names(pair))]
    assert clearance.distances(talos().q_home)[pair] > 0.0
    check = MeshCheck(problem)
    assert both not in map(frozenset, check.unchecked)
    free = LocalIK(talos()).samples(20, np.random.default_rng(3))
    beyond = np.random.default_rng(0).uniform(-np.pi, np.pi, size=(60, talos().model.nq))  # limits apart
    named = [[both <= set(check.contact(q).split("'")) for q in some] for some in (free, beyond)]
    assert not any(named[0])
    assert any(named[1])


def test_links_that_touch_in_every_configuration_are_not_checked_and_named():
    """The last link of two stays inside of a ball on the base, which it does not join."""
    radii = {"a": 2, "b": 0.1, "c": 0.1}
    balls = {name: f'<collision><geometry><sphere radius="{r}"/></geometry></collision>' for name, r in radii.items()}
    joints = [UrdfJoint(child, parent, child, "0.5 0 0", limit=(-1.0, 1.0)) for parent, child in ("ab", "bc")]
    arm = cinegen.load(urdf_text(joints, balls))
    check = MeshCheck(scene(arm, {}, arm.q_home))
    assert check.unchecked == (("a", "c"),)
    assert check.contact(arm.q_home) == ""


def test_collisions_that_a_scene_allows_are_not_checked():
    named = {"allowed_collisions": [["panda_link5", "panda_hand"], ["panda_link7", "panda_link5"]]}
    named["allowed_collisions"] += [["panda_link5", f"panda_{side}finger"] for side in ("left", "right")]
    problem = scene(panda(), READY, panda().configuration(READY), **named)
    assert problem.document()["allowed_collisions"] == named["allowed_collisions"]
    folded = panda().configuration(FOLDED)
    assert MeshCheck(scene(panda(), READY, panda().configuration(READY))).contact(folded)
    assert MeshCheck(problem).contact(folded) == ""
    clearance = clearance_of(problem)
    names = {frozenset(clearance.names(pair)) for pair in range(len(clearance.pairs))}
    assert names.isdisjoint(map(frozenset, named["allowed_collisions"]))


def test_a_sheet_of_a_tenth_of_a_millimetre_is_not_passed_through():
    """In one step of a path, by a hand that is at rest at neither end of it near the sheet."""
    model = panda()
    ends = [model.configuration(READY | {"panda_joint1": angle}) for angle in (-0.6, 0.6)]
    middle = model.placement(model.configuration(READY), "panda_hand").translation
    sheet = {"kind": "box", "size": [0.02, 1e-4, 0.02], "point": middle.tolist()}
    check = MeshCheck(scene(model, READY | {"panda_joint1": -0.6}, ends[0], obstacle=[sheet]))
    assert check.contact(ends[0]) == check.contact(ends[1]) == ""
    contact = check.first_contact(np.array(ends))
    assert contact is not None
    assert "box 1" in contact.reason


# --- plans ---------------------------------------------------------------------------------------------------------


def test_a_path_with_contact_is_never_reported_as_reached(monkeypatch):
    """Even if no pair of links were kept clear while planning."""
    bodies = cinegen.collision.clearance.links_of(panda())[0]
    monkeypatch.setattr(cinegen.collision.clearance, "links_of", lambda mechanism: (bodies, ()))
    planned = plan(scene(panda(), READY, panda().configuration(FOLDED)), attempts=2, planner="vortex", shorten=False)
    assert [attempt.status for attempt in planned.attempts] == [PlanStatus.IN_COLLISION] * 2
    assert not planned
    assert "check against the meshes" in planned.reason
    assert not any(meshes().touches(q) for ends in pairwise(planned.path) for q in between(ends, 5))
