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
    own: Array  # (readings, parameters) whitened columns of what was estimated, in expected errors
    others: Array  # (readings, names) of what was not, in m and rad


def is_poor(found: Calibration) -> bool:
    """Return whether the residuals are larger than the sigmas of the readings allow."""
    return found.degrees_of_freedom > 0 and found.fit > 1.0 + POOR * math.sqrt(2.0 / found.degrees_of_freedom)


def left_out(found: Calibration, estimate: Estimate) -> str:
    """Return which parameters explain the readings better, or as well, as a sentence; "" where none does.

    Args:
        found: what was estimated.
        estimate: of other parameters, by measurements and expected errors.
    """
    if is_poor(found):
        return _added(found, _columns(found))
    count, errors = len(found.parameters), found.subspace.errors
    least = _UNEXPECTED * np.maximum(found.sigmas, errors)
    is_far = found.separate & (np.abs(found.values - found.nominal) > least) & (errors > 0.0)
    unexpected = np.flatnonzero(is_far[:count]).tolist() if found.degrees_of_freedom > 0 else []
    return "; ".join(_swapped(found, _columns(found), unexpected, estimate)) if unexpected else ""


def _columns(found: Calibration) -> _Columns:
    parameters, observation = found.parameters, found.observation
    tied = np.asarray((parameters.ties.matrix != 0.0).any(axis=1))
    measured = {one.of for one in observation.quantities + observation.measurements.quantities if one.kind == "joint"}
    whole = Parameters(
        parameters.document,
        [one.name for one in parameters.all if not one.joint or one.joint in measured],
        robot=parameters.robot.name,
    )
    every = Observation(whole, observation.measurements, observation.gains, observation.frames)
    every.keep(observation.start() if observation.kept is None else observation.kept)
    count, at = len(parameters), [parameters.find(name) for name in whole.names]
    theta = np.append(parameters.full(found.values[:count])[at], found.values[count:])
    here, own = every.predict(theta), observation.predict(found.values)
    free = [
        k for k, (i, name) in enumerate(zip(at, whole.names, strict=True)) if not tied[i] and name not in here.opening
    ]

    def whitened(rows: Array) -> Array:
        return np.asarray((rows / found.standard[..., None])[found.kept])

    return _Columns(
        tuple(whole.names[k] for k in free),
        whitened(observation.residuals(own)[..., None])[:, 0],
        whitened(own.jacobian) * found.subspace.errors,
        whitened(here.jacobian[..., free]),
    )


def _without(matrix: Array, own: Array) -> Array:
    """Return columns without what those of `own` span."""
    u = orth(own, rcond=_NO_EFFECT)
    return np.asarray(matrix - u @ (u.T @ matrix))


def _gains(rest: Array, columns: Array, sizes: Array) -> Array:
    """Return by how much each column alone makes |rest|^2 smaller; columns that were (., sizes) long before."""
    norms = np.linalg.norm(columns, axis=0)
    has_effect = norms > _NO_EFFECT * sizes
    return np.where(has_effect, (rest @ columns) ** 2 / np.where(has_effect, norms, 1.0) ** 2, 0.0)


def _added(found: Calibration, columns: _Columns) -> str:
    sizes, own = np.linalg.norm(columns.others, axis=0), columns.own
    chosen, texts = list[int](), list[str]()
    dof = found.degrees_of_freedom
    while len(chosen) < min(_MOST, dof - 1):
        rest, others = _without(columns.rest[:, None], own)[:, 0], _without(columns.others, own)
        gains = _gains(rest, others, sizes)
        alike = np.flatnonzero(gains > max(gains.max(initial=0.0) - _ALIKE, _CERTAIN)).tolist()
        if not alike:
            return ""
        k, *equal = alike
        chosen.append(k)
        names = [columns.names[j] for j in equal[:_LISTED]]
        texts.append(columns.names[k] + (f" (or instead {', '.join(names)})" if names else ""))
        own = np.column_stack([own, columns.others[:, k] / sizes[k] * np.linalg.norm(columns.own, axis=0).max()])
        left, remaining = float(rest @ rest - gains[k]), dof - len(chosen)
        if left < remaining * (1.0 + POOR * math.sqrt(2.0 / remaining)):
            listed = ", ".join(texts)
            be = "is" if len(chosen) == 1 else "are"
            return (
                f"{listed}, which {be} not estimated, would explain them (chi-square {left:.4g} in place of "
                f"{found.chi2:.4g}): add {'it' if len(chosen) == 1 else 'them'} to --vary"
            )
    return ""


