"""Measurements with one mistake: they are refused, and the mistake is named with its correction."""

import re
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
from cinegen.design.calibration.checks import check
from cinegen.design.calibration.comparison import ColumnComparison
from cinegen.design.calibration.estimation import expected_errors
from cinegen.design.calibration.observation import Observation

Mistaken = Callable[[Measurements], Measurements]

GON = 0.9  # degrees
FEW = Parameters("five_bar", ["*.d", "link1.theta", "link3.theta"])  # it stays planar
ALL = cache(everything)


@cache
def right(name: str, kinds: int, errors: float = 1.0, seed: int = 1, poses: int = 8) -> Measurements:
    """Readings of a robot that differs from its description by expected errors, in its first kinds of coordinates."""
    parameters = ALL(name)
    free = ~np.isin(parameters.names, Design(parameters).evaluate().opening)
    errors_now = errors * errors_of(parameters) * free
    truth = parameters.values + errors_now * np.random.default_rng(seed).normal(size=len(parameters))
    columns = [f"{parameters.mechanism.end}.{c}" for c in POSE[:kinds]]
    return noisy(exact(parameters, columns, truth, poses, seed), seed)


@pytest.fixture(scope="module")
def few() -> Measurements:
    """Readings of a five-bar of which a few parameters differ from their description by expected errors."""
    errors = np.array([3e-4 if name.endswith(".d") else np.radians(0.05) for name in FEW.names])
    truth = FEW.values + errors * np.random.default_rng(3).normal(size=len(FEW))
    return noisy(exact(FEW, ["tool.x", "tool.y"], truth, poses=15), 4)


def checked(name: str, given: Measurements, sigma: dict[str, str] | None = None) -> None:
    """Compare measurements with a robot as it is described."""
    check(ColumnComparison(Observation(ALL(name), given), expected_errors(ALL(name), sigma)))


def other(given: Measurements, change: Callable[[np.ndarray], object]) -> Measurements:
    values = given.values.copy()
    change(values)
    return replace(given, values=values)


def scaled(factor: float, *at: int, offset: float = 0.0) -> Mistaken:
    def change(values: np.ndarray) -> None:
        values[:, at] = factor * values[:, at] + offset

    return lambda given: other(given, change)


def placed(at: tuple[int, ...], there: tuple[int, ...]) -> Mistaken:
    def change(values: np.ndarray) -> None:
        values[:, at] = values[:, there]

    return lambda given: other(given, change)


def of_poses(changed: Callable[[pin.SE3], pin.SE3]) -> Mistaken:
    def change(values: np.ndarray) -> None:
        for row in values:
            there = changed(pin.SE3(pin.rpy.rpyToMatrix(*row[-3:]), row[-6:-3].copy()))
            row[-6:] = *there.translation, *pin.rpy.matrixToRpy(there.rotation)

    return lambda given: other(given, change)


def in_frame(angles: tuple[float, float, float], place: tuple[float, float, float]) -> Mistaken:
    """Positions in a frame that stands elsewhere."""
    turn = pin.rpy.rpyToMatrix(*np.radians(angles))

    def change(values: np.ndarray) -> None:
        values[:, -3:] = values[:, -3:] @ turn.T + place

    return lambda given: other(given, change)


def about_own_axes(values: np.ndarray) -> None:
    matrices = np.array([pin.rpy.rpyToMatrix(*row[-3:]) for row in values])
    values[:, -3:] = Rotation.from_matrix(matrices).as_euler("XYZ")


def shifted(values: np.ndarray) -> None:
    values[:, -3:] = np.roll(values[:, -3:], 1, axis=0)


def reversed_lines(values: np.ndarray) -> None:
    values[:, -3:] = values[::-1, -3:].copy()


def named(names: dict[str, str]) -> Mistaken:
    """The same numbers below other names."""

    def change(given: Measurements) -> Measurements:
        columns = [names.get(one.name, one.name) for one in given.quantities]
        return Measurements.of(ALL("five_bar").mechanism, columns, given.values, given.sigmas)

    return change


