"""Mistakes in measurements, found before any estimate: each column is compared with the robot as it is described.

Readings that are far from what the robot does by its expected errors are compared again without one mistake: a sign, a
unit, an exchange, an order of lines, a zero, a convention of rotations, a frame. If they fit then, the measurements are
refused, and the mistake is named with its correction. Errors of a robot can't imitate one: the readings must be farther
off than `_FAR` expected standard deviations, and nearer than `_NEAR` without it.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from cinegen.arrays import Array
from cinegen.design.calibration.frames import UNITS
from cinegen.design.calibration.measurements import COORDINATES, Measurements
from cinegen.design.calibration.observation import Observation
from cinegen.design.errors import DesignError
from raff2urdf import closure
from raff2urdf.quantities import ANGLE, LENGTH, Dimension, shown

UNEXPLAINED = "no other sign, unit or order of columns explains them; check the columns, and the sigmas"
"""Advice where no mistake is found."""

_FAR, _NEAR = 8.0, 4.0  # expected standard deviations: of readings with a mistake at least, of those without at most
_RATIO = 4.0  # of the one and the other, at least
_ALIKE = 3.0  # times the smallest misfit: mistakes that explain the readings as well
_FEWEST = 3  # readings of a column whose median counts
_OFF = 0.25  # of the characteristic length or rad: readings farther off need a mistake
_MOVED, _TURNED = 0.05, math.radians(3.0)  # characteristic lengths and rad: smaller offsets are left to the estimate
_SOME = 8  # lines that are compared at first
_OF_FRAMES = 3  # the rank of mistakes of frames
_SUBSETS = 4  # joints of which all subsets may have the wrong sign
_ITERATIONS = 8  # of Gauss and Newton for an offset
_NAMED = 3  # mistakes in a message
_EULER = ("XYZ", "xyz", "zyx", "ZYZ")  # conventions of angles, as scipy writes them; "ZYX" is in the order rz, ry, rx


class ContradictionError(DesignError):
    """Readings that contradict the others, or the robot.

    Attributes:
        text: measurements, column, and what is wrong.
    """

    def __init__(self, text: str, advice: str = UNEXPLAINED) -> None:
        self.text = text
        super().__init__(f"{text}: {advice}")


class Mistake(NamedTuple):
    """One mistake that measurements may have.

    Attributes:
        text: what makes it good, such as "with the opposite sign of tool.x".
        edit: what the person does to the file then.
        measurements: without it.
        rank: 0 of a column, 1 of several, 2 of a zero, 3 of a frame; mistakes of a lower one are likelier.
    """

    text: str
    edit: str
    measurements: Measurements
    rank: int


class _Compared(NamedTuple):
    observation: Observation
    off: Array  # (outputs,) median distances from what the robot does, m and rad
    ratios: Array  # (outputs,) the same in expected standard deviations

    @property
    def misfit(self) -> float:
        return float(self.ratios.max(initial=0.0))


def check(observation: Observation, errors: Array) -> None:
    """Refuse measurements that fit the robot as described without a mistake, and don't as they are.

    Args:
        observation: of the measurements.
        errors: (parameters,) expected ones of the description and of gains.

    Raises:
        ContradictionError: they are far off, and no mistake is found.
        DesignError: names the mistake, both distances, and the correction; or the loops can't be closed.
    """
    open_: DesignError | None = None
    try:
        observation.keep(observation.start())
    except DesignError as error:
        open_ = error
    given = None if open_ is not None else _compared(observation, errors)
    if given is not None and given.misfit <= _FAR:
        return
    limit = _NEAR if given is None else min(_NEAR, given.misfit / _RATIO)
    found = list[tuple[Mistake, _Compared]]()
    some = Observation(observation.design.parameters, _some(observation.measurements), observation.gains)
    if observation.kept is not None:
        some.keep(_thinned(observation.kept))
    for source in (mistakes(observation), _offsets(observation, some, given, errors), _frames(observation)):
        for one in source:
            if one.rank < _OF_FRAMES:
                first = _tried(some, _some(one.measurements), errors)
                if first is None or first.misfit > _RATIO * limit:
                    continue
            other = _tried(observation, one.measurements, errors)
            if other is not None and other.misfit <= limit and _is_large(other):
                found.append((_with_places(one, other), other))
        if found:
            raise DesignError(_question(observation, given, _likeliest(found))) from open_
    if open_ is not None:
        raise open_
    assert given is not None
    length, k = observation.design.mechanism.length, int(np.argmax(given.ratios))
    sizes = given.off / np.array([length if one.dimension is LENGTH else 1.0 for one in observation.quantities])
    if sizes.max() > _OFF:
        k = int(np.argmax(sizes))
        name = observation.quantities[k].name
        raise ContradictionError(
            f"{_where(observation, given, k)} (its characteristic length is {shown(length, LENGTH)})",
            "check the unit and the sign of this column and those of the joints, and that the device measures in "
            f"the robot's world frame; if it stands elsewhere, name it: {name.partition('@')[0].strip()} @ tracker",
        )


def _likeliest(found: Sequence[tuple[Mistake, _Compared]]) -> list[tuple[Mistake, _Compared]]:
    """Return the mistakes of lowest rank that explain the readings about as well as the best."""
    best = max(min(other.misfit for _, other in found), 1.0)
    alike = [one for one in found if one[1].misfit <= _ALIKE * best]
    rank = min(one.rank for one, _ in alike)
    return sorted((one for one in alike if one[0].rank == rank), key=lambda one: one[1].misfit)[:_NAMED]


def _question(
    observation: Observation, given: _Compared | None, found: Sequence[tuple[Mistake, _Compared]]
) -> str:  # fmt: skip
    best = found[0][1]
    k = int(np.argmax((best if given is None else given).ratios[: len(best.off)]))
    rest = shown(float(best.off[k]), best.observation.quantities[k].dimension, 3)
    if given is None:
        where = f"{observation.measurements.source}: the loops don't close at the readings of the joints"
        where += f" ({', '.join(observation.inputs)})"
    else:
        where = _where(observation, given, k)
    texts = ", or ".join(one.text for one, _ in found)
    edits = "; or ".join(one.edit for one, _ in found)
    return (
        f"{where}. They fit {texts} ({best.observation.quantities[k].name} differs by {rest} then): is that what was "
        f"measured? Then {edits}. If they are right as they are, give larger expected errors (sigma)"
    )


def _where(observation: Observation, given: _Compared, k: int) -> str:
    one = observation.quantities[k]
    return (
        f"{observation.measurements.source}, column {one.name}: the readings differ by "
        f"{shown(float(given.off[k]), one.dimension, 3)} from what the robot does"
    )


def _compared(observation: Observation, errors: Array) -> _Compared | None:
    """Return how far readings are from the robot as described; None if the loops don't close."""
    here = observation.predict(observation.values)
    if not (here.gap <= closure.CLOSED).all():
        return None
    known = np.where(np.isin(observation.names[: len(errors)], here.opening), 0.0, errors)
    spread = ((here.jacobian[..., : len(errors)] * known) ** 2).sum(axis=2)
    expected = np.sqrt(spread + np.einsum("nkk->nk", observation.covariances(here)))
    rest = np.abs(observation.residuals(here))
    off, ratios = np.zeros(rest.shape[1]), np.zeros(rest.shape[1])
    counts = np.isfinite(rest).sum(axis=0)
    for k in np.flatnonzero(counts >= min(_FEWEST, counts.max())).tolist():
        read = np.isfinite(rest[:, k])
        off[k], ratios[k] = np.median(rest[read, k]), np.median(rest[read, k] / expected[read, k])
    return _Compared(observation, off, ratios)


