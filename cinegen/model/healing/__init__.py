"""Loops that are nearly redundant because numbers are rounded: found, healed, written back into files."""
