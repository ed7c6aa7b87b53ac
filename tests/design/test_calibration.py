"""Calibration: derivatives, identifiable combinations, estimates against the Cramer-Rao bound, outliers, mistakes."""

from functools import cache

import numpy as np
import pytest
from calibration_data import POSE, changed_by_dependencies, changes, errors_of, everything, exact, noisy

import cinegen
import raff2urdf
from cinegen.design import Calibration, Design, DesignError, Measurements, Parameters, calibrate
from cinegen.design.calibration.observation import Observation
from cinegen.design.calibration.proposal import propose
from cinegen.design.poses import random_poses
from cinegen.errors import CinegenWarning

IDENTIFIABLE = [("delta4", 114, 42, 38), ("five_bar", 42, 13, 12)]
"""Parameters, and combinations that full poses and positions determine (issue: identifiability of the design)."""


@cache
def measured(name: str, columns: tuple[str, ...], seed: int = 3) -> tuple[Parameters, np.ndarray, Measurements]:
    parameters = everything(name)
    rng = np.random.default_rng(seed)
    errors = errors_of(parameters) * min(1.0, 5.0 * parameters.mechanism.length)  # tssm is 20 mm high
    opening = Design(parameters).evaluate().opening
    errors[[parameter in opening for parameter in parameters.names]] = 0.0
    truth = parameters.values + errors * rng.normal(size=len(parameters))
    end = parameters.mechanism.end
    return parameters, truth, exact(parameters, [f"{end}.{c}" for c in columns], truth, seed=seed)


@cache
def calibrated(name: str, columns: tuple[str, ...]) -> Calibration:
    parameters, _, readings = measured(name, columns)
    return calibrate(parameters, noisy(readings, 1), folds=0, robust=False)


@cache
def held_out() -> Calibration:
    parameters, _, readings = measured("delta4", POSE)
    return calibrate(parameters, noisy(readings, 3))


def combinations(calibration: Calibration, truth: np.ndarray) -> np.ndarray:
    errors = np.where(calibration.subspace.errors > 0.0, calibration.subspace.errors, 1.0)
    return calibration.subspace.basis.T @ ((truth - calibration.nominal) / errors)


def test_derivatives_against_differences():
    parameters = everything("gough")
    mechanism = parameters.mechanism
    q = random_poses(Design(parameters), 3, 5)
    columns = [*mechanism.actuated, "joint1", *(f"platform.{c}" for c in POSE)]
    columns += ["platform(0 0 50mm).distance(1 0 0)", "link3(10mm 0 0).along(1 1 2)"]
    values = np.zeros((3, len(columns)))
    for k, joint in enumerate(columns[:7]):
        values[:, k] = q[:, mechanism.q_index(joint)]
    measurements = Measurements.of(mechanism, columns, values, [0.0] * 6 + [1e-4] * 9)
    observation = Observation(parameters, measurements, ["joint3", "joint1"])
    assert observation.inputs == mechanism.actuated
    prediction = observation.predict(observation.values)
    np.testing.assert_allclose(prediction.values[:, 0], values[:, 6], atol=1e-9)  # the loops lead to the passive joint
    for k in range(0, len(observation), 7):
        ends = []
        for step in (1e-6, -1e-6):
            theta = observation.values.copy()
            theta[k] += step
            ends.append(observation.predict(theta, derivatives=False).values)
        np.testing.assert_allclose(prediction.jacobian[:, :, k], (ends[0] - ends[1]) / 2e-6, atol=1e-8)


@pytest.mark.parametrize(("name", "count", "full", "position"), IDENTIFIABLE)
def test_identifiable_combinations(name, count, full, position):
    for columns, wanted in ((POSE, full), (POSE[:3], position)):
        calibration = calibrated(name, columns)
        assert len(calibration.names) == count
        assert calibration.subspace.rank == wanted
        counted = calibration.subspace.rank + len(calibration.without_effect) + len(calibration.opening)
        assert counted + sum(len(dependency.changes) for dependency in calibration.dependencies) == count


def test_dependencies_changed_by_dependencies():
    calibration = calibrated("delta4", POSE)
    assert changed_by_dependencies(calibration) < 1e-6
    texts = [dependency.text for dependency in calibration.dependencies]
    assert "base.gamma and base.theta: only their sum" in texts
    assert any(text.startswith("base moved, and link1, link6, link12 on it moved back") for text in texts)


def test_estimates_obey_the_cramer_rao_bound():
    truth, estimate = measured("delta4", POSE)[1], held_out()
    wanted = combinations(estimate, truth)
    sigma = np.sqrt(np.diag(estimate.combination_covariance))
    assert (np.abs(estimate.combinations - wanted) <= 3.0 * sigma).mean() >= 0.95
    whitened = np.linalg.solve(np.linalg.cholesky(estimate.combination_covariance), estimate.combinations - wanted)
    assert 0.4 < np.mean(whitened**2) < 1.8  # chi-square with some 45 degrees of freedom
    assert 0.6 < estimate.fit < 1.4
    for held in estimate.held_out:
        assert held.noise < held.after < 2.0 * held.noise < 0.2 * held.before
    for name, k in zip(estimate.names, estimate.separate, strict=True):
        if k:  # the parameter itself, not only a combination
            i = estimate.names.index(name)
            assert abs(estimate.values[i] - truth[i]) < 4.5 * estimate.sigmas[i]


