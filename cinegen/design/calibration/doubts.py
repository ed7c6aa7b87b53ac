"""Estimates that can't be meant: most readings of a column dropped, or parameters far from their description."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cinegen.design.calibration.left_out import is_poor
from raff2urdf.quantities import shown

if TYPE_CHECKING:
    from cinegen.design.calibration.estimation import Calibration

MOVED = 20.0
"""Expected errors by which a parameter changes at most without a question."""

_FEWEST = 3  # readings of a column whose majority counts
_EXPLAINED = 0.1  # of the residuals that were there before: what remains at most where parameters explain them
_CERTAIN = 3.0  # standard deviations of a change that may be its uncertainty


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
    name, dimension = found.names[k], found.dimension(found.names[k])
    by, expected = (shown(x[k], dimension, 3) for x in (change, errors))
    times = change[k] / errors[k]
    text = f"{source}: the estimate changes {name} by {by}, {times:.0f} times its expected error of {expected}"
    before, after = (float(np.nanmean((rest / found.standard) ** 2)) ** 0.5 for rest in (found.before, found.after))
    if is_poor(found) and after > _EXPLAINED * before:
        return Doubt(f"{text}, and the readings are still off by {after:.2g} sigma (before: {before:.2g})")
    return Doubt(text, f"{name}={by.replace(' ', '')}")
