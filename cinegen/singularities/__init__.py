"""Singularities of a mechanism: which kind, what moves or no longer moves, and the geometric reason."""

from cinegen.singularities.legs import leg_lines
from cinegen.singularities.singularity import Kind, Singularity, singularity

__all__ = ["Kind", "Singularity", "leg_lines", "singularity"]
