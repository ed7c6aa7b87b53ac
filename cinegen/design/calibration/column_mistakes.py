"""`mistakes`: what may be wrong with the columns of measurements, each with the measurements made good.

A sign, a unit, an exchange of columns, the name of another one, or another way to write poses. `lines`: what was read
is in other lines than the readings of the joints where it was read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from cinegen.design.calibration.comparison import FEWEST, ColumnComparison
from cinegen.design.calibration.frames import UNITS
from cinegen.design.calibration.measurements import COORDINATES, MeasuredQuantity, Measurements
from cinegen.design.calibration.observation import Observation
from raff2urdf.errors import first_of
from raff2urdf.quantities import ANGLE, LENGTH

_SEEN = 0.01  # of the characteristic length or rad: a range in which a column shows its unit
_SHOWN = 4  # lines whose other place is named
_SUBSETS = 4  # columns of a group of which all subsets may have the wrong sign
_EULER = ("XYZ", "xyz", "zyx", "ZYZ")  # conventions of angles, as scipy writes them; "ZYX" is in the order rz, ry, rx


class Mistake(NamedTuple):
    """One mistake that measurements may have.

    Attributes:
        text: what makes it good, such as "with the opposite sign of tool.x".
        edit: what the person does to the file then.
        measurements: without it.
        rank: 0 of a column, 1 of several, 2 of a zero, 3 of a frame, 4 of two; those of a lower one are likelier.
        real: expected errors, as --sigma takes them, with which the robot may really be so; "" where it can't.
    """

    text: str
    edit: str
    measurements: Measurements
    rank: int
    real: str = ""


def mistakes(observation: Observation) -> Iterator[Mistake]:
    """Yield mistakes of signs, units, columns, their names, and poses."""
    groups = _groups(observation)
    yield from _signs(observation, groups)
    yield from _units(observation)
    yield from _orders(observation, groups)
    for angles in groups:
        yield from _poses(observation.measurements, angles, groups)
    yield from _headers(observation)


def lines(comparison: ColumnComparison) -> Iterator[Mistake]:
    """Yield readings that are shifted by one line, then the order in which they are nearest to what the robot does."""
    observation = comparison.observation
    measurements, outputs = observation.measurements, observation.outputs
    count, names = len(measurements), names_of(measurements, outputs)
    if count <= 2 * FEWEST or comparison.written is None:
        return

    def moved(joint_rows: list[int], output_rows: list[int], text: str, edit: str) -> Mistake:
        values, sigmas = measurements.values[joint_rows].copy(), measurements.sigmas[joint_rows].copy()
        values[:, outputs], sigmas[:, outputs] = (
            measurements.values[output_rows][:, outputs],
            measurements.sigmas[output_rows][:, outputs],
        )
        labels = tuple(measurements.labels[i] for i in joint_rows)
        return Mistake(text, edit, replace(measurements, values=values, sigmas=sigmas, labels=labels), 1)

    first, last, edit = list(range(count - 1)), list(range(1, count)), f"move {names} by one line, joints stay"
    yield moved(first, last, f"with {names} of the line below", edit)
    yield moved(last, first, f"with {names} of the line above", edit)
    values = observation.predict(observation.values, derivatives=False).values
    apart = (values[:, None] - observation.measured) / comparison.written.expected
    order = linear_sum_assignment(np.nan_to_num(np.abs(apart)).sum(axis=2))[1].tolist()
    others = [f"{measurements.labels[j]} at {measurements.labels[i]}" for i, j in enumerate(order) if i != j]
    text = f"with {names} in another order of lines ({first_of(others, _SHOWN)})"
    yield moved(list(range(count)), order, text, f"move {names} to the lines of the joints where they were read")


def scaled(measurements: Measurements, chosen: Sequence[int], factor: float, offset: float = 0.0) -> Measurements:
    """Return measurements with other numbers in some columns: offset + factor times what they are."""
    values, sigmas = measurements.values.copy(), measurements.sigmas.copy()
    values[:, chosen] = offset + factor * values[:, chosen]
    sigmas[:, chosen] *= abs(factor)
    return replace(measurements, values=values, sigmas=sigmas)


def of_joints(observation: Observation) -> list[list[int]]:
    """Return the columns of sliding and of rotating joints from which the configuration follows."""
    columns = observation.measurements.quantities
    return [[k for k in observation.input_columns if columns[k].dimension is kind] for kind in (LENGTH, ANGLE)]


def _groups(observation: Observation) -> list[list[int]]:
    """Return columns that are coordinates of one target, positions and angles apart."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for k in observation.outputs:
        quantity = observation.measurements.quantities[k]
        if quantity.kind in COORDINATES:
            groups.setdefault(
                (quantity.of, quantity.point, quantity.device, quantity.target, quantity.dimension.default), []
            ).append(k)
    return list(groups.values())


