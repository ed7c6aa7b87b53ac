"""Motion along the path of a plan within limits of velocity, acceleration and jerk."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PPoly

from cinegen.arrays import Array, Indices
from cinegen.errors import ClosureError
from cinegen.model import Mechanism
from cinegen.model.motion_limits import MotionLimits, motion_limits
from cinegen.planning.clearance_barrier import is_clear
from cinegen.planning.planner import Plan
from cinegen.planning.timing import TimingError, averaged, averaging_window, excess, time_law
from raff2urdf.errors import counted

_COARSE = 0.1  # rad or characteristic lengths: between two control points where nothing is near
_FINE = 0.005  # the same, where the clearance needs it
_EQUAL = 1e-9  # rad or characteristic lengths
_ROUNDS = 20
_SLOWER = 1.001  # more than needed, so that few rounds suffice
_ROUNDING = 1e-9
_BLEND = np.array([[-1.0, 3.0, -3.0, 1.0], [3.0, -6.0, 3.0, 0.0], [-3.0, 0.0, 3.0, 0.0], [1.0, 4.0, 1.0, 0.0]]) / 6.0
"""Coefficients of a uniform cubic B-spline, highest power first, of each control point."""


@dataclass(frozen=True, eq=False)
class TimedPath:
    """Motion from rest to rest.

    Attributes:
        times: (n,) s, equally spaced from 0.
        q: (n, nq) configurations with closed loops.
        limits: limits that finite differences of the samples obey.
        follows: true if the motion stops at each configuration of the plan's path, because any smoother one would come
            too near to something.
    """

    times: Array
    q: Array
    limits: MotionLimits
    follows: bool

    def __repr__(self) -> str:
        return f"<TimedPath: {self.times[-1]:.3f} s, {counted(len(self.times), 'sample')}>"


def timed_path(
    plan: Plan,
    rate: float = 100.0,
    acceleration: float | Mapping[str, float] | None = None,
    jerk: float | Mapping[str, float] | None = None,
) -> TimedPath:
    """Return the fastest motion along a plan's path within limits (`motion_limits`), from rest to rest.

    The path is rounded by a cubic B-spline, whose control points are on it. The clearance of the samples, joints
    straight between them, is bounded by the same method as that of the plan, and the meshes are checked: where the
    curve comes nearer to anything than the safety distance, or than the path itself does, there are more control
    points.

    Args:
        plan: plan whose path has two configurations at least.
        rate: samples per second.
        acceleration: limits of acceleration, rad/s^2 and m/s^2: one number, or by joint name; defaults unless given.
        jerk: limits of jerk, rad/s^3 and m/s^3, likewise; unlimited unless given.

    Raises:
        UnknownNameError: no such joint.
        CinegenError: a limit is not positive.
        MissingExtraError: toppra is not installed.
        TimingError: there is no such motion.
    """
    mechanism = plan.scene.mechanism
    limits = motion_limits(mechanism, acceleration, jerk)
    required = min(plan.scene.safety, plan.clearance)
    path = _evenly(mechanism, plan.path, _FINE)
    chosen = np.unique(
        np.linspace(0, len(path) - 1, math.ceil(len(path) * _FINE / _COARSE) + 1).round().astype(np.intp)
    )
    while True:
        try:
            q, s = _samples(mechanism, limits, rate, *_rounded(mechanism, path[chosen]))
            near = _too_near(plan, q, required)
        except ClosureError:
            s, near = np.arange(len(chosen) - 1.0), np.arange(len(chosen) - 1)
        if not len(near):
            return TimedPath(np.arange(len(q)) / rate, q, limits, False)
        intervals = np.unique(np.clip(np.add.outer(s[near].astype(np.intp), [-1, 0, 1]), 0, len(chosen) - 2))
        more = np.union1d(chosen, (chosen[intervals] + chosen[intervals + 1]) // 2)
        if len(more) == len(chosen):
            break
        chosen = more
    q, _ = _samples(mechanism, limits, rate, *_stopping(mechanism, limits, _thinned(mechanism, plan.path)))
    return TimedPath(np.arange(len(q)) / rate, q, limits, True)


def _evenly(mechanism: Mechanism, path: Array, step: float) -> Array:
    """Return configurations (k, nq) at equal distances along a path, at most `step` apart, from its first to its last.

    Args:
        mechanism: measures distances (`Mechanism.distance`).
        path: (n, nq) configurations, between which the joints move straight.
        step: rad or characteristic lengths.
    """
    lengths = np.array([mechanism.distance(a, b) for a, b in pairwise(path)])
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    configurations = []
    for position in np.linspace(0.0, along[-1], math.ceil(along[-1] / step) + 3)[:-1]:
        i = int(np.searchsorted(along, position, side="right")) - 1
        configurations.append(mechanism.interpolate(path[i], path[i + 1], (position - along[i]) / lengths[i]))
    return np.array([*configurations, path[-1]])


def _thinned(mechanism: Mechanism, path: Array) -> Array:
    """Return a path (n, nq) without configurations that are equal to the one before."""
    moves = np.array([True, *(mechanism.distance(a, b) > _EQUAL for a, b in pairwise(path))])
    return np.asarray(path[moves])


def _steps(mechanism: Mechanism, points: Array) -> Array:
    """Return the motion (n - 1, nv) from each point (n, nq) to the next."""
    return np.array([mechanism.difference(a, b) for a, b in pairwise(points)])


def _rounded(mechanism: Mechanism, points: Array) -> tuple[PPoly, Callable[[float], Array]]:
    """Return a uniform cubic B-spline with control points (n, nq), through the first and the last one: its coordinates
    (nv,), which add up the motions from point to point, and the configuration (nq,) at a parameter from 0 to n - 1.

    Of joints with rotations in space it is cumulative: M.-J. Kim, M.-S. Kim and S. Y. Shin, "A general construction
    scheme for unit quaternion curves with simple high order derivatives", SIGGRAPH 1995.
    """
    steps = _steps(mechanism, points)
    steps = np.vstack([steps[:1], steps, steps[-1:]])
    x = np.cumsum(np.vstack([np.zeros_like(steps[:1]), steps]), axis=0)
    pieces = len(points) - 1
    coefficients = np.array([sum(row[k] * x[k : k + pieces] for k in range(4)) for row in _BLEND])
    first = mechanism.integrate(points[0], -steps[0])

    def at(s: float) -> Array:
        i = min(int(s), pieces - 1)
        t = s - i
        q = first if i == 0 else points[i - 1]
        parts = ((5.0 + t * (3.0 + t * (-3.0 + t))) / 6.0, (1.0 + t * (3.0 + t * (3.0 - 2.0 * t))) / 6.0, t**3 / 6.0)
        for part, step in zip(parts, steps[i : i + 3], strict=True):
            q = mechanism.integrate(q, part * step)
        return q

    return PPoly(coefficients, np.arange(pieces + 1.0)), at


def _stopping(mechanism: Mechanism, limits: MotionLimits, points: Array) -> tuple[PPoly, Callable[[float], Array]]:
    """Return a curve straight from point (n, nq) to point, at rest at each of them; see `_rounded`."""
    steps = _steps(mechanism, points)
    x = np.cumsum(np.vstack([np.zeros_like(steps[:1]), steps]), axis=0)
    seconds = np.sqrt((np.abs(steps) / limits.acceleration).max(axis=1)) + (np.abs(steps) / limits.velocity).max(axis=1)
    knots = np.concatenate([[0.0], np.cumsum(seconds)])

    def at(s: float) -> Array:
        i = int(np.clip(np.searchsorted(knots, s, side="right") - 1, 0, len(steps) - 1))
        t = (s - knots[i]) / seconds[i]
        return mechanism.integrate(points[i], t * t * (3.0 - 2.0 * t) * steps[i])

    return CubicHermiteSpline(knots, x, np.zeros_like(x)), at


def _samples(
    mechanism: Mechanism, limits: MotionLimits, rate: float, curve: PPoly, at: Callable[[float], Array]
) -> tuple[Array, Array]:
    """Return samples (n, nq) of the fastest motion along a curve, with closed loops, and their parameters (n,).

    Raises:
        ClosureError: loops can't be closed somewhere on the curve.
    """
    limited = np.isfinite(limits.velocity) | np.isfinite(limits.acceleration)
    columns = PPoly(curve.c[:, :, limited], curve.x)
    law = time_law(columns, limits.velocity[limited], limits.acceleration[limited])
    window = averaging_window(limits, rate)
    for _ in range(_ROUNDS):
        times = np.arange(math.ceil(law.seconds * rate - _ROUNDING) + 1) / rate
        s, _ = law.at(times)
        q = averaged(np.array([at(parameter) for parameter in s.tolist()]), window)
        if window > 1:
            q, s = np.array([mechanism.structure.normalized(row) for row in q]), averaged(s[:, None], window)[:, 0]
        q = np.array([_closed(mechanism, row) for row in q]) if mechanism.is_constrained else q
        slower = excess(mechanism, limits, q, rate)
        if slower <= 1.0 + _ROUNDING:
            return q, s
        law = law.slowed(slower * _SLOWER)
    raise TimingError(f"{mechanism.name}: a passive joint exceeds its limits however slow the motion is")


def _closed(mechanism: Mechanism, q: Array) -> Array:
    """Return a configuration with closed loops, with its actuated joints if possible."""
    try:
        return mechanism.close(q, mechanism.actuated)
    except ClosureError:
        return mechanism.close(q)


def _too_near(plan: Plan, q: Array, required: float) -> Indices:
    """Return the samples of q (n, nq) at or after which anything comes nearer than required (m), or meshes touch."""
    clearance = plan._clearance
    near = [
        i
        for i, (a, b) in enumerate(pairwise(q))
        if min(clearance.least(a), clearance.least(b)) < required or not is_clear(clearance, a, b, required)
    ]
    contact = None if near else plan.mesh_check.first_contact(q)
    return np.array(near if contact is None else [max(contact.index, 0)], dtype=np.intp)