def test_the_covariance_holds_for_large_errors_of_what_is_not_determined():
    """Whose effects of second order bias what is: chi-square per rank is 1.5 by the Cramer-Rao bound alone, and 1.3
    with errors as they are expected by default. They are taken to be as large as those that are found."""
    parameters, chi2, count = everything("delta4"), 0.0, 0
    columns = [f"platform.{c}" for c in POSE]
    for seed in range(4, 9):
        errors = 4.0 * errors_of(parameters) * np.random.default_rng(seed).normal(size=len(parameters))
        truth = parameters.values + errors
        readings = noisy(exact(parameters, columns, truth, seed=seed), seed + 100)
        estimate = calibrate(parameters, readings, folds=0, robust=False)
        off = estimate.combinations - combinations(estimate, truth)
        chi2 += off @ np.linalg.solve(estimate.combination_covariance, off)
        count += len(off)
    assert chi2 / count == pytest.approx(1.0, abs=3.0 * np.sqrt(2.0 / count))


def test_outliers_change_little_and_are_listed():
    parameters, _, readings = measured("delta4", POSE)
    good, bad = noisy(readings, 3), noisy(readings, 3, 0.05)
    reference, again = held_out(), calibrate(parameters, bad, folds=0)
    assert (changes(again, reference) < 1.0).mean() > 0.98
    wrong = set(zip(*np.nonzero(bad.values != good.values), strict=True))
    assert {(outlier.pose, outlier.column) for outlier in again.outliers} == wrong
    # which least squares alone would not ignore
    small = Parameters("five_bar", ["link2.d", "link4.d", "link5.d"])
    readings = exact(small, ["tool.x", "tool.y"], small.values + 1e-4, seed=3)
    reference, bad = calibrate(small, noisy(readings, 3), folds=0), noisy(readings, 3, 0.05)
    with pytest.warns(CinegenWarning, match="times what the sigmas of the readings allow"):
        naive = calibrate(small, bad, folds=0, robust=False)
    assert changes(naive, reference).max() > 10.0


def test_dependent_columns_on_which_divide_and_conquer_fails():
    """Of this matrix numpy's decomposition does not converge."""
    parameters = everything("delta4")
    rng = np.random.default_rng([7, 3])
    truth = parameters.values + errors_of(parameters) * rng.normal(size=len(parameters))
    readings = noisy(exact(parameters, [f"platform.{c}" for c in POSE], truth, seed=3), 3)
    rows, columns = np.nonzero(readings.sigmas > 0.0)
    lost = np.random.default_rng([3, 1]).choice(len(rows), 72, replace=False)
    values = readings.values.copy()
    values[rows[lost], columns[lost]] = np.nan
    result = calibrate(parameters, Measurements(readings.quantities, values, readings.sigmas, readings.labels), folds=0)
    assert result.subspace.rank == 42


def test_offsets_gains_and_redundant_encoders():
    """A five-bar whose encoders are wrong, measured by the encoder of a passive joint and a ball bar."""
    plain = Parameters("five_bar")
    mechanism = plain.mechanism
    names = ["link2.d", "link4.d", "link1.theta", "link3.theta"]
    parameters = Parameters("five_bar", names)
    truth = parameters.with_changed({"link2.d": "251mm", "link4.d": "249.5mm"})
    truth[2:] += [0.01, -0.02]
    gains = [0.003, -0.002]
    columns = [*mechanism.actuated, "joint2", "tool.distance(0 -0.1 0)", "tool.x"]
    q = random_poses(Design(plain), 30, 2, 0.5)
    values = np.zeros((30, 5))
    for k, joint in enumerate(columns[:3]):
        values[:, k] = q[:, mechanism.q_index(joint)]
    sigmas = [0.0, 0.0, 1e-5, 1e-6, 1e-6]
    blank = Measurements.of(mechanism, columns, values, sigmas)
    observation = Observation(parameters, blank, list(mechanism.actuated))
    values[:, 2:] = observation.predict(np.append(truth, gains), derivatives=False).values
    readings = noisy(Measurements.of(mechanism, columns, values, sigmas), 1)
    calibration = calibrate(parameters, readings, gains=mechanism.actuated)
    assert calibration.subspace.basis.shape[1] == 6
    assert (np.abs(calibration.values - np.append(truth, gains)) < 4.0 * calibration.sigmas).all()
    assert calibration.sigmas.max() < 1e-4