def _tried(observation: Observation, measurements: Measurements, errors: Array) -> _Compared | None:
    """Return how far other measurements of the robot are from it; None if the loops don't close at them."""
    try:
        other = Observation(observation.design.parameters, measurements, observation.gains)
        if other.inputs == observation.inputs and np.array_equal(other.readings, observation.readings):
            if observation.kept is None:
                return None
            other.keep(observation.kept)
        else:
            other.keep(other.start(hasty=True))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _compared(other, errors)
    except DesignError:
        return None


# --- one mistake or several columns -----------------------------------------------------------------------------------


def mistakes(observation: Observation) -> Iterator[Mistake]:
    """Yield mistakes of signs, units, columns, lines, nodes and conventions."""
    given, inputs, outputs = observation.measurements, observation.input_columns, observation.outputs
    columns = given.quantities

    def names(chosen: Sequence[int]) -> str:
        return ", ".join(columns[k].name for k in chosen)

    groups = _groups(observation)
    of_joints = [[k for k in inputs if columns[k].dimension is dimension] for dimension in (LENGTH, ANGLE)]
    for chosen in _subsets(len(columns), [*of_joints, *groups]):
        yield Mistake(
            f"with the opposite sign of {names(chosen)}", f"change the sign of {names(chosen)}",
            _scaled(given, chosen, -1.0), 0 if len(chosen) == 1 or len(chosen) in map(len, of_joints) else 1,
        )  # fmt: skip
    whole = [[k for k in of if columns[k].dimension is kind] for of in (inputs, outputs) for kind in (LENGTH, ANGLE)]
    for chosen in [[k] for k in range(len(columns))] + [one for one in whole if len(one) > 1]:
        for wrong, right, factor in UNITS[columns[chosen[0]].dimension]:
            yield Mistake(
                f"with {names(chosen)} in {right} instead of {wrong}",
                f"multiply the numbers in {names(chosen)} by {factor:.6g}", _scaled(given, chosen, factor), 0,
            )  # fmt: skip
    for chosen, order in _orders(observation, groups):
        moved = [columns[k].name for k, other in zip(chosen, order, strict=True) if k != other]
        if len(moved) == 2:
            text = f"with columns {moved[0]} and {moved[1]} exchanged"
        else:
            text = f"with {names(chosen)} in the order {names(order)}"
        values, sigmas = given.values.copy(), given.sigmas.copy()
        values[:, chosen], sigmas[:, chosen] = given.values[:, order], given.sigmas[:, order]
        edit = f"write {names(order)} where the header has {names(chosen)}"
        yield Mistake(text, edit, replace(given, values=values, sigmas=sigmas), 0 if len(moved) == 2 else 1)
    for step in (1, -1) if len(given) > 2 * _FEWEST else ():
        ahead, behind = (slice(1, None), slice(None, -1)) if step > 0 else (slice(None, -1), slice(1, None))
        values, sigmas = given.values[behind].copy(), given.sigmas[behind].copy()
        values[:, outputs], sigmas[:, outputs] = given.values[ahead][:, outputs], given.sigmas[ahead][:, outputs]
        one = replace(given, values=values, sigmas=sigmas, labels=given.labels[behind])
        where = f"the line {'below' if step > 0 else 'above'}"
        text = f"with {names(outputs)} of {where}"
        yield Mistake(text, f"move {names(outputs)} by one line, joints stay", one, 1)
    yield from _conventions(observation)
    mechanism = observation.design.mechanism
    own = [k for k in outputs if columns[k].kind != "joint" and not columns[k].target]
    measured = list(dict.fromkeys(columns[k].of for k in own))
    for old in measured:
        for node in mechanism.nodes:
            if node not in measured:
                read = tuple(replace(one, of=node) if one.of == old else one for one in columns)
                text = f"with {node} in place of {old}"
                yield Mistake(text, f"write {node} in place of {old}", replace(given, quantities=read), 1)


