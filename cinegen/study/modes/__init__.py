"""Assembly modes: all ways in which a closed mechanism can be assembled with its motors where they are."""

from cinegen.study.modes.linkage import ModesError
from cinegen.study.modes.modes import Approach, AssemblyModes, Paths, assembly_modes

__all__ = ["Approach", "AssemblyModes", "ModesError", "Paths", "assembly_modes"]
