"""A box about its frame: `size` along x, y and z, m; of two numbers, it is an upright one in the plane."""

from __future__ import annotations

from pathlib import Path

import coal
import pinocchio as pin

from cinegen.collision.scene.solid import HEIGHT, Solid
from cinegen.collision.scene.table import Table


def solids(table: Table, folder: Path) -> list[Solid]:
    """As `Kind` says."""
    x, y, z = (*table.sizes("size", 2, 3), HEIGHT)[:3]
    return [Solid(pin.SE3.Identity(), coal.Box(x, y, z))]