def _thinned(rows: Array) -> Array:
    return np.asarray(rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), _SOME)).astype(int))])


def _some(given: Measurements) -> Measurements:
    """Return a few lines, which refute most mistakes."""
    labels = tuple(_thinned(np.array(given.labels)).tolist())
    return replace(given, values=_thinned(given.values), sigmas=_thinned(given.sigmas), labels=labels)


def _scaled(given: Measurements, chosen: Sequence[int], factor: float) -> Measurements:
    values, sigmas = given.values.copy(), given.sigmas.copy()
    values[:, chosen] *= factor
    sigmas[:, chosen] *= abs(factor)
    return replace(given, values=values, sigmas=sigmas)


def _groups(observation: Observation) -> list[list[int]]:
    """Return columns that are coordinates of one target, positions and angles apart."""
    found: dict[tuple[object, ...], list[int]] = {}
    for k in observation.outputs:
        one = observation.measurements.quantities[k]
        if one.kind in COORDINATES:
            found.setdefault((one.of, one.point, one.device, one.target, one.dimension.default), []).append(k)
    return list(found.values())


def _subsets(count: int, groups: Sequence[Sequence[int]]) -> Iterator[list[int]]:
    """Yield single columns, then more of one group."""
    yield from ([k] for k in range(count))
    for group in groups:
        sizes = range(2, len(group) + 1) if len(group) <= _SUBSETS else (2, len(group))
        for size in sizes:
            yield from map(list, combinations(group, size))


def _orders(observation: Observation, groups: Sequence[Sequence[int]]) -> Iterator[tuple[list[int], list[int]]]:
    """Yield columns, and those that stand in their places."""
    columns = observation.measurements.quantities
    joints = [
        [k for k, one in enumerate(columns) if one.kind == "joint" and one.dimension is d] for d in (LENGTH, ANGLE)
    ]
    for group in [*joints, *groups]:
        for one, other in combinations(group, 2):
            yield [one, other], [other, one]
        for a, b, c in combinations(group, 3):
            yield [a, b, c], [b, c, a]
            yield [a, b, c], [c, a, b]
        count = len(group)
        if count > 3:
            for by in range(1, count):
                yield list(group), [*group[by:], *group[:by]]
            yield list(group), list(reversed(group))


