"""Obstacles of triangles and of points: distances against brute force over all triangles and all points."""

import json
import math

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import UR5, load
from scenes_of_tables import refused, scene_with

import cinegen
from cinegen.collision import clearance_of, scene_of
from cinegen.planning import plan

seeds = st.integers(0, 2**32 - 1)

INNER, OUTER, HALF = 0.4, 0.6, 0.3
RADIUS = 0.05


def tube():
    """A pipe along z: closed, not convex."""
    return trimesh.creation.annulus(INNER, OUTER, 2.0 * HALF, sections=24)


def cup():
    """The faces of a box without a lid: an open surface."""
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    return trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 2] < 0.5])


def as_values(mesh):
    return {"kind": "mesh", "vertices": mesh.vertices, "triangles": mesh.faces}


def to_triangles(corners, points):
    """(n,) distances of points from the nearest of all triangles, one by one."""
    return np.array(
        [
            np.linalg.norm(trimesh.triangles.closest_point(corners, np.tile(p, (len(corners), 1))) - p, axis=1).min()
            for p in points
        ]
    )


def among(clearance, q):
    """The least distance of links from obstacles."""
    return float(clearance.distances(q)[clearance.pairs[:, 1] >= len(clearance.links)].min())


# --- triangles -------------------------------------------------------------------------------------------------------


@settings(max_examples=6)
@given(seed=seeds)
def test_a_ball_is_as_far_from_a_mesh_that_is_not_convex_as_from_its_nearest_triangle(seed):
    rng = np.random.default_rng(seed)
    for mesh in (tube(), cup()):
        clearance = clearance_of(scene_with(as_values(mesh), mobile={"radius": RADIUS}), is_exact=True)
        points = np.column_stack([rng.uniform(-1.0, 1.0, size=(20, 2)), np.zeros(20)])
        truth = to_triangles(mesh.triangles, points) - RADIUS
        across = np.linalg.norm(points, axis=1)
        inside = mesh.is_watertight & (across > INNER) & (across < OUTER * math.cos(math.pi / 24))
        for point, distance, is_inside in zip(points, truth, inside, strict=True):
            found = clearance.least(point[:2])
            if is_inside or distance < 0.0:
                assert found <= 1e-9
            elif across[0] < INNER or across[0] > OUTER:
                assert found == pytest.approx(distance, abs=1e-6)


def test_a_path_leads_out_of_a_pipe_whose_hull_fills_it(tmp_path):
    """A mobile robot leaves the inside of a C through its gap, and the path is clear by brute force."""
    outline = trimesh.creation.annulus(INNER, OUTER, 0.6, sections=48)
    gap = outline.triangles_center[:, 0] < 0.2  # cut open at +x: an open surface
    shape = trimesh.Trimesh(outline.vertices, outline.faces[gap])
    shape.export(tmp_path / "c.ply")
    values = {"mobile": {"radius": RADIUS}, "goal": {"point": [-1.0, 0.1]}, "start": {"point": [-0.1, 0.1]}}
    scene = scene_of(values | {"obstacle": [{"kind": "mesh", "file": "c.ply"}]}, tmp_path)
    found = plan(scene)
    assert found
    fine = np.vstack([np.linspace(a, b, 20) for a, b in zip(found.path, found.path[1:], strict=False)])
    points = np.column_stack([fine[:: max(1, len(fine) // 60)], np.zeros(len(fine[:: max(1, len(fine) // 60)]))])
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
        found = clearance.least(q)
        assert found <= max(truth, 0.0) + 1e-9
        if found > 0.0:
            assert found >= truth - math.sqrt(3.0) * size - 1e-9


def test_a_speck_inside_of_a_link_is_in_collision():
    """It touches no triangle of the link's mesh, and the block to which it belongs lies outside of the link."""
    mechanism = load(UR5)
    q = mechanism.q_home
    link = next(one for one in mechanism.collision.geometryObjects if one.parentJoint == 2)
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
    values = {"mobile": {"radius": 0.01}, "goal": {"point": [9, 9]}}
    read = scene_of(values | {"obstacle": [{"kind": "points", "file": path.name, "scale": 0.5}]}, tmp_path)
    given = scene_of(values | {"obstacle": [{"kind": "points", "points": (0.5 * points).tolist()}]})
    for q in np.random.default_rng(2).normal(size=(20, 2)):
        first, second = (clearance_of(scene, True).least(q) for scene in (read, given))
        assert first == pytest.approx(second, abs=1e-5)
    again = scene_of(json.loads(json.dumps(given.document())))
    assert clearance_of(again).least(np.zeros(2)) == clearance_of(given).least(np.zeros(2))


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
    values = {"mobile": {"radius": 0.01}, "goal": {"point": [9, 9]}}
    for file, message in [
        ("box.ply", "it has triangles: write kind = 'mesh'"),
        ("cloud.pcd", "use .npy, .ply, .txt, .xyz; pcl_pcd2ply, a tool of the Point Cloud Library, converts it"),
    ]:
        with pytest.raises(cinegen.CinegenError, match=message.replace(".", r"\.")):
            scene_of(values | {"obstacle": [{"kind": "points", "file": file}]}, tmp_path)


def test_a_repulsive_potential_refuses_a_mesh_that_is_not_convex():
    with pytest.raises(cinegen.CinegenError, match="need convex obstacles: 'mesh 1' is not"):
        plan(scene_with(as_values(cup()), mobile={"radius": RADIUS}), field="firas")


def test_a_pointer_of_git_lfs_is_told(tmp_path):
    (tmp_path / "part.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n")
    said = refused({"kind": "mesh", "file": str(tmp_path / "part.stl")})
    assert f"file '{tmp_path}/part.stl' is a Git LFS pointer: run `git lfs pull`" in said.replace("= ", "")
