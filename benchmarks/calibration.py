"""Calibration of synthetic robots: errors against the Cramer-Rao bound, and what gross outliers change.

    python benchmarks/calibration.py [COUNT]      # of robots of each kind; 40 unless given

Each robot has random errors in all parameters (0.3 mm, 0.05 degrees) and is measured in 40 poses of its joints' range:
full poses of the end with noise of 0.05 mm and 0.01 degrees. Then 5 % of the readings are 20 to 1000 sigma off.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/helpers"))

from calibration_data import POSE, errors_of, everything, exact, noisy

from cinegen.design import calibrate


def main(count: int) -> None:
    print("robot     combinations  within 3 sigma   robots all within  squares / combination  chi2/dof  CPU s each")
    for name in ("gough", "delta4"):
        parameters = everything(name)
        end = parameters.mechanism.end
        within, squares, fits, moved = list[float](), list[float](), list[float](), list[float]()
        whole = runs = wrong = missed = 0
        spent = 0.0
        for seed in range(count):
            rng = np.random.default_rng([7, seed])
            truth = parameters.values + errors_of(parameters) * rng.normal(size=len(parameters))
            clean = exact(parameters, [f"{end}.{c}" for c in POSE], truth, seed=seed)
            measured, bad = noisy(clean, seed), noisy(clean, seed, 0.05)
            began = time.process_time()
            found = calibrate(parameters, measured)
            spent += time.process_time() - began
            again = calibrate(parameters, bad, folds=0)
            wanted = found.subspace.basis.T @ ((truth - parameters.values) / found.subspace.errors)
            sigma = np.sqrt(np.diag(found.combination_covariance))
            error = np.abs(found.combinations - wanted) / sigma
            root = np.linalg.cholesky(found.combination_covariance)
            squares.append(float(np.mean(np.linalg.solve(root, found.combinations - wanted) ** 2)))
            within.append(float((error <= 3.0).mean()))
            whole += int((error <= 3.0).all())
            fits.append(found.fit)
            change = np.abs(again.combinations - found.combinations) / sigma
            moved.append(float((change <= 1.0).mean()))
            runs += int((change <= 1.0).all())
            spoilt = bad.values != measured.values
            told = np.zeros_like(spoilt)
            for one in again.outliers:
                told[one.pose, one.column] = True
            missed += int((spoilt & ~told).sum())
            wrong += int((told & ~spoilt).sum())
        print(
            f"{name:<10}{len(sigma):>10}{100 * np.mean(within):>14.2f} %{100 * whole / count:>17.1f} %"
            f"{np.mean(squares):>20.3f}{np.mean(fits):>16.3f}{spent / count:>11.2f}"
        )
        print(
            f"          5 % outliers: {100 * np.mean(moved):.2f} % of the combinations change by less than 1 sigma, "
            f"in {100 * runs / count:.0f} % of the robots all do; {missed} outliers missed, {wrong} wrongly left out "
            f"in {count} robots"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
