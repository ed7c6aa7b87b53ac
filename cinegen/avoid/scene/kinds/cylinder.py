"""A cylinder: `radius` and `length` along z of its frame, or `ends`, m."""

from __future__ import annotations

from pathlib import Path

import coal

from cinegen.avoid.scene.axis import axis
from cinegen.avoid.scene.solid import Solid
from cinegen.avoid.scene.table import Table


def solids(table: Table, folder: Path) -> list[Solid]:
    """As `Kind` says."""
    placement, length = axis(table)
    return [Solid(placement, coal.Cylinder(table.size("radius"), length))]
