"""Thresholds for closing loops; those shared with the plain form are in `raff2urdf.closure`."""

from raff2urdf.bounds import STEP_CAP as STEP_CAP
from raff2urdf.closure import CLOSED as CLOSED
from raff2urdf.closure import ROUNDING as ROUNDING

CLOSURE = 1e-10
"""Loops with a larger residual (rad, characteristic lengths) are open."""

CORRECTION = 0.5
"""Largest correction of the loops, as a fraction of the step; more would be another assembly mode."""

HEALTHY = 2e-2
"""Singular vectors are used if a pivot of the loops is below this fraction of the first."""

NEAR_SINGULAR = 0.05
"""Singular value (dimensionless) below which a configuration is near a singularity, of either type, in all of cinegen:
the solver damps motion there, and reports, forecasts, checks of paths and the cockpit show it."""

AT_SINGULAR = 1e-3
"""Singular value below which a motion that is known at its ticks or samples passes through a singularity."""

NEGLIGIBLE = 1e-8
"""Damping below this fraction of the smallest squared pivot is neglected."""

NOTHING_ADDED = 1e-10
"""Remainder of a dependent row, as a fraction of the longest row."""

AT_LIMIT = 1e-9
"""rad or m: a joint that exceeds its limit by no more is at that limit."""
