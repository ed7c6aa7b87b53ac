"""Calibration of synthetic robots: errors against the Cramer-Rao bound, and what gross outliers change.

    python benchmarks/calibration.py [COUNT]      # of robots of each kind; 40 unless given

Each robot has random errors in all parameters (0.3 mm, 0.05 degrees) and is measured in 40 poses of its joints' range:
full poses of the end with noise of 0.05 mm and 0.01 degrees. Then 5 % of the readings are 20 to 1000 sigma off, and the
estimate is compared with two others: that of all readings before, and that of the same readings left out. A reading
that is wrong by an unknown amount tells nothing: the second is the best that is possible.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/helpers"))

from calibration_data import POSE, changes, errors_of, everything, exact, noisy

from cinegen.design import Measurements, calibrate


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
            measured, bad = noisy(clean, seed), noisy(clean, seed, 0.05)
            spoilt = bad.values != measured.values
            blank = Measurements(bad.quantities, np.where(spoilt, np.nan, bad.values), bad.sigmas, bad.labels)
            began = time.process_time()
            found = calibrate(parameters, measured, folds=0)
            spent += time.process_time() - began
            again, without = (calibrate(parameters, one, folds=0) for one in (bad, blank))
            wanted = found.subspace.basis.T @ ((truth - parameters.values) / found.subspace.errors)
            sigma = np.sqrt(np.diag(found.combination_covariance))
            within.append(float((np.abs(found.combinations - wanted) <= 3.0 * sigma).mean()))
            root = np.linalg.cholesky(found.combination_covariance)
            squares.append(float(np.mean(np.linalg.solve(root, found.combinations - wanted) ** 2)))
            fits.append(found.fit)
            moved.append(changes(again, found))
            lost.append(changes(without, found))
            best.append(changes(again, without))
            told = np.zeros_like(spoilt)
            for one in again.outliers:
                told[one.pose, one.column] = True
            spoilt_ones += int(spoilt.sum())
            missed += int((spoilt & ~told).sum())
            wrong += int((told & ~spoilt).sum())
        most = 100 * np.mean(np.array(within) >= 0.95)
        print(
            f"{name}: {count} robots, {len(wanted)} combinations; {100 * np.mean(within):.2f} % of the estimates are "
            f"within 3 sigma of the Cramer-Rao bound, 95 % or more in {most:.1f} % of the robots; squares in units of "
            f"the bound {np.mean(squares):.3f}, chi-square per degree of freedom {np.mean(fits):.3f}; "
            f"{spent / count:.2f} CPU s each"
        )
        print(f"  5 % outliers: {missed} of {spoilt_ones} missed, {wrong} good readings left out")
        for text, one in (
            ("against the same readings left out", best),
            ("against all readings as they were", moved),
            ("  of which by their loss alone", lost),
        ):
            below = np.array([(x <= 1.0).all() for x in one])
            print(
                f"  {text:<36} {100 * np.mean(np.concatenate(one) <= 1.0):.2f} % of the combinations change by 1 sigma "
                f"at most, in {100 * below.mean():.1f} % of the robots all do; largest change "
                f"{np.concatenate(one).max():.2g} sigma",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
