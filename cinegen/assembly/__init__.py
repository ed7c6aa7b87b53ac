"""Assembly modes: all configurations in which a closed mechanism can be assembled with given actuated joints."""

from cinegen.assembly.linkage import ModesError
from cinegen.assembly.modes import assembly_modes
from cinegen.assembly.results import AssemblyModes, NearestConfiguration

__all__ = ["AssemblyModes", "ModesError", "NearestConfiguration", "assembly_modes"]
