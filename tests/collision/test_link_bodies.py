"""Links as convex bodies: nothing that is drawn is outside of them, whatever it is drawn with."""

import math
from functools import cache

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from example_robots import PANDA, load
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.collision.body import PlacedShape as Solid
from cinegen.collision.body import rounded_hull
from cinegen.collision.convex_hull import hull
from cinegen.collision.links import TIGHT, is_inside
from cinegen.collision.links import convex_shape as solid
from cinegen.collision.links import link_bodies as bodies_of

SOME = ["delta4", PANDA]


@cache
def bodies_named(name):
    return bodies_of(load(name))


# --- the tests' own idea of where a shape is -----------------------------------------------------------------------


def surface(shape, rng, count=60):
    """Points on the surface of a shape, in its frame; all corners that it has."""
    if isinstance(shape, coal.BVHModelOBBRSS):
        corners = np.array(shape.vertices())
        picked = [shape.tri_indices(int(i)) for i in rng.integers(shape.num_tris, size=count)]
        triangles = np.array([[triangle[0], triangle[1], triangle[2]] for triangle in picked])
        weights = rng.dirichlet([1.0, 1.0, 1.0], size=count)
        return np.vstack([corners, np.einsum("ij,ijk->ik", weights, corners[triangles])])
    if isinstance(shape, coal.Box):
        points = rng.uniform(-1.0, 1.0, (count, 3))
        points[np.arange(count), rng.integers(3, size=count)] = rng.choice([-1.0, 1.0], count)
        return np.vstack([points, np.sign(points)]) * np.array(shape.halfSide)
    if isinstance(shape, coal.Convex):
        return np.array(shape.points())
    turn = rng.uniform(0.0, 2.0 * math.pi, count)
    if isinstance(shape, coal.Cylinder):
        rim = shape.radius * np.column_stack([np.cos(turn), np.sin(turn)])
        return np.column_stack([rim, rng.choice([-1.0, 1.0], count) * shape.halfLength])
    ball = rng.normal(size=(count, 3))
    ball *= shape.radius / np.linalg.norm(ball, axis=1)[:, None]
    if isinstance(shape, coal.Capsule):
        ball[:, 2] += np.sign(ball[:, 2]) * shape.halfLength
    return ball


def outside(points, shape):
    """(n,) how far points, in the frame of a shape, are outside of it; not more than 0 inside."""
    if isinstance(shape, coal.Sphere):
        return np.linalg.norm(points, axis=1) - shape.radius
    if isinstance(shape, coal.Capsule):
        beyond = np.maximum(np.abs(points[:, 2]) - shape.halfLength, 0.0)
        return np.linalg.norm(np.c_[points[:, :2], beyond], axis=1) - shape.radius
    if isinstance(shape, coal.Cylinder):
        return np.maximum(np.linalg.norm(points[:, :2], axis=1) - shape.radius, np.abs(points[:, 2]) - shape.halfLength)
    if isinstance(shape, coal.Box):
        return (np.abs(points) - np.array(shape.halfSide)).max(axis=1)
    corners = np.array(shape.points())
    normals = ConvexHull(corners).equations[:, :3]
    return (points @ normals.T - (corners @ normals.T).max(axis=0)).max(axis=1)


def placed(placement, points):
    return points @ placement.rotation.T + placement.translation


def seen(placement, points):
    return (points - placement.translation) @ placement.rotation


# --- what holds for every robot ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SOME)
def test_nothing_that_can_be_hit_is_outside_of_the_bodies_which_are_called_by_their_links(name):
    mechanism, rng = load(name), np.random.default_rng(0)
    bodies = bodies_named(name)
    for body in bodies:
        assert mechanism.model.frames[mechanism.frame_id(body.name)].parentJoint == body.joint
    order = [mechanism.nodes.index(body.name) for body in bodies]
    assert order == sorted(order)
    for piece in mechanism.collision.geometryObjects:
        points = placed(piece.placement, surface(piece.geometry, rng))
        candidates = [body for body in bodies if body.joint == piece.parentJoint]
        assert min(outside(seen(body.placement, points), body.shape).max() for body in candidates) <= 1e-9, piece.name


