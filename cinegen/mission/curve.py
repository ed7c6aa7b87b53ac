"""A smooth curve through points without overshoot, at rest at both ends."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator, PPoly

from cinegen.arrays import Array


def curve_through(s: Array, points: Array) -> PPoly:
    """Return a piecewise cubic curve with the slopes of F. N. Fritsch and J. Butland ("A method for constructing local
    monotone piecewise cubic interpolants", SIAM J. Sci. Stat. Comput. 5, 1984) at inner points, and 0 at both ends:
    between two points no value is beyond theirs.

    Args:
        s: (k,) parameter of each point, ascending; two at least.
        points: (k, m) points.
    """
    slopes = np.zeros_like(points)
    if len(s) > 2:
        slopes[1:-1] = PchipInterpolator(s, points)(s[1:-1], 1)
    return CubicHermiteSpline(s, points, slopes)
