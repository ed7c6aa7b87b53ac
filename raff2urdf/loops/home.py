"""A home configuration: all loops closed, all joints within their limits, near to the configuration as written."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.bounds import JointBounds
from raff2urdf.closure import LoopSystem, close
from raff2urdf.errors import first_of

_STARTS = 8  # random configurations within limits at which closing begins
_ATTEMPTS = 10  # to draw home nearer to what is written
_LITTLE = 0.05  # part of a distance: a smaller gain is followed by a shorter attempt
_ENOUGH = 3  # closed configurations within limits of which the nearest is taken
_NEAR = 1e-6  # rad or lengths: joints that are so near to a limit are put on it
_LISTED = 8  # joints that are named


def close_within(
    system: LoopSystem,
    written: Array,
    closed: Array,
    lower: Array,
    upper: Array,
    columns: Mapping[int, int] | None = None,
) -> Array:
    """Return a closed configuration within the limits, near to the one as written; `closed` itself where none is found.

    Loops are closed by bounded least squares, first from `written` and `closed` with all joints put within their
    limits; where that fails, from the middles of the limits and from random configurations within them. What is found
    there is drawn towards the configuration as written, as far as the limits allow.

    Args:
        system: the loops.
        written: (nq,) the configuration as written; loops may be open.
        closed: (nq,) a closed configuration.
        lower: (nq,) least values; -inf where there is none.
        upper: (nq,) greatest values; inf where there is none.
        columns: of each index in q that has limits the index in v; the same unless given.
    """
    bounds = _bounds(system, closed, lower, upper, columns)
    if bounds.contain(closed):
        return closed
    solutions, starts = list[Array](), [bounds.clipped(written), bounds.clipped(closed)]
    for i, start in enumerate((*starts, *bounds.samples(written, _STARTS))):
        if len(solutions) == _ENOUGH or (solutions and i == len(starts)):
            break
        closing = close(system, start, bounds=bounds)
        solutions += [closing.q] if closing.closed else []
    nearest = min(solutions, key=lambda q: bounds.distance(q, written), default=None)
    return closed if nearest is None else _drawn(system, nearest, written, bounds)


def _bounds(system: LoopSystem, q: Array, lower: Array, upper: Array, columns: Mapping[int, int] | None) -> JointBounds:
    at = np.arange(len(q)) if columns is None else np.array(list(columns), dtype=np.intp)
    moved = at if columns is None else np.array(list(columns.values()), dtype=np.intp)
    unit = system.integrate(q, np.ones(system.evaluate(q)[1].shape[1])) - q
    return JointBounds(at, moved, lower[at], upper[at], unit[at])


def _drawn(system: LoopSystem, q: Array, written: Array, bounds: JointBounds) -> Array:
    """Return the closed q (nq,), moved towards the configuration as written while loops close within the limits."""
    part, step = 1.0, np.zeros(system.evaluate(q)[1].shape[1])
    for _ in range(_ATTEMPTS):
        step[bounds.columns] = part * (written[bounds.at] - q[bounds.at]) / bounds.scale
        closing = close(system, bounds.clipped(system.integrate(q, step)), bounds=bounds)
        gained = bounds.distance(q, written) - bounds.distance(closing.q, written)
        if closing.closed and gained > 0.0:
            q = closing.q
        if not closing.closed or gained < _LITTLE * bounds.distance(q, written):
            part *= 0.5
    return _on_limits(system, q, bounds)


def _on_limits(system: LoopSystem, q: Array, bounds: JointBounds) -> Array:
    """Return the closed q (nq,) with joints that are at a limit but for rounding exactly there, if loops close so."""
    free, snapped = np.ones(system.evaluate(q)[1].shape[1], dtype=bool), q.copy()
    for limit in (bounds.lower, bounds.upper):
        near = np.abs(q[bounds.at] - limit) < _NEAR * bounds.scale
        snapped[bounds.at[near]] = limit[near]
        free[bounds.columns[near]] = False
    closing = close(system, snapped, free)
    return closing.q if closing.closed and bounds.contain(closing.q) else q


class Beyond(NamedTuple):
    """A joint beyond a limit: its name, its value and the limit, rad or m."""

    joint: str
    prismatic: bool
    value: float
    limit: float

    def __str__(self) -> str:
        unit, scale = ("mm", 1e3) if self.prismatic else ("deg", math.degrees(1.0))
        return f"{self.joint} ({scale * self.value:.4g} {unit}, limit {scale * self.limit:.4g})"


def outside(beyond: Sequence[Beyond]) -> str:
    """Return the text of a warning: no home within all limits was found."""
    what = "no configuration was found that closes all loops within all limits: home is outside those of"
    return f"{what} {first_of(beyond, _LISTED)}: change these limits, or the dimensions"


def moved_within(beyond: Sequence[Beyond]) -> str:
    """Return the text of a note: home was moved to where all joints are within their limits."""
    what = "home was moved to where all joints are within their limits; as written, beyond are"
    return f"{what} {first_of(beyond, _LISTED)}"
