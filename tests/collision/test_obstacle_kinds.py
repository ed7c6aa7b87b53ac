"""Obstacles of all kinds: where they stand and how far points are from them, by formulas."""

import json
import math
from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from clearings import apart, at
from example_robots import UR5, load
from firas import firas
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes_of_tables import refused, scene_with, to_point

import cinegen
from cinegen.collision import Clearance, Obstacle, SceneError, clearance_of, scene_of
from cinegen.collision.body import Body
from cinegen.collision.links import link_bodies
from cinegen.collision.obstacle_kinds import HEIGHT
from cinegen.planning import plan

seeds = st.integers(0, 2**32 - 1)


def _outside_box(p, half):
    return float(np.linalg.norm(np.maximum(np.abs(p) - half, 0.0)))


def _outside_cylinder(p, radius, half):
    return math.hypot(max(math.hypot(p[0], p[1]) - radius, 0.0), max(abs(p[2]) - half, 0.0))


def _outside_capsule(p, radius, a, b):
    t = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return float(np.linalg.norm(a + t * (b - a) - p)) - radius


def _ends_frame(a, b):
    return pin.Quaternion.FromTwoVectors(np.array([0, 0, 1.0]), (b - a) / np.linalg.norm(b - a)).toRotationMatrix()


A, B = np.array([0.3, -0.2, 0.1]), np.array([-0.4, 0.5, 0.9])
NORMAL = np.array([1.0, 2.0, -2.0])
SHAPES = {
    "sphere": ({"radius": 0.4}, lambda p: np.linalg.norm(p) - 0.4),
    "box": ({"size": [0.2, 0.4, 0.6]}, lambda p: _outside_box(p, np.array([0.1, 0.2, 0.3]))),
    "box in the plane": (
        {"kind": "box", "size": [0.2, 0.4]},
        lambda p: _outside_box(p, np.array([0.1, 0.2, HEIGHT / 2])),
    ),
    "cylinder": ({"radius": 0.3, "length": 0.8}, lambda p: _outside_cylinder(p, 0.3, 0.4)),
    "cylinder between ends": (
        {"kind": "cylinder", "radius": 0.2, "ends": [A, B]},
        lambda p: _outside_cylinder(_ends_frame(A, B).T @ (p - (A + B) / 2), 0.2, np.linalg.norm(B - A) / 2),
    ),
    "capsule": (
        {"radius": 0.3, "length": 0.8},
        lambda p: _outside_capsule(p, 0.3, np.array([0, 0, -0.4]), np.array([0, 0, 0.4])),
    ),
    "capsule between ends": (
        {"kind": "capsule", "radius": 0.1, "ends": [A, B]},
        lambda p: _outside_capsule(p, 0.1, A, B),
    ),
    "capsule between ends in the plane": (
        {"kind": "capsule", "radius": 0.1, "ends": [A[:2], B[:2]]},
        lambda p: _outside_capsule(p, 0.1, np.array([*A[:2], 0]), np.array([*B[:2], 0])),
    ),
    "half_plane": ({"normal": [3.0, -4.0]}, lambda p: p @ np.array([0.6, -0.8, 0.0])),
    "half_space": ({"normal": NORMAL}, lambda p: p @ NORMAL / 3.0),
    "disc": ({"radius": 0.4}, lambda p: _outside_cylinder(p, 0.4, HEIGHT / 2)),
    "disc of a height": ({"kind": "disc", "radius": 0.4, "height": 0.2}, lambda p: _outside_cylinder(p, 0.4, 0.1)),
    "polygon of a height": (
        {"kind": "polygon", "points": [[-1, -2], [1, -2], [1, 2], [-1, 2]], "height": 0.6},
        lambda p: _outside_box(p, np.array([1, 2, 0.3])),
    ),
}


@pytest.mark.parametrize("case", SHAPES)
@settings(max_examples=60)
@given(seed=seeds)
def test_points_are_as_far_from_an_obstacle_as_geometry_says(case, seed):
    shape, truth = SHAPES[case]
    rng = np.random.default_rng(seed)
    point, rpy = rng.normal(size=3), rng.uniform(-3, 3, size=3)
    scene = scene_with({"kind": case.split()[0], **shape, "point": point, "rpy": rpy})
    (obstacle,) = scene.obstacles
    seen = rng.normal(size=3) * 2.0
    in_world = pin.rpy.rpyToMatrix(rpy) @ seen + point
    if truth(seen) > 0.0:
        assert to_point(obstacle.bodies, in_world) == pytest.approx(truth(seen), abs=2e-5)
    else:
        assert to_point(obstacle.bodies, in_world) <= 1e-9
    # moved, it is as far from the point that moved with it
    away = pin.SE3.Random()
    moved = obstacle.moved(away)
    assert moved.placement is not away
    assert to_point(moved.bodies, away.act(seen)) == pytest.approx(to_point(obstacle.bodies, in_world), abs=2e-5)


