"""Singularities of a mechanism: their type, what moves or no longer moves, and the geometric reason."""

from cinegen.singularities.leg_lines import leg_lines
from cinegen.singularities.singularity import Singularity, SingularityType, singularity

__all__ = ["Singularity", "SingularityType", "leg_lines", "singularity"]
