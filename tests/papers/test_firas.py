"""Down a potential: its gradient, that it ends in minima where the paper says so, and that nothing is ever hit."""

import numpy as np
import pinocchio as pin
import pytest
from descents import ROBOTS, apart, attraction, bodies, figure, moved, slopes
from firas import STRENGTH, GoalPotential, Potential, firas
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

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


def test_descent_only_goes_down():
    scene = figure("rod")
    total = potential(scene, 0.5 * scene.mechanism.length)
    values = [total.value(q) for q in plan(scene, field=firas, steps=15).path]
    assert values[0] - values[-1] > 0.1
    assert np.diff(values).max() < 1e-9