@pytest.mark.filterwarnings("ignore:.*graphics that can't be shown")
def test_the_raff_file_is_the_calibrated_robot(tmp_path):
    """Loaded anew, it is where the robot was measured."""
    plain, parameters = Parameters("delta4"), everything("delta4")
    rng = np.random.default_rng(0)
    errors = np.where([bool(param.joint) for param in parameters.all], 0.0, errors_of(parameters))  # encoders are exact
    truth = parameters.values + errors * rng.normal(size=len(errors))
    end = parameters.mechanism.end
    readings = noisy(exact(parameters, [f"{end}.{c}" for c in POSE], truth), 1)
    calibration = calibrate(Parameters("delta4"), readings)
    (tmp_path / "new.raff").write_text(calibration.raff())
    start = Observation(plain, readings).start()
    at = Design(Parameters(tmp_path / "new.raff")).evaluate(q=start)
    actuated = len(plain.mechanism.actuated)
    off = at.placements(end)[:, :3, 3] - readings.values[:, actuated : actuated + 3]
    assert np.sqrt(np.mean(off**2)) < 7e-5
    assert raff2urdf.loads(calibration.raff()).robots


MISTAKES = [
    ({"platform.x": 1000.0}, "platform.x: .* is far beyond the reach .* did you mean"),
    ({"joint1": 1000.0}, "joint1: .* far beyond its limits"),
]


@pytest.mark.parametrize(("factors", "message"), MISTAKES)
def test_wrong_units_are_asked_back(factors, message):
    parameters, _, readings = measured("delta4", POSE)
    values = readings.values.copy()
    for k, quantity in enumerate(readings.quantities):
        values[:, k] *= factors.get(quantity.name, 1.0)
    bad = Measurements(readings.quantities, values, readings.sigmas, readings.labels, "m.csv")
    with pytest.raises((DesignError, cinegen.CinegenError), match=message):
        calibrate(parameters, Measurements.loads(bad.text("m", "rad"), parameters.mechanism, "m.csv"))


def test_joints_that_nothing_determines_are_named():
    mechanism = cinegen.load("five_bar")
    lacking = Measurements.of(mechanism, ["joint1", "tool.x"], [[1.0, 0.1]], [0.0, 1e-4])
    with pytest.raises(DesignError, match=r"joint3 is neither measured nor given by the loops: .* such as joint3"):
        calibrate("five_bar", lacking)
    gap = Measurements.of(mechanism, ["joint1", "joint3", "tool.x"], [[1.0, np.nan, 0.1]], [0.0, 0.0, 1e-4])
    with pytest.raises(DesignError, match="pose 1, joint3: the reading is missing"):
        calibrate("five_bar", gap)
    bare = Measurements.of(mechanism, ["joint1", "joint3"], [[1.5, 1.5]], [0.0, 0.0])
    with pytest.raises(DesignError, match="nothing is measured but the joints"):
        calibrate("five_bar", bare)


def test_proposed_poses_are_better_than_random_ones():
    """By information that is computed anew, from the poses' readings alone."""
    parameters, _, readings = measured("delta4", POSE[:3])
    some = noisy(readings, 1)
    some = Measurements(some.quantities, some.values[:20], some.sigmas[:20], some.labels[:20])
    calibration = calibrate(parameters, some, folds=0)
    best = propose(calibration, 6, 80)
    assert best.gain > 1.05 * best.random_gain > 1.05
    again = Measurements.loads(best.text().replace(",,,", ",0,0,0"), parameters.mechanism)
    limits = parameters.mechanism.limits
    for k, joint in enumerate(parameters.mechanism.actuated):
        assert (again.values[:, k] >= limits[joint][0]).all()
        assert (again.values[:, k] <= limits[joint][1]).all()

    def information(lines: Measurements) -> np.ndarray:
        observation = Observation(parameters, lines)
        prediction = observation.predict(observation.values)
        rows = prediction.jacobian / observation.sigmas[..., None] * calibration.subspace.errors
        return np.einsum("nkp,nkq->pq", rows, rows)

    base = np.eye(len(parameters)) + information(some)
    chosen = np.linalg.slogdet(base + information(again))[1]
    for seed in range(5):
        q = random_poses(Design(parameters), 6, 100 + seed)
        values = again.values.copy()
        for k, joint in enumerate(parameters.mechanism.actuated):
            values[:, k] = q[:, parameters.mechanism.q_index(joint)]
        others = Measurements(again.quantities, values, again.sigmas, again.labels)
        assert chosen > np.linalg.slogdet(base + information(others))[1]


def test_noise_of_encoders_widens_the_covariance():
    parameters, truth, readings = measured("delta4", POSE)
    inputs = [k for k, quantity in enumerate(readings.quantities) if quantity.kind == "joint"]
    sigmas = readings.sigmas.copy()
    sigmas[:, inputs] = 2e-4
    values = readings.values + sigmas * np.random.default_rng(5).normal(size=readings.values.shape)
    calibration = calibrate(parameters, Measurements(readings.quantities, values, sigmas, readings.labels), folds=0)
    assert 0.6 < calibration.fit < 1.4  # without the encoders' part, it would be beyond 10
    sigma = np.sqrt(np.diag(calibration.combination_covariance))
    assert (np.abs(calibration.combinations - combinations(calibration, truth)) <= 3.0 * sigma).mean() >= 0.95
    exact_ones = calibrate(parameters, noisy(readings, 1), folds=0)
    assert (sigma > np.sqrt(np.diag(exact_ones.combination_covariance))).all()
