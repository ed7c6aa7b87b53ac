"""Maps of robots of the repository, in a folder."""

from pathlib import Path

from repository import load

from cinegen.workspace import GridAxis, MapSpecification, Region, make_map


def map_of(folder: Path, name: str, *axes: tuple[str, float, float, int], at=None, centre=None, quantities=(), **more):
    """Make a map over axes (name, low, high, count), next to others.

    Args:
        folder: for maps alone.
        name: of the robot.
        axes: of the region.
        at: other coordinates of the region.
        centre: of a region around a point.
        quantities: of the map.
        more: options of the specification.
    """
    region = Region(tuple(GridAxis(*axis) for axis in axes), at or {}, centre=centre)
    spec = MapSpecification(load(name), region, quantities, **more)
    return make_map(spec, folder / f"{len(list(folder.iterdir()))}.zarr", workers=1)
