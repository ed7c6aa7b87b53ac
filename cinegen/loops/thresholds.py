"""The thresholds by which loops are closed."""

CLOSURE = 1e-10
"""Loops that can't be closed to this (rad, characteristic lengths) are open."""

CORRECTION = 0.5
"""Part of the step that closing the loops again may add; more would be another assembly mode."""

HEALTHY = 2e-2
"""Where a row of the loops adds less than this part of the first, singular vectors are used."""
