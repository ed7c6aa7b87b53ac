"""Calibration of synthetic robots: errors against the Cramer-Rao bound, and what gross outliers change.

    python benchmarks/calibration.py [COUNT]              # robots of each kind; 40 unless given
    python benchmarks/calibration.py covariance [COUNT]   # chi-square per rank; 40 unless given

Each robot has random errors in all parameters (0.3 mm, 0.05 degrees) and is measured in 40 poses of its joints' range:
full poses of the end with noise of 0.05 mm and 0.01 degrees. Then 5 % of the readings are 20 to 1000 sigma off, and the
estimate is compared with two others: that of all readings before, and that of the same readings left out. A reading
that is wrong by an unknown amount tells nothing: the second is the best that is possible.

`covariance` compares the combinations that are estimated with the truth, in the covariance that `calibrate` states.
Their squares have a mean of 1 if it is right; the error of that mean is the one that the robots' own means have. What
was drawn is shown beside it: the mean square of the noise along the combinations, which no covariance changes.
"""

from __future__ import annotations

import sys
import time
import warnings
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/helpers"))

from calibration_data import POSE, changes, errors_of, everything, exact, noisy

from cinegen.design import Design, Measurements, Parameters, calibrate

ROBOTS = ("arm7", "five_bar", "delta4", "gough", "scara")


def synthetic(
    parameters: Parameters, kinds: int, seed: int, errors: float = 1.0, noise: float = 1.0, poses: int = 40
) -> tuple[np.ndarray, Measurements, Measurements]:
    """Return the true values of a robot that can be assembled, and its readings without and with noise: the first kinds
    of coordinates."""
    free = ~np.isin(parameters.names, Design(parameters).evaluate().opening)
    rng = np.random.default_rng([7, seed])
    truth = parameters.values + errors * errors_of(parameters) * free * rng.normal(size=len(parameters))
    columns = [f"{parameters.mechanism.end}.{c}" for c in POSE[:kinds]]
    readings = exact(parameters, columns, truth, poses, seed)
    readings = replace(readings, sigmas=noise * readings.sigmas)
    return truth, readings, noisy(readings, 1000 + seed)


def covariance(count: int) -> None:
    """Print chi-square per rank by the covariance that is stated."""
    for (name, kinds), (errors, noise) in product(
        (("five_bar", 2), ("delta4", 3), ("delta4", 6), ("gough", 6)), ((1.0, 1.0), (1.0, 0.2), (3.0, 1.0))
    ):
        parameters, squares, drawn, largest = everything(name), list[float](), list[float](), 0.0
        for seed in range(count):
            truth, clean, measured = synthetic(parameters, kinds, seed, errors, noise)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                estimate = calibrate(parameters, measured, folds=0)
            scale = np.where(estimate.subspace.errors > 0.0, estimate.subspace.errors, np.inf)
            off = estimate.combinations - estimate.subspace.basis.T @ ((truth - parameters.values) / scale)
            root = np.linalg.cholesky(estimate.combination_covariance)
            squares.append(float(np.mean(np.linalg.solve(root, off) ** 2)))
            largest = max(largest, float(np.max(np.abs(off) / np.sqrt(np.diag(estimate.combination_covariance)))))
            rows = estimate.observation.predict(estimate.values).jacobian @ estimate.subspace.changes
            basis = np.linalg.qr((rows / estimate.observation.sigmas[..., None])[estimate.kept])[0]
            outputs = estimate.observation.outputs
            apart = ((measured.values - clean.values)[:, outputs] / estimate.observation.sigmas)[estimate.kept]
            drawn.append(float(np.mean((basis.T @ apart) ** 2)))
        print(
            f"{name}, {kinds} coordinates, {errors:g} expected errors, {noise:g} noise: chi-square per rank "
            f"{np.mean(squares):.3f} +- {np.std(squares, ddof=1) / count**0.5:.3f} ({count} robots, rank {len(off)}); "
            f"of the noise drawn {np.mean(drawn):.3f}; largest {largest:.2g} sigma",
            flush=True,
        )


def main(count: int) -> None:
    for name in ("gough", "delta4"):
        parameters = everything(name)
        end = parameters.mechanism.end
        within, squares, fits = list[float](), list[float](), list[float]()
        lost, moved, best = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()
        spoilt_ones = wrong = missed = 0
        spent = 0.0
        for seed in range(count):
            rng = np.random.default_rng([7, seed])
            truth = parameters.values + errors_of(parameters) * rng.normal(size=len(parameters))
            clean = exact(parameters, [f"{end}.{c}" for c in POSE], truth, seed=seed)
            measured, bad = noisy(clean, 1000 + seed), noisy(clean, 1000 + seed, 0.05)  # no draws of the poses
            spoilt = bad.values != measured.values
            blank = Measurements(bad.quantities, np.where(spoilt, np.nan, bad.values), bad.sigmas, bad.labels)
            began = time.process_time()
            estimate = calibrate(parameters, measured, folds=0)
            spent += time.process_time() - began
            again, without = (calibrate(parameters, readings, folds=0) for readings in (bad, blank))
            wanted = estimate.subspace.basis.T @ ((truth - parameters.values) / estimate.subspace.errors)
            sigma = np.sqrt(np.diag(estimate.combination_covariance))
            within.append(float((np.abs(estimate.combinations - wanted) <= 3.0 * sigma).mean()))
            root = np.linalg.cholesky(estimate.combination_covariance)
            squares.append(float(np.mean(np.linalg.solve(root, estimate.combinations - wanted) ** 2)))
            fits.append(estimate.fit)
            moved.append(changes(again, estimate))
            lost.append(changes(without, estimate))
            best.append(changes(again, without))
            flagged = np.zeros_like(spoilt)
            for outlier in again.outliers:
                flagged[outlier.pose, outlier.column] = True
            spoilt_ones += int(spoilt.sum())
            missed += int((spoilt & ~flagged).sum())
            wrong += int((flagged & ~spoilt).sum())
        most = 100 * np.mean(np.array(within) >= 0.95)
        print(
            f"{name}: {count} robots, {len(wanted)} combinations; {100 * np.mean(within):.2f} % of the estimates are "
            f"within 3 sigma of the Cramer-Rao bound, 95 % or more in {most:.1f} % of the robots; squares in units of "
            f"the bound {np.mean(squares):.3f}, chi-square per degree of freedom {np.mean(fits):.3f}; "
            f"{spent / count:.2f} CPU s each"
        )
        print(f"  5 % outliers: {missed} of {spoilt_ones} missed, {wrong} good readings left out")
        for text, off in (
            ("against the same readings left out", best),
            ("against all readings as they were", moved),
            ("  of which by their loss alone", lost),
        ):
            below = np.array([(x <= 1.0).all() for x in off])
            print(
                f"  {text:<36} {100 * np.mean(np.concatenate(off) <= 1.0):.2f} % of the combinations change by 1 sigma "
                f"at most, in {100 * below.mean():.1f} % of the robots all do; largest change "
                f"{np.concatenate(off).max():.2g} sigma",
                flush=True,
            )


if __name__ == "__main__":
    mode = covariance if sys.argv[1:2] == ["covariance"] else main
    numbers = [word for word in sys.argv[1:] if word.isdigit()]
    mode(int(numbers[0]) if numbers else 40)
