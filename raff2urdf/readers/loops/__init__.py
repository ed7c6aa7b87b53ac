"""Loops and couplings that a URDF and the files next to it declare, in all dialects."""
