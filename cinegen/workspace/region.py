"""`Region`: the grid of a map, and the pose of the node or the values of joints in each of its cells.

The grid's axes are coordinates of a node's pose or actuated joints. A cell is evaluated at its middle and counts as a
whole, so that volumes are sums of cells.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import msgspec
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from cinegen.arrays import Array
from cinegen.model import Mechanism
from cinegen.singularities.slice import POSE
from cinegen.workspace.errors import MapError
from raff2urdf.errors import did_you_mean

SPHERICAL = ("azimuth", "elevation", "radius")
"""Position seen from a centre: rad about z from x, rad up from the plane of x and y, m."""

DISTANCE = "distance"
"""Position along a line: m from its first point."""

ORIENTATIONS = ("free", "axis", "fixed")
"""How much of the node's orientation is given: nothing; the direction of its z axis; all."""

_ANGLE = 1e-9  # rad, of rounding
_MOST = 2**62
"""Cells that can be counted."""


@dataclass(frozen=True)
class GridAxis:
    """A coordinate that is divided into cells of equal width.

    Attributes:
        name: of `POSE`, `SPHERICAL`, an actuated joint, or `DISTANCE`.
        low: lower end of the first cell, m or rad.
        high: upper end of the last cell, m or rad.
        count: number of cells.

    Raises:
        MapError: the range is empty, or there are no cells.
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
        """Width of a cell, m or rad."""
        return (self.high - self.low) / self.count

    @property
    def borders(self) -> Array:
        """(count + 1,) borders of the cells, m or rad."""
        return np.linspace(self.low, self.high, self.count + 1)

    def middles(self, cells: slice = slice(None)) -> Array:
        """Return the middles (n,) of some cells, m or rad."""
        first, last, _ = cells.indices(self.count)
        return np.asarray(self.low + (np.arange(first, last) + 0.5) * self.width)


@dataclass(frozen=True)
class Region:
    """The grid of a map.

    Attributes:
        axes: coordinates of a pose (`POSE`), or all of a position seen from a centre (`SPHERICAL`), with or without
            rotations (rx, ry, rz); or the distance along a line (`DISTANCE`); or actuated joints alone.
        at: fixed values of other coordinates, m and rad; those of a position and of actuated joints that are not given
            are those of the home configuration.
        orientation: of `ORIENTATIONS`; how much of the node's orientation is given.
        centre: (3,) m, the centre of `SPHERICAL`; the origin unless given.
        ends: two points (3,), m, of the line of `DISTANCE`.

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
            raise MapError("a map needs at least one axis")
        coordinates = [*names, *self.at]
        if twice := sorted({name for name in coordinates if coordinates.count(name) > 1}):
            raise MapError(f"{', '.join(twice)} is given twice")
        if self.orientation not in ORIENTATIONS:
            raise MapError(f"unknown orientation '{self.orientation}'{did_you_mean(self.orientation, ORIENTATIONS)}")
        for name, value in self.at.items():
            if not math.isfinite(value):
                raise MapError(f"{name}={value}: give a finite number")
        positions = [name for name in names if name in (*SPHERICAL, DISTANCE)]
        if positions and (clash := [name for name in coordinates if name in POSE[:3]]):
            raise MapError(f"both {positions[0]} and {clash[0]} give the node's position: leave one out")
        spherical = [name for name in SPHERICAL if name in coordinates]
        if spherical and (missing := [name for name in SPHERICAL if name not in spherical]):
            raise MapError(
                f"{', '.join(spherical)} give the position seen from a centre only together with {', '.join(missing)}"
            )
        for axis in self.axes:
            if axis.name == "elevation" and max(-axis.low, axis.high) > 0.5 * math.pi + _ANGLE:
                raise MapError(f"elevation from {axis.low:g} to {axis.high:g} rad: it goes from -90 to 90 degrees")
            if axis.name == "azimuth" and axis.high - axis.low > 2.0 * math.pi + _ANGLE:
                raise MapError(f"azimuth from {axis.low:g} to {axis.high:g} rad: that is more than a revolution")
        if DISTANCE in names and any(name in SPHERICAL for name in names):
            raise MapError(f"both {DISTANCE} and {positions[0]} give the node's position: leave one out")

    def __repr__(self) -> str:
        return f"<Region {' x '.join(map(str, self.shape))} cells over {', '.join(self.names)}>"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(axis.name for axis in self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of cells along each axis."""
        return tuple(axis.count for axis in self.axes)

    @property
    def size(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    def is_over_joints(self, mechanism: Mechanism) -> bool:
        """Return whether the axes are actuated joints of a mechanism, not coordinates of a pose.

        Raises:
            MapError: they are neither, or both.
        """
        actuated = [name in mechanism.actuated for name in (*self.names, *self.at)]
        if all(actuated):
            return True
        known = (*POSE, *SPHERICAL, DISTANCE)
        for name in (*self.names, *self.at):
            if name in mechanism.actuated:
                raise MapError(f"{mechanism.name}: coordinates of a pose and actuated joints ({name}) can't be mixed")
            if name not in known:
                choice = f"{', '.join(POSE)} (of a node), {', '.join(SPHERICAL)}, or actuated joints: "
                choice += ", ".join(mechanism.actuated)
                raise MapError(f"{mechanism.name}: unknown coordinate '{name}'; there are {choice}")
        return False

    # --- coordinates ---------------------------------------------------------------------------------------------

    def values(self, cells: tuple[slice, ...]) -> Array:
        """Return the coordinates (n, axes) of the middles of some cells, m and rad, the last axis fastest."""
        middles = [axis.middles(part) for axis, part in zip(self.axes, cells, strict=True)]
        grid = np.meshgrid(*middles, indexing="ij")
        return np.column_stack([values.ravel() for values in grid])

    def joint_values(self, mechanism: Mechanism, values: Array) -> Array:
        """Return the values (n, actuated) of all actuated joints, rad and m, at coordinates (n, axes)."""
        home = {name: mechanism.q_home[mechanism.q_index(name)] for name in mechanism.actuated}
        joints = np.tile([float(self.at.get(name, value)) for name, value in home.items()], (len(values), 1))
        joints[:, [mechanism.actuated.index(name) for name in self.names]] = values
        return joints

    def poses(self, home: pin.SE3, values: Array) -> tuple[Array, Array]:
        """Return the poses of the node in the world.

        Args:
            home: its pose in the home configuration, for the coordinates that are not given.
            values: (n, axes) coordinates, m and rad.

        Returns:
            positions (n, 3), m, and rotations (n, 3, 3), or (1, 3, 3) where all are the same.
        """
        column = {name: values[:, k] for k, name in enumerate(self.names)}
        points = np.empty((len(values), 3))
        for k, name in enumerate(POSE[:3]):
            points[:, k] = column.get(name, self.at.get(name, home.translation[k]))
        if DISTANCE in column:
            if self.ends is None:
                raise MapError(f"'{DISTANCE}' is measured from one point to another: give both (`Region.ends`)")
            first, last = np.asarray(self.ends)
            points = first + column[DISTANCE][:, None] * (last - first) / np.linalg.norm(last - first)
        elif any(name in SPHERICAL for name in (*self.names, *self.at)):
            azimuth, elevation, radius = (
                np.broadcast_to(column.get(name, self.at.get(name, 0.0)), len(values)) for name in SPHERICAL
            )
            flat = radius * np.cos(elevation)
            away = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), radius * np.sin(elevation)])
            points = (np.zeros(3) if self.centre is None else np.asarray(self.centre)) + away
        return points, self._rotations(column, home)

    def _rotations(self, column: Mapping[str, Array], home: pin.SE3) -> Array:
        if not any(name in column or name in self.at for name in POSE[3:]):
            return np.asarray(home.rotation)[None]
        at_home = pin.rpy.matrixToRpy(home.rotation)
        angles = [column.get(name, np.array([self.at.get(name, at_home[k])])) for k, name in enumerate(POSE[3:])]
        return np.asarray(Rotation.from_euler("xyz", np.column_stack(np.broadcast_arrays(*angles))).as_matrix())

    # --- sizes ---------------------------------------------------------------------------------------------------

    @cached_property
    def sizes(self) -> tuple[Array, ...]:
        """For each axis (count,) factors whose product is the size of a cell.

        Sizes are lengths, areas or volumes, times rad for each rotation; over actuated joints products of rad and m.
        Cells in spherical coordinates are parts of a sphere or a ball.
        """
        factors = []
        for axis in self.axes:
            borders = axis.borders
            if axis.name == "elevation" and self._spherical:
                radius = 1.0 if "radius" in self.names else self.at.get("radius", 1.0)
                factors.append(np.diff(np.sin(borders)) * radius**2)
            elif axis.name == "radius" and self._spherical:
                factors.append(np.diff(borders**3) / 3.0)
            else:
                factors.append(np.full(axis.count, axis.width))
        return tuple(factors)

    @property
    def _spherical(self) -> bool:
        """True if cells are parts of a sphere."""
        return "azimuth" in self.names and "elevation" in self.names

    @property
    def periodic(self) -> list[bool]:
        """True for each axis that is a whole revolution about a centre, so that its ends meet."""
        return [axis.name == "azimuth" and axis.high - axis.low > 2.0 * math.pi - _ANGLE for axis in self.axes]

    def units(self, mechanism: Mechanism) -> tuple[str, ...]:
        """Return the unit of each axis: m or rad."""
        lengths = {*POSE[:3], DISTANCE, "radius", *filter(mechanism.is_prismatic, mechanism.joints)}
        return tuple("m" if name in lengths else "rad" for name in self.names)

    def unit(self, mechanism: Mechanism) -> str:
        """Return the unit of the size of a cell, such as m^2 or m rad."""
        units = self.units(mechanism)
        metres, radians = units.count("m"), units.count("rad")
        if self._spherical:
            metres, radians = (3 if "radius" in self.names else 2), radians - 2
        parts = [f"{name}^{n}" if n > 1 else name for name, n in (("m", metres), ("rad", radians)) if n > 0]
        return " ".join(parts)

    # --- JSON ----------------------------------------------------------------------------------------------------

    def document(self) -> dict[str, Any]:
        """Return the region as JSON values, m and rad; whole numbers are written like others."""
        plain = json.loads(
            json.dumps(asdict(self), default=lambda number: number.item())
        )  # numpy's numbers are Python's
        return asdict(self.of_document(plain))

    @classmethod
    def of_document(cls, document: Mapping[str, Any]) -> Region:
        """Return the region that `document` wrote."""
        return msgspec.convert(document, cls)


def line_region(first: Sequence[float], last: Sequence[float], count: int, **more: Any) -> Region:
    """Return the line from one point (3,) to another, m, as a region of `count` cells.

    Args:
        first: (3,) m, where the line begins.
        last: (3,) m, where it ends.
        count: number of cells.
        more: `at` and `orientation` of `Region`.

    Raises:
        MapError: the two points are the same.
    """
    length = float(np.linalg.norm(np.subtract(last, first)))
    ends = (tuple(map(float, first)), tuple(map(float, last)))
    return Region((GridAxis(DISTANCE, 0.0, length, count),), ends=ends, **more)  # type: ignore[arg-type]