def tracked(mistaken: Mistaken) -> Mistaken:
    """The same mistake in positions that a tracker has read."""

    def change(given: Measurements) -> Measurements:
        columns = [one.name + (" @ tracker" if one.kind != "joint" else "") for one in given.quantities]
        there = in_frame((2, -1, 120), (1.9, -0.6, 0.4))(given)
        return mistaken(Measurements.of(ALL("scara").mechanism, columns, there.values, there.sigmas))

    return change


MISTAKES = [
    # signs
    ("five_bar", 2, scaled(-1.0, 2), "with the opposite sign of tool.x"),
    ("delta4", 3, scaled(-1.0, 0, 1, 2), "with the opposite sign of joint1, joint6, joint12 "),
    ("delta4", 3, in_frame((180, 0, 0), (0, 0, 0)), "with the opposite sign of platform.y, platform.z"),
    ("gough", 6, scaled(-1.0, 0), r"loops don't close .*They fit with the opposite sign of joint3 "),
    ("scara", 3, tracked(scaled(-1.0, 0)), "with the opposite sign of joint1 "),
    # units
    ("five_bar", 2, scaled(1 / GON, 0, 1), "with joint1, joint3 in gon instead of deg"),
    ("scara", 3, scaled(np.pi / 180, 0, 1, 2, 3), "joint4 in rad instead of deg"),
    ("five_bar", 2, scaled(1e3, 2, 3), "with tool.x, tool.y in mm instead of m"),
    ("five_bar", 2, scaled(1 / 25.4, 2, 3), "tool.y in in instead of mm"),
    ("scara", 3, scaled(0.1, 4, 5, 6), "tool.z in cm instead of mm"),
    # columns and lines
    ("five_bar", 2, placed((2, 3), (3, 2)), "with columns tool.x and tool.y exchanged"),
    ("delta4", 3, placed((0, 1, 2), (1, 2, 0)), "in the order joint12, joint1, joint6"),
    ("scara", 3, lambda given: other(given, shifted), "tool.z of the line below"),
    ("scara", 3, lambda given: other(given, reversed_lines), r"order of lines \(8 at 1, 7 at 2, 6 at 3, 5 at 4 and "),
    # names
    ("five_bar", 2, named({"tool.x": "link2.x", "tool.y": "link2.y"}), "with tool in place of link2"),
    ("five_bar", 2, named({"joint3": "joint4"}), "with joint3 in place of joint4"),
    ("five_bar", 2, named({"joint3": "joint2"}), r"loops don't close .*They fit with joint3 in place of joint2"),
    # zeros
    ("scara", 3, scaled(1.0, 1, offset=np.pi / 2), r"with -(89|90)\S* deg added to joint2"),
    ("five_bar", 2, scaled(-1.0, 1, offset=np.pi), r"with -(179|180)(\.\d*)? deg minus the readings of joint3"),
    ("gough", 6, scaled(1.0, 1, offset=0.05), r"loops don't close .*They fit with -0\.0[45]\d* m added to joint9"),
    ("delta4", 3, scaled(1.0, 5, offset=0.5), r"with -0\.\d+ m added to platform\.z"),
    # frames, and ways to write a rotation
    ("scara", 3, in_frame((0, 0, 90), (0.2, 0.1, 0)), r"of its own \(tracker at .*, turned by (89|90)\S* deg about"),
    ("arm7", 6, of_poses(pin.SE3.inverse), "with poses of the world in tool, the inverse"),
    ("arm7", 6, lambda given: other(given, about_own_axes), "tool.rz as Euler angles XYZ"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "kinds", "mistaken", "says"), MISTAKES)
def test_a_mistake_is_named_before_the_estimate(name, kinds, mistaken, says):
    with pytest.raises(DesignError, match=says) as caught:
        checked(name, mistaken(right(name, kinds)))
    assert "is that what was measured? Then " in str(caught.value)


@pytest.mark.parametrize(("name", "kinds"), [("arm7", 6), ("five_bar", 2), ("delta4", 6), ("gough", 6)])
def test_true_deviations_of_three_expected_errors_are_no_mistake(name, kinds):
    checked(name, right(name, kinds, 3.0, 0, 8))


