"""Many configurations at once say what one at a time says: placements, Jacobians and singular values."""

import numpy as np
import pytest
from elementary import at
from example_robots import load
from hypothesis import given, settings
from hypothesis import strategies as st
from test_inverse_kinematics import CLOSED, SERIAL, end_of

import cinegen


def around_home(mechanism: cinegen.Mechanism, count: int, seed: int, size: float = 0.3) -> np.ndarray:
    """(count, motors) values around home."""
    scale = np.array([mechanism.length if mechanism.is_prismatic(joint) else 1.0 for joint in mechanism.actuated])
    rng = np.random.default_rng(seed)
    return at(mechanism, mechanism.q_home, mechanism.actuated) + rng.uniform(-size, size, (count, len(scale))) * scale


@pytest.mark.parametrize("name", [*CLOSED, *SERIAL])
def test_it_is_what_closing_and_differences_say(name: str) -> None:
    mechanism = load(name)
    node = end_of(mechanism)
    values = around_home(mechanism, 12, seed=5, size=0.1)
    result = cinegen.evaluate(mechanism, node, values)
    closed = np.isfinite(result.closure)
    assert closed.sum() >= 6
    for i in np.flatnonzero(closed):
        q = result.q[i]
        assert mechanism.closure(q) <= 1e-10
        np.testing.assert_array_equal(at(mechanism, q, mechanism.actuated), values[i])
        place = mechanism.placement(q, node)
        np.testing.assert_allclose(result.placements[i], place.homogeneous, atol=1e-12 * max(1.0, mechanism.length))
        if len(mechanism.actuated) != mechanism.mobility:
            continue
        for c, joint in enumerate(mechanism.actuated):
            unit = mechanism.length if mechanism.is_prismatic(joint) else 1.0
            offsets = []
            for sign in (-1.0, 1.0):
                moved = q.copy()
                moved[mechanism.q_index(joint)] += sign * 1e-5 * unit
                moved = mechanism.close(moved, locked=mechanism.actuated)
                offsets.append(place.actInv(mechanism.placement(moved, node)).translation)
            slope = (offsets[1] - offsets[0]) / (2e-5 * unit)
            size = np.abs(result.jacobians[i]).max()
            np.testing.assert_allclose(result.jacobians[i][:3, c], slope, atol=1e-6 * (1.0 + size))


@pytest.mark.parametrize("name", [*CLOSED, *SERIAL])
@pytest.mark.parametrize(("translation", "rotation"), [(3, 0), (3, 3), (2, 1)])
def test_singular_values_are_those_of_a_tick(name: str, translation: int, rotation: int) -> None:
    mechanism = load(name)
    node = end_of(mechanism)
    result = cinegen.evaluate(mechanism, node, around_home(mechanism, 3, seed=7, size=0.05), translation, rotation)
    for q, sigma in zip(result.q, result.singular_values, strict=True):
        if not np.isfinite(q).all():
            continue
        solver = cinegen.Solver(mechanism, 0.01, q)
        solver.add_task(node, None, translation, rotation)
        expected = solver.step().singular_values
        np.testing.assert_allclose(sigma[: len(expected)], expected, atol=1e-9)
        np.testing.assert_allclose(sigma[len(expected) :], 0.0, atol=1e-9)


def test_what_can_not_be_closed_is_no_number_and_does_not_stop_the_others() -> None:
    mechanism = load("five_bar")
    home = at(mechanism, mechanism.q_home, mechanism.actuated)
    away = [home, home + np.array([2.5, -2.5]), [np.nan, 0.0], [1e9, 0.0], home]
    result = cinegen.evaluate(mechanism, end_of(mechanism), away, 2, 0)
    np.testing.assert_array_equal(np.isfinite(result.closure)[[0, 2, 3, 4]], [True, False, False, True])
    for field in (result.q, result.placements, result.jacobians, result.singular_values):
        np.testing.assert_array_equal(np.isfinite(field).reshape(5, -1).all(axis=1), np.isfinite(result.closure))
    np.testing.assert_allclose(result.q[0], result.q[4], atol=1e-12)


@pytest.mark.parametrize("name", CLOSED)
@given(st.integers(0, 10**6))
@settings(max_examples=8)
def test_a_line_of_equal_steps_is_where_each_of_its_configurations_is_alone(name: str, seed: int) -> None:
    """What is foreseen from the steps before saves work, and makes no difference; nor do turns, stops and other
    steps between."""
    mechanism = load(name)
    first, last, third = around_home(mechanism, 3, seed, size=0.02)
    line = np.linspace(first, last, 12)
    values = np.vstack([line, line[:-1][::-1], [first, first], np.linspace(first, third, 3), line])
    together = cinegen.evaluate(mechanism, end_of(mechanism), values)
    alone = np.array([cinegen.evaluate(mechanism, end_of(mechanism), [value]).q[0] for value in line])
    passes = (together.q[:12], together.q[11:23][::-1], together.q[-12:])
    for way in passes:
        np.testing.assert_allclose(way, alone, atol=1e-9)
    assert together.closure.max() < 1e-10


def test_nothing_gives_nothing_and_another_shape_is_refused() -> None:
    mechanism = load("delta4")
    assert cinegen.evaluate(mechanism, "platform", np.zeros((0, 3))).q.shape == (0, 15)
    with pytest.raises(cinegen.CinegenError, match=r"\(count, 3\)"):
        cinegen.evaluate(mechanism, "platform", np.zeros((4, 2)))
    with pytest.raises(cinegen.CinegenError, match="plat"):
        cinegen.evaluate(mechanism, "plat", np.zeros((4, 3)))
