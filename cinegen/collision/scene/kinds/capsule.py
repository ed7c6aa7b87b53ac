"""A capsule: `radius` and, between the middles of its round ends, `length` along z of its frame, or `ends`, m."""

from __future__ import annotations

from pathlib import Path

import coal

from cinegen.collision.scene.axis import axis
from cinegen.collision.scene.solid import Solid
from cinegen.collision.scene.table import Table


def solids(table: Table, folder: Path) -> list[Solid]:
    """As `Kind` says."""
    placement, length = axis(table)
    return [Solid(placement, coal.Capsule(table.size("radius"), length))]