def _conventions(observation: Observation) -> Iterator[Mistake]:
    """Yield other ways to write a rotation, and a pose."""
    given = observation.measurements
    columns = given.quantities
    groups = _groups(observation)
    for angles in groups:
        of = columns[angles[0]]
        if of.dimension is not ANGLE or [columns[k].kind for k in angles] != list(COORDINATES[3:]):
            continue
        read = given.values[:, angles]
        whole = np.isfinite(read).all(axis=1)
        if not whole.any():
            continue
        names, at = ", ".join(columns[k].name for k in angles), np.ix_(np.flatnonzero(whole), np.array(angles))
        ways = {f"as Euler angles {way} of scipy": Rotation.from_euler(way, read[whole]) for way in _EULER}
        ways["as angles about z, y and x"] = Rotation.from_euler("ZYX", read[whole])
        ways["as a rotation vector"] = Rotation.from_rotvec(read[whole])
        own = np.array([pin.rpy.rpyToMatrix(*row) for row in read[whole]])
        ways["as the inverse rotation"] = Rotation.from_matrix(np.swapaxes(own, 1, 2))
        convert = f"convert {names} to roll, pitch and yaw, R = Rz(rz) Ry(ry) Rx(rx)"
        for text, rotation in ways.items():
            values = given.values.copy()
            values[at] = rotation.as_euler("ZYX")[:, ::-1]
            yield Mistake(f"with {names} {text}", convert, replace(given, values=values), 1)
        for places in groups:
            a = columns[places[0]]
            same = (a.of, a.point, a.device, a.target) == (of.of, of.point, of.device, of.target)
            if not same or [columns[k].kind for k in places] != list(COORDINATES[:3]):
                continue
            values = given.values.copy()
            values[at] = Rotation.from_matrix(np.swapaxes(own, 1, 2)).as_euler("ZYX")[:, ::-1]
            there = np.ix_(np.flatnonzero(whole), np.array(places))
            values[there] = -np.einsum("nji,nj->ni", own, given.values[there])
            text = f"with poses of the world in {of.of}, the inverse of what the columns name"
            yield Mistake(text, f"invert the poses of {of.of}", replace(given, values=values), 1)


# --- zeros and frames -------------------------------------------------------------------------------------------------


def _offsets(
    observation: Observation, some: Observation, compared: _Compared | None, errors: Array
) -> Iterator[Mistake]:
    """Yield other zeros: of columns that are compared, then of joints, with either sign."""
    given = observation.measurements
    columns, mechanism = given.quantities, observation.design.mechanism

    def is_large(offset: float, dimension: Dimension) -> bool:
        return abs(offset) >= (_TURNED if dimension is ANGLE else _MOVED * mechanism.length)

    here = observation.predict(observation.values, derivatives=False) if compared is not None else None
    rest = np.zeros((0, 0)) if here is None else observation.residuals(here).T
    for k, off in zip(observation.outputs, rest, strict=False):
        one, offset = columns[k], float(np.nanmedian(off))
        if is_large(offset, one.dimension):
            by = f"{shown(offset, one.dimension, 4)} added to {one.name}"
            edit = f"write {by.replace(' added to ', ' plus ')}"
            if one.kind in COORDINATES and not one.device:
                edit += f", or name the device whose origin is elsewhere in all of its columns: {one.name} @ tracker"
            yield Mistake(f"with {by}", edit, _zeroed(given, [k], 1.0, offset), 2)
    home = np.array([mechanism.q_home[mechanism.q_index(joint)] for joint in observation.inputs])
    homes = given.values.copy()
    homes[:, observation.input_columns] += home
    if np.abs(home).max(initial=0.0) > 0.0:
        names = ", ".join(observation.inputs)
        yield Mistake(
            f"with {names} read from home",
            f"add the joints' values at home to {names}",
            replace(given, values=homes),
            2,
        )
    whole = [[k for k in observation.input_columns if columns[k].dimension is kind] for kind in (LENGTH, ANGLE)]
    for chosen in [[k] for k in observation.input_columns] + [one for one in whole if len(one) > 1]:
        dimension = columns[chosen[0]].dimension
        for sign in (1.0, -1.0):
            starts = np.arange(8) * math.pi / 4.0 if dimension is ANGLE else np.zeros(1)
            if dimension is LENGTH and sign < 0.0:
                starts = np.array([2.0 * float(np.mean(home[[observation.input_columns.index(k) for k in chosen]]))])
            zero = _offset(some, errors, chosen, sign, starts.tolist())
            if zero is None or not is_large(zero, dimension):
                continue
            names = ", ".join(columns[k].name for k in chosen)
            by = shown(zero, dimension, 4)
            text = f"with {by} added to {names}" if sign > 0.0 else f"with {by} minus the readings of {names}"
            edit = f"put {by} {'plus' if sign > 0.0 else 'minus'} {names} in place of {names}"
            yield Mistake(text, edit, _zeroed(given, chosen, sign, zero), 2)