def names_of(measurements: Measurements, chosen: Sequence[int]) -> str:
    """Return the names of columns."""
    return ", ".join(measurements.quantities[k].name for k in chosen)


def _signs(observation: Observation, groups: Sequence[Sequence[int]]) -> Iterator[Mistake]:
    """Yield signs of single columns, then of more of one group."""
    measurements, joints = observation.measurements, of_joints(observation)
    several = [
        list(chosen)
        for group in (*joints, *groups)
        for size in (range(2, len(group) + 1) if len(group) <= _SUBSETS else (2, len(group)))
        for chosen in combinations(group, size)
    ]
    for chosen in [[k] for k in range(len(measurements.quantities))] + several:
        rank = 0 if len(chosen) == 1 or chosen in joints else 1
        names = names_of(measurements, chosen)
        yield Mistake(
            f"with the opposite sign of {names}",
            f"change the sign of {names}",
            scaled(measurements, chosen, -1.0),
            rank,
        )


def _units(observation: Observation) -> Iterator[Mistake]:
    measurements, outputs = observation.measurements, observation.outputs
    columns = measurements.quantities
    read = [[k for k in outputs if columns[k].dimension is kind] for kind in (LENGTH, ANGLE)]
    whole = [group for group in (*of_joints(observation), *read) if len(group) > 1]
    for chosen in [[k] for k in range(len(columns))] + whole:
        names, dimension = names_of(measurements, chosen), columns[chosen[0]].dimension
        seen = np.nan_to_num(measurements.values[:, chosen])
        least = (
            _SEEN
            * (observation.design.mechanism.length if dimension is LENGTH else 1.0)
            / max(float(np.ptp(seen, axis=0).max()), 1e-300)
        )
        for wrong, right, factor in UNITS[dimension]:
            if factor < min(least, 1.0):
                continue  # numbers near 0 say nothing
            edit = f"multiply the numbers in {names} by {factor:.6g}"
            yield Mistake(f"with {names} in {right} instead of {wrong}", edit, scaled(measurements, chosen, factor), 0)


def _orders(observation: Observation, groups: Sequence[Sequence[int]]) -> Iterator[Mistake]:
    """Two columns exchanged, or more in another order, of one group."""
    measurements = observation.measurements
    columns = measurements.quantities
    joints = [
        [k for k, quantity in enumerate(columns) if quantity.kind == "joint" and quantity.dimension is d]
        for d in (LENGTH, ANGLE)
    ]
    for group in map(list, [*joints, *groups]):
        orders = [([a, b], [b, a]) for a, b in combinations(group, 2)]
        for a, b, c in combinations(group, 3):
            orders += [([a, b, c], [b, c, a]), ([a, b, c], [c, a, b])]
        if len(group) > 3:
            orders += [(group, group[by:] + group[:by]) for by in range(1, len(group))] + [(group, group[::-1])]
        for chosen, order in orders:
            values, sigmas = measurements.values.copy(), measurements.sigmas.copy()
            values[:, chosen], sigmas[:, chosen] = measurements.values[:, order], measurements.sigmas[:, order]
            names, others = names_of(measurements, chosen), names_of(measurements, order)
            text = (
                f"columns {names.replace(', ', ' and ')} exchanged"
                if len(order) == 2
                else f"{names} in the order {others}"
            )
            edit = f"write {others} where the header has {names}"
            yield Mistake(
                f"with {text}", edit, replace(measurements, values=values, sigmas=sigmas), int(len(order) > 2)
            )