# --- meshes -----------------------------------------------------------------------------------------------------------


def _reads(folder, mesh, suffix="stl", **keys):
    mesh.export(folder / f"thing.{suffix}")
    return scene_with({"kind": "mesh", "file": f"thing.{suffix}", **keys}, folder=folder).obstacles[0]


@pytest.mark.parametrize("suffix", ["stl", "glb"])
def test_a_convex_mesh_is_one_piece(tmp_path, suffix):
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    obstacle = _reads(tmp_path, box, suffix, scale=0.1)
    assert [piece.name for piece in obstacle.pieces] == ["mesh 1"]
    rng = np.random.default_rng(1)
    for p in rng.normal(size=(50, 3)):
        truth = _outside_box(p, np.array([0.05, 0.1, 0.15]))
        assert to_point(obstacle.bodies, p) == pytest.approx(truth, abs=1e-5) or truth == 0.0


def test_a_mesh_of_convex_parts_is_as_many_pieces(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    ball.apply_translation([3, 0, 0])
    obstacle = _reads(tmp_path, trimesh.util.concatenate([trimesh.creation.box((1, 1, 1)), ball]))
    assert sorted(piece.name for piece in obstacle.pieces) == ["mesh 1/1", "mesh 1/2"]
    assert to_point(obstacle.bodies, [1.5, 0, 0]) == pytest.approx(1.0, abs=0.02)
    assert to_point(obstacle.bodies, [1.0, 0, 0]) == pytest.approx(0.5, abs=1e-6)
    volumes = sorted(piece.shape.computeVolume() for piece in obstacle.pieces)
    assert volumes == pytest.approx(sorted([1.0, ball.volume]), rel=1e-5)


def test_damaged_meshes_and_flat_hulls_are_refused(tmp_path):
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    for convex, said in (("hull", "it is flat: leave out convex"), ("parts", "can only be 'hull', not 'parts'")):
        with pytest.raises(SceneError, match=said):
            _reads(tmp_path, flat, convex=convex)
    for file, content, said in [
        ("gone.stl", "", "does not exist"),
        ("noise.stl", "solid nothing", "can't be read|it is empty"),
        ("noise.glb", "glTF nothing", "can't be read"),
        ("picture.png", "x", r"has an unknown format: use \.stl"),
        ("lfs.stl", "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n", "Git LFS pointer: run `git"),
    ]:
        if content:
            (tmp_path / file).write_text(content)
        with pytest.raises(SceneError, match=said) as error:
            scene_with({"kind": "mesh", "file": file}, folder=tmp_path)
        assert str(error.value).startswith(f"scene: obstacle 1: file '{tmp_path / file}'")


# --- there and back ---------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(seeds)
def test_what_a_scene_writes_reads_back_as_the_same(seed):
    rng = np.random.default_rng(seed)
    kinds = [{"kind": case.split()[0], **shape} for case, (shape, _) in SHAPES.items()]
    obstacles = [kind | {"point": rng.normal(size=3), "rpy": rng.uniform(-4, 4, 3)} for kind in kinds]
    obstacles[0]["rpy"] = [0.3, math.pi / 2, -0.2]  # where roll and yaw are one
    scene = scene_with(*obstacles, safety=float(rng.uniform(0, 0.1)), start={"point": rng.normal(size=2)})
    obstacles = scene.obstacles
    moved = replace(scene, obstacles=(*obstacles[:3], obstacles[3].moved(pin.SE3.Random()), *obstacles[4:]))
    for before in (scene, moved):
        after = scene_of(json.loads(json.dumps(before.document())))
        assert _close(after.document(), before.document())
        assert (after.start == before.start).all()
        assert after.goal.isApprox(before.goal, 1e-12)
        for original, other in zip(before.obstacles, after.obstacles, strict=True):
            assert (original.name, original.kind, len(original.pieces)) == (other.name, other.kind, len(other.pieces))
            assert original.placement.isApprox(other.placement, 1e-12)
            for p in rng.normal(size=(3, 3)) * 2:
                assert to_point(original.bodies, p) == pytest.approx(to_point(other.bodies, p), abs=1e-5)


def _close(a, b):
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(k == "rpy" or _close(a[k], b[k]) for k in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(map(_close, a, b))
    return a == b or (isinstance(a, float) and abs(a - b) < 1e-9)


# --- another robot -----------------------------------------------------------------------------------------------


def test_another_robot_is_an_obstacle_at_its_joint_values_and_base_pose(robot, root):
    """Its convex bodies are as far from a ball as the robot itself is, moved there."""
    other = robot("planar_3r")
    values = {"joint1": 0.7, "joint3": -0.4}
    table = {"name": "other", "kind": "robot", "file": "robots/planar_3r.raff", "joints": values, "point": [1, 0.5, 0]}
    made = scene_of({"mobile": {"radius": 0.1}, "goal": {"point": [3, 0]}, "obstacle": [table]}, root)
    (obstacle,) = made.obstacles
    q, ball = other.configuration(values), np.array([0.9, 0.9, 0.3])
    near = Obstacle("ball", (Body("ball", 0, pin.SE3(np.eye(3), ball - [1, 0.5, 0]), coal.Sphere(0.05)),))
    bodies = link_bodies(other)
    expected = Clearance(other, bodies, [near]).least(q)
    moving = [body for body, link in zip(obstacle.bodies, bodies, strict=True) if link.joint]
    distances = [apart(body.shape, body.placement, coal.Sphere(0.05), at(*ball)) for body in moving]
    assert min(distances) == pytest.approx(expected, abs=1e-6)
    (again,) = scene_of(made.document(), root).obstacles
    assert [body.placement for body in again.bodies] == [body.placement for body in obstacle.bodies]


# --- obstacle meshes --------------------------------------------------------------------------------------------------
# Obstacles of triangles and of points: distances against brute force over all triangles and all points.


INNER, OUTER, HALF = 0.4, 0.6, 0.3
RADIUS = 0.05


def cup():
    """The faces of a box without a lid: an open surface."""
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    return trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] < 0.5])


