"""Measurements with one mistake, made from readings of a five-bar: the calibration names it, and refuses."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from calibration_data import POSE, errors_of, everything, exact, noisy
from scipy.spatial.transform import Rotation

import cinegen
from cinegen.design import Design, DesignError, Measurements, Parameters, calibrate
from cinegen.design.calibration.estimation import expected_errors
from cinegen.design.calibration.mistakes import check
from cinegen.design.calibration.observation import Observation

Mistaken = Callable[[Measurements], Measurements]

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
        ({"joint1": 1 / GON, "joint3": 1 / GON}, (0, 1, 2, 3), "They fit with joint1, joint3 in gon instead of deg"),
        ({"joint1": 1 / GON}, (0, 1, 2, 3), "They fit with joint1 in gon instead of deg"),
        ({"tool.x": 1e3, "tool.y": 1e3}, (0, 1, 2, 3), "They fit with tool.x, tool.y in mm instead of m"),
    ],
    ids=["the sign of x", "x and y exchanged", "gon", "one encoder in gon", "mm"],
)
def test_a_mistake_is_refused_and_named(right, factors, order, says):
    with pytest.raises(DesignError) as caught:
        calibrate(PARAMETERS, changed(right, factors, order))
    assert says in str(caught.value)


FULL = [f"tool.{c}" for c in POSE]


def turned(given: Measurements) -> Measurements:
    """The same poses in a frame that is turned by 90 degrees about z, and 0.3 m away."""
    values = given.values.copy()
    for row in values:
        there = pin.SE3(pin.rpy.rpyToMatrix(0, 0, np.pi / 2), np.array([0.3, 0.0, 0.0]))
        there = there * pin.SE3(pin.rpy.rpyToMatrix(*row[-3:]), row[-6:-3])
        row[-6:] = *there.translation, *pin.rpy.matrixToRpy(there.rotation)
    return replace(given, values=values)


def inverted(given: Measurements) -> Measurements:
    """The pose of the base in the tool."""
    values = given.values.copy()
    for row in values:
        there = pin.SE3(pin.rpy.rpyToMatrix(*row[-3:]), row[-6:-3].copy()).inverse()
        row[-6:] = *there.translation, *pin.rpy.matrixToRpy(there.rotation)
    return replace(given, values=values)


def euler(given: Measurements) -> Measurements:
    """Angles about the tool's own x, y and z."""
    values = given.values.copy()
    matrices = [pin.rpy.rpyToMatrix(*row[-3:]) for row in values]
    values[:, -3:] = Rotation.from_matrix(np.array(matrices)).as_euler("XYZ")
    return replace(given, values=values)


def scaled(factor: float, *at: int) -> Mistaken:
    def made(given: Measurements) -> Measurements:
        values = given.values.copy()
        values[:, at] *= factor
        return replace(given, values=values)

    return made


def added(amount: float, *at: int) -> Mistaken:
    def made(given: Measurements) -> Measurements:
        values = given.values.copy()
        values[:, at] += amount
        return replace(given, values=values)

    return made


def placed(order: dict[int, int]) -> Mistaken:
    def made(given: Measurements) -> Measurements:
        values = given.values.copy()
        for k, other in order.items():
            values[:, k] = given.values[:, other]
        return replace(given, values=values)

    return made


def shifted(given: Measurements) -> Measurements:
    values = given.values.copy()
    values[:, -6:] = np.roll(values[:, -6:], 1, axis=0)
    return replace(given, values=values)


OF_ARM = [
    (scaled(-1.0, 1), "with the opposite sign of joint2 "),
    (scaled(-1.0, *range(7)), "with the opposite sign of joint1, joint2, "),
    (scaled(1 / GON, *range(7)), "joint7 in gon instead of deg"),
    (scaled(1 / GON, 0), "with joint1 in gon instead of deg"),
    (scaled(np.pi / 180, *range(7)), "joint7 in rad instead of deg"),
    (placed({0: 1, 1: 0}), "with columns joint1 and joint2 exchanged"),
    (placed({0: 1, 1: 2, 2: 0}), "in the order "),
    (added(np.pi / 2, 1), "with -90 deg added to joint2"),
    (added(-0.35, 0), r"with (19|20)\.\d* deg added to joint1"),
    (scaled(-1.0, 7), "with the opposite sign of tool.x "),
    (scaled(-1.0, 7, 8), "with the opposite sign of tool.x, tool.y"),
    (scaled(-1.0, 12), "with the opposite sign of tool.rz"),
    (placed({8: 9, 9: 8}), "with columns tool.y and tool.z exchanged"),
    (placed({10: 12, 12: 10}), "with columns tool.rx and tool.rz exchanged"),
    (scaled(1 / 25.4, 7, 8, 9), "tool.z in in instead of mm"),
    (scaled(0.1, 7, 8, 9), "tool.z in cm instead of mm"),
    (scaled(np.pi / 180, 10, 11, 12), "tool.rz in rad instead of deg"),
    (added(0.1, 7), r"with -0\.\d+ m added to tool\.x"),
    (turned, r"frame of its own \(tracker at .*, turned by (89|90)(\.\d*)? deg about"),
    (inverted, "with poses of the world in tool, the inverse"),
    (euler, "tool.rz as Euler angles XYZ"),
    (shifted, "tool.rz of the line below"),
]


@cache
def arm(seed: int, poses: int = 12) -> Measurements:
    parameters = everything("arm7")
    truth = parameters.values + errors_of(parameters) * np.random.default_rng(seed).normal(size=len(parameters))
    return noisy(exact(parameters, FULL, truth, poses, seed), seed)


def checked(name: str, given: Measurements, sigma: dict[str, str] | None = None) -> None:
    """Compare measurements with a robot as it is described."""
    parameters = everything(name)
    check(Observation(parameters, given), expected_errors(parameters, sigma))


@pytest.mark.parametrize(("mistaken", "says"), OF_ARM)
def test_mistakes_in_poses_of_an_arm_are_named_before_the_estimate(mistaken, says):
    with pytest.raises(DesignError, match=says) as caught:
        checked("arm7", mistaken(arm(1)))
    assert "is that what was measured? Then " in str(caught.value)


def test_joints_at_which_loops_do_not_close_are_named():
    parameters = everything("gough")
    given = noisy(exact(parameters, [f"platform.{c}" for c in POSE], parameters.values, 8), 1)
    with pytest.raises(DesignError, match=r"loops don't close .*They fit with the opposite sign of joint3 "):
        checked("gough", scaled(-1.0, 0)(given))


def test_a_zero_that_is_expected_to_be_elsewhere_is_taken():
    given = added(0.35, 0)(arm(1))
    with pytest.raises(DesignError, match="give larger expected errors"):
        checked("arm7", given)
    checked("arm7", given, {"link1.theta": "10deg"})


@pytest.mark.parametrize(("name", "node"), [("arm7", "tool"), ("five_bar", "tool"), ("delta4", "platform")])
def test_true_deviations_of_three_expected_errors_are_no_mistake(name, node):
    parameters = everything(name)
    columns = [f"{node}.{c}" for c in (POSE[:2] if name == "five_bar" else POSE)]
    free = ~np.isin(parameters.names, Design(parameters).evaluate().opening)
    for seed in range(10):
        errors = 3.0 * errors_of(parameters) * free
        truth = parameters.values + errors * np.random.default_rng(seed).normal(size=len(parameters))
        checked(name, noisy(exact(parameters, columns, truth, 8, seed), seed))


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