def _poses(measurements: Measurements, angles: Sequence[int], groups: Sequence[Sequence[int]]) -> Iterator[Mistake]:
    """Other ways to write a rotation, and a pose."""
    columns = measurements.quantities
    of = columns[angles[0]]
    read = measurements.values[:, angles]
    whole = np.isfinite(read).all(axis=1)
    if [columns[k].kind for k in angles] != list(COORDINATES[3:]) or not whole.any():
        return
    lines, names = np.flatnonzero(whole), names_of(measurements, angles)
    matrices = np.array([pin.rpy.rpyToMatrix(*row) for row in read[whole]])
    back = Rotation.from_matrix(np.swapaxes(matrices, 1, 2))
    rotations = {f"as Euler angles {order} of scipy": Rotation.from_euler(order, read[whole]) for order in _EULER}
    rotations["as angles about z, y and x"] = Rotation.from_euler("ZYX", read[whole])
    rotations["as a rotation vector"] = Rotation.from_rotvec(read[whole])
    rotations["as the inverse rotation"] = back

    def turned(rotation: Rotation) -> Measurements:
        values = measurements.values.copy()
        values[np.ix_(lines, np.array(angles))] = rotation.as_euler("ZYX")[:, ::-1]
        return replace(measurements, values=values)

    for text, rotation in rotations.items():
        edit = f"convert {names} to roll, pitch and yaw, R = Rz(rz) Ry(ry) Rx(rx)"
        yield Mistake(f"with {names} {text}", edit, turned(rotation), 1)
    for places in groups:
        a = columns[places[0]]
        same = (a.of, a.point, a.device, a.target) == (of.of, of.point, of.device, of.target)
        if same and [columns[k].kind for k in places] == list(COORDINATES[:3]):
            inverted = turned(back)
            cells = np.ix_(lines, np.array(places))
            inverted.values[cells] = -np.einsum("nji,nj->ni", matrices, measurements.values[cells])
            text = f"with poses of the world in {of.of}, the inverse of what the columns name"
            yield Mistake(text, f"invert the poses of {of.of}", inverted, 1)


def _headers(observation: Observation) -> Iterator[Mistake]:
    """The header names another coordinate, node or joint."""
    measurements, columns, mechanism = (
        observation.measurements,
        observation.measurements.quantities,
        observation.design.mechanism,
    )

    def instead(old: str, new: str, changed: Sequence[MeasuredQuantity], rank: int) -> Mistake:
        text = f"{new} in place of {old}"
        return Mistake(f"with {text}", f"write {text}", replace(measurements, quantities=tuple(changed)), rank)

    for group in _groups(observation):
        kinds = [columns[k].kind for k in group]
        for k in group:
            quantity, all_ = columns[k], COORDINATES[:3] if columns[k].dimension is LENGTH else COORDINATES[3:]
            for kind in (kind for kind in all_ if kind not in kinds):
                head, _, tail = quantity.name.rpartition(f".{quantity.kind}")
                new = replace(quantity, kind=kind, name=f"{head}.{kind}{tail}")
                yield instead(quantity.name, new.name, [new if other is quantity else other for other in columns], 0)
    of_nodes = [quantity for quantity in columns if quantity.kind != "joint" and not quantity.target]
    measured = list(dict.fromkeys(quantity.of for quantity in of_nodes))
    for old in measured:
        for node in (node for node in mechanism.nodes if node not in measured):
            changed = [
                replace(quantity, of=node) if quantity in of_nodes and quantity.of == old else quantity
                for quantity in columns
            ]
            yield instead(old, node, changed, 1)
    joints = [quantity for quantity in columns if quantity.kind == "joint"]
    for joint in (name for name in mechanism.actuated if name not in [other.of for other in joints]):
        for quantity in (quantity for quantity in joints if quantity.of not in mechanism.actuated):
            new = replace(quantity, of=joint, name=joint)
            yield instead(quantity.name, joint, [new if other is quantity else other for other in columns], 0)
