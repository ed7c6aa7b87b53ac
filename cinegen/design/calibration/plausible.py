"""Measurements that only fit in another unit or frame: they are refused, and the unit is asked."""

from __future__ import annotations

import math

import numpy as np

from cinegen.arrays import Array
from cinegen.design.calibration.frames import UNITS
from cinegen.design.calibration.hypotheses import ContradictionError
from cinegen.design.calibration.measurements import Measurements
from cinegen.design.calibration.observation import Observation, Prediction
from cinegen.design.errors import DesignError
from raff2urdf.quantities import ANGLE, LENGTH, Dimension, shown

_FAR = 20.0  # standard deviations by errors of the robot beyond which other units are tried
_CLEAR = 3.0  # standard deviations of the readings that a difference exceeds at least
_FITS = 0.05  # of the difference that remains in the right unit
_NEAR = 5.0  # standard deviations by errors of the robot that remain in the right unit, at most
_OFF = 0.25  # of the characteristic length or rad: most readings farther from nominal are in another unit or frame


def predicted(observation: Observation) -> Prediction:
    """Return what should be read at nominal values.

    Raises:
        DesignError: the loops can't be closed at the readings of the inputs, perhaps as they are in another unit.
    """
    try:
        observation.keep(observation.start())
    except DesignError as error:
        for dimension, wrong, right, factor in _others(observation):
            if _scaled(observation, dimension, factor) is not None:
                raise DesignError(_question(observation, dimension, wrong, right, factor, "the loops close")) from error
        raise
    return observation.predict(observation.values)


def check_units(observation: Observation, nominal: Prediction, errors: Array) -> None:
    """Refuse measurements that are far from what the robot does.

    Args:
        observation: of the measurements.
        nominal: what should be read at nominal values.
        errors: (parameters,) expected ones; 0 of frames, which are where their readings put them.

    Raises:
        DesignError: some are in another unit or frame.
    """
    length, before = observation.design.mechanism.length, observation.residuals(nominal)
    spread = np.median(np.sqrt(((nominal.jacobian * errors) ** 2).sum(axis=2)), axis=0)
    off = _medians(before)
    noise = _medians(
        np.where(np.isfinite(before), np.sqrt(np.einsum("nkk->nk", observation.covariances(nominal))), np.nan)
    )
    far = (off > _FAR * spread) & (off > _CLEAR * noise)
    fitting = _NEAR * spread + _CLEAR * noise
    if far.any():
        for dimension, wrong, right, factor in _others(observation):
            found = _scaled(observation, dimension, factor)
            if found is not None and (found <= np.where(far, _FITS * off, fitting)).all():
                raise DesignError(_question(observation, dimension, wrong, right, factor, "all columns fit"))
    for k, one in enumerate(observation.quantities):
        where = (
            f"{observation.measurements.source}, column {one.name}: the readings differ by "
            f"{shown(off[k], one.dimension)} from what the robot does"
        )
        for wrong, right, factor in UNITS[one.dimension] if far[k] else ():
            rest = nominal.values[:, k] - factor * observation.measured[:, k]
            if one.dimension is ANGLE:
                rest = (rest + math.pi) % (2.0 * math.pi) - math.pi
            if np.nanmedian(np.abs(rest)) < min(_FITS * off[k], fitting[k]):
                raise DesignError(
                    f"{where}, and would fit if they were {factor:.4g} times as large: are they in {right}, and read "
                    f"as {wrong}?"
                )
        if off[k] > _OFF * (length if one.dimension is LENGTH else 1.0):
            raise ContradictionError(
                f"{where} (its characteristic length is {shown(length, LENGTH)})",
                "check the unit and the sign of this column and those of the joints, and that the device measures in "
                f"the robot's world frame; if it stands elsewhere, name it: {one.name.partition('@')[0].strip()} @ "
                "tracker",
            )


def _medians(values: Array) -> Array:
    """Return the medians (columns,) of magnitudes; 0 of columns without any."""
    return np.array([np.median(np.abs(x[np.isfinite(x)])) if np.isfinite(x).any() else 0.0 for x in values.T])


def _others(observation: Observation) -> list[tuple[Dimension, str, str, float]]:
    """Return in which units the joints that the configuration follows from may have been meant."""
    kinds = {observation.measurements.quantities[k].dimension for k in observation.input_columns}
    return [(kind, *other) for kind in (LENGTH, ANGLE) if kind in kinds for other in UNITS[kind]]


def _scaled(observation: Observation, dimension: Dimension, factor: float) -> Array | None:
    """Return the medians (outputs,) of residuals if the inputs of a dimension are read in another unit; None if the
    loops don't close then."""
    old = observation.measurements
    values = old.values.copy()
    for k in observation.input_columns:
        if old.quantities[k].dimension is dimension:
            values[:, k] *= factor
    again = Measurements(old.quantities, values, old.sigmas, old.labels, old.source)
    try:
        other = Observation(observation.design.parameters, again, observation.gains)
        return _medians(other.residuals(other.predict(other.values, derivatives=False)))
    except DesignError:
        return None


def _question(
    observation: Observation, dimension: Dimension, wrong: str, right: str, factor: float, fits: str
) -> str:  # fmt: skip
    columns = observation.measurements.quantities
    joints = [columns[k].name for k in observation.input_columns if columns[k].dimension is dimension]
    where = f"{observation.measurements.source}, column{'s' if len(joints) > 1 else ''} {', '.join(joints)}"
    return (
        f"{where}: {fits} if these readings are {factor:.4g} times as large, and don't as they are: are they in "
        f"{right}, and read as {wrong}?"
    )
