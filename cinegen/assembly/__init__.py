"""Assembly modes: all configurations in which a closed mechanism can be assembled with given actuated joints."""

from cinegen.assembly.errors import ModesError
from cinegen.assembly.modes import assembly_modes
from cinegen.assembly.results import AssemblyModes, NearestConfiguration, SelfMotion

__all__ = ["AssemblyModes", "ModesError", "NearestConfiguration", "SelfMotion", "assembly_modes"]
