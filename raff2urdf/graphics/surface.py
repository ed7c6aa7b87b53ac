"""Coloured surfaces: polygons of any shape, cut into triangles, gathered by colour, written as binary STL.

URDF viewers, simulators and browsers all read STL. It has no colours: each surface has one, which becomes a material in
the URDF.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mapbox_earcut
import numpy as np
from numpy.typing import NDArray

from raff2urdf.arrays import Array
from raff2urdf.errors import RaffError
from raff2urdf.files import GENERATED

Colour = tuple[int, int, int, int]
"""Red, green, blue and opacity, 0 to 255."""

Point = Sequence[float]

MOST_COLOURS = 32
"""Each colour becomes a file: of more colours (a scan has one for each vertex) the nearest are merged."""

MOST_CORNERS = 1000
"""Largest number of corners of a polygon: the time to cut it grows with their square. WorldToolKit's limit was 256."""

LARGEST = 1e37
"""Largest coordinate: STL's numbers end at 3.4e38, and a viewer must still be able to add some of them."""


@dataclass(frozen=True, slots=True)
class ColouredSurface:
    """Triangles of one colour.

    Attributes:
        triangles: (n, 3, 3) corners, counter-clockwise as seen from outside; all have an area above 0.
        colour: None if the file gives none.
    """

    triangles: NDArray[np.float32]
    colour: Colour | None


class Polygons:
    """Polygons, in the order of a file, from which surfaces are made."""

    def __init__(self) -> None:
        # For each colour, by the number of corners: all triangles and all quadrangles are processed at once.
        self._gathered: dict[Colour | None, dict[int, list[Sequence[Point]]]] = {}

    def add(self, corners: Sequence[Point], colour: Colour | None, both: bool = False) -> None:
        """Add a plane polygon without holes, convex or not.

        Args:
            corners: three or more points (x, y, z), counter-clockwise as seen from outside. The first corner may be
                repeated at the end.
            colour: of its surface.
            both: whether it is visible from the other side too. Viewers hide faces that point away, so it is then
                added a second time, reversed.

        Raises:
            RaffError: it has too many corners.
        """
        if len(corners) > MOST_CORNERS:
            raise RaffError(f"a polygon has {len(corners)} corners: at most {MOST_CORNERS} are allowed")
        kinds = self._gathered.setdefault(colour, {})
        kinds.setdefault(len(corners), []).append(corners)
        if both:
            kinds[len(corners)].append(corners[::-1])

    def surfaces(self) -> list[ColouredSurface]:
        """Return one surface for each colour, in the order of the file; triangles without area are left out.

        Raises:
            RaffError: a coordinate is not finite, or too large.
        """
        coloured = []
        for colour, kinds in self._gathered.items():
            parts = [_cut(_checked(np.array(corners, dtype=float))) for _, corners in sorted(kinds.items())]
            coloured.append(ColouredSurface(solid(np.concatenate(parts)), colour))
        return [surface for surface in coloured if len(surface.triangles)]


def solid(triangles: Array) -> NDArray[np.float32]:
    """Return triangles (n, 3, 3) in single precision, without those that have no area then.

    Raises:
        RaffError: a coordinate is not finite, or too large.
    """
    rounded = _checked(triangles).astype(np.float32)
    return np.ascontiguousarray(rounded[np.any(_normals(rounded) != 0.0, axis=1)])


def fewer_colours(surfaces: Sequence[ColouredSurface], most: int = MOST_COLOURS) -> list[ColouredSurface]:
    """Merge surfaces of the same colour; if there are more than `most`, those of near colours too.

    Near colours agree in their first bits, and become their mean by area.

    Args:
        surfaces: in any number.
        most: at least 17: one for each bright or dark channel, and one without a colour.
    """
    groups: dict[tuple[int, ...] | None, list[ColouredSurface]] = {}
    for bits in range(8, 0, -1):
        groups = {}
        for surface in surfaces:
            key = None if surface.colour is None else tuple(channel >> (8 - bits) for channel in surface.colour)
            groups.setdefault(key, []).append(surface)
        if len(groups) <= most:
            break
    return [
        ColouredSurface(np.concatenate([part.triangles for part in group]), _mean(group)) for group in groups.values()
    ]


