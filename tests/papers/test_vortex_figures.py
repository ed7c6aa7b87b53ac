"""The paper's figures 1 to 4: what they show is so."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
import vortex_figures as drawn
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.backends.backend_agg import FigureCanvasAgg
from scipy.optimize import approx_fprime
from vortex_figures import Paraboloid, PointVortex, draw_potentials

lengths = st.floats(-3.0, 3.0).map(lambda x: round(x, 4))
vectors = arrays(float, 3, elements=lengths)
points = arrays(float, 3, elements=st.floats(-2.0, 2.0).map(lambda x: round(x, 4)))
LINKS = (0.5, 0.4, 0.3)


def minima(value, x, y):
    """(k, 2) points of a grid that are lower than their eight neighbours; nan, and the rim, are none."""
    inner = value[1:-1, 1:-1]
    around = [np.roll(value, (i, j), axis=(0, 1))[1:-1, 1:-1] for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    low = np.all([inner < other for other in around], axis=0)
    return np.column_stack([x[1:-1, 1:-1][low], y[1:-1, 1:-1][low]])


@pytest.fixture(scope="module")
def grid():
    return np.meshgrid(np.linspace(-1.0, 1.0, 401), np.linspace(-0.8, 0.8, 321))


def test_figure_1_has_a_minimum_before_the_rod(grid):
    x, y = grid
    points = np.stack([x, y, np.zeros_like(x)], axis=-1)
    total = drawn.ATTRACTION.value(points) + drawn.REPULSION.value(points)
    trap = drawn.stop()
    before, beyond = sorted(minima(total, x, y).tolist())
    assert drawn.START[0] < trap[0] < -drawn.ROD[0]
    assert before == pytest.approx(trap[:2], abs=5e-3)
    assert beyond == pytest.approx(drawn.GOAL[:2], abs=0.05)


def test_figure_3_has_none_before_the_goal():
    """Between two circles, and from one side of the cut to the other: only where the vortex moves the goal to."""
    turn, radius = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 721) + drawn.VORTEX.cut, np.linspace(0.03, 0.95, 461))
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    points = np.stack([x, y, np.zeros_like(x)], axis=-1)
    potential = drawn.VORTEX.value(points)
    potential[:, -1] = drawn.VORTEX.strength * turn[0, -1]
    found = minima(drawn.ATTRACTION.value(points) + potential, x, y)
    # Where k (p - G) = -V, the attraction is across p: on the circle over OG. The larger root is the minimum.
    length, ratio = np.linalg.norm(drawn.GOAL), drawn.SLOPE / drawn.ATTRACTION.stiffness
    away = np.sqrt((length**2 + np.sqrt(length**4 - 4.0 * ratio**2)) / 2.0)
    assert np.linalg.norm(found, axis=1) == pytest.approx([away], abs=5e-3)
    assert np.linalg.norm(found[0] - drawn.GOAL[:2]) == pytest.approx(np.sqrt(length**2 - away**2), abs=5e-3)


def test_in_figure_4_the_angle_closes_and_the_way_is_free_from_q_on():
    way, angles = drawn.avoided()
    distance = np.linalg.norm(way, axis=1) - drawn.RADIUS
    near = np.flatnonzero(distance < drawn.FIGURE_4_VORTEX.reach)
    q = int(np.flatnonzero(angles > 0.0)[-1])
    inside = angles[near[0] : q]
    assert inside[0] == pytest.approx(np.pi / 2.0, abs=0.01)
    assert inside[-1] == pytest.approx(0.0, abs=0.02)
    assert (np.diff(inside) < 1e-3).all()
    assert distance.min() > 0.02
    assert way[-1] == pytest.approx(drawn.GOAL, abs=2e-3)
    towards = np.diff(way[q + 1 :], axis=0)
    straight = (drawn.GOAL - way[q + 1]) / np.linalg.norm(drawn.GOAL - way[q + 1])
    assert towards / np.linalg.norm(towards, axis=1)[:, None] == pytest.approx(
        np.tile(straight, (len(towards), 1)), abs=1e-6
    )


@pytest.mark.parametrize(("name", "count"), [("figure1", 2), ("figure2", 2), ("figure3", 2), ("figure4", 1)])
def test_each_figure_shows_something_with_units(name, count):
    figure = draw_potentials()[name]
    FigureCanvasAgg(figure).draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    assert len(figure.axes) == count
    for axes in figure.axes:
        assert axes.has_data()
        assert axes.get_xlabel() == "x (m)"
        assert axes.get_ylabel() == "y (m)"
        box = axes.get_window_extent().bounds
        left, bottom, width, height = (round(v) for v in box)
        part = pixels[len(pixels) - bottom - height : len(pixels) - bottom, left : left + width]
        assert (part.min(axis=2) < 200).mean() > 0.02
    for text in figure.findobj(lambda artist: hasattr(artist, "get_legend_handler_map")):
        box = text.get_window_extent()
        assert box.x0 >= 0.0
        assert box.x1 <= pixels.shape[1]


# --- paraboloid --------------------------------------------------------------------------------------------------


def tip(q):
    """The end of a planar 3R arm."""
    turned = np.cumsum(q)
    return np.array([LINKS @ np.cos(turned), LINKS @ np.sin(turned), 0.0])


def jacobian(q):
    turned = np.cumsum(q)
    parts = np.array([-np.multiply(LINKS, np.sin(turned)), np.multiply(LINKS, np.cos(turned)), np.zeros(3)])
    return np.cumsum(parts[:, ::-1], axis=1)[:, ::-1]


@given(vectors, arrays(float, (4, 3), elements=lengths), st.floats(0.1, 10.0))
def test_the_gradient_is_that_of_the_value(goal, points, stiffness):
    field = Paraboloid(goal, stiffness)
    for point, gradient in zip(points, field.gradient(points), strict=True):
        assert approx_fprime(point, field.value, 1e-6) == pytest.approx(gradient, abs=1e-4)
    assert field.value(goal) == 0.0
    assert field.value(points) == pytest.approx(0.5 * stiffness * np.linalg.norm(points - goal, axis=1) ** 2)


@given(vectors, arrays(float, 3, elements=st.floats(-math.pi, math.pi)))
def test_equation_1_is_the_derivative_by_the_joints(goal, q):
    field = Paraboloid(goal, 2.0)
    wanted = approx_fprime(q, lambda joints: float(field.value(tip(joints))), 1e-7)
    assert field.joint_gradient(jacobian(q), tip(q)) == pytest.approx(wanted, abs=1e-5)


# --- the vortex of a point ---------------------------------------------------------------------------------------


@given(points, points, st.floats(-7.0, 7.0), st.floats(0.1, 3.0))
def test_equation_4_is_the_gradient_of_the_angle(centre, point, cut, strength):
    """The angle by complex logarithms, continued from the point itself: no cut near it."""
    z = complex(*(point - centre)[:2])
    assume(abs(z) > 0.05)
    step = 1e-6
    along = [cmath.log((z + h) / (z - h)).imag / (2.0 * step) for h in (step, 1j * step)]
    vortex = PointVortex(centre, strength, cut)
    assert vortex.gradient(point) == pytest.approx(strength * np.array([*along, 0.0]), rel=1e-5, abs=1e-5)
    angle = float(vortex.value(point)) / strength
    assert cut - 1e-9 <= angle <= cut + 2.0 * math.pi + 1e-9
    assert cmath.exp(1j * angle) == pytest.approx(z / abs(z), abs=1e-9)