def _swapped(
    found: Calibration, columns: _Columns, unexpected: Sequence[int], estimate: Estimate
) -> Iterator[str]:  # fmt: skip
    for i in unexpected:
        node = found.names[i].rpartition(".")[0]
        at = [k for k, one in enumerate(columns.names) if one.rpartition(".")[0] == node]
        if not at:
            continue
        others = np.delete(columns.own, i, axis=1)
        step = (found.nominal[i] - found.values[i]) / found.subspace.errors[i]
        rest = _without((columns.rest + columns.own[:, i] * step)[:, None], others)[:, 0]
        moved = _without(columns.others[:, at], others)
        gains = _gains(rest, moved, np.linalg.norm(columns.others[:, at], axis=0))
        k = int(np.argmax(gains))
        if not gains[k] > 0.5 * float(rest @ rest - found.chi2):
            continue
        other, size = columns.names[at[k]], float(abs(rest @ moved[:, k]) / (moved[:, k] @ moved[:, k]))
        text = _compared(found, i, other, size, estimate)
        if text:
            yield text


def _compared(found: Calibration, i: int, other: str, size: float, estimate: Estimate) -> str:
    """Return what an estimate of another parameter in place of one states; "" if it fits worse, or does the same."""
    parameters, observation, name = found.parameters, found.observation, found.names[i]
    kept = observation.measurements.values.copy()
    kept[:, observation.outputs] = np.where(found.kept, kept[:, observation.outputs], np.nan)
    names = [one for one in parameters.names if one != name] + [other]
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
    nominal = found.values.copy()
    nominal[i] = found.nominal[i]
    poses = [
        one.observation.design.evaluate(values[: len(one.parameters)], q, derivatives=False).placements(end)
        for one, values, q in (
            (found, found.values, observation.kept),
            (again, again.values, again.observation.kept),
            (found, nominal, observation.kept),
        )
    ]
    apart, effect = (np.array(_apart(poses[0], one)) for one in poses[1:])
    scale = np.array([1.0 / length, 1.0])
    if again.chi2 > found.chi2 + _ALIKE or (apart * scale).max() < _APART * (effect * scale).max():
        return ""
    change, instead = (
        shown(abs(one.values[k] - one.nominal[k]), one.dimension(one.names[k]), 3)
        for one, k in ((found, i), (again, again.names.index(other)))
    )
    return (
        f"{name} changes by {change}, but {other} by {instead} instead fits as well (chi-square {again.chi2:.4g} "
        f"and {found.chi2:.4g}), and {end} is {shown(float(apart[0]), LENGTH, 3)} and "
        f"{shown(float(apart[1]), ANGLE, 3)} elsewhere then (root mean square): these readings can't tell them apart; "
        f"measure what differs, as {end}.rx, {end}.ry and {end}.rz, or vary the one that is meant"
    )


def _apart(one: Array, other: Array) -> tuple[float, float]:
    """Return root mean square distances, m, and rotations, rad, between poses (poses, 4, 4)."""
    angles = Rotation.from_matrix(np.swapaxes(one[:, :3, :3], 1, 2) @ other[:, :3, :3]).magnitude()
    distances = np.linalg.norm(one[:, :3, 3] - other[:, :3, 3], axis=1)
    return float(np.sqrt(np.mean(distances**2))), float(np.sqrt(np.mean(angles**2)))
