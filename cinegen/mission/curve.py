"""A smooth curve through points without overshoot, at rest at both ends, within velocity limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

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
        self._slopes = np.zeros_like(points)
        if len(times) > 2:
            self._slopes[1:-1] = PchipInterpolator(times, points)(times[1:-1], 1)

    def at(self, times: Array) -> Array:
        """Return the values (n, m) at times (n,)."""
        if len(self.times) == 1:
            return np.repeat(self.points, len(times), axis=0)
        i, h, x = self._segments(times)
        first, second = self.points[i], self.points[i + 1]
        slopes = h * (x * (1.0 - x) ** 2 * self._slopes[i] - x * x * (1.0 - x) * self._slopes[i + 1])
        part = x * x * (3.0 - 2.0 * x)
        return np.asarray(np.where(x == 1.0, second, first + part * (second - first) + slopes))

    def speeds(self, times: Array) -> Array:
        """Return the derivatives (n, m) at times (n,)."""
        if len(self.times) == 1:
            return np.zeros((len(times), self.points.shape[1]))
        i, h, x = self._segments(times)
        mean = (self.points[i + 1] - self.points[i]) / h
        edges = (1.0 - x) * (1.0 - 3.0 * x) * self._slopes[i] + x * (3.0 * x - 2.0) * self._slopes[i + 1]
        return np.asarray(6.0 * x * (1.0 - x) * mean + edges)

    def _segments(self, times: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Return the segment of each time, (n,), its length and the elapsed fraction, both (n, 1)."""
        i = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        h = self.times[i + 1] - self.times[i]
        x = np.clip((times - self.times[i]) / h, 0.0, 1.0)
        return i, h[:, None], x[:, None]

    @property
    def fastest(self) -> Array:
        """(k - 1, m) largest speed in each segment, exact."""
        mean = np.diff(self.points, axis=0) / np.diff(self.times)[:, None]
        first, second = self._slopes[:-1], self._slopes[1:]
        a, b = 3.0 * (first + second - 2.0 * mean), 6.0 * mean - 4.0 * first - 2.0 * second  # a x^2 + b x + first
        with np.errstate(divide="ignore", invalid="ignore"):
            x = -b / (2.0 * a)
            inner = np.where((x > 0.0) & (x < 1.0), np.abs(first + 0.5 * b * x), 0.0)
        return np.asarray(np.maximum(np.maximum(np.abs(first), np.abs(second)), inner))


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
