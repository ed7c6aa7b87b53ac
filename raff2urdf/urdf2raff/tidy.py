"""Numbers without the last digits, which rounding made: 90 instead of 90.00000000000001."""

from __future__ import annotations

import math

TIDY = 1e-13
"""What a length (m) or an angle (rad) may lose."""


def tidy(value: float, tolerance: float) -> float:
    """The number with so many decimals that it is no further away than the tolerance; tidying it again changes nothing.

    (The shortest number within the tolerance would be shorter yet, but perhaps not the shortest as seen from itself.)
    """
    return round(value, math.ceil(-math.log10(2.0 * tolerance))) + 0.0  # no -0.0
