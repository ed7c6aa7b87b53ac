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
from cinegen.design.calibration.comparison import ColumnComparison, Compared
from cinegen.design.calibration.left_out import is_poor
from cinegen.design.calibration.mistakes import Mistake, lines, mistakes
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
    observation, given = comparison.observation, comparison.given
    if given is not None and given.misfit <= _FAR:
        return
    is_wrong = given is not None and given.sizes.max() > _OFF
    limit = _NEAR if given is None else min(_NEAR, given.misfit / _RATIO)
    most = limit if given is None or not is_wrong else max(limit, given.misfit / _MUCH)
    nearer = list[Found]()
    for source in (mistakes(observation), lines(comparison), zeros(comparison), frames(comparison)):
        for one in source:
            if one.rank < FRAME and comparison.misfit(one.measurements) > _RATIO * most:
                continue
            other = comparison.of(one.measurements)
            named = placed(one, other) if other is not None and other.misfit <= most else None
            if other is not None and named is not None and (other.misfit <= limit or one.rank < FRAME):
                nearer.append((named, other))
        found = [one for one in nearer if one[1].misfit <= limit]
        if found:
            raise DesignError(_question(comparison, _likeliest(found))) from comparison.open
    if nearer:
        raise DesignError(_question(comparison, _likeliest(nearer)))
    if comparison.open is not None:
        raise comparison.open
    if given is not None and is_wrong:
        k, length = int(np.argmax(given.sizes)), observation.design.mechanism.length
        name = observation.quantities[k].name
        raise ContradictionError(
            f"{_where(given, k)} (its characteristic length is {shown(length, LENGTH)})",
            "check the unit and the sign of this column and those of the joints, and that the device measures in "
            f"the robot's world frame; if it stands elsewhere, name it: {name.partition('@')[0].strip()} @ tracker",
        )


def check_fit(comparison: ColumnComparison, found: Calibration) -> None:
    """Refuse measurements that don't fit their estimate, and would without a mistake of a column.

    Raises:
        DesignError: names the mistake, both sums of squares, and the correction.
    """
    dof = found.degrees_of_freedom
    most = 1.0 + _POOR * math.sqrt(2.0 / max(dof, 1))
    if dof <= 0 or (found.fit <= most and len(found.outliers) <= _DROPPED * np.isfinite(found.before).sum()):
        return
    here = found.observation.predict(found.values)
    alternatives = list[tuple[float, float, Mistake]]()
    for one in mistakes(found.observation):
        other = comparison.placed(one.measurements) if one.rank == 0 else None
        if other is None or comparison.misfit(one.measurements) > max(
            _NEAR, comparison.misfit(found.observation.measurements)
        ):
            continue
        changed = (other.measured != found.observation.measured).any(axis=0)
        counted = (found.kept | changed) & np.isfinite(other.measured)
        there = here if np.array_equal(other.readings, found.observation.readings) else other.predict(found.values)
        squares = _squares(found, other, there, counted)
        if squares <= most * dof:
            alternatives.append((squares, _squares(found, found.observation, here, counted), one))
    squares, given, best = min(alternatives, key=lambda one: one[0], default=(0.0, 0.0, None))
    if best is not None and squares + _CERTAIN < given:
        raise DesignError(
            f"{found.observation.measurements.source}: the readings don't fit any robot that is near its description "
            f"(chi-square {given:.4g} for {dof} degrees of freedom). They fit {best.text} ({squares:.4g} then): is "
            f"that what was measured? Then {best.edit}"
        )


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
    certain = np.maximum(change - _SURE * found.sigmas[:known], 0.0)
    moved = np.divide(certain, errors, out=np.zeros(known), where=errors > 0.0)
    k = int(np.argmax(moved)) if known else 0
    if not known or moved[k] <= _MOVED:
        return None
    name, dimension = found.names[k], found.dimension(found.names[k])
    by, expected = (shown(x[k], dimension, 3) for x in (change, errors))
    times = change[k] / errors[k]
    text = f"{source}: the estimate changes {name} by {by}, {times:.0f} times its expected error of {expected}"
    before, after = (float(np.nanmean((rest / found.standard) ** 2)) ** 0.5 for rest in (found.before, found.after))
    if is_poor(found) and after > _EXPLAINED * before:
        return Doubt(f"{text}, and the readings are still off by {after:.2g} sigma (before: {before:.2g})")
    return Doubt(text, f"{name}={by.replace(' ', '')}")


def _squares(found: Calibration, observation: Observation, here: Prediction, counted: Bools) -> float:
    """Return about the sum of squares that an estimate of the readings counted (poses, outputs) would leave."""
    standard = np.sqrt(np.einsum("nkk->nk", observation.covariances(here)))
    rest = (observation.residuals(here) / standard)[counted]
    rows = (here.jacobian @ found.subspace.changes / standard[..., None])[counted]
    return float(((rest - rows @ np.linalg.lstsq(rows, rest)[0]) ** 2).sum())


def _likeliest(found: Sequence[Found]) -> list[Found]:
    """Return the mistakes of lowest rank that explain the readings about as well as the best."""
    best = max(min(other.misfit for _, other in found), 1.0)
    alike = [one for one in found if one[1].misfit <= _ALIKE * best]
    rank = min(one.rank for one, _ in alike)
    return sorted((one for one in alike if one[0].rank == rank), key=lambda one: one[1].misfit)[:_NAMED]


def _question(comparison: ColumnComparison, found: Sequence[Found]) -> str:
    given, (one, best) = comparison.given, found[0]
    k = int(np.argmax((given or best).ratios[: len(best.off)]))
    rest = shown(float(best.off[k]), best.observation.quantities[k].dimension, 3)
    if given is None:
        observation = comparison.observation
        where = f"{observation.measurements.source}: the loops don't close at the readings of the joints"
        where += f" ({', '.join(observation.inputs)})"
    else:
        where = _where(given, k)
    texts = ", or ".join(one.text for one, _ in found)
    edits = "; or ".join(one.edit for one, _ in found) if len(found) <= _EDITED else "correct the one that is meant"
    expected = one.real if given is not None and one.real else _expected(comparison)
    so = f". If the readings are right as they are, expect such errors of the robot: --sigma {expected!r}"
    so = so if expected else ""
    return (
        f"{where}. They fit {texts} ({best.observation.quantities[k].name} differs by {rest} then): is that what was "
        f"measured? Then {edits}{so}"
    )


def _expected(comparison: ColumnComparison) -> str:
    """Return errors with which the readings would be taken as they are; "" if they are beyond what is manufactured."""
    parameters, given, errors = comparison.observation.design.parameters, comparison.given, comparison.errors
    count = len(parameters)
    kinds = [
        (kind, np.array([not one.joint and one.dimension is kind for one in parameters.free]))
        for kind in (LENGTH, ANGLE)
    ]
    length = parameters.mechanism.length
    larger, factor = errors.copy(), 2.0
    while given is not None:
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


def _where(given: Compared, k: int) -> str:
    one = given.observation.quantities[k]
    return (
        f"{given.observation.measurements.source}, column {one.name}: the readings differ by "
        f"{shown(float(given.off[k]), one.dimension, 3)} from what the robot does"
    )
