"""Every assembly mode of a manipulator whose platform is a triangle (TSSM, "6-3"): up to 16, from one eigenproblem."""

from cinegen.study.hexapod import Approach
from cinegen.study.triangle.spin_surface import SpinSurface
from cinegen.study.triangle.tssm import TSSM, Modes, TSSMError

__all__ = ["TSSM", "Approach", "Modes", "SpinSurface", "TSSMError"]
