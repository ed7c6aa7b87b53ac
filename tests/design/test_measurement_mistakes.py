"""Measurements with one mistake, made from readings of a five-bar: the calibration names it, and refuses."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from calibration_data import everything, exact, noisy

import cinegen
from cinegen.design import DesignError, Measurements, Parameters, calibrate

COLUMNS = ("joint1", "joint3", "tool.x", "tool.y")
GON = 0.9  # degrees
PARAMETERS = Parameters("five_bar", ["*.d", "link1.theta", "link3.theta"])  # it stays planar


@pytest.fixture(scope="module")
def right() -> Measurements:
    """Readings of a robot whose dimensions differ from its description by the expected errors."""
    errors = np.array([3e-4 if name.endswith(".d") else np.radians(0.05) for name in PARAMETERS.names])
    truth = PARAMETERS.values + errors * np.random.default_rng(3).normal(size=len(PARAMETERS))
    return noisy(exact(PARAMETERS, COLUMNS[2:], truth, poses=15), 4)


def changed(given: Measurements, factors: dict[str, float], order: tuple[int, ...] = (0, 1, 2, 3)) -> Measurements:
    """Measurements with columns times factors, then in another order under the same headers."""
    factor = np.array([factors.get(name, 1.0) for name in COLUMNS])
    return replace(given, values=(given.values * factor)[:, order])


def test_the_right_readings_are_taken_without_a_word(right):
    found = calibrate(PARAMETERS, right)
    assert not found.outliers
    assert found.fit < 2.0


@pytest.mark.parametrize(
    ("factors", "order", "says"),
    [
        ({"tool.x": -1.0}, (0, 1, 2, 3), "They fit with the opposite sign of tool.x"),
        ({}, (0, 1, 3, 2), "They fit with columns tool.x and tool.y exchanged"),
        ({"joint1": 1 / GON, "joint3": 1 / GON}, (0, 1, 2, 3), "are they in gon, and read as deg"),
        ({"joint1": 1 / GON}, (0, 1, 2, 3), "They fit with joint1 in gon instead of deg"),
        ({"tool.x": 1e3, "tool.y": 1e3}, (0, 1, 2, 3), "are they in mm, and read as m"),
    ],
    ids=["the sign of x", "x and y exchanged", "gon", "one encoder in gon", "mm"],
)
def test_a_mistake_is_refused_and_named(right, factors, order, says):
    with pytest.raises(DesignError) as caught:
        calibrate(PARAMETERS, changed(right, factors, order))
    assert says in str(caught.value)


def test_what_no_mistake_explains_is_refused_with_its_column(right):
    values = right.values.copy()
    values[:, 2] += np.random.default_rng(10).uniform(-0.1, 0.1, len(values))
    with pytest.raises(DesignError, match=r"column tool\.x: \d+ of 15 readings contradict .*no other sign, unit or"):
        calibrate(PARAMETERS, replace(right, values=values))


def test_a_minority_of_outliers_is_left_out_and_counts_in_held_out_errors(right):
    values = right.values.copy()
    values[3, 2] += 0.02
    found = calibrate(PARAMETERS, replace(right, values=values))
    assert [(one.pose, one.column) for one in found.outliers] == [(3, 2)]
    (held,) = found.held_out
    assert held.count == 30
    assert held.after == pytest.approx(0.02 / np.sqrt(30), rel=0.1)
    assert held.kept < 1e-4


def test_a_parameter_that_is_far_from_its_description_is_named_and_taken_when_it_is_expected():
    parameters = everything("five_bar")
    truth = parameters.values.copy()
    truth[parameters.names.index("link2.d")] += 0.02
    given = noisy(exact(parameters, COLUMNS[2:], truth, poses=25), 6)
    with pytest.warns(cinegen.CinegenWarning, match=r"link2\.d by 0\.02 m, 67 times.*--sigma link2\.d=(\S+)") as met:
        found = calibrate("five_bar", given)
    assert found.values[found.names.index("link2.d")] == pytest.approx(
        truth[parameters.names.index("link2.d")], abs=1e-3
    )
    name, _, amount = str(met[0].message).rpartition("--sigma ")[2].partition("=")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        calibrate("five_bar", given, sigma={name: amount})
