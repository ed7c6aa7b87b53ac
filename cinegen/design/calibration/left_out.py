"""`left_out`: parameters that were not estimated, and explain the readings better than those that were, or as well.

An angle of a delta's tower turns the joints of the rods with it; a tower that is mounted beside where it should be
does not turn them. Either model closes the loops at the readings of joints and platform, with other residuals r. With
Q the whitened columns of what was estimated, made orthonormal, and c that of a parameter which was not, P = 1 - Q Q^T,
an estimate of it leaves |P r|^2 - (r^T P c)^2 / |P c|^2 (the score test; C. R. Rao, 1948). Where the readings don't
fit, parameters are added until they do. Where they fit by a change that is not expected, another parameter of the same
node is estimated instead.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import orth
from scipy.spatial.transform import Rotation

from cinegen.arrays import Array
from cinegen.design.calibration.measurements import Measurements
from cinegen.design.calibration.observation import Observation
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from raff2urdf.quantities import ANGLE, LENGTH, shown

if TYPE_CHECKING:
    from cinegen.design.calibration.result import Calibration

POOR = 5.0
"""Standard deviations of chi-square beyond which residuals are not those of the readings' sigmas."""

_LISTED = 3  # parameters that explain the readings as well as another
_MOST = 6  # parameters that are added
_CERTAIN = 25.0  # squares by which a parameter makes the residuals smaller, at least
_UNEXPECTED = 5.0  # expected errors, and standard deviations, of a change for which another is sought
_ALIKE = 9.0  # squares by which a parameter in place of another fits worse, at most
_APART = 0.1  # parts of what the change does to the pose of the end, by which the other differs, at least
_NO_EFFECT = 1e-6  # part of a column that what was estimated leaves

Estimate = Callable[[Parameters, Measurements, dict[str, float]], "Calibration"]


class _Columns(NamedTuple):
    names: tuple[str, ...]  # of parameters that were not estimated
    rest: Array  # (readings,) whitened residuals
    varied: Array  # (readings, parameters) whitened columns of what was estimated, in expected errors
    others: Array  # (readings, names) of what was not, in m and rad


def is_poor(calibration: Calibration) -> bool:
    """Return whether the residuals are larger than the sigmas of the readings allow."""
    return calibration.degrees_of_freedom > 0 and calibration.fit > 1.0 + POOR * math.sqrt(
        2.0 / calibration.degrees_of_freedom
    )


def left_out(calibration: Calibration, estimate: Estimate) -> str:
    """Return which parameters explain the readings better, or as well, as a sentence; "" where none does.

    Args:
        calibration: what was estimated.
        estimate: of other parameters, by measurements and expected errors.
    """
    if is_poor(calibration):
        return _added(calibration, _columns(calibration))
    count, errors = len(calibration.parameters), calibration.subspace.errors
    least = _UNEXPECTED * np.maximum(calibration.sigmas, errors)
    is_far = calibration.separate & (np.abs(calibration.values - calibration.nominal) > least) & (errors > 0.0)
    unexpected = np.flatnonzero(is_far[:count]).tolist() if calibration.degrees_of_freedom > 0 else []
    return "; ".join(_swapped(calibration, _columns(calibration), unexpected, estimate)) if unexpected else ""


def _columns(calibration: Calibration) -> _Columns:
    parameters, observation = calibration.parameters, calibration.observation
    tied = np.asarray((parameters.ties.matrix != 0.0).any(axis=1))
    measured = {
        each.of for each in observation.quantities + observation.measurements.quantities if each.kind == "joint"
    }
    whole = Parameters(
        parameters.document,
        [each.name for each in parameters.all if not each.joint or each.joint in measured],
        robot=parameters.robot.name,
    )
    every = Observation(whole, observation.measurements, observation.gains, observation.frames)
    every.keep(observation.start() if observation.kept is None else observation.kept)
    count, at = len(parameters), [parameters.find(name) for name in whole.names]
    theta = np.append(parameters.full(calibration.values[:count])[at], calibration.values[count:])
    of_all, of_free = every.predict(theta), observation.predict(calibration.values)
    free = [
        k for k, (i, name) in enumerate(zip(at, whole.names, strict=True)) if not tied[i] and name not in of_all.opening
    ]

    def whitened(rows: Array) -> Array:
        return np.asarray((rows / calibration.standard[..., None])[calibration.kept])

    return _Columns(
        tuple(whole.names[k] for k in free),
        whitened(observation.residuals(of_free)[..., None])[:, 0],
        whitened(of_free.jacobian) * calibration.subspace.errors,
        whitened(of_all.jacobian[..., free]),
    )


def _without(matrix: Array, span: Array) -> Array:
    """Return columns without what those of `span` span."""
    u = orth(span, rcond=_NO_EFFECT)
    return np.asarray(matrix - u @ (u.T @ matrix))


def _gains(rest: Array, columns: Array, sizes: Array) -> Array:
    """Return by how much each column alone makes |rest|^2 smaller; columns that were (., sizes) long before."""
    norms = np.linalg.norm(columns, axis=0)
    has_effect = norms > _NO_EFFECT * sizes
    return np.where(has_effect, (rest @ columns) ** 2 / np.where(has_effect, norms, 1.0) ** 2, 0.0)


