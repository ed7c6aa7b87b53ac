"""`left_out`: parameters that were not estimated, and explain the readings better than those that were, or as well.

With r the residuals, Q the whitened columns of what was estimated, made orthonormal, c that of a parameter which was
not, and P = 1 - Q Q^T, an estimate of it leaves |P r|^2 - (r^T P c)^2 / |P c|^2 (the score test; C. R. Rao, 1948).
Where the readings don't fit, parameters are added until they do. Where they fit by a change that is not expected,
another parameter of the same node is looked for that fits as well and moves the end otherwise: a turned tower of a
delta, and one that is mounted a few millimetres away, can be taken for each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import orth

from cinegen.arrays import Array
from cinegen.design.calibration.observation import Observation
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


class _Columns(NamedTuple):
    names: tuple[str, ...]  # of parameters that were not estimated
    rest: Array  # (readings,) whitened residuals
    varied: Array  # (readings, parameters) whitened columns of what was estimated, in expected errors
    others: Array  # (readings, names) of what was not, in m and rad
    moved: Array  # (poses, 6, parameters) derivative of the end's pose, in the world's axes, by what was estimated
    moved_by_others: Array  # (poses, 6, names)


def is_poor(calibration: Calibration) -> bool:
    """Return whether the residuals are larger than the sigmas of the readings allow."""
    return calibration.degrees_of_freedom > 0 and calibration.fit > 1.0 + POOR * math.sqrt(
        2.0 / calibration.degrees_of_freedom
    )


def left_out(calibration: Calibration) -> str:
    """Return which parameters explain the readings better, or as well, as a sentence; "" where none does."""
    if is_poor(calibration):
        return _added(calibration, _columns(calibration))
    count, errors = len(calibration.parameters), calibration.subspace.errors
    least = _UNEXPECTED * np.maximum(calibration.sigmas, errors)
    is_far = calibration.separate & (np.abs(calibration.values - calibration.nominal) > least) & (errors > 0.0)
    unexpected = np.flatnonzero(is_far[:count]).tolist() if calibration.degrees_of_freedom > 0 else []
    return "; ".join(_swapped(calibration, _columns(calibration), unexpected)) if unexpected else ""


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
    of_end = every.design.evaluate(theta[: len(at)], of_all.q).pose_derivative(parameters.mechanism.end, "world")
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
        of_end @ parameters.ties.matrix[at],
        of_end[..., free],
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


def _swapped(calibration: Calibration, columns: _Columns, unexpected: list[int]) -> Iterator[str]:
    """Yield what else of the same node would fit as well in place of changes that are not expected, to first order."""
    parameters = calibration.parameters
    end, length = parameters.mechanism.end, parameters.mechanism.length
    for i in unexpected:
        name, back = calibration.names[i], calibration.nominal[i] - calibration.values[i]
        span = np.delete(columns.varied, i, axis=1)
        whole = columns.rest + columns.varied[:, i] * (back / calibration.subspace.errors[i])
        rest, others = _without(whole[:, None], span)[:, 0], _without(columns.others, span)
        gains = _gains(rest, others, np.linalg.norm(columns.others, axis=0))
        gains *= [other.rpartition(".")[0] == name.rpartition(".")[0] for other in columns.names]
        chi2 = float(rest @ rest - gains.max(initial=0.0))
        if not gains.any() or chi2 > calibration.chi2 + _ALIKE:
            continue
        k = int(np.argmax(gains))
        instead = float(-(rest @ others[:, k]) / (others[:, k] @ others[:, k]))
        again = -np.linalg.lstsq(span, whole + columns.others[:, k] * instead)[0]  # of all others, in expected errors
        change = (np.insert(again, i, 0.0) * calibration.subspace.errors)[: columns.moved.shape[-1]]
        effect = columns.moved[..., i] * back
        apart, least = (
            np.sqrt((each.reshape(-1, 2, 3) ** 2).sum(axis=2).mean(axis=0))  # m, rad
            for each in (effect + columns.moved @ change + columns.moved_by_others[..., k] * instead, _APART * effect)
        )
        scale = np.array([1.0 / length, 1.0])
        if (apart * scale).max() >= (least * scale).max():
            text = parameters.text
            yield (
                f"{name} changes by {text(name, abs(back), 3)}, but {columns.names[k]} by "
                f"{text(columns.names[k], abs(instead), 3)} instead fits as well (chi-square {chi2:.4g} and "
                f"{calibration.chi2:.4g}), and {end} is {shown(float(apart[0]), LENGTH, 3)} and "
                f"{shown(float(apart[1]), ANGLE, 3)} elsewhere then (root mean square): these readings can't tell them "
                f"apart; measure what differs, as {end}.rx, {end}.ry and {end}.rz, or vary the one that is meant"
            )
