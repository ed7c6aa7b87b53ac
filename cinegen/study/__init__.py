"""What one learns of a mechanism before it moves: all its assembly modes, and its singularities."""

from cinegen.study.modes import AssemblyModes, assembly_modes
from cinegen.study.singular import Singularity, singularity

__all__ = ["AssemblyModes", "Singularity", "assembly_modes", "singularity"]
