"""Spherical and elliptical repulsion: definitions, gradients, minima, and plans that hit nothing."""

import math
import sys

import coal
import enclosing_potentials
import numpy as np
import pinocchio as pin
import pytest
from descents import ROBOTS, apart, attraction, bodies, figure, moved, slopes, slopes_at
from elliptical_potential import Elliptical
from enclosing_potentials import EllipticalPotential, Gains, Spherical, SphericalPotential, spherical
from enclosures import Enclosure
from firas import CONTACT
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation
from surfaces import placed, shapes, surface

from cinegen.collision.body import Body
from cinegen.planning import plan

points = arrays(float, 3, elements=st.floats(-2.0, 2.0).map(lambda x: round(x, 4)))
around_start = st.lists(st.floats(-0.25, 0.25), min_size=3, max_size=3)


# --- the spherical potential -------------------------------------------------------------------------------------


@pytest.mark.parametrize("d", [CONTACT, 0.0, -0.1, math.nan])
def test_at_contact_it_is_infinite_and_has_no_gradient(d):
    assert Spherical(1.0).value(d) == math.inf
    assert np.isnan(Spherical(1.0).gradient(d, [1.0, 0.0, 0.0])).all()


# --- the total potential -----------------------------------------------------------------------------------------


def circle_around(box):
    """A rectangle in the plane, as a disc: all of its height, which is only drawn, is left out."""
    return Body("", 0, box.placement, coal.Capsule(float(np.linalg.norm(box.shape.halfSide[:2])), 9.0))


def spherical_value(scene, q, reach, task):
    """The same of the circles around rectangles."""
    total = attraction(scene, q)
    for each in scene.obstacles:
        k = task / scene.mechanism.length * (reach / 2.0) ** 3 / 2.0
        total += float((k / apart(scene, q, circle_around(each.bodies[0])) ** 2).sum())
    return total


def elliptical_value(scene, q, field):
    """The same of a potential around a rectangle, at the worst of many points of each link's axis."""
    mechanism = scene.mechanism
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    worst = {}
    for body in bodies(scene):
        if body.joint:
            at = data.oMi[body.joint] * body.placement
            half = getattr(body.shape, "halfLength", 0.0)
            axis = at.translation + np.linspace(-half, half, 401)[:, None] * at.rotation[:, 2]
            local = (axis - field.centre) @ field.axes
            off = local - np.clip(local, -field.half, field.half)
            nearest = axis - body.shape.radius * (off / np.linalg.norm(off, axis=1)[:, None]) @ field.axes.T
            worst[body.joint] = max(worst.get(body.joint, 0.0), float(field.value(nearest).max()))
    return attraction(scene, q) + sum(worst.values())


@settings(max_examples=25)
@given(around_start, st.floats(0.1, 0.5))
def test_spherical_has_the_gradient_of_its_total_potential_for_an_arm(step, reach):
    scene = figure("rod")
    q = moved(scene, scene.start, step)
    assume(min(apart(scene, q, circle_around(scene.obstacles[0].bodies[0]))) > 0.02)
    potential = SphericalPotential(scene, bodies(scene), reach)
    task = Gains().strength
    assert len(potential.balls) == 1
    by_hand = spherical_value(scene, q, reach, task)
    assert potential.value(q) == pytest.approx(by_hand, rel=1e-3)  # its ball is nearly the least
    wanted = slopes(scene, potential.value, q, 1e-5)
    assert potential.gradient(q) == pytest.approx(wanted, abs=2e-4 * (1.0 + np.abs(wanted).max()))
    by_formula = slopes(scene, lambda q: spherical_value(scene, q, reach, task), q, 1e-5)
    assert potential.gradient(q) == pytest.approx(by_formula, abs=5e-3 * (1.0 + np.abs(wanted).max()))


@settings(max_examples=8)
@given(around_start)
def test_elliptical_has_the_gradient_of_its_total_potential_for_an_arm(step):
    scene = figure("rod")
    q = moved(scene, scene.start, step)
    potential = EllipticalPotential(scene, bodies(scene), 0.2)
    (field,) = potential.boxes
    assert potential.value(q) == pytest.approx(elliptical_value(scene, q, field), rel=1e-3)
    wanted = slopes(scene, lambda q: elliptical_value(scene, q, field), q, 1e-4)
    assert potential.gradient(q) == pytest.approx(wanted, abs=0.02 * (1.0 + np.abs(wanted).max()))


