"""`check`: measurements are compared with the robot as it is described before any estimate.

Readings that are far from what the robot does by its expected errors are compared again without one mistake: of a
column (`mistakes`), of `lines`, of a zero or a frame (`zeros`). If they fit then, the measurements are refused, and the
mistake is named with its correction. Errors of a robot can't imitate one: the readings must be farther off than `_FAR`
expected standard deviations, and nearer than `_NEAR` without it.

`check_fit`: readings that are near, but don't fit the estimate, as the angles of a platform that hardly rotates.

`doubt`: estimates that can't be meant: most readings of a column dropped, or parameters far from their description.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cinegen.arrays import Bools
from cinegen.design.calibration.column_mistakes import Mistake, lines, mistakes
from cinegen.design.calibration.comparison import ColumnComparison, Compared
from cinegen.design.calibration.missing_parameters import is_poor
from cinegen.design.calibration.observation import Observation, Prediction
from cinegen.design.calibration.zeros import FRAME, frames, placed, zeros
from cinegen.design.errors import DesignError
from raff2urdf.quantities import ANGLE, LENGTH, shown

if TYPE_CHECKING:
    from cinegen.design.calibration.result import Calibration

UNEXPLAINED = (
    "no other sign, unit or order of columns explains them; check the columns, the order of lines, and the sigmas"
)
"""Advice where no mistake is found."""

_FAR, _NEAR = 8.0, 4.0  # expected standard deviations: of readings with a mistake at least, of those without at most
_RATIO = 4.0  # of the one and the other, at least
_MUCH = 10.0  # the same, if the readings are so far off that one mistake does not explain all
_ALIKE = 3.0  # times the smallest misfit: mistakes that explain the readings as well
_OFF = 0.25  # of the characteristic length or rad: readings farther off need a mistake
_POOR = 3.0  # standard deviations of chi-square beyond which an estimate is compared with mistakes
_DROPPED = 0.05  # of all readings, the same
_CERTAIN = 25.0  # squares by which readings without a mistake fit better, at least
_NAMED, _EDITED = 9, 3  # mistakes in a message, and how many of them with their corrections
_REAL = 0.05  # of the characteristic length or rad: errors of manufacture are smaller
_FEWEST = 3  # readings of a column whose majority counts
_EXPLAINED = 0.1  # of the residuals that were there before: what remains at most where parameters explain them
_SURE = 3.0  # standard deviations of a change that may be its uncertainty

_MOVED = 20.0  # expected errors by which a parameter changes at most without a question

Found = tuple[Mistake, Compared]


class ContradictionError(DesignError):
    """Readings that contradict the others, or the robot.

    Attributes:
        text: measurements, column, and what is wrong.
    """

    def __init__(self, text: str, advice: str = UNEXPLAINED) -> None:
        self.text = text
        super().__init__(f"{text}: {advice}")


def check(comparison: ColumnComparison) -> None:
    """Refuse measurements that fit the robot as described without a mistake, and don't as they are.

    Raises:
        ContradictionError: they are far off, and no mistake is found.
        DesignError: names the mistake, both distances, and the correction; or the loops can't be closed.
    """
    observation, written = comparison.observation, comparison.written
    if written is not None and written.misfit <= _FAR:
        return
    is_wrong = written is not None and written.sizes.max() > _OFF
    limit = _NEAR if written is None else min(_NEAR, written.misfit / _RATIO)
    most = limit if written is None or not is_wrong else max(limit, written.misfit / _MUCH)
    nearer = list[Found]()
    for source in (mistakes(observation), lines(comparison), zeros(comparison), frames(comparison)):
        for candidate in source:
            if candidate.rank < FRAME and comparison.misfit(candidate.measurements) > _RATIO * most:
                continue
            other = comparison.of(candidate.measurements)
            named = placed(candidate, other) if other is not None and other.misfit <= most else None
            if other is not None and named is not None and (other.misfit <= limit or candidate.rank < FRAME):
                nearer.append((named, other))
        fitting = [candidate for candidate in nearer if candidate[1].misfit <= limit]
        if fitting:
            raise DesignError(_question(comparison, _likeliest(fitting))) from comparison.open
    if nearer:
        raise DesignError(_question(comparison, _likeliest(nearer)))
    if comparison.open is not None:
        raise comparison.open
    if written is not None and is_wrong:
        k, length = int(np.argmax(written.sizes)), observation.design.mechanism.length
        name = observation.quantities[k].name
        raise ContradictionError(
            f"{_where(written, k)} (its characteristic length is {shown(length, LENGTH)})",
            "check the unit and the sign of this column and those of the joints, and that the device measures in "
            f"the robot's world frame; if it stands elsewhere, name it: {name.partition('@')[0].strip()} @ tracker",
        )


def check_fit(comparison: ColumnComparison, calibration: Calibration) -> None:
    """Refuse measurements that don't fit their estimate, and would without a mistake of a column.

    Raises:
        DesignError: names the mistake, both sums of squares, and the correction.
    """
    dof = calibration.degrees_of_freedom
    most = 1.0 + _POOR * math.sqrt(2.0 / max(dof, 1))
    if dof <= 0 or (
        calibration.fit <= most and len(calibration.outliers) <= _DROPPED * np.isfinite(calibration.before).sum()
    ):
        return
    predicted = calibration.observation.predict(calibration.values)
    alternatives = list[tuple[float, float, Mistake]]()
    for candidate in mistakes(calibration.observation):
        other = comparison.placed(candidate.measurements) if candidate.rank == 0 else None
        if other is None or comparison.misfit(candidate.measurements) > max(
            _NEAR, comparison.misfit(calibration.observation.measurements)
        ):
            continue
        changed = (other.measured != calibration.observation.measured).any(axis=0)
        counted = (calibration.kept | changed) & np.isfinite(other.measured)
        corrected = (
            predicted
            if np.array_equal(other.readings, calibration.observation.readings)
            else other.predict(calibration.values)
        )
        squares = _squares(calibration, other, corrected, counted)
        if squares <= most * dof:
            alternatives.append(
                (squares, _squares(calibration, calibration.observation, predicted, counted), candidate)
            )
    squares, unchanged, best = min(alternatives, key=lambda candidate: candidate[0], default=(0.0, 0.0, None))
    if best is not None and squares + _CERTAIN < unchanged:
        raise DesignError(
            f"{calibration.observation.measurements.source}: the readings don't fit any robot that is near its "
            f"description (chi-square {unchanged:.4g} for {dof} degrees of freedom). They fit {best.text} "
            f"({squares:.4g} then): is that what was measured? Then {best.edit}"
        )


class Doubt(NamedTuple):
    """Why an estimate can't be meant.

    Attributes:
        text: measurements, column or parameter, and what is wrong.
        remedy: if it is real nevertheless; "" where it can't be.
    """

    text: str
    remedy: str = ""


def doubt(calibration: Calibration) -> Doubt | None:
    """Return why an estimate can't be meant; None if it may be."""
    observation, present = calibration.observation, np.isfinite(calibration.before)
    source = observation.measurements.source
    dropped, read = (present & ~calibration.kept).sum(axis=0), present.sum(axis=0)
    for k in np.argsort(-dropped / np.maximum(read, 1)).tolist()[:1]:
        if read[k] >= _FEWEST and 2 * dropped[k] > read[k]:
            column = observation.outputs[k]
            worst = max(outlier.sigmas for outlier in calibration.outliers if outlier.column == column)
            return Doubt(
                f"{source}, column {observation.quantities[k].name}: {dropped[k]} of {read[k]} readings contradict the "
                f"others, by up to {worst:.3g} sigma: so many are no outliers"
            )
    known = len(calibration.parameters)
    errors = calibration.subspace.errors[:known]
    change = np.abs(calibration.values - calibration.nominal)[:known]
    certain = np.maximum(change - _SURE * calibration.sigmas[:known], 0.0)
    moved = np.divide(certain, errors, out=np.zeros(known), where=errors > 0.0)
    k = int(np.argmax(moved)) if known else 0
    if not known or moved[k] <= _MOVED:
        return None
    name, dimension = calibration.names[k], calibration.dimension(calibration.names[k])
    by, expected = (shown(x[k], dimension, 3) for x in (change, errors))
    times = change[k] / errors[k]
    text = f"{source}: the estimate changes {name} by {by}, {times:.0f} times its expected error of {expected}"
    before, after = (
        float(np.nanmean((rest / calibration.standard) ** 2)) ** 0.5 for rest in (calibration.before, calibration.after)
    )
    if is_poor(calibration) and after > _EXPLAINED * before:
        return Doubt(f"{text}, and the readings are still off by {after:.2g} sigma (before: {before:.2g})")
    return Doubt(text, f"{name}={by.replace(' ', '')}")