@pytest.mark.parametrize("name", SOME)
def test_no_body_is_much_larger_than_the_hull_of_a_piece(name):
    mechanism = load(name)
    rng = np.random.default_rng(0)
    pieces = mechanism.collision.geometryObjects
    volumes = [(piece.parentJoint, ConvexHull(surface(piece.geometry, rng, 400)).volume) for piece in pieces]
    for body in bodies_named(name):
        largest = max(volume for joint, volume in volumes if joint == body.joint)
        assert body.shape.computeVolume() <= 1.02 * TIGHT * largest


# --- which shapes count --------------------------------------------------------------------------------------------

JOINTS = (
    UrdfJoint("turn", "base", "upper", "0 0 0.5", "0 0.6 0.8", limit=(-1.0, 1.0)),
    UrdfJoint("reach", "upper", "tool", "0.4 0 0", "1 0 0", "prismatic", (0.0, 1.0)),
)


def element(kind, geometry, xyz="0 0 0"):
    return f'<{kind}><origin xyz="{xyz}"/><geometry>{geometry}</geometry></{kind}>'


@pytest.fixture
def arm(tmp_path):
    def load(**links):
        path = tmp_path / "arm.urdf"
        path.write_text(urdf_text(JOINTS, links))
        return cinegen.load(path)

    return load


def test_a_link_has_its_collision_shapes_and_where_it_has_none_its_visual_ones(arm):
    ball, rod = '<sphere radius="0.1"/>', '<cylinder radius="0.02" length="0.4"/>'
    mechanism = arm(
        base=element("visual", '<box size="1 1 1"/>') + element("collision", ball, "0.1 0 0"),
        upper=element("visual", rod),
    )
    base, upper = bodies_of(mechanism)
    assert (base.name, base.joint, upper.name, upper.joint) == ("base", 0, "upper", 1)
    assert isinstance(base.shape, coal.Sphere)
    assert base.centre == pytest.approx([0.1, 0.0, 0.0])
    assert isinstance(upper.shape, coal.Capsule)
    assert (upper.shape.radius, upper.shape.halfLength) == pytest.approx((0.02, 0.2))
    kinds = [type(piece.geometry) for piece in mechanism.visual.geometryObjects]
    assert kinds == [coal.Box, coal.Cylinder]  # what is seen is as ever


def test_without_any_shapes_the_bars_of_the_stick_figure_count_and_no_link_is_without_body(arm):
    mechanism = arm()
    bodies = {body.name: body for body in bodies_of(mechanism)}
    assert set(bodies) == {"base", "upper", "tool"}
    assert len(bodies_of(mechanism)) == 3  # no drums beside the bars
    for name, end in {"base": [0.0, 0.0, 0.5], "upper": [0.4, 0.0, 0.0]}.items():
        shape, place = bodies[name].shape, bodies[name].placement
        assert isinstance(shape, coal.Capsule)
        tips = [place.translation + side * shape.halfLength * place.rotation[:, 2] for side in (-1.0, 1.0)]
        assert np.allclose(sorted(tips, key=np.linalg.norm), [np.zeros(3), end], atol=1e-9)
    assert bodies["tool"].radius < 0.1  # a drum: it has no bar


def test_sticks_collide_for_a_missing_collision_mesh_though_the_visual_one_is_there(arm):
    shapes = element("visual", '<sphere radius="0.1"/>') + element("collision", '<mesh filename="x.stl"/>')
    mechanism = arm(upper=shapes)
    assert len(mechanism.visual.geometryObjects) == 1
    with pytest.warns(cinegen.CinegenWarning, match=r"arm.urdf:3: .*mesh 'x.stl' is not found"):
        bodies = {body.name: body.shape for body in bodies_of(mechanism)}
    assert isinstance(bodies["upper"], coal.Capsule)  # its bar
    assert list(mechanism.unchecked_links) == ["upper"]


