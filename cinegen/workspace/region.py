"""`Region`: what a map is made over, cut into cells, and what a node is to do in each of them.

Cells are those of a grid over some coordinates: of a node's pose, or the values of motors. What is asked in a cell is
asked at its middle, and holds for all of it: so volumes are counted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.model import Mechanism
from cinegen.singularities.slice import POSE
from cinegen.workspace.errors import MapError
from raff2urdf.errors import did_you_mean

Array = NDArray[np.float64]

AROUND = ("azimuth", "elevation", "radius")
"""Where a node is, seen from a centre: rad about z from x, rad up from the plane of x and y, m."""

ALONG = "way"
"""m from one point straight to another."""

ORIENTATIONS = ("free", "axis", "fixed")
"""Of a node, how much counts: nothing; the direction of its z; all."""

_TURN = 1e-9  # rad, of a turn: rounding
_MOST = 2**62
"""Cells that can be counted."""


@dataclass(frozen=True)
class GridAxis:
    """A coordinate that is cut into cells of equal width.

    Attributes:
        name: of `POSE`, `AROUND`, a motor, or `ALONG`.
        low: where the first cell begins, m or rad.
        high: where the last one ends.
        count: of cells.

    Raises:
        MapError: it goes nowhere, or has no cells.
    """

    name: str
    low: float
    high: float
    count: int

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise MapError(f"{self.name} from {self.low:g} to {self.high:g} is no range: give the lower end first")
        if not 0 < self.count < _MOST:
            raise MapError(f"{self.name}: a grid of {self.count} cells: give 1 or more")

    @property
    def width(self) -> float:
        """Of a cell, m or rad."""
        return (self.high - self.low) / self.count

    @property
    def borders(self) -> Array:
        """(count + 1,) between the cells, m or rad."""
        return np.linspace(self.low, self.high, self.count + 1)

    def middles(self, cells: slice = slice(None)) -> Array:
        """(n,) middles of some cells, m or rad."""
        first, last, _ = cells.indices(self.count)
        return np.asarray(self.low + (np.arange(first, last) + 0.5) * self.width)


@dataclass(frozen=True)
class Region:
    """What a map is made over.

    Attributes:
        axes: of the grid: coordinates of a pose (`POSE`), or all of a place seen from a centre (`AROUND`), with or
            without turns (rx, ry, rz); or the way from one point to another (`ALONG`); or motors alone.
        at: values of other coordinates, m and rad; those of a place and those of motors are as at home else.
        orientation: of `ORIENTATIONS`; of a node, what of its orientation counts.
        centre: (3,) m, what `AROUND` is seen from.
        ends: two points (3,), m, of `ALONG`.

    Raises:
        MapError: coordinates that don't go together.
    """

    axes: tuple[GridAxis, ...]
    at: Mapping[str, float] = field(default_factory=dict)
    orientation: str = "free"
    centre: tuple[float, float, float] | None = None
    ends: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None

    def __post_init__(self) -> None:
        names = self.names
        if not names:
            raise MapError("a map needs at least one coordinate to go over")
        twice = sorted({name for name in (*names, *self.at) if [*names, *self.at].count(name) > 1})
        if twice:
            raise MapError(f"{', '.join(twice)} is given twice")
        if self.orientation not in ORIENTATIONS:
            raise MapError(f"orientation '{self.orientation}'{did_you_mean(self.orientation, ORIENTATIONS)}")
        for name, value in self.at.items():
            if not math.isfinite(value):
                raise MapError(f"{name}={value}: this is no number")
        placed = [name for name in names if name in (*AROUND, ALONG)]
        if placed and (clash := [name for name in (*names, *self.at) if name in POSE[:3]]):
            raise MapError(f"{placed[0]} says where the node is, and so does {clash[0]}: leave one out")
        around = [name for name in AROUND if name in (*names, *self.at)]
        if around and (missing := [name for name in AROUND if name not in around]):
            raise MapError(
                f"{', '.join(around)} is where the node is, seen from a centre: say {', '.join(missing)}, too"
            )
        for axis in self.axes:
            if axis.name == "elevation" and max(-axis.low, axis.high) > 0.5 * math.pi + _TURN:
                raise MapError(f"elevation from {axis.low:g} to {axis.high:g}: it goes from -90 to 90 degrees")
            if axis.name == "azimuth" and axis.high - axis.low > 2.0 * math.pi + _TURN:
                raise MapError(f"azimuth from {axis.low:g} to {axis.high:g}: that is more than a turn")
        if ALONG in names and any(name in AROUND for name in names):
            raise MapError(f"{ALONG} says where the node is, and so does {placed[0]}: leave one out")

    @property
    def names(self) -> tuple[str, ...]:
        """Of the axes."""
        return tuple(axis.name for axis in self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis."""
        return tuple(axis.count for axis in self.axes)

    @property
    def size(self) -> int:
        """Cells in all."""
        return math.prod(self.shape)

    def of_motors(self, mechanism: Mechanism) -> bool:
        """Whether the axes are motors.

        Raises:
            MapError: they are neither, or both.
        """
        of_motors = [name in mechanism.actuated for name in (*self.names, *self.at)]
        if all(of_motors):
            return True
        known = (*POSE, *AROUND, ALONG)
        for name in (*self.names, *self.at):
            if name not in known:
                what = "coordinates of a pose and motors can't be mixed: " if name in mechanism.actuated else ""
                choice = f"{', '.join(POSE)} (of a node), {', '.join(AROUND)}, or motors: "
                raise MapError(f"{mechanism.name}: {what}no coordinate '{name}' here; there are {choice}"
                               f"{', '.join(mechanism.actuated)}")  # fmt: skip
        return False

    # --- chunks --------------------------------------------------------------------------------------------------

    def blocks(self, most: int) -> tuple[int, ...]:
        """Cells along each axis of a piece of at most so many cells, as long as it is wide: what neighbours tell of
        each other goes a short way."""
        width = [1] * len(self.axes)
        growing = set(range(len(width)))
        while growing:
            k = min(growing, key=lambda k: (width[k], -k))
            wider = min(2 * width[k], self.shape[k])
            if wider == width[k] or math.prod(width) // width[k] * wider > most:
                growing.discard(k)
            else:
                width[k] = wider
        for k in reversed(range(len(width))):  # what is left goes to the last axes
            width[k] = max(1, min(self.shape[k], width[k] * (most // math.prod(width)) or 1))
        return self._even(width)

    def lines(self, most: int) -> tuple[int, ...]:
        """The same for pieces of whole lines, as far as they fit: one cell after the other, with few turns."""
        width = [1] * len(self.axes)
        for k in reversed(range(len(width))):
            width[k] = max(1, min(self.shape[k], most // math.prod(width)))
        return self._even(width)

    def _even(self, width: Sequence[int]) -> tuple[int, ...]:
        """No wider, and as many, but alike."""
        return tuple(-(-n // -(-n // wide)) for n, wide in zip(self.shape, width, strict=True))

    # --- coordinates ---------------------------------------------------------------------------------------------

    def values(self, piece: tuple[slice, ...]) -> Array:
        """(n, axes) coordinates of the middles of a piece's cells, the last axis fastest."""
        middles = [axis.middles(cells) for axis, cells in zip(self.axes, piece, strict=True)]
        grid = np.meshgrid(*middles, indexing="ij")
        return np.column_stack([values.ravel() for values in grid])

    def motors(self, mechanism: Mechanism, piece: tuple[slice, ...]) -> Array:
        """(n, motors) values of the motors in the order of `mechanism.actuated`, rad and m."""
        return self.motors_at(mechanism, self.values(piece))

    def motors_at(self, mechanism: Mechanism, given: Array) -> Array:
        """(n, motors) likewise, for values (n, axes) of the axes, wherever they are."""
        home = [mechanism.q_home[mechanism.q_index(name)] for name in mechanism.actuated]
        motors = np.tile([self.at.get(name, value) for name, value in zip(mechanism.actuated, home, strict=True)],
                         (len(given), 1))  # fmt: skip
        for k, name in enumerate(self.names):
            motors[:, mechanism.actuated.index(name)] = given[:, k]
        return np.asarray(motors, dtype=float)

    def poses(self, home: pin.SE3, piece: tuple[slice, ...]) -> tuple[Array, Array]:
        """Where the node is to be.

        Args:
            home: its pose, which says what the region does not.
            piece: of the grid.

        Returns:
            points (n, 3), m, and rotations (n, 3, 3) or (1, 3, 3) where all are the same, in the world.
        """
        return self.poses_at(home, self.values(piece))

    def poses_at(self, home: pin.SE3, given: Array) -> tuple[Array, Array]:
        """Likewise, for values (n, axes) of the axes, wherever they are."""
        column = {name: given[:, k] for k, name in enumerate(self.names)}
        points = np.empty((len(given), 3))
        for k, name in enumerate(POSE[:3]):
            points[:, k] = column.get(name, self.at.get(name, home.translation[k]))
        if ALONG in column:
            first, last = self._ends
            way = (last - first) / np.linalg.norm(last - first)
            points = first + column[ALONG][:, None] * way
        elif any(name in AROUND for name in (*self.names, *self.at)):
            points = self._around(column, len(given))
        return points, self._rotations(column, home)

    def _around(self, column: Mapping[str, Array], count: int) -> Array:
        centre = np.zeros(3) if self.centre is None else np.asarray(self.centre)
        azimuth, elevation, radius = (
            np.broadcast_to(column.get(name, self.at.get(name, 0.0)), count) for name in AROUND
        )
        flat = radius * np.cos(elevation)
        return np.asarray(
            centre + np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), radius * np.sin(elevation)])
        )

    def _rotations(self, column: Mapping[str, Array], home: pin.SE3) -> Array:
        given = [name in column or name in self.at for name in POSE[3:]]
        if not any(given):
            return np.asarray(home.rotation)[None]
        at_home = pin.rpy.matrixToRpy(home.rotation)
        angles = [column.get(name, np.array([self.at.get(name, at_home[k])])) for k, name in enumerate(POSE[3:])]
        roll, pitch, yaw = np.broadcast_arrays(*angles)
        return _rotation(2, yaw) @ _rotation(1, pitch) @ _rotation(0, roll)

    @property
    def _ends(self) -> tuple[Array, Array]:
        if self.ends is None:
            raise MapError(f"'{ALONG}' goes from one point to another: say which (`Region.ends`)")
        return np.asarray(self.ends[0]), np.asarray(self.ends[1])

    # --- sizes ---------------------------------------------------------------------------------------------------

    @cached_property
    def sizes(self) -> tuple[Array, ...]:
        """For each axis (count,) factors whose product is what a cell measures: of places in m, m^2 or m^3, times rad
        for each turn; of motors in rad and m. Seen from a centre a cell is a part of a sphere."""
        spherical = self._spherical
        found = []
        for axis in self.axes:
            borders = axis.borders
            if axis.name == "elevation" and spherical:
                sizes = np.diff(np.sin(borders))
            elif axis.name == "radius" and spherical:
                sizes = np.diff(borders**3) / 3.0
            else:
                sizes = np.full(axis.count, axis.width)
            found.append(sizes)
        if spherical and "radius" not in self.names:
            found[self.names.index("elevation")] = (
                found[self.names.index("elevation")] * self.at.get("radius", 1.0) ** 2
            )
        return tuple(found)

    @property
    def _spherical(self) -> bool:
        """Whether cells are parts of a sphere."""
        return "azimuth" in self.names and "elevation" in self.names

    def unit(self, mechanism: Mechanism) -> str:
        """Of what a cell measures."""
        long = [name in (*POSE[:3], ALONG, "radius") or (name in mechanism.joints and mechanism.is_prismatic(name))
                for name in self.names]  # fmt: skip
        metres, radians = sum(long), len(long) - sum(long)
        if self._spherical:
            metres, radians = (3, radians - 2) if "radius" in self.names else (2, radians - 2)
        parts = [f"{name}^{n}" if n > 1 else name for name, n in (("m", metres), ("rad", radians)) if n > 0]
        return " ".join(parts)

    # --- words ---------------------------------------------------------------------------------------------------

    def document(self) -> dict[str, Any]:
        """As JSON has it, m and rad."""
        found: dict[str, Any] = {
            "axes": [{"name": a.name, "low": a.low, "high": a.high, "count": a.count} for a in self.axes],
            "at": dict(sorted(self.at.items())),
            "orientation": self.orientation,
        }
        if self.centre is not None:
            found["centre"] = list(self.centre)
        if self.ends is not None:
            found["ends"] = [list(end) for end in self.ends]
        return found

    @classmethod
    def of_document(cls, document: Mapping[str, Any]) -> Region:
        """What `document` has written."""
        return cls(
            tuple(GridAxis(**axis) for axis in document["axes"]),
            document["at"],
            document["orientation"],
            tuple(document["centre"]) if "centre" in document else None,
            tuple(tuple(end) for end in document["ends"]) if "ends" in document else None,  # type: ignore[arg-type]
        )


def straight(first: Sequence[float], last: Sequence[float], count: int, **more: Any) -> Region:
    """The line from one point (3,) to another, m, in so many cells; more as of `Region`.

    Raises:
        MapError: the two are one.
    """
    length = float(np.linalg.norm(np.subtract(last, first)))
    ends = (tuple(map(float, first)), tuple(map(float, last)))
    return Region((GridAxis(ALONG, 0.0, length, count),), ends=ends, **more)  # type: ignore[arg-type]


def pieces(shape: Sequence[int], chunks: Sequence[int]) -> Any:
    """All pieces of a grid, as indices of chunks, the last axis fastest; one after the other, for there may be many."""
    return product(*(range(-(-count // width)) for count, width in zip(shape, chunks, strict=True)))


def piece(index: Sequence[int], shape: Sequence[int], chunks: Sequence[int]) -> tuple[slice, ...]:
    """The cells of a chunk."""
    return tuple(
        slice(i * width, min((i + 1) * width, count)) for i, count, width in zip(index, shape, chunks, strict=True)
    )


def _rotation(axis: int, angles: Array) -> Array:
    """(n, 3, 3) turns about x, y or z."""
    c, s = np.cos(angles), np.sin(angles)
    one, two = (axis + 1) % 3, (axis + 2) % 3
    found = np.zeros((len(angles), 3, 3))
    found[:, axis, axis] = 1.0
    found[:, one, one] = found[:, two, two] = c
    found[:, one, two], found[:, two, one] = -s, s
    return found
