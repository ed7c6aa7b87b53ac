"""A disc in the plane: `radius`, m. In space it is an upright cylinder, of `height`."""

from __future__ import annotations

from pathlib import Path

import coal
import pinocchio as pin

from cinegen.collision.scene.solid import HEIGHT, Solid
from cinegen.collision.scene.table import Table


def solids(table: Table, folder: Path) -> list[Solid]:
    """As `Kind` says."""
    height = table.size("height") if "height" in table else HEIGHT
    return [Solid(pin.SE3.Identity(), coal.Cylinder(table.size("radius"), height))]
