"""The paper's figures 1 to 4: what they show is so."""

import cmath
import math

import numpy as np
import pytest
import vortex_figures as drawn
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from vortex_figures import PointVortex, draw_potentials

points = arrays(float, 3, elements=st.floats(-2.0, 2.0).map(lambda x: round(x, 4)))


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
    lowest = minima(drawn.ATTRACTION.value(points) + potential, x, y)
    # Where k (p - G) = -V, the attraction is across p: on the circle over OG. The larger root is the minimum.
    length, ratio = np.linalg.norm(drawn.GOAL), drawn.SLOPE / drawn.ATTRACTION.stiffness
    away = np.sqrt((length**2 + np.sqrt(length**4 - 4.0 * ratio**2)) / 2.0)
    assert np.linalg.norm(lowest, axis=1) == pytest.approx([away], abs=5e-3)
    assert np.linalg.norm(lowest[0] - drawn.GOAL[:2]) == pytest.approx(np.sqrt(length**2 - away**2), abs=5e-3)


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
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    straight = (drawn.GOAL - way[q + 1]) / np.linalg.norm(drawn.GOAL - way[q + 1])
    assert np.abs(towards - straight).max() <= 1e-6


def test_each_figure_shows_something_with_units():
    figures = draw_potentials()
    for name, count in (("figure1", 2), ("figure2", 2), ("figure3", 2), ("figure4", 1)):
        assert len(figures[name].axes) == count
        for axes in figures[name].axes:
            assert axes.has_data()
            assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (m)", "y (m)")


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