def _mean(group: Sequence[ColouredSurface]) -> Colour | None:
    colours = [surface.colour for surface in group if surface.colour is not None]
    if len(set(colours)) < 2:
        return group[0].colour
    areas = np.array([area(surface.triangles) for surface in group])
    weights = areas / areas.max()  # so that tiny areas don't vanish in the sum
    red, green, blue, opacity = np.rint(weights @ np.array(colours, dtype=float) / weights.sum()).astype(int).tolist()
    return red, green, blue, opacity


def area(triangles: NDArray[np.float32]) -> float:
    """Return the area of triangles (n, 3, 3), in the square of their unit."""
    return float(np.sqrt((_normals(triangles) ** 2).sum(axis=1)).sum() / 2.0)


def stl(triangles: NDArray[np.float32]) -> bytes:
    """Return triangles (n, 3, 3) as a binary STL file: the same triangles make the same bytes."""
    normals = _normals(triangles)
    normals /= np.abs(normals).max(axis=1, keepdims=True)  # before squaring, which could underflow
    normals /= np.sqrt((normals**2).sum(axis=1, keepdims=True))
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    facets = np.zeros(len(triangles), facet)
    facets["normal"], facets["corners"] = normals, triangles
    header = GENERATED.encode().ljust(80, b"\0")  # "solid" at the beginning would declare a text file
    return header + len(facets).to_bytes(4, "little") + facets.tobytes()


def _checked(corners: Array) -> Array:
    if not np.all(np.abs(corners) <= LARGEST):  # NaN is not
        raise RaffError(f"a coordinate is not a number up to {LARGEST:g}")
    return corners


def _cut(polygons: Array) -> Array:
    """Cut polygons (n, k, 3) with k corners each into triangles (m, 3, 3)."""
    corners = polygons.shape[1]
    if corners == 3:
        return polygons
    if corners == 4:
        return _quadrangles(polygons)
    return np.concatenate([_polygon(polygon) for polygon in polygons])


def _quadrangles(polygons: Array) -> Array:
    """Cut along the first diagonal if both halves then face the same side, else along the second."""
    first = np.stack([polygons[:, [0, 1, 2]], polygons[:, [0, 2, 3]]], axis=1)
    second = np.stack([polygons[:, [1, 2, 3]], polygons[:, [1, 3, 0]]], axis=1)
    sides = _normals(_moderate(first).reshape(-1, 3, 3)).reshape(-1, 2, 3)
    agree = (sides[:, 0] * sides[:, 1]).sum(axis=1) >= 0.0
    cut: Array = np.where(agree[:, None, None, None], first, second).reshape(-1, 3, 3)
    return cut


def _polygon(corners: Array) -> Array:
    """Cut one polygon (k, 3), projected along the axis that it faces most, by its ears (mapbox-earcut)."""
    moderate = _moderate(corners)
    following = np.roll(moderate, -1, axis=0)
    normal = np.cross(moderate - moderate[0], following - moderate[0]).sum(axis=0)  # Newell's; twice the area
    axis = int(np.argmax(np.abs(normal)))
    if normal[axis] == 0.0:
        return np.empty((0, 3, 3))
    plane = np.ascontiguousarray(moderate[:, [(axis + 1) % 3, (axis + 2) % 3]])
    ears = mapbox_earcut.triangulate_float64(plane, np.array([len(plane)], dtype=np.uint32)).reshape(-1, 3)
    (ax, ay), (bx, by), (cx, cy) = (plane[ears[:, i]].T for i in range(3))
    against = ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) * normal[axis] < 0.0
    ears[against] = ears[against][:, ::-1]
    return corners[ears]


def _moderate(corners: Array) -> Array:
    """Return corners relative to the first one, scaled so that no product overflows."""
    offset: Array = corners - corners.reshape(-1, 3)[0]
    return offset / (float(np.abs(offset).max()) or 1.0)


def _normals(triangles: NDArray[np.float32] | Array) -> Array:
    """Return the cross product of two edges of each triangle (n, 3, 3): its normal, with twice its area as length."""
    wide = np.asarray(triangles, dtype=float)
    return np.asarray(np.cross(wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0]))
