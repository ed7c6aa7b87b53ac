"""Obstacles of all kinds: where they stand and how far points are from them, by formulas."""

import json
import math
from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes_of_tables import refused, scene_with, to_point

from cinegen.collision import Clearance, Obstacle, SceneError, scene_of
from cinegen.collision.body import Body
from cinegen.collision.links import link_bodies
from cinegen.collision.obstacle_kinds import HEIGHT

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
    there = pin.rpy.rpyToMatrix(rpy) @ seen + point
    if truth(seen) > 0.0:
        assert to_point(obstacle.bodies, there) == pytest.approx(truth(seen), abs=2e-5)
    else:
        assert to_point(obstacle.bodies, there) <= 1e-9
    # moved, it is as far from the point that moved with it
    away = pin.SE3.Random()
    moved = obstacle.moved(away)
    assert moved.placement is not away
    assert to_point(moved.bodies, away.act(seen)) == pytest.approx(to_point(obstacle.bodies, there), abs=2e-5)


# --- meshes -----------------------------------------------------------------------------------------------------------


def _reads(folder, mesh, suffix="stl", **keys):
    mesh.export(folder / f"thing.{suffix}")
    values = {"mobile": {"radius": 0}, "goal": {"point": [9, 9]}}
    return scene_of(values | {"obstacle": [{"kind": "mesh", "file": f"thing.{suffix}", **keys}]}, folder).obstacles[0]


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
    assert sorted(piece.shape.computeVolume() for piece in obstacle.pieces) == pytest.approx(
        sorted([1.0, ball.volume]), rel=1e-5
    )


def test_damaged_meshes_and_flat_hulls_are_refused(tmp_path):
    box = trimesh.creation.box((1, 1, 1))
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(SceneError, match="it is flat: leave out convex"):
        _reads(tmp_path, flat, convex="hull")
    with pytest.raises(SceneError, match="convex can only be 'hull', not 'parts'"):
        _reads(tmp_path, box, convex="parts")
    base = {"mobile": {"radius": 0}, "goal": {"point": [9, 9]}}
    for file, content, said in [
        ("gone.stl", None, "does not exist"),
        ("noise.stl", b"solid nothing", "can't be read|it is empty"),
        ("noise.glb", b"glTF nothing", "can't be read"),
        ("picture.png", b"", r"has an unknown format: use \.stl"),
    ]:
        if content is not None:
            (tmp_path / file).write_bytes(content)
        with pytest.raises(SceneError, match=said) as error:
            scene_of(base | {"obstacle": [{"kind": "mesh", "file": file}]}, tmp_path)
        assert str(error.value).startswith("scene: obstacle 1: file '")


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("obstacle", "said"),
    [
        ({"kind": "sphere", "name": "post", "radius": 0.0}, "obstacle 1 'post': radius must be above 0, not 0.0"),
        ({"kind": "sphere", "radius": math.nan}, "radius must be finite, not nan"),
        ({"kind": "sphere", "radius": 1e7}, "radius is 1e+07: the largest value is 1e+06"),
        ({"kind": "sphere", "radius": 1e-9}, "radius is 1e-09 m: the least size"),
        ({"kind": "sphere", "radius": "0.1 pc"}, "radius is wrong: '0.1 pc': unknown unit 'pc'"),
        ({"kind": "sphere", "raduis": 1.0}, "radius is missing: is 'raduis' misspelled?"),
        ({"kind": "disc", "radius": 1, "hieght": 2}, "unknown key 'hieght': did you mean 'height'?"),
        ({"kind": "spheer", "radius": 1}, "kind 'spheer' is unknown: did you mean 'sphere'?"),
        ({"kind": "box", "size": [1]}, "size must be a list of 2 or 3 numbers"),
        ({"kind": "capsule", "radius": 1, "ends": [[0, 0], [0, 0, 0]]}, "ends coincide: for a sphere, write kind"),
        ({"kind": "half_plane", "normal": [0, 0]}, "normal must be a direction: [0.0, 0.0] has length 0"),
        ({"kind": "disc", "radius": 1, "angle": 1, "rpy": [0, 0, 0]}, "angle cannot be combined with rpy"),
    ],
)
def test_what_is_wrong_with_an_obstacle_is_said_with_its_number_and_key(obstacle, said):
    assert (message := refused(obstacle)).startswith("scene: obstacle 1")
    assert said in message


# --- there and back ---------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(seeds)
def test_what_a_scene_writes_reads_back_as_the_same(seed):
    rng = np.random.default_rng(seed)
    obstacles = [
        {"kind": case.split()[0], **shape, "point": rng.normal(size=3), "rpy": rng.uniform(-4, 4, 3)}
        for case, (shape, _) in SHAPES.items()
    ]
    obstacles[0]["rpy"] = [0.3, math.pi / 2, -0.2]  # where roll and yaw are one
    scene = scene_with(*obstacles, safety=float(rng.uniform(0, 0.1)), start={"point": rng.normal(size=2)})
    moved = scene.obstacles[3].moved(pin.SE3.Random())
    for before in (scene, _with(scene, 3, moved)):
        after = scene_of(json.loads(json.dumps(before.document())))
        assert _close(after.document(), before.document())
        assert (after.start == before.start).all()
        assert after.goal.isApprox(before.goal, 1e-12)
        for one, other in zip(before.obstacles, after.obstacles, strict=True):
            assert (one.name, one.kind, len(one.pieces)) == (other.name, other.kind, len(other.pieces))
            assert one.placement.isApprox(other.placement, 1e-12)
            for p in rng.normal(size=(3, 3)) * 2:
                assert to_point(one.bodies, p) == pytest.approx(to_point(other.bodies, p), abs=1e-5)


def _with(scene, i, obstacle):
    return replace(scene, obstacles=(*scene.obstacles[:i], obstacle, *scene.obstacles[i + 1 :]))


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
    found = [
        coal.distance(
            body.shape, coal.Transform3s(body.placement.rotation, body.placement.translation),
            coal.Sphere(0.05), coal.Transform3s(np.eye(3), ball), coal.DistanceRequest(), coal.DistanceResult(),
        )
        for body in moving
    ]  # fmt: skip
    assert min(found) == pytest.approx(expected, abs=1e-6)
    (again,) = scene_of(made.document(), root).obstacles
    assert [one.placement for one in again.bodies] == [one.placement for one in obstacle.bodies]


def test_two_obstacles_of_one_name_are_refused():
    ball = {"kind": "sphere", "radius": 1}
    assert refused(ball | {"name": "a"}, ball | {"name": "a"}).startswith(
        "scene: obstacle 2 'a': name 'a' is used by another"
    )
    assert "name 'sphere 2' is used by another" in refused(ball | {"name": "sphere 2"}, ball)
    assert [o.name for o in scene_with(ball, ball).obstacles] == ["sphere 1", "sphere 2"]
