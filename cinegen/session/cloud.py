"""`Cloud`: the reachable cells of a map, with their positions in the world and the values of its quantities."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from msgspec import Struct
from numpy.typing import NDArray

if TYPE_CHECKING:
    from cinegen.workspace.specification import MapSpecification

Array = NDArray[np.float64]

MOST = 200_000
"""Largest number of cells that are shown."""

_READ = 10  # times as many cells may be read, since most may be unreachable
_PERCENT = 1.0  # of the values that may be beyond either end of the colours
_BALL = 0.25  # characteristic lengths: radius of the ball on which rotations are shown
_ALONE = 0.05  # characteristic lengths: size of cells that are all at one point
_MIXED = np.array([1.0, np.sqrt(2.0), np.sqrt(3.0)])  # projects different grid points to different numbers
_SAMPLE = 2000  # cells from which the distance to the nearest is measured
_TRANSLATIONS = ("x", "y", "z", "azimuth", "elevation", "radius", "distance")


class AxisShown(Struct, frozen=True):
    """A coordinate of the map, as it is drawn.

    Attributes:
        name: name of the coordinate.
        unit: m or rad.
        low: center of the first cell, m or rad.
        step: distance of two cells, m or rad.
        count: number of cells.
        every: cells of the map per cell that is drawn.
        translates: whether the coordinate moves the node; otherwise it rotates it.
    """

    name: str
    unit: str
    low: float
    step: float
    count: int
    every: int
    translates: bool


class QuantityShown(Struct, frozen=True):
    """A quantity of the map.

    Attributes:
        name: name of the quantity.
        unit: unit; "1" if it is dimensionless.
        text: description for people.
        low: value at the start of the colours; there may be smaller ones.
        high: value at their end.
        least: smallest value that is drawn; None if no cell has a value.
        most: largest value that is drawn.
    """

    name: str
    unit: str
    text: str
    low: float
    high: float
    least: float | None
    most: float | None


@dataclass(frozen=True, eq=False)
class Cloud:
    """The reachable cells of a map at a moment; maps may be incomplete.

    Attributes:
        axes: axes of the map.
        numbers: (n,) numbers of the cells in the map, the last axis fastest.
        indices: (n, axes) index of each cell along each axis, among those that are shown.
        points: (n, 3) positions in the robot's world, m.
        edges: (n, 2, 3) edges of the cells as tiles of a surface, m; None if they make none.
        size: distance of neighbouring cells, m.
        quantities: quantities of the map.
        values: values (n,) of each quantity.
        done: number of evaluated cells of the map.
        cells: number of cells of the map.
    """

    axes: tuple[AxisShown, ...]
    numbers: NDArray[np.uint32]
    indices: NDArray[np.uint32]
    points: Array
    edges: Array | None
    size: float
    quantities: tuple[QuantityShown, ...]
    values: Mapping[str, NDArray[np.float32]]
    done: int
    cells: int


class ShownMap:
    """A map that is shown, and may grow meanwhile. Threads may share it.

    Args:
        path: path of the map.
        most: largest number of cells that are shown; of a larger map every second, every fourth ... along some axes.

    Raises:
        MapError: there is no map.
    """

    def __init__(self, path: str | Path, most: int = MOST) -> None:
        from cinegen.workspace import open_map
        from cinegen.workspace.zarr_store import MapStore

        self._store = MapStore(Path(path).absolute())
        self._dataset: Any = open_map(path)
        self._most = most
        self._lock = threading.Lock()
        self._cloud: Cloud | None = None

    @property
    def spec(self) -> MapSpecification:
        """Specification of the map."""
        return self._store.spec

    def cloud(self) -> Cloud:
        """Return the present cells; they are read again only if the map has grown."""
        with self._lock:
            if self._cloud is None or self._cloud.done < self._cloud.cells:
                done = self._store.done
                if self._cloud is None or self._cloud.done < done:
                    self._cloud = self._read(done)
            return self._cloud

    def configuration(self, number: int) -> Array | None:
        """Return the configuration (nq,) of a cell by its number; None if it is not reached."""
        region = self.spec.region
        if not 0 <= number < region.size:
            return None
        at = np.unravel_index(number, region.shape)
        with self._lock:
            q = np.asarray(self._dataset["configuration"][at].values, dtype=float)
        return q if np.isfinite(q).all() else None

    # --- reading -------------------------------------------------------------------------------------------------

    def _read(self, done: int) -> Cloud:
        spec, region = self.spec, self.spec.region
        every = [1] * len(region.shape)
        while math.prod(_counts(region.shape, every)) > _READ * self._most:
            _coarsen(region.shape, every)
        while (reached := self._values("reachable", every)).sum() > self._most:
            _coarsen(region.shape, every)
        translates = [name in _TRANSLATIONS for name in region.names]
        widths = np.array([axis.width for axis in region.axes]) * every
        middles = [axis.middles(slice(n // 2, n // 2 + 1))[0] for axis, n in zip(region.axes, every, strict=True)]
        first = np.array(middles)
        indices = np.argwhere(reached)
        at = first + indices * widths
        if spec.over_joints:
            points = self._node_positions(self._values("configuration", every)[reached])
        elif any(translates):
            points = region.poses(spec.home, at)[0]
        else:
            points = self._on_ball(at, first + np.argwhere(np.full(reached.shape, True)) * widths)
        values = {name: self._values(name, every)[reached].astype(np.float32) for name in spec.quantities}
        axes = zip(region.names, first.tolist(), widths.tolist(), reached.shape, every, translates, strict=True)
        own = indices * every + np.array(every) // 2
        return Cloud(
            axes=tuple(
                AxisShown(name, self._dataset[name].attrs["units"], low, width, count, n, moves or spec.over_joints)
                for name, low, width, count, n, moves in axes
            ),
            numbers=np.ravel_multi_index(tuple(own.T), region.shape).astype(np.uint32),
            indices=indices.astype(np.uint32),
            points=points,
            edges=self._edges(at, widths, translates),
            size=self._size(points),
            quantities=tuple(self._quantity(name, values[name]) for name in spec.quantities),
            values=values,
            done=done,
            cells=region.size,
        )

    def _values(self, name: str, every: list[int]) -> NDArray[Any]:
        """Return the values of the shown cells, each in the middle of the cells that it stands for."""
        return np.asarray(self._dataset[name][tuple(slice(n // 2, None, n) for n in every)].values)

    def _on_ball(self, at: Array, everywhere: Array) -> Array:
        """Return points (n, 3) for rotations, m: on a ball around the node.

        Args:
            at: (n, axes) reachable cells.
            everywhere: (m, axes) all cells.
        """
        region, spec = self.spec.region, self.spec
        samples = region.poses(spec.home, everywhere)[1].var(axis=0).sum(axis=0)  # of the node's x, y and z
        axis = int(2 - np.argmax(samples[::-1] > 0.5 * samples.max()))  # the axis that moves most
        points, rotations = region.poses(spec.home, at)
        return points + _BALL * spec.mechanism.length * rotations[:, :, axis]

    def _node_positions(self, configurations: Array) -> Array:
        """Return the positions (n, 3) of the node in configurations (n, nq), m."""
        model, points = self.spec.mechanism.model, np.empty((len(configurations), 3))
        data, frame = model.createData(), self.spec.mechanism.frame_id(self.spec.node)
        for point, q in zip(points, configurations, strict=True):
            pin.forwardKinematics(model, data, q)
            point[:] = pin.updateFramePlacement(model, data, frame).translation
        return points

    def _edges(self, at: Array, widths: Array, translates: list[bool]) -> Array | None:
        """Return the edges (n, 2, 3) of cells with their centres at (n, axes), m; None unless two axes translate."""
        if sum(translates) != 2:
            return None
        edges = []
        for half in 0.5 * np.diag(widths)[translates]:
            low, high = (self.spec.region.poses(self.spec.home, at + sign * half)[0] for sign in (-1.0, 1.0))
            edges.append(high - low)
        return np.stack(edges, axis=1)

    def _size(self, points: Array) -> float:
        from scipy.spatial import cKDTree

        length = self.spec.mechanism.length
        apart = points[np.unique(np.round(points / length, 9) @ _MIXED, return_index=True)[1]]
        if len(apart) < 2:
            return _ALONE * length
        some = apart[:: max(1, len(apart) // _SAMPLE)]
        return float(np.median(cKDTree(apart).query(some, 2)[0][:, 1]))

    def _quantity(self, name: str, values: NDArray[np.float32]) -> QuantityShown:
        known, attributes = values[np.isfinite(values)].astype(float), self._dataset[name].attrs
        low, high, least, most = 0.0, 1.0, None, None
        if len(known):
            cut = 0.0 if np.issubdtype(self._dataset[name].dtype, np.integer) else _PERCENT
            least, low, high, most = np.percentile(known, [0.0, cut, 100.0 - cut, 100.0]).tolist()
        return QuantityShown(name, str(attributes["units"]), str(attributes["long_name"]), low, high, least, most)


def _counts(shape: tuple[int, ...], every: list[int]) -> list[int]:
    return [len(range(n // 2, count, n)) for count, n in zip(shape, every, strict=True)]


def _coarsen(shape: tuple[int, ...], every: list[int]) -> None:
    """Show half as many cells along the axis that has most."""
    every[int(np.argmax(_counts(shape, every)))] *= 2
