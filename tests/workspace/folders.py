"""Folders of maps: what is in them, and small maps to fill them with."""

import hashlib
from pathlib import Path

from cinegen import Mechanism
from cinegen.workspace import GridAxis, MapSpecification, Region


def digest(folder: Path) -> str:
    """Of all files and folders, names included."""
    checksum = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        checksum.update(f"{path.relative_to(folder)}\n".encode())
        checksum.update(path.read_bytes() if path.is_file() else b"a folder")
    return checksum.hexdigest()


def files(folder: Path) -> dict[str, tuple[int, int]]:
    """By name, which file it is and when it was written."""
    stats = {str(path.relative_to(folder)): path.stat() for path in folder.rglob("*") if path.is_file()}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in stats.items()}


def over_joints(
    mechanism: Mechanism, side: int = 5, quantities: tuple[str, ...] = ("sigma_1", "margin")
) -> MapSpecification:
    """Over its first three actuated joints, about home; not all cells are within limits."""
    home = {name: float(mechanism.q_home[mechanism.q_index(name)]) for name in mechanism.actuated[:3]}
    axes = tuple(GridAxis(name, at - 2.1, at + 1.9, side) for name, at in home.items())
    return MapSpecification(mechanism, Region(axes), quantities)


def of_delta(mechanism: Mechanism, side: int = 10) -> MapSpecification:
    """A slice through what a delta reaches, and beyond."""
    axes = (GridAxis("x", -2.2, 2.0, side), GridAxis("y", -2.1, 2.2, side))
    return MapSpecification(mechanism, Region(axes, {"z": -1.8}), ("solutions", "sigma_1", "sigma_2"))
