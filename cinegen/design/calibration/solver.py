"""Least squares of whitened residuals, robust against outliers."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import least_squares

from cinegen.arrays import Array, Bools
from cinegen.design.calibration.checks import ContradictionError
from cinegen.design.calibration.identifiability import Subspace
from cinegen.design.calibration.observation import Observation, Prediction
from cinegen.errors import warn
from raff2urdf import closure

REJECTED = 4.0
"""Studentised residuals beyond this many standard deviations are outliers."""


_STARTS = 8.0  # expected standard deviations beyond which a reading is left out at first


_CAUCHY = 2.0  # standard deviations from which the redescending loss weakens


_ROUNDS = 12  # of rejection


_SAMPLES = 64  # of errors that nothing measures


class CalibrationSolver:
    """Residuals of an observation in the combinations of a subspace, whitened."""

    def __init__(self, observation: Observation, covariances: Array, errors: Array) -> None:
        self.observation, self.covariances, self.errors = observation, covariances, errors
        self.standard = np.sqrt(np.einsum("nkk->nk", covariances))

    def expected(self, nominal: Prediction) -> Array:
        """Return the standard deviations (poses, outputs) that residuals at nominal values have by the expected errors
        of parameters and readings; frames are where their readings put them."""
        known = len(self.errors) - len(self.observation.frames)
        return np.asarray(np.sqrt(self.standard**2 + ((nominal.jacobian * self.errors)[..., :known] ** 2).sum(axis=2)))

    def whiten(self, rows: Array, kept: Bools) -> Array:
        """Return rows (poses, outputs, .) of the readings kept (poses, outputs), whitened: (rows, .)."""
        is_diagonal = not self.observation.input_sigmas.any()
        if is_diagonal:
            return np.asarray((rows / self.standard[..., None])[kept])
        whitened = []
        for row, covariance, mask in zip(rows, self.covariances, kept, strict=True):
            if mask.any():
                factor = np.linalg.cholesky(covariance[np.ix_(mask, mask)])
                whitened.append(np.linalg.solve(factor, row[mask]))
        return np.concatenate(whitened)

    def least_squares(self, space: Subspace, z: Array, kept: Bools, loss: str = "linear", scale: float = 1.0) -> Array:
        """Return the combinations (combinations,) that minimise the loss of the readings kept, from z. Losses that are
        not linear take readings as independent."""
        observation = self.observation
        last: dict[bytes, Prediction] = {}
        independent = loss != "linear"

        def predicted(z: Array) -> Prediction:
            key = z.tobytes()
            if key not in last:
                last.clear()
                last[key] = observation.predict(observation.values + space.changes @ z)
            return last[key]

        def whitened(rows: Array) -> Array:
            return (rows / self.standard[..., None])[kept] if independent else self.whiten(rows, kept)

        def residuals(z: Array) -> Array:
            prediction = predicted(z)
            if not (prediction.gap <= closure.CLOSED).all():
                return np.full(int(kept.sum()), 1e9)  # refused: the step is shortened
            return whitened(observation.residuals(prediction)[..., None])[:, 0]

        def jacobian(z: Array) -> Array:
            return np.asarray(whitened(predicted(z).jacobian) @ space.changes)

        tolerance = 1e-10 if loss == "linear" else 1e-5
        done = least_squares(
            residuals, z, jacobian, method="trf", loss=loss, f_scale=scale, xtol=tolerance, ftol=tolerance,
            gtol=1e-8, max_nfev=60,
        )  # fmt: skip
        if not done.success and loss == "linear":
            warn(f"{observation.measurements.source}: the estimate has not converged in {done.nfev} evaluations")
        return np.asarray(done.x)

    def curvature(self, space: Subspace, theta: Array, size: float, kept: Bools) -> Array:
        """Return what random errors along combinations that are not determined, of a size in expected ones, change the
        readings by in second order, whitened (rows, samples): their second moment is the product with its transpose."""
        random = np.random.default_rng(0).normal(size=(len(theta), _SAMPLES)) * (self.errors > 0.0)[:, None]
        changes = size * self.errors[:, None] * (random - space.basis @ (space.basis.T @ random))
        centre, sums = self.observation.predict(theta, derivatives=False), list[Array]()
        for change in changes.T:
            both = [self.observation.predict(theta + sign * change, derivatives=False) for sign in (1.0, -1.0)]
            if all((prediction.gap <= closure.CLOSED).all() for prediction in both):
                sums.append(sum(map(self.observation.residuals, both)) / 2.0 - self.observation.residuals(centre))
        return (
            self.whiten(np.stack(sums, axis=-1), kept) / math.sqrt(len(sums))
            if sums
            else np.zeros((int(kept.sum()), 0))
        )

    def robust(self, space: Subspace, nominal: Prediction, before: Array) -> tuple[Array, Bools]:
        """Return combinations, and which readings (poses, outputs) are no outliers."""
        present = np.isfinite(before)
        sizes = np.abs(before) / self.expected(nominal)
        start = present & (sizes <= _STARTS * max(1.0, float(np.median(sizes[present])) / 0.6745))
        z = self.least_squares(space, np.zeros(space.basis.shape[1]), start, "soft_l1")
        z = self.least_squares(space, z, present, "cauchy", _CAUCHY)
        kept = np.zeros_like(present)
        for _ in range(_ROUNDS):
            prediction = self.observation.predict(self.observation.values + space.changes @ z)
            sizes = self._studentised(space, prediction, kept if kept.any() else present)
            scale = max(1.0, float(np.median(sizes[present])) / 0.6745)
            wanted = present & (sizes <= REJECTED * scale)
            if (wanted == kept).all():
                break
            kept = wanted
            if kept.sum() < len(z):
                contrary, count = int(present.sum() - kept.sum()), int(present.sum())
                raise ContradictionError(
                    f"{self.observation.measurements.source}: {contrary} of {count} readings contradict the others"
                )
            z = self.least_squares(space, z, kept)
        return z, kept

    def _studentised(self, space: Subspace, prediction: Prediction, kept: Bools) -> Array:
        """Return residuals (poses, outputs) in their standard deviations, were they estimated without themselves."""
        residuals = self.observation.residuals(prediction) / self.standard
        rows = prediction.jacobian @ space.changes / self.standard[..., None]
        inside = rows[kept]
        inverse = np.linalg.pinv(inside.T @ inside, hermitian=True)
        leverage = np.einsum("nkz,zy,nky->nk", rows, inverse, rows)
        spread = np.where(kept, np.maximum(1.0 - leverage, 1e-6), 1.0 + leverage)
        return np.asarray(np.nan_to_num(np.abs(residuals) / np.sqrt(spread), nan=0.0))
