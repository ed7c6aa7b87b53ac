"""The vortex method exactly as published: its weight, and its plans."""

import math

import numpy as np
import pytest
from descents import slopes_at
from firas import Firas
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from literal_vortices import plan_literally, scissors
from polygons import convex, distance, holds, normal
from vortex_field import Vortex, facing

from cinegen.collision import load_scene
from cinegen.planning.vortices import folding, rotation_axis

X, Y, Z = np.eye(3)
angles = st.floats(-math.pi, math.pi)


def direction(angle):
    return np.array([math.cos(angle), math.sin(angle), 0.0])


@given(angles, angles, st.sampled_from([-1.0, 1.0]), st.floats(0.01, 100.0))
def test_in_the_plane_both_weights_are_one(n, alpha, sense, size):
    """With the attraction put at an angle alpha from the vortex toward the obstacle, by hand: cos v - sin n."""
    normal_ = direction(n)
    vortex = sense * np.cross(Z, normal_)
    attraction = size * (math.cos(alpha) * vortex - math.sin(alpha) * normal_)
    weight = max(0.0, math.sin(alpha))
    assert facing(attraction, normal_) == pytest.approx(weight, abs=1e-12)
    assume(abs(math.sin(alpha)) > 1e-9)
    assert scissors(attraction, 3.0 * vortex, normal_) == pytest.approx(weight, abs=1e-12)


# --- plans -------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("unhurried")
@pytest.mark.parametrize("name", ["rod", "discs"])
def test_nothing_comes_nearer_than_the_safety_distance(root, name):
    scene = load_scene(root / "robots" / "scenes" / f"{name}.toml")
    planned = plan_literally(scene)
    assert len(planned.path) > 10
    assert planned.clearance >= scene.safety


# --- vortex axis ------------------------------------------------------------------------------------------------------
# The axis of a vortex, and its weight.


vectors = arrays(float, 3, elements=st.floats(-2.0, 2.0).map(lambda x: round(x, 4)))


def unit(vector):
    assume(np.linalg.norm(vector) > 0.05)
    return vector / np.linalg.norm(vector)


@given(convex(), arrays(float, (2, 2), elements=st.floats(-3.0, 3.0)))
def test_where_the_weight_is_nothing_the_way_is_free(polygon, ends):
    """ "The vortex field can be discarded, since the QG line is free.\""""
    point, goal = (np.append(end, 0.0) for end in ends)
    assume(distance(polygon, point) > 1e-3 and not holds(polygon, point) and not holds(polygon, goal))
    if facing(goal - point, normal(polygon, point)) == 0.0:
        way = point + np.linspace(0.0, 1.0, 300)[:, None] * (goal - point)
        assert not any(holds(polygon, p) for p in way)


@given(vectors, vectors)
def test_the_vortex_begins_along_the_tangential_part_of_the_direction(n, tau):
    n = unit(n)
    tangent = tau - (tau @ n) * n
    assume(np.linalg.norm(tangent) > 1e-3)
    w = rotation_axis(n, tau)
    assert np.linalg.norm(w) == pytest.approx(1.0)
    assert np.cross(w, n) == pytest.approx(tangent / np.linalg.norm(tangent), abs=1e-9)


@given(angles, angles)
def test_in_a_plane_the_axis_is_its_normal(n, tau):
    """What space says and what the plane says are one; the sense is that of the paper."""
    assume(abs(math.sin(tau - n)) > 1e-6)
    sense = math.copysign(1.0, math.sin(tau - n))
    assert rotation_axis(direction(n), direction(tau)) == pytest.approx(sense * Z, abs=1e-9)
    assert (rotation_axis(direction(n), direction(tau), plane=Z) == sense * Z).all()


@given(angles, vectors, vectors)
def test_a_folding_vortex_comes_nearer_to_the_axis_of_the_base(n, point, base):
    n, to = direction(n), folding(point, base, Z)
    assume(np.linalg.norm(np.cross(n, to)) > 1e-3)
    velocity = Vortex(1.0, 1.0).velocity(0.1, n, rotation_axis(n, to))
    near = np.linalg.norm((point + 1e-6 * velocity - base)[:2])
    assert near < np.linalg.norm((point - base)[:2])


# --- vortex field -----------------------------------------------------------------------------------------------------
# Vortices of shapes, against distances that are computed otherwise.


lengths = st.floats(-2.0, 2.0).map(lambda x: round(x, 4))
points = arrays(float, 3, elements=lengths)


@given(points)
def test_the_vortex_of_a_shape_is_equation_4_for_a_point(point):
    d = float(np.hypot(*point[:2]))
    assume(d > 0.01)
    n = np.array([*point[:2] / d, 0.0])
    vortex = Vortex(1.0, 1e12)
    assert vortex.velocity(d, n, Z) == pytest.approx(np.array([-point[1], point[0], 0.0]) / d**2, abs=1e-9 / d)
    assert vortex.velocity(d, n, -Z) == pytest.approx(-vortex.velocity(d, n, Z))


@given(convex(), points)
def test_around_a_polygon_it_is_tangent_to_firas_contours(polygon, point):
    """To finite differences of the potential, which know only the distance."""
    point = point * [1.0, 1.0, 0.0]
    d = distance(polygon, point)
    assume(not holds(polygon, point) and 0.02 < d < 1.99)
    firas = Firas(1.0, 2.0)

    slope = slopes_at(lambda p: float(firas.value(distance(polygon, p))), point, 1e-6)
    slope /= np.linalg.norm(slope)
    velocity = Vortex(1.0, 2.0).velocity(d, normal(polygon, point), Z)
    size = np.linalg.norm(velocity)
    assert velocity @ slope == pytest.approx(0.0, abs=1e-4 * size)
    assert np.cross(-slope, velocity)[2] > 0.999 * size  # counterclockwise
    assert size == pytest.approx(1.0 / d - 0.5)


@settings(max_examples=25)
@given(convex(), st.integers(0, 2**32 - 1))
def test_around_a_convex_polygon_it_is_continuous(polygon, seed):
    """Along a way across all pieces of the contours, and the end of the range: steps shrink with the way's."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-3.0, 3.0, (2, 3)) * [1.0, 1.0, 0.0]
    vortex = Vortex(1.0, 1.0)
    way = a + np.linspace(0.0, 1.0, 301)[:, None] * (b - a)
    way = [p for p in way if not holds(polygon, p)]
    d = np.array([distance(polygon, p) for p in way])
    field = vortex.velocity(d, np.array([normal(polygon, p) for p in way]), Z)
    jumps, steps = np.linalg.norm(np.diff(field, axis=0), axis=1), np.linalg.norm(np.diff(way, axis=0), axis=1)
    near = np.minimum(d[1:], d[:-1])
    clear = (near > 0.05) & (steps < 0.04)  # not over the polygon itself
    # |dV| <= |m'| |dd| + m |dn|, with |dd| and |dn| at most a step, over d for the second.
    assert (jumps[clear] <= 2.5 * steps[clear] / near[clear] ** 2).all()


def test_the_modulus_ends_continuously():
    d = np.array([0.5 - 1e-9, 0.5, 0.6])
    assert Vortex(2.0, 0.5).modulus(d) == pytest.approx(0.0, abs=1e-7)
    assert Vortex(2.0, 0.5).modulus(0.25) == pytest.approx(4.0)
    assert np.isnan(Vortex(2.0, 0.5).modulus([0.0, -1.0])).all()
