"""Point-to-point inverse kinematics: from poses to configurations, for serial and closed mechanisms."""

from cinegen.solve.inverse.reach import Reached, reach

__all__ = ["Reached", "reach"]
