"""All that lies behind a plane through the origin of its frame: `normal` points out of it, to where robots may go."""

from __future__ import annotations

from pathlib import Path

import coal
import pinocchio as pin

from cinegen.collision.scene.solid import Solid
from cinegen.collision.scene.table import Table


def solids(table: Table, folder: Path) -> list[Solid]:
    """As `Kind` says."""
    return [Solid(pin.SE3.Identity(), coal.Halfspace(table.direction("normal", 2, 3), 0.0))]
