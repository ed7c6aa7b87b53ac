"""Thresholds for closing loops; those shared with the plain form are in `raff2urdf.closure`."""

from raff2urdf.closure import CLOSED as CLOSED
from raff2urdf.closure import ROUNDING as ROUNDING
from raff2urdf.closure import STEP_CAP as STEP_CAP

CLOSURE = 1e-10
"""Loops with a larger residual (rad, characteristic lengths) are open."""

CORRECTION = 0.5
"""Largest correction of the loops, as a fraction of the step; more would be another assembly mode."""

HEALTHY = 2e-2
"""Singular vectors are used if a pivot of the loops is below this fraction of the first."""

NEGLIGIBLE = 1e-8
"""Damping below this fraction of the smallest squared pivot is neglected."""

NOTHING_ADDED = 1e-10
"""Remainder of a dependent row, as a fraction of the longest row."""
