"""Down a potential: its gradient, that it ends in minima where the paper says so, and that nothing is ever hit."""

import cmath
import math

import numpy as np
import pinocchio as pin
import pytest
import vortex_figures as drawn
from descents import ROBOTS, apart, attraction, bodies, figure, moved, slopes
from firas import STRENGTH, GoalPotential, Potential, firas
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation
from vortex_figures import PointVortex, draw_potentials

from cinegen.collision import scene_of
from cinegen.planning import PlanStatus, plan


def potential(scene, reach, **more):
    return Potential(scene, bodies(scene), reach, **more)


# --- the gradient ----------------------------------------------------------------------------------------------------


def by_formula(scene, q, reach, task):
    """The total potential far from the goal, by its formula: at half its range it pushes with task / length."""
    k = task / scene.mechanism.length * (reach / 2.0) ** 2 / (2.0 / reach - 1.0 / reach)
    distances = np.concatenate([apart(scene, q, body) for each in scene.obstacles for body in each.bodies])
    return attraction(scene, q) + float(0.5 * k * (np.maximum(1.0 / distances - 1.0 / reach, 0.0) ** 2).sum())


around_start = st.lists(st.floats(-0.25, 0.25), min_size=3, max_size=3)


@settings(max_examples=25)
@given(around_start, st.floats(0.1, 0.5))
def test_firas_has_the_gradient_of_its_total_potential_for_an_arm(step, reach):
    scene = figure("rod")
    q = moved(scene, scene.start, step)
    field = potential(scene, reach)
    assert field.value(q) == pytest.approx(by_formula(scene, q, reach, STRENGTH), rel=1e-6)
    wanted = slopes(scene, lambda q: by_formula(scene, q, reach, STRENGTH), q, 1e-5)
    assert field.gradient(q) == pytest.approx(wanted, abs=2e-4 * (1.0 + np.abs(wanted).max()))


def test_the_attraction_counts_rotation_too():
    document = {"name": "turn", "robot": str(ROBOTS / "arm7.raff"), "safety": 0.01, "obstacle": []}
    start = scene_of({**document, "goal": {"point": [0.1, 0.1, 0.5]}})
    target = start.mechanism.placement(start.start + 0.3, start.node)
    turn = pin.rpy.matrixToRpy(target.rotation).tolist()
    scene = scene_of({**document, "node": start.node, "goal": {"point": target.translation.tolist(), "rpy": turn}})
    goal, q = GoalPotential(scene), scene.start
    at_start = scene.mechanism.placement(q, scene.node)
    way = (target.translation - at_start.translation) / scene.mechanism.length
    turned = Rotation.from_matrix(target.rotation @ at_start.rotation.T).magnitude()
    assert turned > 0.1
    assert goal.value(q) == pytest.approx(0.5 * (way @ way + turned**2), rel=1e-9)
    assert goal.gradient(q) == pytest.approx(slopes(scene, goal.value, q, 1e-5), abs=1e-6)


# --- minima ----------------------------------------------------------------------------------------------------------


def is_lowest(scene, field, q, away):
    """Whether nothing around q is lower."""
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(200, scene.mechanism.model.nv))
    lowest = field.value(q)
    return all(field.value(moved(scene, q, away * way / np.linalg.norm(way))) >= lowest - 1e-9 for way in directions)


@pytest.mark.parametrize("which", ["rod", "disc"])
def test_firas_stops_in_a_minimum_of_the_field_in_figures_5_and_7(which):
    scene = figure(which)
    planned = plan(scene, field=firas)
    assert planned.status is PlanStatus.STUCK
    assert planned.field == "firas"
    assert len(planned.attempts) == 1
    end = planned.path[-1]
    total = potential(scene, 0.5 * scene.mechanism.length)
    assert np.abs(total.gradient(end)).max() < 2e-3
    assert np.linalg.norm(total.goal.gradient(end)) > 0.1  # attraction and repulsion are in balance
    assert is_lowest(scene, total, end, 0.01)
    assert not planned.attempts[0].blocked_by  # it is not the barrier that stops it
    assert planned.clearances[-1] > 3.0 * scene.safety


# --- figures 1 to 4 ---------------------------------------------------------------------------------------------------
# The paper's figures 1 to 4: what they show is so.


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
