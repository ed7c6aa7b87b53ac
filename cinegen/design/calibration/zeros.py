"""`zeros` and `frames`: where readings are counted from, if not from where the robot's description does."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from cinegen.design.calibration.column_mistakes import Mistake, of_joints, scaled
from cinegen.design.calibration.comparison import ColumnComparison, Compared, some
from cinegen.design.calibration.measurements import COORDINATES
from raff2urdf.quantities import ANGLE, LENGTH, Dimension, shown

FRAME = 3
"""The rank of mistakes of frames."""

_MOVED, _TURNED = 0.05, math.radians(3.0)  # characteristic lengths and rad: smaller offsets are left to the estimate
_ITERATIONS = 8  # of Gauss and Newton for an offset
_STARTS = 8  # angles of a turn from which they begin
_AROUND = (0.0, -0.05, 0.05, -0.1, 0.1)  # characteristic lengths from the same mean as at home, likewise


def zeros(comparison: ColumnComparison) -> Iterator[Mistake]:
    """Yield other zeros: of columns that are compared, then of joints, with either sign."""
    observation = comparison.observation
    measurements, mechanism = observation.measurements, observation.design.mechanism
    columns = measurements.quantities
    if comparison.written is not None:
        rest = observation.residuals(observation.predict(observation.values, derivatives=False))
        for k, off in zip(observation.outputs, rest.T, strict=True):
            each, offset = columns[k], float(np.nanmedian(off))
            if not _is_large(offset, each.dimension, mechanism.length):
                continue
            by = shown(offset, each.dimension, 4)
            edit = f"write {each.name} plus {by}"
            if each.kind in COORDINATES and not each.device:
                edit += f", or name the device whose origin is elsewhere in all of its columns: {each.name} @ tracker"
            yield Mistake(f"with {by} added to {each.name}", edit, scaled(measurements, [k], 1.0, offset), 2)
    home = np.array([mechanism.q_home[mechanism.q_index(joint)] for joint in observation.inputs])
    if home.any():
        names = ", ".join(observation.inputs)
        values = measurements.values.copy()
        values[:, observation.input_columns] += home
        edit = f"add the joints' values at home to {names}"
        yield Mistake(f"with {names} read from home", edit, replace(measurements, values=values), 2)
    groups = [each for each in of_joints(observation) if len(each) > 1]
    for chosen in [[k] for k in observation.input_columns] + groups:
        at = [observation.input_columns.index(k) for k in chosen]
        read = float(np.mean(measurements.values[:, chosen]))
        for sign in (1.0, -1.0):
            if columns[chosen[0]].dimension is ANGLE:
                starts = (np.arange(_STARTS) * math.tau / _STARTS).tolist()
            else:
                middle = float(home[at].mean()) - sign * read
                starts = [0.0, *(middle + mechanism.length * np.array(_AROUND)).tolist()]
            yield from _zero(comparison, chosen, sign, starts)


def _is_large(offset: float, dimension: Dimension, length: float) -> bool:
    return abs(offset) >= (_TURNED if dimension is ANGLE else _MOVED * length)


def _zero(
    comparison: ColumnComparison, chosen: Sequence[int], sign: float, starts: Sequence[float]
) -> Iterator[Mistake]:
    """Yield the zero of joints with which the readings are nearest to the robot."""
    observation = comparison.observation
    measurements, parameters = observation.measurements, observation.design.parameters
    columns = [measurements.quantities[k] for k in chosen]
    dimension = columns[0].dimension
    offset = _offset(comparison, chosen, sign, starts)
    length = parameters.mechanism.length
    if offset is None or (comparison.written is not None and not _is_large(offset, dimension, length)):
        return
    names, by = ", ".join(quantity.name for quantity in columns), shown(offset, dimension, 4)
    text = f"with {by} added to {names}" if sign > 0.0 else f"with {by} minus the readings of {names}"
    edit = f"put {by} {'plus' if sign > 0.0 else 'minus'} {names} in place of {names}"
    expected = shown(1.1 * abs(offset), dimension, 2).replace(" ", "")
    variables = [parameters.own_variable(quantity.of).name for quantity in columns]
    real = (
        ", ".join(f"{name}={expected}" for name in variables)
        if sign > 0.0 and {*variables} <= {*parameters.names}
        else ""
    )
    yield Mistake(text, edit, scaled(measurements, chosen, sign, offset), 2, real)


def _offset(comparison: ColumnComparison, chosen: Sequence[int], sign: float, starts: Sequence[float]) -> float | None:
    measurements = some(comparison.observation.measurements)
    at = [comparison.observation.input_columns.index(k) for k in chosen]
    offset = min(starts, key=lambda start: comparison.misfit(scaled(measurements, chosen, sign, start)))
    best = comparison.of(scaled(measurements, chosen, sign, offset))
    if best is None:
        return None
    for _ in range(_ITERATIONS):
        predicted = best.observation.predict(best.observation.values)
        rest, slope = best.observation.residuals(predicted), predicted.by_inputs[:, :, at].sum(axis=2)
        weight = 1.0 / np.maximum(best.off, 1e-9)
        steps = np.where(np.isfinite(rest), rest, 0.0) * weight, slope * weight
        step = -float((steps[0] * steps[1]).sum() / max((steps[1] ** 2).sum(), 1e-300))
        other = comparison.of(scaled(measurements, chosen, sign, offset + step))
        if other is None or other.misfit >= best.misfit:
            break
        best, offset = other, offset + step
    return math.remainder(offset, math.tau) if measurements.quantities[chosen[0]].dimension is ANGLE else offset


def frames(comparison: ColumnComparison) -> Iterator[Mistake]:
    """Yield a device that stands elsewhere, a target beside a node's origin, and both."""
    observation = comparison.observation
    measurements = observation.measurements
    coordinates = [k for k in observation.outputs if measurements.quantities[k].kind in COORDINATES]
    at_world = [k for k in coordinates if not measurements.quantities[k].device]
    at_origin = [k for k in coordinates if not measurements.quantities[k].target]
    nodes = list(dict.fromkeys(measurements.quantities[k].of for k in at_origin))
    for device, target in ((True, False), (False, True), (True, True)):
        if (device and len(at_world) < 2) or (target and not at_origin):
            continue
        read = list(measurements.quantities)
        for k in at_world if device else ():
            read[k] = replace(read[k], device="tracker", name=f"{read[k].name} @ tracker")
        for k in at_origin if target else ():
            ball = "ball" if len(nodes) == 1 else f"ball{nodes.index(read[k].of) + 1}"
            head, _, tail = read[k].name.partition(f".{read[k].kind}")
            name = f"{head.partition('(')[0]}({ball}).{read[k].kind}{tail}"
            read[k] = replace(read[k], point=(0.0, 0.0, 0.0), target=ball, name=name)
        text = ["a device in a frame of its own"] * device + ["a target beside the node's origin"] * target
        edit = f"write {', '.join(read[k].name for k in coordinates)}"
        rank = FRAME + (device and target)
        yield Mistake(f"with {' and '.join(text)}", edit, replace(measurements, quantities=tuple(read)), rank)


def placed(mistake: Mistake, compared: Compared) -> Mistake | None:
    """Return a mistake of frames with where these are; None if they are where they were taken to be, about."""
    if mistake.rank < FRAME:
        return mistake
    length, places, is_far = compared.observation.design.mechanism.length, list[str](), False
    for name, pose in compared.observation.frames.start.items():
        turn = pin.log3(pose[:3, :3])
        angle, distance = float(np.linalg.norm(turn)), float(np.linalg.norm(pose[:3, 3]))
        is_far |= _is_large(angle, ANGLE, length) or _is_large(distance, LENGTH, length)
        if distance > length and name not in compared.observation.frames.devices:
            return None  # no target is so far from its node
        axis = f", turned by {shown(angle, ANGLE, 3)} about ({' '.join(f'{x:.2g}' for x in turn / max(angle, 1e-9))})"
        places.append(f"{name} at ({' '.join(f'{1e3 * x:.4g}mm' for x in pose[:3, 3])}){axis * (angle > 1e-3)}")
    return mistake._replace(text=f"{mistake.text} ({'; '.join(places)})") if is_far else None
