"""Estimates that can't be meant: most readings of a column dropped, or parameters far from their description.

Such measurements have mostly one mistake: a sign, a unit, or two columns that are exchanged. Each is made good in turn,
and the estimate is repeated for those that bring the readings nearer to the robot as described; the one that then fits
is named.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.design.calibration.measurements import COORDINATES, Measurements
from cinegen.design.calibration.mistakes import mistakes
from cinegen.design.calibration.observation import Observation
from cinegen.design.errors import DesignError
from raff2urdf.quantities import ANGLE, LENGTH, shown

if TYPE_CHECKING:
    from cinegen.design.calibration.estimation import Calibration


MOVED = 20.0
"""Expected errors by which a parameter changes at most without a question."""

_FEWEST = 3  # readings of a column whose majority counts
_NEARER = 0.7  # of the misfit at nominal values: hypotheses that leave more are not estimated
_CERTAIN = 3.0  # standard deviations of a change that may be its uncertainty
_MOST = 6  # hypotheses that are estimated
_DROPPED = 0.2  # of all readings, which a hypothesis leaves out at most
_FIT, _WORSE = 25.0, 1.5  # chi-square per degree of freedom of a hypothesis, at most; and by that of the data as given


class Doubt(NamedTuple):
    """Why an estimate can't be meant.

    Attributes:
        text: measurements, column or parameter, and what is wrong.
        remedy: if it is real nevertheless; "" where it can't be.
    """

    text: str
    remedy: str = ""


def doubt(found: Calibration) -> Doubt | None:
    """Return why an estimate can't be meant; None if it may be."""
    observation, present = found.observation, np.isfinite(found.before)
    source = observation.measurements.source
    dropped, read = (present & ~found.kept).sum(axis=0), present.sum(axis=0)
    for k in np.argsort(-dropped / np.maximum(read, 1)).tolist()[:1]:
        if read[k] >= _FEWEST and 2 * dropped[k] > read[k]:
            column = observation.outputs[k]
            worst = max(one.sigmas for one in found.outliers if one.column == column)
            return Doubt(
                f"{source}, column {observation.quantities[k].name}: {dropped[k]} of {read[k]} readings contradict the "
                f"others, by up to {worst:.3g} sigma: so many are no outliers"
            )
    known = len(found.parameters)
    errors = found.subspace.errors[:known]
    change = np.abs(found.values - found.nominal)[:known]
    certain = np.maximum(change - _CERTAIN * found.sigmas[:known], 0.0)
    moved = np.divide(certain, errors, out=np.zeros(known), where=errors > 0.0)
    k = int(np.argmax(moved)) if known else 0
    if not known or moved[k] <= MOVED:
        return None
    name, dimension = found.names[k], LENGTH if found.unit(found.names[k]) == "m" else ANGLE
    by, expected = (shown(x[k], dimension, 3) for x in (change, errors))
    times = change[k] / errors[k]
    text = f"{source}: the estimate changes {name} by {by}, {times:.0f} times its expected error of {expected}"
    return Doubt(text, f"{name}={by.replace(' ', '')}")


def explanation(
    observation: Observation, expected: Array, estimate: Callable[[Measurements], Calibration], fit: float
) -> str:
    """Return the mistake in measurements that explains why they don't fit; "" if none does.

    Args:
        observation: of the measurements.
        expected: (poses, outputs) standard deviations of residuals at nominal values.
        estimate: calibrates by other measurements.
        fit: chi-square per degree of freedom of the measurements as they are; NaN if there is no estimate.
    """
    best, named = max(_FIT, _WORSE * fit) if not np.isfinite(fit) else _WORSE * max(fit, 1.0), ""
    scale = np.median(expected, axis=0)
    limit = _NEARER * _misfit(observation, observation.measurements, scale)
    tried = [
        (_misfit(observation, other, scale), text, other) for text, _, other, rank in mistakes(observation) if rank == 0
    ]
    nearer = sorted((one for one in tried if one[0] < limit), key=lambda one: one[0])[:_MOST]
    for _, text, other in [*nearer, *((0.0, *one) for one in _elsewhere(observation))]:
        if named and other.quantities != observation.measurements.quantities:
            continue  # a pose of the device explains a sign, too
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = estimate(other)
        except DesignError:
            continue
        outliers = len(found.outliers) / np.isfinite(found.before).sum()
        if found.degrees_of_freedom > 0 and found.fit < best and outliers <= _DROPPED and doubt(found) is None:
            best, named = found.fit, text
    return named


def _misfit(observation: Observation, measurements: Measurements, scale: Array) -> float:
    """Return the sum of the columns' median residuals at nominal values, in parts of a scale (outputs,)."""
    try:
        other = Observation(observation.design.parameters, measurements, observation.gains)
        rest = np.abs(other.residuals(other.predict(other.values, derivatives=False))) / scale
    except DesignError:
        return np.inf
    return float(sum(np.median(column[np.isfinite(column)]) for column in rest.T if np.isfinite(column).any()))


def _elsewhere(observation: Observation) -> Iterator[tuple[str, Measurements]]:
    """Yield the measurements as those of a device that measures in a frame of its own."""
    given = observation.measurements
    own = [k for k in observation.outputs if given.quantities[k].kind in COORDINATES and not given.quantities[k].device]
    if len(own) >= _FEWEST:
        read = [replace(one, device="tracker") if k in own else one for k, one in enumerate(given.quantities)]
        names = ", ".join(f"{given.quantities[k].name} @ tracker" for k in own)
        yield f"with a device in a frame of its own ({names})", replace(given, quantities=tuple(read))
