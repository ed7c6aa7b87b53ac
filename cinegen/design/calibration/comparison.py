"""`ColumnComparison`: how far readings are from what a robot does as described, in what its expected errors explain."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.design.calibration.measurements import Measurements
from cinegen.design.calibration.observation import Observation, Prediction
from cinegen.design.errors import DesignError
from raff2urdf import closure
from raff2urdf.quantities import LENGTH

FEWEST = 3
"""Readings of a column whose median counts."""

_SOME = 8  # lines that are compared at first


class Compared(NamedTuple):
    """Readings, and how far they are from what the robot does; medians of the columns (outputs,).

    Attributes:
        observation: of the readings, closed.
        off: distances, m and rad.
        expected: standard deviations.
        ratios: distances in these.
    """

    observation: Observation
    off: Array
    expected: Array
    ratios: Array

    @property
    def misfit(self) -> float:
        """The largest ratio."""
        return float(self.ratios.max(initial=0.0))

    @property
    def sizes(self) -> Array:
        """Distances (outputs,) in characteristic lengths and rad."""
        length = self.observation.design.mechanism.length
        units = [length if quantity.dimension is LENGTH else 1.0 for quantity in self.observation.quantities]
        return np.asarray(self.off / np.array(units))


class ColumnComparison:
    """Compares measurements of the same joints with a robot as it is described.

    Args:
        observation: of the measurements that were given.
        errors: (parameters,) expected ones of the description and of gains.

    Attributes:
        observation: as given.
        written: how far its readings are off; None if the loops don't close at them.
        open: why they don't.
        errors: as given.

    Raises:
        DesignError: as `MeasuringFrames.locate`.
    """

    def __init__(self, observation: Observation, errors: Array) -> None:
        self.observation, self.errors = observation, errors
        self._closed: dict[tuple[tuple[str, ...], bytes], Array | None] = {}  # by the inputs and their readings
        self.open: DesignError | None = None
        try:
            observation.keep(observation.start())
        except DesignError as error:
            self.open = error
        if observation.kept is not None:
            self._closed[observation.inputs, observation.readings.tobytes()] = observation.kept
            self._closed[observation.inputs, thinned(observation.readings).tobytes()] = thinned(observation.kept)
        self.written = None if self.open else self._compared(observation, errors)
        self._scale = np.maximum(self._expected_at_home() if self.written is None else self.written.expected, 1e-300)

    def of(self, measurements: Measurements, errors: Array | None = None) -> Compared | None:
        """Return how far other measurements are off, by other expected errors if they are given; None if the loops
        don't close at them."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                other = self.placed(measurements)
                return None if other is None else self._compared(other, self.errors if errors is None else errors)
        except DesignError:
            return None

    def misfit(self, measurements: Measurements) -> float:
        """Return about the misfit of some lines of other measurements: infinite if the loops don't close at them."""
        try:
            other = self.placed(some(measurements), rough=True)
            if other is None:
                return np.inf
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                rest = np.abs(other.residuals(other.predict(other.values, derivatives=False)))
        except DesignError:
            return np.inf
        return float((_medians(rest, 1) / self._scale).max(initial=0.0))

    def placed(self, measurements: Measurements, rough: bool = False) -> Observation | None:
        """Return an observation of other measurements, closed; None if the loops don't close at them."""
        other = self.observation.again(measurements, rough)
        key = other.inputs, other.readings.tobytes()
        if key not in self._closed:
            try:
                self._closed[key] = other.start(hasty=True)
            except DesignError:
                self._closed[key] = None
        q = self._closed[key]
        if q is None:
            return None
        other.keep(q)
        return other

    def _compared(self, observation: Observation, errors: Array) -> Compared | None:
        prediction = observation.predict(observation.values)
        if not (prediction.gap <= closure.CLOSED).all():
            return None
        rest, expected = np.abs(observation.residuals(prediction)), self._expected(observation, prediction, errors)
        return Compared(
            observation,
            _medians(rest),
            _medians(np.where(np.isfinite(rest), expected, np.nan)),
            _medians(rest / expected),
        )

    @staticmethod
    def _expected(observation: Observation, prediction: Prediction, errors: Array) -> Array:
        """Return expected standard deviations (poses, outputs)."""
        known = np.where(np.isin(observation.names[: len(errors)], prediction.opening), 0.0, errors)
        spread = ((prediction.jacobian[..., : len(errors)] * known) ** 2).sum(axis=2)
        return np.asarray(np.sqrt(spread + np.einsum("nkk->nk", observation.covariances(prediction))))

    def _expected_at_home(self) -> Array:
        lines, mechanism = self.observation.measurements, self.observation.design.mechanism
        values = np.zeros_like(lines.values[:1])
        values[:, self.observation.input_columns] = [
            mechanism.q_home[mechanism.q_index(joint)] for joint in self.observation.inputs
        ]
        home = self.observation.again(replace(lines, values=values, sigmas=lines.sigmas[:1], labels=lines.labels[:1]))
        home.keep(mechanism.q_home[None])
        return np.asarray(self._expected(home, home.predict(home.values), self.errors)[0])


def _medians(values: Array, least: int = FEWEST) -> Array:
    """Return the medians of columns (columns,), 0 of those with too few numbers."""
    counts = np.isfinite(values).sum(axis=0)
    medians = np.zeros(values.shape[1])
    for k in np.flatnonzero(counts >= min(least, max(int(counts.max(initial=0)), 1))).tolist():
        medians[k] = np.nanmedian(values[:, k])
    return medians


def thinned(rows: Array) -> Array:
    """Return a few of all rows."""
    return np.asarray(rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), _SOME)).astype(int))])


def some(lines: Measurements) -> Measurements:
    """Return a few lines, which refute most mistakes."""
    labels = tuple(thinned(np.array(lines.labels)).tolist())
    return replace(lines, values=thinned(lines.values), sigmas=thinned(lines.sigmas), labels=labels)
