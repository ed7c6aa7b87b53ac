"""Calibration: the true dimensions of a robot, from measurements of any kind."""

from cinegen.design.calibration.estimation import Calibration, calibrate
from cinegen.design.calibration.measurements import Measurements

__all__ = ["Calibration", "Measurements", "calibrate"]
