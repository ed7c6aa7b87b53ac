"""What is reached of three axes, as a solid: the border of its cells, smoothed, with a quarter cut out to look inside.

The border is a surface net: a point for each corner of cells that border on another kind, moved towards the middle of
its neighbours, and never by more than half a cell. So it stays where the cells say that the border is (S. F. F. Gibson,
"Constrained elastic surface nets", MICCAI 1998). Each step to the middle is followed by one away from it that is a
little longer, so that solids don't shrink (G. Taubin, "A signal processing approach to fair surface design", SIGGRAPH
1995).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.shades import Shades
from cinegen.plotting.stick import INK
from cinegen.plotting.units import user_scale
from cinegen.workspace.region import SPHERICAL, Region
from cinegen.workspace.specification import MapSpecification

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.intp]

_ROUNDS = 10  # of smoothing
_TO, _FRO = 0.6, -0.63  # parts of the way to the middle of a point's neighbours
_MOST = 56  # cells along an axis: of more every other one is taken
_SKIN = (0.80, 0.86, 0.92)
_LIGHT = np.array([-0.25, -0.75, 0.61])  # from where it comes
_DARK = 0.4  # of the brightness, of what is turned away from it
_EYE = (24.0, -52.0)  # degrees: elevation, azimuth
_ROOM = 0.04  # of the size, around it
_FLATTEST = 0.1  # of the largest side: a thinner body is drawn as thick as that
_TICKS = 4  # along the largest side


class Net(NamedTuple):
    """A surface between cells.

    Attributes:
        points: (n, 3) in cells: 0 is the middle of the first one.
        quads: (m, 4) numbers of points, in turn, seen from outside.
        inside: (m, 3) the cell behind each.
        outside: (m, 3) that before it; beyond the grid at its edges.
    """

    points: Array
    quads: Ints
    inside: Ints
    outside: Ints


def net(cells: Bools, rounds: int = _ROUNDS) -> Net:
    """The surface of cells (l, m, n).

    Args:
        cells: that are within it.
        rounds: how often it is smoothed.
    """
    filled = np.pad(cells, 1)
    corners, insides, outsides = [], [], []
    for axis in range(3):
        rolled = np.moveaxis(filled, axis, 0)
        for sign in (1, -1):
            here, there = (rolled[:-1], rolled[1:]) if sign > 0 else (rolled[1:], rolled[:-1])
            found = np.argwhere(here & ~there)
            if not len(found):
                continue
            cell = np.empty_like(found)  # the lower one of both, in the padded grid
            others = [k for k in range(3) if k != axis]
            cell[:, axis], cell[:, others[0]], cell[:, others[1]] = found.T
            step = np.eye(3, dtype=int)[axis]
            one, other = (np.eye(3, dtype=int)[k] for k in others)
            ring = np.array([-one - other, -other, 0 * one, -one])  # the dual corners around the face
            if (axis == 1) == (sign > 0):  # so that one always looks at it from outside
                ring = ring[::-1]
            corners.append(cell[:, None] + ring)
            insides.append(cell if sign > 0 else cell + step)
            outsides.append(cell + step if sign > 0 else cell)
    if not corners:
        return Net(np.zeros((0, 3)), np.zeros((0, 4), int), np.zeros((0, 3), int), np.zeros((0, 3), int))
    rings = np.concatenate(corners)
    places, numbers = np.unique(rings.reshape(-1, 3), axis=0, return_inverse=True)
    quads = numbers.reshape(-1, 4)
    middles = places + 0.5 - 1.0  # the corner between eight cells, in the grid that is not padded
    return Net(_smoothed(middles, quads, rounds), quads, np.concatenate(insides) - 1, np.concatenate(outsides) - 1)


def _smoothed(middles: Array, quads: Ints, rounds: int) -> Array:
    points = middles.copy()
    edges = np.concatenate([np.roll(quads, -k, axis=1)[:, :2] for k in range(4)])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    both = np.concatenate([edges, edges[:, ::-1]])
    count = np.bincount(both[:, 0], minlength=len(points))[:, None]
    for part in (_TO, _FRO) * rounds:
        sums = np.stack([np.bincount(both[:, 0], points[both[:, 1], k], len(points)) for k in range(3)], axis=1)
        points = np.clip(points + part * (sums / count - points), middles - 0.5, middles + 0.5)
    return points


def paint_solid(axes: Any, spec: MapSpecification, reached: Bools, values: Array, look: Shades) -> None:
    """Paints what is reached into axes in space; mm and degrees.

    Args:
        axes: of matplotlib.
        specification: over three axes.
        reached: (l, m, n) cells.
        values: of the quantity in them, which the cut shows.
        look: of the quantity.
    """
    from matplotlib.ticker import MaxNLocator
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    region, strides = spec.region, [-(-count // _MOST) for count in reached.shape]
    every = tuple(slice(None, None, stride) for stride in strides)
    reached, values = reached[every], values[every]
    names, scales, units = _coordinates(spec)
    _dress(axes, names, units)
    if not reached.any():
        return

    def places(cells: Array) -> Array:
        within = np.clip(cells * strides + 0.5 * (np.array(strides) - 1.0), -0.5, np.array(region.shape) - 0.5)
        return _places(spec, within) * scales

    borders, middles = places(net(reached, 0).points), places(np.argwhere(reached).astype(float))
    low, high = borders.min(axis=0), borders.max(axis=0)
    centre = 0.5 * (low + high)
    quarter = np.zeros_like(reached)
    quarter[reached] = (middles[:, 0] > centre[0]) & (middles[:, 1] < centre[1])
    surface = net(reached & ~quarter)
    points = places(surface.points)
    kept = ~_on_seam(region, surface.outside, reached.shape)
    corners, inside, outside = points[surface.quads[kept]], surface.inside[kept], surface.outside[kept]
    colours = _lit(corners)
    cut = _at(reached, outside)
    shown = values[tuple(inside[cut].T)]
    colours[cut] = look.colours(look.norm(np.ma.masked_invalid(shown)))
    axes.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.3))
    sizes = high - low if len(set(units)) == 1 else np.ones(3)
    sizes = np.maximum(sizes / sizes.max(), _FLATTEST)
    axes.set_box_aspect(sizes, zoom=0.84)
    for axis, one, other, size in zip((axes.xaxis, axes.yaxis, axes.zaxis), low, high, sizes, strict=True):
        room = _ROOM * (other - one)
        axis._set_lim(one - room, other + room, auto=False)
        axis.set_major_locator(MaxNLocator(max(1, round(_TICKS * size))))


def _coordinates(spec: MapSpecification) -> tuple[tuple[str, ...], Array, tuple[str, ...]]:
    """Names, what SI values are multiplied by, and units, of what a solid is drawn over."""
    spherical = set(spec.region.names) == set(SPHERICAL)
    names = ("x", "y", "z") if spherical else spec.region.names
    scales, units = zip(*(user_scale(spec.mechanism, name) for name in names), strict=True)
    return names, np.array(scales), units


def _places(spec: MapSpecification, cells: Array) -> Array:
    """(n, 3) of what a solid is drawn over, m and rad, for places (n, 3) in cells."""
    region = spec.region
    given = np.column_stack([axis.low + (cells[:, k] + 0.5) * axis.width for k, axis in enumerate(region.axes)])
    if set(region.names) != set(SPHERICAL):
        return given
    return region.poses(spec.home, given)[0]


def _on_seam(region: Region, outside: Ints, shape: tuple[int, ...]) -> Bools:
    """(n,) quads at the end of a whole turn, where it begins again."""
    found = np.zeros(len(outside), dtype=bool)
    for k, axis in enumerate(region.axes):
        if axis.name == "azimuth" and axis.high - axis.low > 2.0 * math.pi - 1e-9:
            found |= (outside[:, k] < 0) | (outside[:, k] >= shape[k])
    return found


def _at(cells: Bools, where: Ints) -> Bools:
    """(n,) of places (n, 3), of which some are beyond the grid."""
    there = ((where >= 0) & (where < cells.shape)).all(axis=1)
    found = np.zeros(len(where), dtype=bool)
    found[there] = cells[tuple(where[there].T)]
    return found


def _lit(corners: Array) -> Array:
    """(n, 4) colours of faces (n, 4, 3), brighter where they look towards the light."""
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    bright = _DARK + (1.0 - _DARK) * (0.5 + 0.5 * normals @ (_LIGHT / np.linalg.norm(_LIGHT)))
    return np.column_stack([np.clip(bright[:, None] * np.array(_SKIN), 0.0, 1.0), np.ones(len(corners))])


def _dress(axes: Any, names: tuple[str, ...], units: tuple[str, ...]) -> None:
    for axis, name, unit in zip((axes.xaxis, axes.yaxis, axes.zaxis), names, units, strict=True):
        axis.set_label_text(f"{name} ({unit})", fontsize="small")
        axis.pane.set_facecolor("white")
        axis.pane.set_edgecolor("#c9ced4")
        axis._axinfo["grid"].update(color="#e3e6ea", linewidth=0.5)
    axes.tick_params(labelsize="x-small", color=INK)
    axes.view_init(*_EYE)
