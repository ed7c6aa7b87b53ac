"""The thresholds by which loops are closed; `raff2urdf.closure` has those that it shares with them."""

from raff2urdf.closure import CLOSED as CLOSED
from raff2urdf.closure import ROUNDING as ROUNDING
from raff2urdf.closure import STEP_CAP as STEP_CAP

CLOSURE = 1e-10
"""Loops that can't be closed to this (rad, characteristic lengths) are open."""

CORRECTION = 0.5
"""Part of the step that closing the loops again may add; more would be another assembly mode."""

HEALTHY = 2e-2
"""Where a row of the loops adds less than this part of the first, singular vectors are used."""

NEGLIGIBLE = 1e-8
"""Damping below this part of the smallest squared pivot is left out."""

NOTHING_ADDED = 1e-10
"""Part of the longest row: what is left of one that depends on others."""