def _zeroed(given: Measurements, chosen: Sequence[int], sign: float, offset: float) -> Measurements:
    values = given.values.copy()
    values[:, chosen] = offset + sign * values[:, chosen]
    return replace(given, values=values)


def _offset(
    observation: Observation, errors: Array, chosen: Sequence[int], sign: float, starts: Sequence[float]
) -> float | None:
    """Return the zero of joints with which the readings are nearest to the robot, by the method of Gauss and Newton."""
    given, at = observation.measurements, [observation.input_columns.index(k) for k in chosen]
    tried = [
        (one, start) for start in starts if (one := _tried(observation, _zeroed(given, chosen, sign, start), errors))
    ]
    if not tried:
        return None
    best, offset = min(tried, key=lambda one: one[0].misfit)
    for _ in range(_ITERATIONS):
        here = best.observation.predict(best.observation.values)
        rest, slope = best.observation.residuals(here), here.by_inputs[:, :, at].sum(axis=2)
        weight = 1.0 / np.maximum(best.off, 1e-9)
        steps = np.where(np.isfinite(rest), rest, 0.0) * weight, slope * weight
        step = -float((steps[0] * steps[1]).sum() / max((steps[1] ** 2).sum(), 1e-300))
        other = _tried(observation, _zeroed(given, chosen, sign, offset + step), errors)
        if other is None or other.misfit >= best.misfit:
            break
        best, offset = other, offset + step
    return math.remainder(offset, 2.0 * math.pi) if given.quantities[chosen[0]].dimension is ANGLE else offset


def _frames(observation: Observation) -> Iterator[Mistake]:
    """Yield a device that stands elsewhere, a target beside a node's origin, and both."""
    given = observation.measurements
    own = [k for k in observation.outputs if given.quantities[k].kind in COORDINATES]
    at_world = [k for k in own if not given.quantities[k].device]
    at_origin = [k for k in own if not given.quantities[k].target]
    nodes = list(dict.fromkeys(given.quantities[k].of for k in at_origin))
    for device, target in ((True, False), (False, True), (True, True)):
        if (device and len(at_world) < 2) or (target and not at_origin):
            continue
        read = list(given.quantities)
        for k in at_world if device else ():
            read[k] = replace(read[k], device="tracker", name=f"{read[k].name} @ tracker")
        for k in at_origin if target else ():
            ball = "ball" if len(nodes) == 1 else f"ball{nodes.index(read[k].of) + 1}"
            head, _, tail = read[k].name.partition(f".{read[k].kind}")
            name = f"{head.partition('(')[0]}({ball}).{read[k].kind}{tail}"
            read[k] = replace(read[k], point=(0.0, 0.0, 0.0), target=ball, name=name)
        names = ", ".join(read[k].name for k in own)
        text = " and ".join(
            ["a device in a frame of its own"] * device + ["a target beside the node's origin"] * target
        )
        yield Mistake(
            f"with {text}", f"write {names}", replace(given, quantities=tuple(read)), _OF_FRAMES + (device and target)
        )


def _is_large(found: _Compared) -> bool:
    """Return whether frames are farther from where they were taken to be than the estimate may move them."""
    length, places = found.observation.design.mechanism.length, found.observation.frames.start.values()
    return not places or any(
        np.linalg.norm(pose[:3, 3]) > _MOVED * length or np.linalg.norm(pin.log3(pose[:3, :3])) > _TURNED
        for pose in places
    )


def _with_places(one: Mistake, found: _Compared) -> Mistake:
    """Return a mistake of frames with where these are."""
    frames = found.observation.frames
    if one.rank < _OF_FRAMES:
        return one
    places = []
    for name, pose in frames.start.items():
        turn = pin.log3(pose[:3, :3])
        angle = float(np.linalg.norm(turn))
        by = (
            f", turned by {shown(angle, ANGLE, 3)} about ({' '.join(f'{x:.2g}' for x in turn / angle)})"
            if angle > 1e-3
            else ""
        )
        places.append(f"{name} at ({' '.join(f'{1e3 * x:.4g}mm' for x in pose[:3, 3])}){by}")
    return one._replace(text=f"{one.text} ({'; '.join(places)})")