def as_values(mesh):
    return {"kind": "mesh", "vertices": mesh.vertices, "triangles": mesh.faces}


def to_triangles(corners, points):
    """(n,) distances of points from the nearest of all triangles, one by one."""
    nearest = [trimesh.triangles.closest_point(corners, np.tile(p, (len(corners), 1))) - p for p in points]
    return np.linalg.norm(nearest, axis=2).min(axis=1)


def among(clearance, q):
    """The least distance of links from obstacles."""
    return float(clearance.distances(q)[clearance.pairs[:, 1] >= len(clearance.links)].min())


# --- triangles -------------------------------------------------------------------------------------------------------


@settings(max_examples=6)
@given(seed=seeds)
def test_a_ball_is_as_far_from_a_mesh_that_is_not_convex_as_from_its_nearest_triangle(seed):
    rng = np.random.default_rng(seed)
    for mesh in (trimesh.creation.annulus(INNER, OUTER, 2.0 * HALF, sections=24), cup()):
        clearance = clearance_of(scene_with(as_values(mesh), mobile={"radius": RADIUS}), is_exact=True)
        points = np.column_stack([rng.uniform(-1.0, 1.0, size=(20, 2)), np.zeros(20)])
        truth = to_triangles(mesh.triangles, points) - RADIUS
        across = np.linalg.norm(points, axis=1)
        inside = mesh.is_watertight & (across > INNER) & (across < OUTER * math.cos(math.pi / 24))
        for point, distance, is_inside in zip(points, truth, inside, strict=True):
            least = clearance.least(point[:2])
            if is_inside or distance < 0.0:
                assert least <= 1e-9
            elif across[0] < INNER or across[0] > OUTER:
                assert least == pytest.approx(distance, abs=1e-6)


