"""The reachable part of a map of three axes as a solid: the smoothed border of its cells, with a quarter cut out.

The border is a surface net: a point for each corner of cells that border on another kind, moved towards the middle of
its neighbours, and never by more than half a cell. So it stays at the border of the cells (S. F. F. Gibson,
"Constrained elastic surface nets", MICCAI 1998). Each step to the middle is followed by one away from it that is a
little longer, so that solids don't shrink (G. Taubin, "A signal processing approach to fair surface design", SIGGRAPH
1995).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from cinegen.arrays import Array, Bools, Indices
from cinegen.plotting.shades import Shades
from cinegen.plotting.sheet import INK
from cinegen.user_units import user_scale
from cinegen.workspace.region import SPHERICAL
from cinegen.workspace.specification import MapSpecification

_ROUNDS = 10  # of smoothing
_TO, _FRO = 0.6, -0.63  # steps to the middle of a point's neighbours, relative to its distance
_MOST = 56  # cells along an axis: of more every other one is taken
_SKIN = (0.80, 0.86, 0.92)
_LIGHT = np.array([-0.25, -0.75, 0.61])  # direction towards the light
_DARK = 0.4  # of the brightness, of faces that point away from it
_EYE = (24.0, -52.0)  # degrees: elevation, azimuth
_ROOM = 0.04  # of the size, around it
_FLATTEST = 0.1  # of the largest side: a thinner body is drawn as thick as that
_TICKS = 4  # along the largest side


class Net(NamedTuple):
    """A surface between cells.

    Attributes:
        points: (n, 3) in cells: 0 is the middle of the first one.
        quads: (m, 4) numbers of points, in order, seen from outside.
        inside: (m, 3) the cell behind each.
        outside: (m, 3) the cell in front of it; beyond the grid at its edges.
    """

    points: Array
    quads: Indices
    inside: Indices
    outside: Indices


def net(cells: Bools, rounds: int = _ROUNDS) -> Net:
    """Return the surface of cells, see this module.

    A face between a cell within and a neighbour outside, along an axis, is a quad. Its corners are in the order of
    `ring`: counterclockwise as seen from outside, so reversed where the neighbour is before the cell.

    Args:
        cells: (l, m, n) bool, the cells within it.
        rounds: number of rounds of smoothing.
    """
    filled, unit = np.pad(cells, 1), np.eye(3, dtype=int)
    corners, insides, outsides = [], [], []
    for axis in range(3):
        right, up = unit[(axis + 1) % 3], unit[(axis + 2) % 3]
        ring = np.array([-right - up, -up, 0 * right, -right])  # the corners around a face, seen along the axis
        for step, order in ((unit[axis], ring), (-unit[axis], ring[::-1])):
            inside = np.argwhere(filled & ~np.roll(filled, -step, axis=(0, 1, 2)))
            corners.append((inside + np.minimum(step, 0))[:, None] + order)
            insides.append(inside)
            outsides.append(inside + step)
    rings = np.concatenate(corners).reshape(-1, 3)
    corner, numbers = np.unique(rings, axis=0, return_inverse=True)
    quads = numbers.reshape(-1, 4)
    middles = corner + 0.5 - 1.0  # between eight cells, in the grid that is not padded
    return Net(_smoothed(middles, quads, rounds), quads, np.concatenate(insides) - 1, np.concatenate(outsides) - 1)


def _smoothed(middles: Array, quads: Indices, rounds: int) -> Array:
    """Return the points (n, 3) of a surface, each moved by at most half a cell from its middle."""
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
    """Draw the reachable part into axes in space; m and degrees.

    Args:
        axes: of matplotlib.
        spec: specification over three axes.
        reached: (l, m, n) bool, the reachable cells.
        values: (l, m, n) of the quantity, which the cut shows.
        look: of the quantity.
    """
    region, strides = spec.region, [-(-count // _MOST) for count in reached.shape]
    every = tuple(slice(None, None, stride) for stride in strides)
    reached, values = reached[every], values[every]
    spherical = set(region.names) == set(SPHERICAL)
    names = ("x", "y", "z") if spherical else region.names
    scales, units = zip(*(user_scale(spec.mechanism, name) for name in names), strict=True)
    _dress(axes, names, units)
    if not reached.any():
        return

    def points_of(cells: Array) -> Array:
        """Return points (n, 3), m and degrees, for positions (n, 3) in cells."""
        within = np.clip(cells * strides + 0.5 * (np.array(strides) - 1.0), -0.5, np.array(region.shape) - 0.5)
        values = np.column_stack([span.low + (within[:, k] + 0.5) * span.width for k, span in enumerate(region.axes)])
        return np.asarray((region.poses(spec.home, values)[0] if spherical else values) * scales)

    borders, middles = points_of(net(reached, 0).points), points_of(np.argwhere(reached).astype(float))
    low, high = borders.min(axis=0), borders.max(axis=0)
    centre = 0.5 * (low + high)
    quarter = np.zeros_like(reached)
    quarter[reached] = (middles[:, 0] > centre[0]) & (middles[:, 1] < centre[1])
    surface = net(reached & ~quarter)
    points = points_of(surface.points)
    beyond = (surface.outside < 0) | (surface.outside >= reached.shape)
    kept = ~beyond[:, region.periodic].any(axis=1)  # the border of a whole revolution is inside the solid
    corners, inside, outside = points[surface.quads[kept]], surface.inside[kept], surface.outside[kept]
    colours = _lit(corners)
    cut = np.pad(reached, 1)[tuple(outside.T + 1)]
    shown = values[tuple(inside[cut].T)]
    colours[cut] = look.colours(look.norm(np.ma.masked_invalid(shown)))
    axes.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.3))
    sizes = high - low if len(set(units)) == 1 else np.ones(3)
    sizes = np.maximum(sizes / sizes.max(), _FLATTEST)
    axes.set_box_aspect(sizes, zoom=0.84)
    for axis, least, most, size in zip((axes.xaxis, axes.yaxis, axes.zaxis), low, high, sizes, strict=True):
        room = _ROOM * (most - least)
        axis._set_lim(least - room, most + room, auto=False)
        axis.set_major_locator(MaxNLocator(max(1, round(_TICKS * size))))


def _lit(corners: Array) -> Array:
    """Return the colours (n, 4) of faces (n, 4, 3), brighter where they point to the light."""
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