def _squares(calibration: Calibration, observation: Observation, predicted: Prediction, counted: Bools) -> float:
    """Return about the sum of squares that an estimate of the readings counted (poses, outputs) would leave."""
    standard = np.sqrt(np.einsum("nkk->nk", observation.covariances(predicted)))
    rest = (observation.residuals(predicted) / standard)[counted]
    rows = (predicted.jacobian @ calibration.subspace.changes / standard[..., None])[counted]
    return float(((rest - rows @ np.linalg.lstsq(rows, rest)[0]) ** 2).sum())


def _likeliest(candidates: Sequence[Found]) -> list[Found]:
    """Return the mistakes of lowest rank that explain the readings about as well as the best."""
    best = max(min(other.misfit for _, other in candidates), 1.0)
    alike = [candidate for candidate in candidates if candidate[1].misfit <= _ALIKE * best]
    rank = min(candidate.rank for candidate, _ in alike)
    return sorted(
        (candidate for candidate in alike if candidate[0].rank == rank), key=lambda candidate: candidate[1].misfit
    )[:_NAMED]


def _question(comparison: ColumnComparison, candidates: Sequence[Found]) -> str:
    written, (mistake, best) = comparison.written, candidates[0]
    k = int(np.argmax((written or best).ratios[: len(best.off)]))
    rest = shown(float(best.off[k]), best.observation.quantities[k].dimension, 3)
    if written is None:
        observation = comparison.observation
        where = f"{observation.measurements.source}: the loops don't close at the readings of the joints"
        where += f" ({', '.join(observation.inputs)})"
    else:
        where = _where(written, k)
    texts = ", or ".join(mistake.text for mistake, _ in candidates)
    edits = (
        "; or ".join(mistake.edit for mistake, _ in candidates)
        if len(candidates) <= _EDITED
        else "correct the one that is meant"
    )
    expected = mistake.real if written is not None and mistake.real else _expected(comparison)
    so = f". If the readings are right as they are, expect such errors of the robot: --sigma {expected!r}"
    so = so if expected else ""
    return (
        f"{where}. They fit {texts} ({best.observation.quantities[k].name} differs by {rest} then): is that what was "
        f"measured? Then {edits}{so}"
    )