def test_a_path_leads_out_of_a_pipe_whose_hull_fills_it(tmp_path):
    """A mobile robot leaves the inside of a C through its gap, and the path is clear by brute force."""
    outline = trimesh.creation.annulus(INNER, OUTER, 0.6, sections=48)
    gap = outline.triangles_center[:, 0] < 0.2  # cut open at +x: an open surface
    shape = trimesh.Trimesh(outline.vertices, outline.faces[gap])
    shape.export(tmp_path / "c.ply")
    values = {"mobile": {"radius": RADIUS}, "goal": {"point": [-1.0, 0.1]}, "start": {"point": [-0.1, 0.1]}}
    scene = scene_of(values | {"obstacle": [{"kind": "mesh", "file": "c.ply"}]}, tmp_path)
    planned = plan(scene)
    assert planned
    fine = np.vstack([np.linspace(a, b, 20) for a, b in zip(planned.path, planned.path[1:], strict=False)])
    some = fine[:: max(1, len(fine) // 60)]
    points = np.column_stack([some, np.zeros(len(some))])
    assert to_triangles(shape.triangles, points).min() >= RADIUS + scene.safety - 1e-6


# --- points ----------------------------------------------------------------------------------------------------------


@settings(max_examples=6)
@given(seed=seeds)
def test_the_distance_of_a_ball_from_points_is_never_overestimated_nor_by_more_than_a_diagonal_too_small(seed):
    rng = np.random.default_rng(seed)
    size = float(rng.uniform(0.01, 0.1))
    points = rng.normal(size=(1500, 3)) * rng.uniform(0.05, 0.5, size=3)
    scene = scene_with({"kind": "points", "points": points, "voxel": size}, mobile={"radius": RADIUS})
    clearance = clearance_of(scene, is_exact=True)
    for q in rng.uniform(-1.0, 1.0, size=(20, 2)):
        truth = float(np.linalg.norm(points - [*q, 0.0], axis=1).min()) - RADIUS
        least = clearance.least(q)
        assert least <= max(truth, 0.0) + 1e-9
        if least > 0.0:
            assert least >= truth - math.sqrt(3.0) * size - 1e-9


def test_a_speck_inside_of_a_link_is_in_collision():
    """It touches no triangle of the link's mesh, and the block to which it belongs lies outside of the link."""
    mechanism = load(UR5)
    q = mechanism.q_home
    link = next(geom for geom in mechanism.collision.geometryObjects if geom.parentJoint == 2)
    mesh = trimesh.load_mesh(link.meshPath, process=True)
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    deep = max(mesh.sample(400, seed=1) * 0.7 + 0.3 * mesh.centroid, key=lambda p: mesh.nearest.signed_distance([p])[0])
    inside = (data.oMi[2] * link.placement).act(deep)
    for points, is_hit in (([inside, [0, 0, 2.5], [0, 0.1, 2.5]], True), ([[0, 0, 2.5], [0, 0.1, 2.5]], False)):
        obstacle = {"kind": "points", "points": points, "voxel": 2e-3}
        scene = scene_of({"goal": {"point": [0.4, 0.1, 0.4]}, "obstacle": [obstacle]}, mechanism=mechanism)
        assert (among(clearance_of(scene), q) <= 0.0) == is_hit


@pytest.mark.parametrize("suffix", ["npy", "ply", "txt"])
def test_points_are_read_from_files(tmp_path, suffix):
    points, path = np.random.default_rng(1).normal(size=(50, 3)).round(4), tmp_path / f"cloud.{suffix}"
    if suffix == "npy":
        np.save(path, points)
    elif suffix == "ply":
        trimesh.PointCloud(points).export(path)
    else:
        np.savetxt(path, points)
    ball = {"radius": 0.01}
    read = scene_with({"kind": "points", "file": path.name, "scale": 0.5}, folder=tmp_path, mobile=ball)
    inline = scene_with({"kind": "points", "points": (0.5 * points).tolist()}, mobile=ball)
    for q in np.random.default_rng(2).normal(size=(20, 2)):
        first, second = (clearance_of(scene, True).least(q) for scene in (read, inline))
        assert first == pytest.approx(second, abs=1e-5)
    again = scene_of(json.loads(json.dumps(inline.document())))
    assert clearance_of(again).least(np.zeros(2)) == clearance_of(inline).least(np.zeros(2))


def test_what_is_wrong_with_triangles_and_points_is_reported(tmp_path):
    cloud = {"kind": "points", "points": [[0, 0, 0], [1, 1, 1]]}
    corners = {"kind": "mesh", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}
    for obstacle, message in [
        (cloud | {"points": [[0, 0]]}, "points must be a list of rows of 3 numbers"),
        (cloud | {"points": [[0, 0, math.nan], [1, 1, 1]]}, "points has 1 points that are not finite: remove them"),
        (cloud | {"voxel": 1e-6, "points": [[0, 0, 5]]}, "beyond 1048576 voxels; make voxel larger than 1e-06 m"),
        (corners | {"triangles": [[0, 1, 3]]}, "triangles must be indices of vertices, from 0 to 2"),
        (corners | {"triangles": [[0, 1, 1]]}, "vertices has no triangle with an area"),
    ]:
        assert message in refused(obstacle)
    trimesh.creation.box().export(tmp_path / "box.ply")
    (tmp_path / "cloud.pcd").write_text("# .PCD")
    for file, message in [
        ("box.ply", "it has triangles: write kind = 'mesh'"),
        ("cloud.pcd", "use .npy, .ply, .txt, .xyz; pcl_pcd2ply, a tool of the Point Cloud Library, converts it"),
    ]:
        assert message in refused({"kind": "points", "file": file}, folder=tmp_path)


def test_a_repulsive_potential_refuses_a_mesh_that_is_not_convex():
    with pytest.raises(cinegen.CinegenError, match="need convex obstacles: 'mesh 1' is not"):
        plan(scene_with(as_values(cup()), mobile={"radius": RADIUS}), field=firas)