def test_a_cylinder_with_balls_at_its_ends_is_one_capsule(arm):
    pieces = element("collision", '<cylinder radius="0.05" length="0.4"/>')
    pieces += element("collision", '<sphere radius="0.05"/>', "0 0 0.2")
    pieces += element("collision", '<sphere radius="0.05"/>', "0 0 -0.2")
    (body,) = bodies_of(arm(upper=pieces))
    assert isinstance(body.shape, coal.Capsule)
    assert (body.shape.radius, body.shape.halfLength) == pytest.approx((0.05, 0.2))


def test_the_hollow_of_a_mesh_is_filled_and_its_scale_counts(arm, tmp_path):
    bars = [trimesh.creation.box(bounds=[[0, 0, 0], size]) for size in ([300, 20, 20], [20, 300, 20])]
    trimesh.util.concatenate(bars).export(tmp_path / "angle.stl")
    (body,) = bodies_of(arm(upper=element("collision", '<mesh filename="angle.stl" scale="0.001 0.001 0.001"/>')))
    middle = seen(body.placement, np.array([[0.1, 0.1, 0.01], [0.29, 0.01, 0.01], [0.29, 0.29, 0.01]]))
    filled, end, beside = outside(middle, body.shape)
    assert filled < 0.0
    assert end < 0.0
    assert beside > 0.1


# --- one solid -----------------------------------------------------------------------------------------------------


shapes = st.one_of(
    st.builds(coal.Sphere, st.floats(0.05, 0.5)),
    st.builds(coal.Capsule, st.floats(0.05, 0.3), st.floats(0.1, 0.8)),
    st.builds(coal.Cylinder, st.floats(0.05, 0.5), st.floats(0.1, 0.8)),
    st.builds(coal.Box, st.floats(0.1, 0.8), st.floats(0.1, 0.8), st.floats(0.1, 0.8)),
    st.integers(0, 10**6).map(lambda seed: hull(np.random.default_rng(seed).normal(size=(12, 3)) * 0.2).shape),
)


@settings(max_examples=80)
@given(shapes, st.integers(0, 10**6))
def test_a_solid_holds_what_it_is_made_of_wherever_that_stands(shape, seed):
    rng = np.random.default_rng(seed)
    pin.seed(seed)
    placement = pin.SE3.Random()
    made = solid(shape, placement)
    points = placed(placement, surface(shape, rng, 200))
    assert outside(seen(made.placement, points), made.shape).max() <= 1e-9


@settings(max_examples=80)
@given(shapes, st.integers(0, 10**6))
def test_the_hull_of_points_grown_by_a_radius_contains_the_shape(shape, seed):
    corners, radius = rounded_hull(shape)
    normals = np.vstack([np.eye(3), -np.eye(3)]) if len(corners) < 4 else ConvexHull(corners).equations[:, :3]
    reach = (surface(shape, np.random.default_rng(seed), 200) @ normals.T).max(axis=0)
    assert (reach - (corners @ normals.T).max(axis=0)).max() <= radius + 1e-9


@settings(max_examples=200)
@given(shapes, shapes, st.integers(0, 10**6), st.floats(0.0, 1.0))
def test_what_is_said_to_be_inside_is_and_what_sticks_out_is_not(inner, outer, seed, far):
    pin.seed(seed)
    rng = np.random.default_rng(seed)
    first, second = pin.SE3.Random(), pin.SE3.Random()
    first.translation = second.translation + far * 0.3 * rng.normal(size=3)
    worst = outside(seen(second, placed(first, surface(inner, rng, 500))), outer).max()
    said = is_inside(Solid(first, inner), Solid(second, outer))
    if said:
        assert worst <= 2e-9
    elif worst < 0.0:  # many points of it are inside, perhaps not all; a cylinder counts as a prism around it
        slack = 0.005 * inner.radius if isinstance(inner, coal.Cylinder) else 0.0
        assert worst >= -0.03 - slack
