"""What moves a mechanism: sensors, and scripts that play one."""

from cinegen.sense.lines import Lines, start_from
from cinegen.sense.path import SHAPES, Path, fitted

__all__ = ["SHAPES", "Lines", "Path", "fitted", "start_from"]
