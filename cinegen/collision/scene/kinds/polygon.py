"""A polygon in the plane, convex or not: `points` in its frame, m. In space it is an upright prism, of `height`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cinegen.collision.scene.cutting import convex_pieces
from cinegen.collision.scene.outline import why_none
from cinegen.collision.scene.solid import HEIGHT, Solid, prism
from cinegen.collision.scene.table import Table


def solids(table: Table, folder: Path) -> list[Solid]:
    """As `Kind` says."""
    points = np.array(table.points("points", 2)).reshape(-1, 2)
    if len(points) > 1 and (points[0] == points[-1]).all():  # some write the first point again at the end
        points = points[:-1]
    why = why_none(points)
    if why is not None:
        raise table.wrong("points", why)
    height = table.size("height") if "height" in table else HEIGHT
    return [prism(corners, height) for corners in convex_pieces(points)]
