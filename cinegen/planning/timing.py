"""Time-optimal motion along a path within limits of velocity, acceleration and torque: TOPP-RA.

H. Pham and Q.-C. Pham, "A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis", IEEE
Trans. Robotics 34, 2018.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import PPoly

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError
from cinegen.model import Mechanism
from cinegen.model.motion_limits import MotionLimits
from cinegen.planning.torque_limits import TorqueTerms
from raff2urdf.command.extras import needs

_EXTRA = "sampling"
_INSIDE = 1.0 - 1e-9  # of a limit
_MOST = 50.0  # times the usual rate, where nothing limits it
_REST = 1e-9  # of the largest tangent: a curve whose tangent at an end is less is at rest there, up to rounding
_INTERVALS = 64  # of a whole grid, at least


class TimingError(CinegenError):
    """A path can't be timed."""


@dataclass(frozen=True, eq=False)
class TimeLaw:
    """Parameter s of a path as a function of time; its second derivative is constant between two knots.

    Attributes:
        times: (n,) time of each knot, s, ascending from 0.
        s: (n,) parameter at each knot.
        rates: (n,) its derivative at each knot, 1/s.
    """

    times: Array
    s: Array
    rates: Array

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return float(self.times[-1])

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return the parameter (k,) and its derivative (k,) at times (k,), s; at rest beyond both ends."""
        if len(self.times) == 1:
            return np.full(len(times), self.s[0]), np.zeros(len(times))
        i = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        lengths, rates = np.diff(self.times), np.diff(self.rates)
        after = np.clip(times - self.times[i], 0.0, lengths[i])
        growth = rates[i] / lengths[i]
        s = np.minimum(self.s[i] + (self.rates[i] + 0.5 * growth * after) * after, self.s[i + 1])
        moves = (times >= 0.0) & (times < self.times[-1])
        return np.where(times >= self.times[-1], self.s[-1], s), np.where(moves, self.rates[i] + growth * after, 0.0)

    def slowed(self, factor: float) -> TimeLaw:
        """Return the same motion, slower by a factor."""
        return TimeLaw(self.times * factor, self.s, self.rates / factor)


def time_law(
    curve: PPoly,
    velocity: Array,
    acceleration: Array,
    grid: Array | None = None,
    fastest: float = np.inf,
    torques: TorqueTerms | None = None,
) -> TimeLaw:
    """Return the fastest motion along a curve within limits, from rest to rest.

    TOPP-RA bounds accelerations at both ends and in the middle of each interval of the grid. Their exact maxima in
    between are then computed in closed form, and the whole motion is slowed down by what they exceed a limit: nowhere
    on the curve is a velocity or an acceleration above its limit. Torques are bounded at these three points only.

    Args:
        curve: cubic curve of (m,) values with continuous slopes.
        velocity: (m,) limits of velocity; infinite where there is none.
        acceleration: (m,) limits of acceleration; likewise.
        grid: (n,) ascending parameters between which the acceleration of the parameter is constant, among them all
            breakpoints of the curve; `grid_of(curve.x)` unless given.
        fastest: limit of the parameter's rate, 1/s.
        torques: (3, n - 1, joints) at the beginning, in the middle and at the end of each interval of the grid,
            relative to their limits; unlimited unless given. If the motion needs a speed (`TorqueTerms.has_pace`),
            it is not slowed down, but timed again within tighter limits.

    Raises:
        MissingExtraError: toppra is not installed.
        TimingError: toppra finds no motion.
    """
    s = grid_of(curve.x) if grid is None else grid
    tangents, bends = derivatives(curve, s)
    tighter = 1.0
    while True:
        limits = velocity / tighter, acceleration / tighter**2
        rates = _fastest_rates(s, tangents, bends, *limits, fastest, torques)
        times = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(s) / (rates[1:] + rates[:-1]))])
        law = TimeLaw(times, s, rates)
        slower = _excess(law, tangents, bends, velocity, acceleration) / _INSIDE
        if torques is None or not torques.has_pace:
            return law.slowed(slower)
        if slower <= 1.0 / _INSIDE:
            return law
        tighter *= 1.001 * slower


def grid_of(s: Array, counts: ArrayLike = 1) -> Array:
    """Return a grid (n,): each interval of s (k,) cut into a number of equal parts (k - 1,), or into more where these
    would be few altogether."""
    parts = np.broadcast_to(np.maximum(counts, math.ceil(_INTERVALS / (len(s) - 1))), len(s) - 1)
    cut = [begin + (end - begin) * np.arange(n) / n for begin, end, n in zip(s[:-1], s[1:], parts, strict=True)]
    return np.concatenate([*cut, s[-1:]])


def derivatives(curve: PPoly, s: Array) -> tuple[Array, Array]:
    """Return the first and second derivatives (3, n - 1, m) of a curve at the beginning, in the middle and at the end
    of each interval of parameters s (n,), with the polynomial of that interval."""
    inner = 0.5 * (s[1:] + s[:-1])
    piece = np.clip(np.searchsorted(curve.x, inner, side="right") - 1, 0, len(curve.x) - 2)
    coefficients = curve.c[:, piece]
    order = len(coefficients) - 1
    first, second = [], []
    for points in (s[:-1], inner, s[1:]):
        t = (points - curve.x[piece])[:, None]
        first.append(sum((order - k) * coefficients[k] * t ** (order - k - 1) for k in range(order)))
        second.append(
            sum((order - k) * (order - k - 1) * coefficients[k] * t ** (order - k - 2) for k in range(order - 1))
        )
    return np.array(first), np.array(second)


def _fastest_rates(
    s: Array,
    tangents: Array,
    bends: Array,
    velocity: Array,
    acceleration: Array,
    fastest: float,
    torques: TorqueTerms | None,
) -> Array:
    """Return the rate (n,) at each parameter by TOPP-RA."""
    with needs(_EXTRA, "times of a motion"):
        from cinegen.planning.toppra_rates import LimitedQuantities, fastest_rates

    most = _velocity_bound(tangents, velocity, fastest)
    known = most[np.isfinite(most)]
    unit = float(np.median(known)) if len(known) else 1.0  # relative to it rates are near 1, as toppra's should be
    tangents, bends = unit * tangents, unit**2 * bends
    limited = np.isfinite(acceleration)
    first, second = (slopes[:, :, limited] / acceleration[limited] for slopes in (tangents, bends))
    constant, weights, drag = np.zeros_like(first), np.ones_like(first), np.zeros_like(first)
    if torques is not None:
        first = np.dstack([first, unit * torques.inertial])
        second = np.dstack([second, unit**2 * torques.centrifugal])
        constant = np.dstack([constant, torques.static + torques.dry])
        drag = np.dstack([drag, unit * torques.viscous])
        weights = np.dstack([weights, np.broadcast_to(torques.weight[..., None], torques.static.shape)])
    still = _REST * np.abs(tangents).max(initial=0.0)
    moves_at_ends = [np.abs(tangent).max(initial=0.0) > still for tangent in (tangents[0][0], tangents[2][-1])]
    quantities = LimitedQuantities(first, second, drag, constant, weights)
    rates = fastest_rates(quantities, s / unit, np.minimum(most / unit, _MOST), moves_at_ends, tangents.shape[2])
    if rates is None:
        kinds = "velocity and acceleration" if torques is None else "velocity, acceleration and torque"
        raise TimingError(f"no motion along the path is within the limits of {kinds}")
    return np.asarray(unit * rates)


def _velocity_bound(tangents: Array, velocity: Array, fastest: float) -> Array:
    """Return the largest rate ds/dt (n,) at each parameter s, and in the intervals on both sides of it, within the
    limits of velocity, |dq/ds| ds/dt <= velocity.

    Args:
        tangents: (3, n - 1, nv) dq/ds at the beginning, in the middle and at the end of each interval.
        velocity: (nv,) limits, rad/s and m/s.
        fastest: largest rate where nothing moves.
    """
    at_knots = np.abs(np.vstack([tangents[0], tangents[2][-1:]]))
    with np.errstate(divide="ignore", invalid="ignore"):
        most = np.where(at_knots > 0.0, velocity / at_knots, np.inf).min(axis=1, initial=fastest)
        middle = np.where(tangents[1] != 0.0, velocity / np.abs(tangents[1]), np.inf).min(axis=1, initial=fastest)
    most[:-1], most[1:] = np.minimum(most[:-1], middle), np.minimum(most[1:], middle)
    return np.asarray(most)


def _excess(law: TimeLaw, tangents: Array, bends: Array, velocity: Array, acceleration: Array) -> float:
    """Return the factor by which a motion must be slowed down, at least 1: its exact largest velocities and
    accelerations relative to their limits.

    In an interval of x in [0, 1] the acceleration is quadratic in x, and the velocity extreme where that is 0.
    """
    step = np.diff(law.s)[:, None]
    squares = law.rates**2
    growth = (np.diff(squares)[:, None]) / (2.0 * step)
    start = squares[:-1, None]
    # tangent(x) = t0 + t1 x + t2 x^2, bend(x) = b0 + b1 x
    t0, middle, end = tangents
    t2 = 2.0 * (end + t0 - 2.0 * middle)
    t1 = end - t0 - t2
    b0, b1 = bends[0], bends[2] - bends[0]
    rise = 2.0 * step * growth
    c0 = t0 * growth + b0 * start
    c1 = t1 * growth + b1 * start + b0 * rise
    c2 = t2 * growth + b1 * rise
    with np.errstate(divide="ignore", invalid="ignore"):
        turning = np.clip(np.nan_to_num(-c1 / (2.0 * c2), posinf=0.0, neginf=0.0), 0.0, 1.0)
        root = np.sqrt(np.maximum(c1 * c1 - 4.0 * c2 * c0, 0.0))
        q = -0.5 * (c1 + np.where(c1 < 0.0, -root, root))
        roots = [np.clip(np.nan_to_num(r, posinf=0.0, neginf=0.0), 0.0, 1.0) for r in (q / c2, c0 / q)]
        largest = max(
            float((np.abs((c2 * x + c1) * x + c0) / acceleration).max(initial=0.0))
            for x in (np.zeros_like(c0), turning, np.ones_like(c0))
        )
        speed = max(
            float(
                (np.abs((t2 * x + t1) * x + t0) * np.sqrt(np.maximum(start + rise * x, 0.0)) / velocity).max(
                    initial=0.0
                )
            )
            for x in (np.zeros_like(c0), *roots, np.ones_like(c0))
        )
    return max(1.0, speed, float(np.sqrt(largest)))


def averaged(samples: Array, count: int) -> Array:
    """Return moving averages (n + count - 1, m) of samples (n, m) of a motion from rest to rest.

    Velocities and accelerations are averages, too, hence within the same limits. The jerk is at most twice the largest
    acceleration over the duration of `count` samples (L. Biagiotti and C. Melchiorri, "FIR filters for online
    trajectory planning with time- and frequency-domain specifications", Control Engineering Practice 20, 2012).
    """
    if count == 1:
        return samples
    begin, end = (np.repeat(rest, count - 1, axis=0) for rest in (samples[:1], samples[-1:]))
    sums = np.cumsum(np.vstack([np.zeros_like(samples[:1]), begin, samples, end]), axis=0)
    return np.asarray((sums[count:] - sums[:-count]) / count)


def averaging_window(limits: MotionLimits, rate: float) -> int:
    """Return the number of samples at a rate (1/s) whose average keeps jerks within their limits; 1 without limits."""
    limited = np.isfinite(limits.jerk) & np.isfinite(limits.acceleration)
    seconds = float((2.0 * limits.acceleration[limited] / limits.jerk[limited]).max(initial=0.0))
    return max(1, math.ceil(seconds * rate - 1e-9))


def excess(mechanism: Mechanism, limits: MotionLimits, q: Array, rate: float) -> float:
    """Return the factor by which samples (n, nq) of a motion from rest to rest, `rate` a second, must be slower so that
    their finite differences obey all limits; at most 1 if they do."""
    at_q, at_v = mechanism.structure.scalar_joints
    steps = np.zeros((max(len(q) - 1, 0), mechanism.model.nv))
    if len(at_v) < mechanism.model.nv:
        for i, (a, b) in enumerate(pairwise(q)):
            steps[i] = mechanism.difference(a, b)
    steps[:, at_v] = np.diff(q[:, at_q], axis=0)
    rest, factor = np.zeros((1, steps.shape[1])), 0.0
    for order, limit in enumerate((limits.velocity, limits.acceleration, limits.jerk), 1):
        most = float((np.abs(steps) * rate**order / limit).max(initial=0.0))
        factor = max(factor, most ** (1.0 / order))
        steps = np.diff(np.vstack([rest, steps, rest]), axis=0)
    return factor
