"""What moves a mechanism: sensors, and scripts that play one."""

from cinegen.sense.path import SHAPES, Path, fitted

__all__ = ["SHAPES", "Path", "fitted"]