@pytest.mark.parametrize("name", ["rod", "discs"])
def test_nothing_comes_nearer_than_the_safety_distance_whatever_leads(name):
    scene = figure(name)
    planned = plan(scene, field=spherical, seconds=600.0)
    assert len(planned.path) > 10
    assert planned.clearance >= scene.safety


@pytest.mark.usefixtures("unhurried")
def test_the_command_prints_the_status_and_draws_the_path(capsys, monkeypatch, tmp_path):
    path, picture = ROBOTS / "scenes" / "rod.toml", tmp_path / "rod.png"
    monkeypatch.setattr(sys, "argv", ["", str(path), "--field", "elliptical", "--plot", str(picture)])
    enclosing_potentials.main()
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{path}: stuck: local minimum")
    assert "10 mm required" in second
    assert picture.stat().st_size > 10_000


# --- enclosures -------------------------------------------------------------------------------------------------------
# Balls and boxes hold what they stand for.


turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(lambda rpy: pin.rpy.rpyToMatrix(*rpy))


@given(shapes, turns, st.sampled_from([None, "plane"]))
def test_ball_and_box_hold_what_they_stand_for(shape, turn, where):
    plane = None if where is None else turn[:, 1]  # any plane
    body = Body("thing", 0, pin.SE3(turn, np.array([0.3, -0.2, 0.5])), shape)
    enclosure, points = Enclosure(body, plane), placed(body.placement, surface(shape, np.random.default_rng(0), 300))
    middle, half, axes = enclosure.box
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert (np.abs((points - middle) @ axes) <= half + 1e-9).all()
    centre, radius = enclosure.ball.placement.translation, enclosure.ball.shape.radius
    off = points - centre
    if plane is not None:
        off = off - np.outer(off @ plane, plane)
        assert half[2] == math.inf
        assert abs(axes[:, 2] @ plane) == pytest.approx(1.0)
    away = np.linalg.norm(off, axis=1)
    assert (away <= radius + 1e-9).all()


# --- elliptical potential ---------------------------------------------------------------------------------------------
# The elliptical potential against its definition and finite differences.


halves = arrays(float, 3, elements=st.floats(0.02, 0.6))


@given(halves, points, st.floats(0.3, 1.7), st.integers(0, 2**32 - 1))
def test_the_elliptical_gradient_is_that_of_its_value(half, point, rounding, seed):
    axes = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    field = Elliptical([0.1, -0.2, 0.3], half, 0.4, 0.8, rounding, axes)
    assume(field.pseudo_distance(point) > 0.05)
    got = field.gradient(point)
    assert got == pytest.approx(slopes_at(field.value, point, 1e-6), abs=1e-4 * (1e-3 + np.linalg.norm(got)))


@given(halves, points, st.floats(0.3, 1.7))
def test_a_point_lies_on_the_contour_of_its_pseudo_distance(half, point, rounding):
    """The published equation, with the root put in."""
    field = Elliptical([0, 0, 0], half, rounding=rounding)
    k = float(field.pseudo_distance(point))
    if (np.abs(point) <= half).all():
        assert k == 0.0
        return
    assume(k > 0.01)
    n, longest = 1.0 / (1.0 - math.exp(-rounding * k)), half.max()
    norm = sum((h / longest) ** 2 * (abs(x) / h / (1.0 + k)) ** (2.0 * n) for x, h in zip(point, half, strict=True))
    assert norm == pytest.approx(1.0, rel=1e-6)


def test_contours_are_the_box_near_it_and_spheres_far_away():
    half = np.array([0.1, 0.2, 0.4])
    field = Elliptical([0, 0, 0], half)
    corner = half * (1.0 + 1e-9)
    on_faces = [[0.1 + 1e-9, 0.15, -0.3], [0.02, 0.2 + 1e-9, 0.1], [0.09, 0.19, 0.4 + 1e-9]]
    assert field.pseudo_distance([*on_faces, corner]) == pytest.approx(0.0, abs=1e-7)
    way = Rotation.random(20, rng=np.random.default_rng(1)).apply([0.0, 0.0, 1.0])
    far = field.pseudo_distance(1e3 * way)
    assert far == pytest.approx(1e3 / 0.4 - 1.0, rel=1e-9)
    gradients = field.gradient(20.0 * way)
    assert gradients == pytest.approx(-np.linalg.norm(gradients, axis=1)[:, None] * way, abs=1e-12)