def _expected(comparison: ColumnComparison) -> str:
    """Return errors with which the readings would be taken as they are; "" if they are beyond what is manufactured."""
    parameters, written, errors = comparison.observation.design.parameters, comparison.written, comparison.errors
    count = len(parameters)
    kinds = [
        (kind, np.array([not parameter.joint and parameter.dimension is kind for parameter in parameters.free]))
        for kind in (LENGTH, ANGLE)
    ]
    length = parameters.mechanism.length
    larger, factor = errors.copy(), 2.0
    while written is not None:
        texts = list[str]()
        for kind, mask in kinds:
            if mask.any():
                error = factor * float(np.median(errors[:count][mask]))
                if error > _REAL * (length if kind is LENGTH else 1.0):
                    return ""
                larger[:count][mask] = error
                texts.append(f"*={shown(error, kind, 3).replace(' ', '')}")
        again = comparison.of(comparison.observation.measurements, larger) if texts else None
        if again is None:
            return ""
        if again.misfit <= _FAR:
            return ", ".join(texts)
        factor *= 2.0
    return ""


def _where(compared: Compared, k: int) -> str:
    quantity = compared.observation.quantities[k]
    return (
        f"{compared.observation.measurements.source}, column {quantity.name}: the readings differ by "
        f"{shown(float(compared.off[k]), quantity.dimension, 3)} from what the robot does"
    )
