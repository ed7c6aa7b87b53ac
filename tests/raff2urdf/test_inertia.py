"""Inertia is what a solid body of the shape drawn has, whatever the shape is made of."""

import math

import numpy as np
import pinocchio as pin
import pytest
import trimesh
import yourdfpy
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import shift, turn
from yourdfpy import Box, Cylinder, Geometry, Mesh, Sphere, Visual

from raff2urdf import RaffError
from raff2urdf.inertia import Inertia, sum_of
from raff2urdf.writers.inertia import LEAST_MASS, LEAST_MOMENT, inertias, of_geometry, of_surface

RHO = 700.0  # kg/m3
SIZES = st.floats(1e-3, 2.0)
COORDINATES = st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6)
PLACES = COORDINATES.map(lambda v: pin.SE3(pin.rpy.rpyToMatrix(*v[3:]), np.array(v[:3])).homogeneous)


def box(x: float, y: float, z: float) -> Geometry:
    return Geometry(box=Box(size=np.array([x, y, z])))


def cylinder(radius: float, length: float) -> Geometry:
    return Geometry(cylinder=Cylinder(radius=radius, length=length))


def sphere(radius: float) -> Geometry:
    return Geometry(sphere=Sphere(radius=radius))


def assert_same(inertia: Inertia, other: Inertia, relative: float = 1e-9) -> None:
    size = math.sqrt(np.trace(other.second) / other.mass) + float(np.linalg.norm(other.centre))
    assert inertia.mass == pytest.approx(other.mass, rel=relative)
    np.testing.assert_allclose(inertia.centre, other.centre, atol=relative * size)
    np.testing.assert_allclose(inertia.matrix, other.matrix, atol=relative * other.mass * size**2)


def assert_physical(body: Inertia) -> None:
    """Positive definite, and no principal moment above the sum of the two others."""
    a, b, c = np.linalg.eigvalsh(body.matrix)
    assert a > 0.0
    assert a + b >= c * (1.0 - 1e-12)


ALONE = {"a": [("a", np.eye(4))]}
"""A body of one link that moves."""


def drawn(*visuals: Visual) -> yourdfpy.Robot:
    return yourdfpy.Robot(name="r", links=[yourdfpy.Link(name="a", visuals=list(visuals))])


# --- shapes ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("shape", "volume", "moments"), [
    (box(0.2, 0.3, 0.5), 0.03, [(0.09 + 0.25) / 12, (0.04 + 0.25) / 12, (0.04 + 0.09) / 12]),
    (cylinder(0.1, 0.8), math.pi * 0.008, [(0.03 + 0.64) / 12, (0.03 + 0.64) / 12, 0.01 / 2]),
    (sphere(0.3), 4 / 3 * math.pi * 0.027, 3 * [0.4 * 0.09]),
], ids=["box", "cylinder", "ball"])  # fmt: skip
def test_a_shape_weighs_its_volume_and_turns_as_the_textbook_says(shape, volume: float, moments: list[float]) -> None:
    body = of_geometry(shape, RHO)
    assert body.mass == pytest.approx(RHO * volume)
    np.testing.assert_allclose(body.matrix, RHO * volume * np.diag(moments), atol=1e-13)


@given(SIZES, SIZES, SIZES, PLACES)
@settings(max_examples=40)
def test_a_mesh_of_a_box_is_that_box(x: float, y: float, z: float, place: np.ndarray) -> None:
    mesh = trimesh.creation.box((x, y, z), transform=place)
    assert_same(of_surface(mesh, RHO), of_geometry(box(x, y, z), RHO).in_frame(place), 1e-6)


def test_a_mesh_counts_in_its_own_unit_and_each_axis_in_its_own() -> None:
    mesh = trimesh.creation.box((200.0, 300.0, 500.0))
    assert_same(of_surface(mesh, RHO, 1e-3), of_geometry(box(0.2, 0.3, 0.5), RHO))
    assert_same(of_surface(mesh, RHO, [1e-3, 2e-3, 3e-3]), of_geometry(box(0.2, 0.6, 1.5), RHO))
    named = Geometry(mesh=Mesh(filename="bar", scale=np.full(3, 1e-3)))
    assert_same(of_geometry(named, RHO, {"bar": mesh}.__getitem__), of_geometry(box(0.2, 0.3, 0.5), RHO))


def test_a_mesh_turned_inside_out_weighs_as_much() -> None:
    whole = trimesh.creation.box((0.2, 0.3, 0.5))
    inside_out = trimesh.Trimesh(whole.vertices, whole.faces[:, ::-1], process=False)
    assert inside_out.volume < 0.0
    assert_same(of_surface(inside_out, RHO), of_surface(whole, RHO))


@pytest.mark.parametrize(("vertices", "faces"), [
    ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
    ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]]),
], ids=["triangle", "plate"])  # fmt: skip
def test_what_encloses_nothing_weighs_nothing(vertices: list[list[float]], faces: list[list[int]]) -> None:
    assert of_surface(trimesh.Trimesh(vertices, faces), RHO).mass == 0.0


# --- several together --------------------------------------------------------------------------------------------


@given(st.lists(st.tuples(SIZES, SIZES, SIZES, PLACES), min_size=1, max_size=4), st.sampled_from("bcs"))
@settings(max_examples=60)
def test_whatever_is_drawn_some_body_has_that_inertia(shapes, kind: str) -> None:
    visuals = []
    for x, y, z, place in shapes:
        shape = {"b": box(x, y, z), "c": cylinder(x, y), "s": sphere(z)}[kind]
        visuals.append(Visual(geometry=shape, origin=place))
    estimate = inertias(drawn(*visuals), RHO)
    assert_physical(estimate.links["a"])
    assert_same(estimate.links["a"], sum_of(of_geometry(v.geometry, RHO).in_frame(v.origin) for v in visuals))


@pytest.mark.parametrize("density", [0.0, -1.0, math.nan, math.inf])
def test_a_density_that_is_none_is_refused(density: float) -> None:
    with pytest.raises(RaffError, match="density"):
        inertias(drawn(), density)


# --- the least --------------------------------------------------------------------


def test_a_body_that_moves_has_a_least_mass_and_is_named() -> None:
    estimate = inertias(drawn(), RHO, moving=ALONE)
    assert (estimate.raised, estimate.links["a"].mass) == (("a",), LEAST_MASS)
    np.testing.assert_allclose(estimate.links["a"].matrix, LEAST_MOMENT * np.eye(3))
    assert "a" in estimate.sentence()


def test_one_that_is_fixed_on_something_heavy_needs_none() -> None:
    model = drawn()
    model.links.append(yourdfpy.Link(name="b", visuals=[Visual(geometry=box(1.0, 1.0, 1.0))]))
    estimate = inertias(model, RHO, moving={"a": [*ALONE["a"], ("b", shift("x", 1.0))]})
    assert (estimate.raised, estimate.links["a"].mass) == ((), 0.0)


def test_a_body_that_is_raised_stays_physical() -> None:
    needle = drawn(Visual(geometry=cylinder(1e-6, 1e-1), origin=turn("x", 1.0)))
    estimate = inertias(needle, RHO, moving=ALONE)
    assert estimate.raised == ("a",)
    assert_physical(estimate.links["a"])
    assert np.linalg.eigvalsh(estimate.links["a"].matrix)[0] >= LEAST_MOMENT * (1 - 1e-9)
