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
from scipy.spatial.transform import Rotation
from shapely import LinearRing, Polygon, unary_union
from surfaces import outside, placed, seen, shapes, surface
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.collision.body import PlacedShape as Solid
from cinegen.collision.body import rounded_hull
from cinegen.collision.capsule import bounding_capsule
from cinegen.collision.convex_hull import hull, simplified
from cinegen.collision.links import TIGHT, is_inside
from cinegen.collision.links import convex_shape as solid
from cinegen.collision.links import link_bodies as bodies_of
from cinegen.collision.polygon import convex_pieces, polygon_error

SOME = ["delta4", PANDA]


@cache
def bodies_named(name):
    return bodies_of(load(name))


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
    of_base = element("visual", '<box size="1 1 1"/>') + element("collision", ball, "0.1 0 0")
    mechanism = arm(base=of_base, upper=element("visual", rod))
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
    of_link = element("visual", '<sphere radius="0.1"/>') + element("collision", '<mesh filename="x.stl"/>')
    mechanism = arm(upper=of_link)
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


# --- capsules ---------------------------------------------------------------------------------------------------------
# The tightest capsule around points: it holds them all, and finds capsules again that are known.


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.integers(1, 200), st.floats(-4.0, 1.0), st.floats(-6.0, 0.0), st.floats(-6.0, 0.0))
def test_every_point_is_inside(seed, count, size, width, height):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) * [1.0, 10.0**width, 10.0**height] * 10.0**size
    points = Rotation.random(random_state=seed).apply(points) + rng.normal(size=3)
    capsule = bounding_capsule(points)
    assert outside(seen(capsule.placement, points), capsule.shape).max() <= 1e-12


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.floats(0.02, 0.3), st.floats(0.05, 2.0))
def test_a_capsule_is_found_again_from_points_of_its_surface(seed, radius, length):
    rng, pose = np.random.default_rng(seed), Rotation.random(random_state=seed)
    points = pose.apply(surface(coal.Capsule(radius, length), rng, 2000)) + rng.normal(size=3)
    capsule = bounding_capsule(points)
    assert capsule.volume <= 1.01 * math.pi * radius**2 * (length + 4.0 / 3.0 * radius)
    assert capsule.radius == pytest.approx(radius, rel=0.02)
    assert capsule.length + 2.0 * capsule.radius == pytest.approx(length + 2.0 * radius, rel=0.02)
    if length > radius:
        assert abs(capsule.axis @ pose.as_matrix()[:, 2]) > math.cos(0.03)


# --- convex hulls -----------------------------------------------------------------------------------------------------
# Convex hulls: of points however flat, and with fewer corners around them.


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(1, 900), st.booleans(), st.floats(-9.0, 0.0), st.floats(-9.0, 0.0))
def test_every_point_is_inside_of_both_and_coal_makes_both(seed, count, round_, width, height):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    if round_:  # then all are corners
        points /= np.linalg.norm(points, axis=1)[:, None]
    points = Rotation.random(random_state=seed).apply(points * [1.0, 10.0**width, 10.0**height]) + rng.normal(size=3)
    exact = hull(points)
    fewer = simplified(exact)
    assert len(fewer.corners) <= 256
    assert fewer.volume >= exact.volume * (1.0 - 1e-9)
    for made in (exact, fewer):
        assert outside(points, made.shape).max() <= 1e-9
        assert made.shape.computeVolume() == pytest.approx(made.volume, rel=1e-6, abs=1e-15)


@pytest.mark.parametrize("points", [[[1, 2, 3]], [[0, 0, 0], [1, 1, 1]], [[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
def test_what_has_no_volume_is_made_a_little_thick(points):
    points = np.array(points, dtype=float)
    made = hull(points)
    assert outside(points, made.shape).max() <= 0.0
    assert 0.0 < made.volume < 1e-4
    assert made.shape.num_points >= 6


# --- polygons ---------------------------------------------------------------------------------------------------------
# Polygons and the convex pieces they are cut into, against shapely.


integers = st.integers(-4, 4)


def _star(seed):
    """Corners around a point, none of them far from a circle: never crossing itself, seldom convex."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 30))
    angles = (np.arange(n) + rng.uniform(0.1, 0.9, n)) * 2.0 * np.pi / n
    radii = rng.uniform(0.3, 1.0, n)
    points = np.column_stack([np.cos(angles), np.sin(angles)]) * radii[:, None] * 10.0 ** rng.uniform(-2, 2)
    return points[::-1] if rng.integers(2) else points


COMB = np.array([[0, 0], [7, 0], [7, 3], [6, 3], [6, 1], [5, 1], [5, 3], [4, 3], [4, 1], [1, 1], [1, 3], [0, 3.0]])
CASES = {
    "square": (np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), 1),
    "square with points on its sides": (np.array([[0, 0], [0.3, 0], [1, 0], [1, 0.5], [1, 1], [0, 1.0]]), 1),
    "L": (np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2.0]]), 2),
    "comb": (COMB, 4),
    "hexagon": (np.column_stack([np.cos(np.arange(6) * np.pi / 3), np.sin(np.arange(6) * np.pi / 3)]), 1),
}


@pytest.mark.parametrize("name", CASES)
def test_known_polygons_have_few_pieces(name):
    points, fewest = CASES[name]
    for turned in (points, points[::-1], np.roll(points, 2, axis=0)):
        pieces = convex_pieces(turned)
        # as few as there can be, and never more than four times as many (Hertel and Mehlhorn)
        assert len(pieces) == 1 if fewest == 1 else fewest <= len(pieces) <= 4 * fewest
        assert sum(Polygon(piece).area for piece in pieces) == pytest.approx(Polygon(points).area)


@settings(max_examples=200)
@given(st.integers(0, 2**32 - 1))
def test_pieces_are_convex_and_fill_the_polygon(seed):
    points = _star(seed)
    pieces = convex_pieces(points)
    size = np.ptp(points, axis=0).max()
    whole, parts = Polygon(points), [Polygon(piece) for piece in pieces]
    assert sum(part.area for part in parts) == pytest.approx(whole.area, rel=1e-9)
    assert unary_union(parts).symmetric_difference(whole).area <= 1e-9 * size * size
    for piece in pieces:
        a, b = np.roll(piece, -1, axis=0) - piece, np.roll(piece, -2, axis=0) - np.roll(piece, -1, axis=0)
        assert (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > -1e-9 * size * size).all()
        assert {tuple(corner) for corner in piece} <= {tuple(corner) for corner in points}


@settings(max_examples=800)
@given(st.lists(st.tuples(integers, integers), min_size=3, max_size=7))
def test_a_polygon_that_crosses_or_touches_itself_is_told_from_one_that_does_not(points):
    is_simple = len(set(points)) == len(points) and LinearRing(points).is_simple
    assert (polygon_error(np.array(points, dtype=float)) is None) == is_simple
