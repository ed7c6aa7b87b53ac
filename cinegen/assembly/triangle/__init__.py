"""Every assembly mode of a manipulator whose platform is a triangle (TSSM, "6-3"): up to 16, from one eigenproblem."""

from cinegen.assembly.hexapod import Approach
from cinegen.assembly.triangle.spin_surface import SpinSurface
from cinegen.assembly.triangle.tssm import TSSM, Modes, TSSMError

__all__ = ["TSSM", "Approach", "Modes", "SpinSurface", "TSSMError"]
