"""How far to go along a direction: "a line search procedure may be included to better convergence, naturally preventing
oscillations about the minimum point" (De Medio and Oriolo 1991, after equation 1).

It needs a function that falls along the way. A vortex has none: where one turns the robot, steps are bounded otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

_ARMIJO = 1e-4  # part of the fall that the slope promises, with which a step is content
_LEAST = 0.1  # of a step that was too long, what is tried next at least; at most it is a good half, the parabola's
_ROUNDS = 50  # at most: 2^-50 of the first step is none


def exact_step(error: ArrayLike, motion: ArrayLike) -> float:
    """The t that makes |e + t v| smallest: -e.v / v.v, and 0 where nothing moves.

    With v = J dq, it is the best step of the paraboloid along dq as far as the robot moves straight: exactly for a
    point, to first order for an arm.

    Args:
        error: (3,) e = p - p_G, m.
        motion: (3,) v, how the point moves for t = 1, m.
    """
    e, v = np.asarray(error, dtype=float), np.asarray(motion, dtype=float)
    square = float(v @ v)
    return -float(e @ v) / square if square > 0.0 else 0.0


def line_search(function: Callable[[float], float], slope: float, longest: float) -> float:
    """A step in [0, longest] at which a function of one variable has fallen well: backtracking to the lowest point of
    the parabola through what is known (J. Nocedal and S. J. Wright, Numerical Optimization, 2nd ed., Springer 2006,
    section 3.5). Of a parabola it finds the minimum, to 1e-4 of the step.

    Args:
        function: of the step; may be infinite or nan where it is not defined, at contact say, but not at 0.
        slope: its derivative at 0.
        longest: the longest step allowed.

    Returns:
        the step; 0 where the slope does not fall, or no step leads down.
    """
    if not slope < 0.0:
        return 0.0
    start, step = function(0.0), longest
    for _ in range(_ROUNDS):
        value = function(step)
        bend = value - start - slope * step
        lowest = -slope * step * step / (2.0 * bend) if math.isfinite(bend) and bend > 0.0 else math.nan
        if value <= start + _ARMIJO * slope * step:
            return lowest if lowest < step and function(lowest) < value else step
        step = max(lowest, _LEAST * step) if math.isfinite(lowest) else _LEAST * step
    return 0.0
