"""`propose`: the poses that should be measured next, by D-optimality.

With the whitened rows J_i of a pose (`identifiability`), in expected errors, and those of the poses that were measured,
M = 1 + sum_i J_i^T J_i is the information that the expected errors and all measurements give together. Of many random
poses within the joints' limits, those are taken that make log det M largest: one after the other, then by exchanges,
until none makes it larger (V. V. Fedorov, "Theory of optimal experiments", 1972).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cinegen.arrays import Array
from cinegen.design.calibration.identifiability import DEPENDENT, svd_by_qr
from cinegen.design.calibration.measurements import Measurements
from cinegen.design.calibration.observation import Observation
from cinegen.design.calibration.result import Calibration
from cinegen.design.design import Design
from cinegen.design.poses import random_poses
from raff2urdf.errors import counted

CANDIDATES = 300
"""Random poses of which some are proposed."""

_SWEEPS = 10  # of exchanges
_GAIN = 1e-9  # of log det, below which an exchange is none


@dataclass(frozen=True, eq=False)
class Proposal:
    """Poses to be measured next.

    Attributes:
        q: (count, nq) configurations, m and rad.
        inputs: joints that are driven there.
        readings: (count, inputs) of their encoders, m and rad.
        gain: factor by which the standard deviations of all combinations of parameters shrink, their geometric mean;
            expected errors count as known.
        random_gain: the same for as many random poses.
        before: root mean square standard deviation of the combinations, in expected errors.
        after: with the poses proposed.
        measurements: the lines to be filled in, with values that are expected; sigmas as in the first pose measured.
    """

    q: Array
    inputs: tuple[str, ...]
    readings: Array
    gain: float
    random_gain: float
    before: float
    after: float
    measurements: Measurements

    def __len__(self) -> int:
        return len(self.q)

    def __repr__(self) -> str:
        return f"<Proposal of {counted(len(self), 'pose')}: standard deviations shrink by {self.gain:.3g}>"

    def text(self) -> str:
        """Return a CSV file with the readings of the inputs; what is to be measured is empty."""
        measurements = self.measurements
        values = measurements.values.copy()
        values[:, [k for k, quantity in enumerate(measurements.quantities) if quantity.of not in self.inputs]] = np.nan
        return Measurements(measurements.quantities, values, measurements.sigmas, measurements.labels).text(digits=7)


def propose(calibration: Calibration, count: int, candidates: int = CANDIDATES, seed: int = 0) -> Proposal:
    """Return the poses that determine the parameters best, in addition to those that were measured.

    Args:
        calibration: of the mechanism; the same quantities are measured again.
        count: number of poses.
        candidates: number of random poses of which they are chosen.
        seed: of the random poses.

    Raises:
        CinegenError: hardly any pose is within the joints' limits.
    """
    observation = calibration.observation
    q = random_poses(Design(calibration.parameters, fixed=observation.inputs), max(candidates, count), seed)
    rows, lines = _rows(observation, q, calibration.subspace.errors)
    measured = _measured(calibration)
    _, sizes, vt = svd_by_qr(np.vstack([measured, rows.reshape(-1, rows.shape[2])]))
    span = vt[sizes > DEPENDENT * sizes[0]].T  # what any of the poses determines: nothing else changes log det
    rows, measured, basis = rows @ span, measured @ span, span.T @ calibration.subspace.basis
    known = np.eye(span.shape[1]) + measured.T @ measured
    chosen = _greedy(known, rows, count)
    _exchange(known, rows, chosen)
    chosen.sort()

    def logarithm(picked: list[int]) -> float:
        return float(np.linalg.slogdet(known + np.einsum("irc,ird->cd", rows[picked], rows[picked]))[1])

    total = logarithm(chosen)
    start = float(np.linalg.slogdet(known)[1])
    rank = span.shape[1]
    rng = np.random.default_rng(seed)
    by_chance = [logarithm(rng.choice(len(rows), count, replace=False).tolist()) for _ in range(20)]
    more = known + np.einsum("irc,ird->cd", rows[chosen], rows[chosen])
    spread = [float(np.sqrt(np.mean(np.diag(basis.T @ np.linalg.inv(m) @ basis)))) for m in (known, more)]
    at = [observation.design.mechanism.q_index(joint) for joint in observation.inputs]
    lines = Measurements(
        lines.quantities, lines.values[chosen], lines.sigmas[chosen], tuple(f"next{i}" for i in range(1, count + 1))
    )
    return Proposal(
        q[chosen], observation.inputs, q[chosen][:, at], float(np.exp((total - start) / (2.0 * rank))),
        float(np.exp((np.mean(by_chance) - start) / (2.0 * rank))), spread[0], spread[1], lines,
    )  # fmt: skip


def _rows(observation: Observation, q: Array, errors: Array) -> tuple[Array, Measurements]:
    """Return the whitened rows (poses, outputs, parameters) of configurations (poses, nq), and their measurements with
    values that are expected."""
    old = observation.measurements
    mechanism = observation.design.mechanism
    values = np.zeros((len(q), len(old.quantities)))
    for k, quantity in enumerate(old.quantities):
        if quantity.kind == "joint":
            values[:, k] = q[:, mechanism.q_index(quantity.of)]
    present = np.where(np.isfinite(old.values), old.sigmas, np.nan)
    sigmas = np.nan_to_num(np.tile(np.nanmedian(present, axis=0), (len(q), 1)), nan=1.0)
    lines = Measurements(old.quantities, values, sigmas, tuple(str(i) for i in range(len(q))))
    again = Observation(observation.design.parameters, lines, observation.gains, observation.frames)
    prediction = again.predict(again.values)
    values[:, again.outputs] = prediction.values
    factors = np.linalg.cholesky(again.covariances(prediction))
    whitened = np.linalg.solve(factors, prediction.jacobian)
    usable = prediction.gap <= 1e-9
    return whitened * errors * usable[:, None, None], lines


def _measured(calibration: Calibration) -> Array:
    """Return rows (combinations, parameters) whose information is that of the readings kept, in expected errors."""
    root = np.linalg.cholesky(np.linalg.inv(calibration.combination_covariance))
    return np.asarray(root.T @ calibration.subspace.basis.T)


def _greedy(known: Array, rows: Array, count: int) -> list[int]:
    """Return indices of poses, each of which adds most to what is known with the ones before."""
    inverse: Array = np.asarray(np.linalg.inv(known), dtype=float)
    chosen = list[int]()
    for _ in range(count):
        gains = _gains(inverse, rows)
        gains[chosen] = -np.inf
        chosen.append(int(np.argmax(gains)))
        inverse = _with(inverse, rows[chosen[-1]])
    return chosen


def _exchange(known: Array, rows: Array, chosen: list[int]) -> None:
    """Exchange poses while that adds information."""
    for _ in range(_SWEEPS):
        changed = False
        for i in range(len(chosen)):
            others = chosen[:i] + chosen[i + 1 :]
            rest = known + np.einsum("irc,ird->cd", rows[others], rows[others])
            inverse: Array = np.asarray(np.linalg.inv(rest), dtype=float)
            gains = _gains(inverse, rows)
            current = gains[chosen[i]]
            gains[others] = -np.inf
            best = int(np.argmax(gains))
            if gains[best] > current + _GAIN:
                chosen[i], changed = best, True
        if not changed:
            return


def _gains(inverse: Array, rows: Array) -> Array:
    """Return what each pose adds to log det (poses,)."""
    inner = np.eye(rows.shape[1]) + rows @ inverse @ np.swapaxes(rows, 1, 2)
    return np.asarray(np.linalg.slogdet(inner)[1])


def _with(inverse: Array, rows: Array) -> Array:
    """Return the inverse after the information of a pose was added (Woodbury)."""
    gain = inverse @ rows.T
    return np.asarray(inverse - gain @ np.linalg.solve(np.eye(len(rows)) + rows @ gain, gain.T))