def _added(calibration: Calibration, columns: _Columns) -> str:
    sizes, span = np.linalg.norm(columns.others, axis=0), columns.varied
    chosen, texts = list[int](), list[str]()
    dof = calibration.degrees_of_freedom
    while len(chosen) < min(_MOST, dof - 1):
        rest, others = _without(columns.rest[:, None], span)[:, 0], _without(columns.others, span)
        gains = _gains(rest, others, sizes)
        alike = np.flatnonzero(gains > max(gains.max(initial=0.0) - _ALIKE, _CERTAIN)).tolist()
        if not alike:
            return ""
        k, *equal = alike
        chosen.append(k)
        names = [columns.names[j] for j in equal[:_LISTED]]
        texts.append(columns.names[k] + (f" (or instead {', '.join(names)})" if names else ""))
        span = np.column_stack([span, columns.others[:, k] / sizes[k] * np.linalg.norm(columns.varied, axis=0).max()])
        left, remaining = float(rest @ rest - gains[k]), dof - len(chosen)
        if left < remaining * (1.0 + POOR * math.sqrt(2.0 / remaining)):
            listed = ", ".join(texts)
            be = "is" if len(chosen) == 1 else "are"
            return (
                f"{listed}, which {be} not estimated, would explain them (chi-square {left:.4g} in place of "
                f"{calibration.chi2:.4g}): add {'it' if len(chosen) == 1 else 'them'} to --vary"
            )
    return ""


def _swapped(
    calibration: Calibration, columns: _Columns, unexpected: Sequence[int], estimate: Estimate
) -> Iterator[str]:  # fmt: skip
    for i in unexpected:
        node = calibration.names[i].rpartition(".")[0]
        at = [k for k, name in enumerate(columns.names) if name.rpartition(".")[0] == node]
        if not at:
            continue
        others = np.delete(columns.varied, i, axis=1)
        step = (calibration.nominal[i] - calibration.values[i]) / calibration.subspace.errors[i]
        rest = _without((columns.rest + columns.varied[:, i] * step)[:, None], others)[:, 0]
        moved = _without(columns.others[:, at], others)
        gains = _gains(rest, moved, np.linalg.norm(columns.others[:, at], axis=0))
        k = int(np.argmax(gains))
        if not gains[k] > 0.5 * float(rest @ rest - calibration.chi2):
            continue
        other, size = columns.names[at[k]], float(abs(rest @ moved[:, k]) / (moved[:, k] @ moved[:, k]))
        text = _compared(calibration, i, other, size, estimate)
        if text:
            yield text


def _compared(calibration: Calibration, i: int, other: str, size: float, estimate: Estimate) -> str:
    """Return what an estimate of another parameter in place of one states; "" if it fits worse, or does the same."""
    parameters, observation, name = calibration.parameters, calibration.observation, calibration.names[i]
    kept = observation.measurements.values.copy()
    kept[:, observation.outputs] = np.where(calibration.kept, kept[:, observation.outputs], np.nan)
    names = [each for each in parameters.names if each != name] + [other]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            again = estimate(
                Parameters(parameters.document, names, robot=parameters.robot.name),
                replace(observation.measurements, values=kept), {other: size},
            )  # fmt: skip
    except DesignError:
        return ""
    end, length = parameters.mechanism.end, parameters.mechanism.length
    nominal = calibration.values.copy()
    nominal[i] = calibration.nominal[i]
    poses = [
        each.observation.design.evaluate(values[: len(each.parameters)], q, derivatives=False).placements(end)
        for each, values, q in (
            (calibration, calibration.values, observation.kept),
            (again, again.values, again.observation.kept),
            (calibration, nominal, observation.kept),
        )
    ]
    apart, effect = (np.array(_apart(poses[0], each)) for each in poses[1:])
    scale = np.array([1.0 / length, 1.0])
    if again.chi2 > calibration.chi2 + _ALIKE or (apart * scale).max() < _APART * (effect * scale).max():
        return ""
    change, instead = (
        shown(abs(each.values[k] - each.nominal[k]), each.dimension(each.names[k]), 3)
        for each, k in ((calibration, i), (again, again.names.index(other)))
    )
    return (
        f"{name} changes by {change}, but {other} by {instead} instead fits as well (chi-square {again.chi2:.4g} "
        f"and {calibration.chi2:.4g}), and {end} is {shown(float(apart[0]), LENGTH, 3)} and "
        f"{shown(float(apart[1]), ANGLE, 3)} elsewhere then (root mean square): these readings can't tell them apart; "
        f"measure what differs, as {end}.rx, {end}.ry and {end}.rz, or vary the one that is meant"
    )


def _apart(first: Array, other: Array) -> tuple[float, float]:
    """Return root mean square distances, m, and rotations, rad, between poses (poses, 4, 4)."""
    angles = Rotation.from_matrix(np.swapaxes(first[:, :3, :3], 1, 2) @ other[:, :3, :3]).magnitude()
    distances = np.linalg.norm(first[:, :3, 3] - other[:, :3, 3], axis=1)
    return float(np.sqrt(np.mean(distances**2))), float(np.sqrt(np.mean(angles**2)))
