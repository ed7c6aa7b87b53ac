"""Shorter paths: shortcuts between points of a path, each along a motion that keeps the safety distance everywhere."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance
from cinegen.model import Mechanism
from cinegen.planning.clear_motion import clear_motion
from cinegen.planning.path_constraints import Projection

_TRIALS = 300  # random shortcuts
_DECADES = 2.0  # of the lengths of those about a corner
_WINDOW = 50  # of them that are compared
_STAGNANT = 0.002  # of the length: less gained by so many ends the search
_SAME = 1e-9  # rad or characteristic lengths between configurations that coincide
_GAIN = 1e-3  # of the length of what a shortcut replaces, at least


def shortened(
    clearance: Clearance,
    path: Array,
    safety: float,
    seed: int = 0,
    deadline: float = math.inf,
    project: Projection | None = None,
    metric: Array | None = None,
) -> Array | None:
    """Return a shorter path between the same ends, by shortcuts: joints straight, or with loops as `clear_motion` moves
    them.

    First between configurations of the path, the ends before what is in between; then between random points, of the
    whole path and about its corners (R. Geraerts and M. H. Overmars, "Creating high-quality paths for motion planning",
    IJRR 26(8), 2007), as long as they gain something.

    Args:
        clearance: distances of the mechanism.
        path: (n, nq) configurations, loops closed.
        safety: distance that is kept, m.
        seed: seed of the random points.
        deadline: value of `time.monotonic` at which no further shortcut is tried, s.
        project: projection onto constraints along the path, as of `clear_motion`.
        metric: (nv,) motion of each joint that has length 1; the mechanism's `scale` by default.

    Returns:
        (m, nq), joints straight in between; with loops or constraints, as fine as `clear_motion` returns motions. None
        if a part of the path itself does not keep the distance.
    """
    mechanism = clearance.mechanism
    metric = mechanism.scale if metric is None else metric
    is_curved = mechanism.is_constrained or project is not None

    def clear(begin: Array, end: Array) -> Array | None:
        motion = clear_motion(clearance, begin, end, safety, project=project)
        return motion if motion is None or is_curved else motion[[0, -1]]

    shorter = _pruned(clear, path, deadline)
    if shorter is None:
        return None
    rng, totals = np.random.default_rng(seed), list[float]()
    for trial in range(_TRIALS if len(shorter) > 1 else 0):
        lengths = np.array([_distance(mechanism, *ends, metric) for ends in pairwise(shorter)])
        bounds = np.concatenate([[0.0], np.cumsum(lengths)])
        totals.append(float(bounds[-1]))
        if trial >= _WINDOW and totals[-1 - _WINDOW] - totals[-1] < _STAGNANT * totals[-1]:
            break
        if time.monotonic() >= deadline:
            break
        parts = bounds[-1] * np.sort(rng.random(2))
        if trial % 2:  # about a corner
            width = bounds[-1] * rng.random(2) * 10.0 ** rng.uniform(-_DECADES, 0.0)
            parts = np.clip(bounds[rng.integers(len(bounds))] + width * [-1.0, 1.0], 0.0, bounds[-1])
        (first, begin), (last, end) = (_at(mechanism, shorter, bounds, part, is_curved) for part in parts)
        longest = (1.0 - _GAIN) * (parts[1] - parts[0])
        if first == last or _distance(mechanism, begin, end, metric) > longest:
            continue
        motion = clear(begin, end)
        if motion is None or path_length(mechanism, motion, metric) > longest:
            continue
        shorter = _distinct(mechanism, np.vstack([shorter[: first + 1], motion, shorter[last + 1 :]]))
    return shorter


def _pruned(clear: Callable[[Array, Array], Array | None], path: Array, deadline: float) -> Array | None:
    """Return the motion between the ends of a path if it is clear, else those of both halves, one after the other."""
    if len(path) == 1:
        return path
    if len(path) == 2 or time.monotonic() < deadline:
        motion = clear(path[0], path[-1])
        if motion is not None or len(path) == 2:
            return motion
    half = len(path) // 2
    before = _pruned(clear, path[: half + 1], deadline)
    after = None if before is None else _pruned(clear, path[half:], deadline)
    return None if before is None or after is None else np.vstack([before, after[1:]])


def _at(mechanism: Mechanism, path: Array, bounds: Array, length: float, is_curved: bool) -> tuple[int, Array]:
    """Return the index of the configuration before a length of a path, and the point there.

    Args:
        mechanism: robot.
        path: (n, nq)
        bounds: (n,) lengths to its configurations.
        length: 0 to the last of these.
        is_curved: whether that configuration is returned: with loops or constraints, which hold at configurations.
    """
    index = min(int(np.searchsorted(bounds, length, "right")), len(path) - 1) - 1
    if is_curved:
        return index, path[index]
    part = (length - bounds[index]) / max(bounds[index + 1] - bounds[index], 1e-12)
    return index, mechanism.interpolate(path[index], path[index + 1], part)


def _distinct(mechanism: Mechanism, path: Array) -> Array:
    """Return a path without configurations that coincide with the one before, or with its end."""
    different = [_distance(mechanism, *ends, mechanism.scale) > _SAME for ends in pairwise(path[:-1])]
    kept = [i for i, is_new in enumerate([True, *different]) if is_new]
    while len(kept) > 1 and _distance(mechanism, path[kept[-1]], path[-1], mechanism.scale) <= _SAME:
        kept.pop()
    return path[[*kept, len(path) - 1]]


def path_length(mechanism: Mechanism, path: Array, metric: Array | None = None) -> float:
    """Return the length of a path (n, nq), joints straight in between: in a metric as of `shortened`, or in rad and
    characteristic lengths."""
    metric = mechanism.scale if metric is None else metric
    return sum(_distance(mechanism, *ends, metric) for ends in pairwise(path))


def _distance(mechanism: Mechanism, begin: Array, end: Array, metric: Array) -> float:
    """Return the length of a straight motion between two configurations in a metric."""
    return float(np.linalg.norm(mechanism.difference(begin, end) / metric))
