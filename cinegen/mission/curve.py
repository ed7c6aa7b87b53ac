"""A smooth curve through points without overshoot, at rest at both ends, within velocity limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator, PPoly

Array = NDArray[np.float64]

_AIM = 0.999  # fraction of a limit to which fast segments are slowed, so that few iterations suffice
_ROUNDING = 1e-9


class JointCurve:
    """Piecewise cubic curve with the slopes of F. N. Fritsch and J. Butland ("A method for constructing
    local monotone piecewise cubic interpolants", SIAM J. Sci. Stat. Comput. 5, 1984) at inner points, and 0 at both
    ends: between two points no value is beyond theirs.

    Args:
        times: (k,) time of each point, s, ascending.
        points: (k, m) points.
    """

    def __init__(self, times: Array, points: Array) -> None:
        self.times, self.points = times, points
        if len(times) == 1:
            self._curve = PPoly(points[None], [times[0], times[0] + 1.0])
        else:
            slopes = np.zeros_like(points)
            if len(times) > 2:
                slopes[1:-1] = PchipInterpolator(times, points)(times[1:-1], 1)
            self._curve = CubicHermiteSpline(times, points, slopes)
        self._speed = self._curve.derivative()

    def at(self, times: Array) -> Array:
        """Return the values (n, m) at times (n,)."""
        return np.asarray(np.where(self._ended(times), self.points[-1], self._curve(times)))

    def speeds(self, times: Array) -> Array:
        """Return the derivatives (n, m) at times (n,)."""
        return np.asarray(np.where(self._ended(times), 0.0, self._speed(times)))

    def _ended(self, times: Array) -> Array:
        return np.asarray(times >= self.times[-1])[:, None]  # exact there, in spite of rounding

    @property
    def fastest(self) -> Array:
        """(k - 1, m) largest speed in each segment, exact."""
        a, b, c = self._speed.c  # a t^2 + b t + c
        end = np.diff(self.times)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            extreme = np.clip(np.nan_to_num(-b / (2.0 * a)), 0.0, end)
        return np.asarray(np.max([np.abs((a * t + b) * t + c) for t in (np.zeros_like(end), extreme, end)], axis=0))


def slowed(times: Array, points: Array, limits: Array) -> Array:
    """Return the times at which a curve starts its points within velocity limits: fast segments are stretched.

    The largest speed of a segment is at most three times its mean speed, so the iteration ends.

    Args:
        times: (k,) desired times, s, ascending.
        points: (k, m) points.
        limits: (m,) velocity limits; infinite where there is none.

    Returns:
        (k,) times, s, from 0.
    """
    lengths = np.diff(times)
    while len(lengths):
        starts = np.concatenate([[0.0], np.cumsum(lengths)])
        over = (JointCurve(starts, points).fastest / limits).max(axis=1, initial=0.0)
        if over.max() <= 1.0 + _ROUNDING:
            return starts
        lengths = np.where(over > 1.0, lengths * over / _AIM, lengths)
    return np.zeros(1)
