"""Calibration: the true dimensions of a robot, from measurements of any kind."""

from cinegen.design.calibration.estimation import calibrate
from cinegen.design.calibration.measurements import Measurements
from cinegen.design.calibration.result import Calibration

__all__ = ["Calibration", "Measurements", "calibrate"]
