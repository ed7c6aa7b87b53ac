"""A ball: `radius`, m."""

from __future__ import annotations

from pathlib import Path

import coal
import pinocchio as pin

from cinegen.collision.scene.solid import Solid
from cinegen.collision.scene.table import Table


def solids(table: Table, folder: Path) -> list[Solid]:
    """As `Kind` says."""
    return [Solid(pin.SE3.Identity(), coal.Sphere(table.size("radius")))]
