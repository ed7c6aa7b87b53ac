"""The unit of length of a COLLADA file.

A URDF's mesh is in metres times its `scale`; COLLADA declares a unit and an upward axis of its own. As in RViz and
Gazebo, the unit counts, so that a file in mm is a thousandth as large, and the axis does not: coordinates are those of
the URDF's link as they are, whether the file declares Y_UP or Z_UP. STL and OBJ declare neither.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

from raff2urdf.files import read_bytes

ENDING = ".dae"

_UNIT = re.compile(rb"""<(?:\w+:)?unit\b[^>]*?\bmeter\s*=\s*["']\s*([^"'\s]+)""")
_HEAD = 100_000  # bytes, in which <asset> is


def unit_of(path: Path) -> float:
    """Return the metres in a mesh's unit of length: as a COLLADA file declares it; 1 for other files, and without it.

    Raises:
        RaffError: the file can't be read.
    """
    if path.suffix.lower() != ENDING:
        return 1.0
    match = _UNIT.search(read_bytes(path, most=_HEAD))
    try:
        unit = 1.0 if match is None else float(match[1])
    except ValueError:
        return 1.0
    return unit if math.isfinite(unit) and unit > 0.0 else 1.0
