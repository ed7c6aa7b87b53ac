"""Assembly modes: all ways in which a closed mechanism can be assembled with its motors where they are."""

from cinegen.assembly.linkage import ModesError
from cinegen.assembly.modes import Approach, AssemblyModes, Paths, assembly_modes

__all__ = ["Approach", "AssemblyModes", "ModesError", "Paths", "assembly_modes"]