def test_the_right_readings_are_taken_without_a_word(few):
    found = calibrate(FEW, few)
    assert not found.outliers
    assert found.fit < 2.0


@pytest.mark.parametrize(
    ("factor", "says"), [(1e3, "these are too large, or in another unit"), (1e-3, "these are too small")]
)
def test_sigmas_in_another_unit_are_named(few, factor, says):
    """Also by few readings."""
    with pytest.warns(cinegen.CinegenWarning, match=says):
        calibrate(FEW, replace(few, sigmas=factor * few.sigmas), folds=0)


def test_a_sign_that_the_expected_errors_could_explain_is_named_by_the_estimate():
    """The platform of a delta rotates by its errors alone: about z by 0.1 degrees."""
    given = scaled(-1.0, 8)(right("delta4", 6, poses=20))
    checked("delta4", given)
    with pytest.raises(DesignError, match=r"They fit with the opposite sign of platform\.rz \(.* then\)"):
        calibrate(ALL("delta4"), given, folds=0)


@pytest.mark.parametrize(("name", "changed"), [("scara", {"link1.theta": "20deg"}), ("five_bar", {"base.d": "60mm"})])
def test_a_robot_that_really_is_so_is_taken_with_the_expected_errors_that_the_message_names(name, changed):
    """The zero of a joint, and a base that stands elsewhere."""
    parameters = Parameters("scara", ["*.d", "link1.theta", "link2.theta"]) if name == "scara" else FEW
    truth = parameters.with_changed(changed)
    given = noisy(exact(parameters, ["tool.x", "tool.y"], truth, 20), 1)
    with pytest.raises(DesignError) as caught:
        calibrate(parameters, given, folds=0)
    remedy = re.search(r"--sigma '(.*)'$", str(caught.value))[1]
    found = calibrate(parameters, given, folds=0, sigma=[tuple(part.split("=")) for part in remedy.split(", ")])
    assert found.fit < 2.0


def test_a_robot_that_no_parameter_explains_is_refused(few):
    """Before, an estimate with a chi-square of 1e6 was taken with a warning."""
    values = few.values.copy()
    values[:, 1] = np.random.default_rng(1).permutation(values[:, 1])
    with pytest.raises(
        DesignError, match=r"the estimate changes \S+ by .*, and the readings are still off by \S+ sigma"
    ):
        calibrate(FEW, replace(few, values=values), folds=0, sigma={"*": "10mm"})


def test_what_no_mistake_explains_is_refused_with_its_column(few):
    noise = np.random.default_rng(10).uniform(-0.1, 0.1, len(few))
    with pytest.raises(DesignError, match=r"column tool\.x: \d+ of 15 readings contradict .*no other sign, unit or"):
        calibrate(FEW, other(few, lambda values: values[:, 2].__iadd__(noise)))


def test_a_minority_of_outliers_is_left_out_and_counts_in_held_out_errors(few):
    values = few.values.copy()
    values[3, 2] += 0.02
    found = calibrate(FEW, replace(few, values=values))
    assert [(one.pose, one.column) for one in found.outliers] == [(3, 2)]
    (held,) = found.held_out
    assert held.count == 30
    assert held.after == pytest.approx(0.02 / np.sqrt(30), rel=0.1)
    assert held.kept < 1e-4


def test_a_parameter_that_is_far_from_its_description_is_named_and_taken_when_it_is_expected():
    parameters = ALL("five_bar")
    truth = parameters.values.copy()
    truth[parameters.names.index("link2.d")] += 0.02
    given = noisy(exact(parameters, ["tool.x", "tool.y"], truth, poses=25), 6)
    with pytest.warns(cinegen.CinegenWarning, match=r"link2\.d by 0\.02 m, 67 times.*--sigma link2\.d=(\S+)") as met:
        found = calibrate("five_bar", given, folds=0)
    assert found.values[found.names.index("link2.d")] == pytest.approx(
        truth[parameters.names.index("link2.d")], abs=1e-3
    )
    name, _, amount = str(met[0].message).rpartition("--sigma ")[2].partition("=")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        calibrate("five_bar", given, sigma={name: amount}, folds=0)
