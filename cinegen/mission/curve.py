"""A smooth curve through points: nowhere outside its neighbours, at rest at both ends, no faster than it may."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]

_AIM = 0.999  # part of a limit that what was too fast is slowed to: so few rounds do
_ROUNDING = 1e-9


class JointCurve:
    """Cubic between each two of its points, with the slopes of F. N. Fritsch and J. Butland ("A method for constructing
    local monotone piecewise cubic interpolants", SIAM J. Sci. Stat. Comput. 5, 1984) in between, and 0 at both ends:
    no value goes beyond those of the two points.

    Args:
        times: (k,) when it passes each point, s, ascending.
        points: (k, m).
    """

    def __init__(self, times: Array, points: Array) -> None:
        self.times, self.points = times, points
        self._slopes = np.zeros_like(points)
        if len(times) > 2:
            self._slopes[1:-1] = PchipInterpolator(times, points)(times[1:-1], 1)

    def at(self, times: Array) -> Array:
        """(n, m) values at times (n,)."""
        if len(self.times) == 1:
            return np.repeat(self.points, len(times), axis=0)
        i, h, x = self._segments(times)
        first, second = self.points[i], self.points[i + 1]
        slopes = h * (x * (1.0 - x) ** 2 * self._slopes[i] - x * x * (1.0 - x) * self._slopes[i + 1])
        part = x * x * (3.0 - 2.0 * x)
        return np.asarray(np.where(x == 1.0, second, first + part * (second - first) + slopes))

    def speeds(self, times: Array) -> Array:
        """(n, m) derivatives at times (n,)."""
        if len(self.times) == 1:
            return np.zeros((len(times), self.points.shape[1]))
        i, h, x = self._segments(times)
        mean = (self.points[i + 1] - self.points[i]) / h
        edges = (1.0 - x) * (1.0 - 3.0 * x) * self._slopes[i] + x * (3.0 * x - 2.0) * self._slopes[i + 1]
        return np.asarray(6.0 * x * (1.0 - x) * mean + edges)

    def _segments(self, times: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """The piece that each time is in, (n,), its length and the part of it that is gone, (n, 1) both."""
        i = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        h = self.times[i + 1] - self.times[i]
        x = np.clip((times - self.times[i]) / h, 0.0, 1.0)
        return i, h[:, None], x[:, None]

    @property
    def fastest(self) -> Array:
        """(k - 1, m) the greatest speed in each piece, exactly."""
        mean = np.diff(self.points, axis=0) / np.diff(self.times)[:, None]
        first, second = self._slopes[:-1], self._slopes[1:]
        a, b = 3.0 * (first + second - 2.0 * mean), 6.0 * mean - 4.0 * first - 2.0 * second  # a x^2 + b x + first
        with np.errstate(divide="ignore", invalid="ignore"):
            x = -b / (2.0 * a)
            turn = np.where((x > 0.0) & (x < 1.0), np.abs(first + 0.5 * b * x), 0.0)
        return np.asarray(np.maximum(np.maximum(np.abs(first), np.abs(second)), turn))


def slowed(times: Array, points: Array, limits: Array) -> Array:
    """When a curve passes its points if it is to be nowhere faster than it may: pieces that would be are stretched.

    No piece is faster than three times its mean speed, so this comes to an end.

    Args:
        times: (k,) when it would, s, ascending.
        points: (k, m).
        limits: (m,) of speed; infinite where there is none.

    Returns:
        (k,) s, from 0.
    """
    lengths = np.diff(times)
    while len(lengths):
        passes = np.concatenate([[0.0], np.cumsum(lengths)])
        over = (JointCurve(passes, points).fastest / limits).max(axis=1, initial=0.0)
        if over.max() <= 1.0 + _ROUNDING:
            return passes
        lengths = np.where(over > 1.0, lengths * over / _AIM, lengths)
    return np.zeros(1)
