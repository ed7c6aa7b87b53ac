"""All assembly modes of a platform on six legs: 40 in general, 16 if legs meet in pairs."""

from cinegen.hexapod.hexapod import Hexapod
from cinegen.hexapod.legs import HexapodError
from cinegen.hexapod.result import NearestPlacement, PlatformModes, SolutionCounts

__all__ = ["Hexapod", "HexapodError", "NearestPlacement", "PlatformModes", "SolutionCounts"]
