"""`Cloud`: the cells of a map that robots reach, where they are in the world, and what the map knows of each."""

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
"""Cells that are shown."""

_LOOKED_AT = 10  # times as many cells may be looked at, for most may be out of reach
_PERCENT = 1.0  # of the values, that may be beyond either end of the colours
_BALL = 0.25  # characteristic lengths: the ball that turns are shown on
_ALONE = 0.05  # characteristic lengths: how wide cells are that are all in one place
_MIXED = np.array([1.0, np.sqrt(2.0), np.sqrt(3.0)])  # no two points of a grid are one number by these
_SAMPLE = 2000  # cells, that the distance to the next one is taken from


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
    """Cells that are reached, as the map has them now.

    Attributes:
        axes: of the map.
        numbers: (n,) of the cells in the map, the last axis fastest.
        indices: (n, axes) of each among those of an axis that are shown.
        points: (n, 3) m, where they are in the robot's world.
        edges: (n, 2, 3) m, from one side of a cell to the other, where they make a surface; None where they make none.
        size: m, from one cell to the next.
        quantities: of the map.
        values: of each quantity (n,).
        done: number of evaluated cells of the map.
        cells: of the map in all.
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
    """A map that is shown, while it may still grow. Threads may share it.

    Args:
        path: of the map.
        most: cells that are shown; of a larger map every second, every fourth ... along some axes.

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
        """What the map shows."""
        return self._store.spec

    def cloud(self) -> Cloud:
        """The cells as they are now; read again only where the map has grown."""
        with self._lock:
            if self._cloud is None or self._cloud.done < self._cloud.cells:
                done = self._store.done
                if self._cloud is None or self._cloud.done < done:
                    self._cloud = self._read(done)
            return self._cloud

    def configuration(self, number: int) -> Array | None:
        """(nq,) of a cell by its number in the map; None where there is no such cell, or it is not reached."""
        region = self.spec.region
        if not 0 <= number < region.size:
            return None
        at = np.unravel_index(number, region.shape)
        with self._lock:
            q = np.asarray(self._dataset["configuration"][at].values, dtype=float)
        return q if np.isfinite(q).all() else None

    # --- reading -------------------------------------------------------------------------------------------------

    def _read(self, done: int) -> Cloud:
        region = self.spec.region
        every = [1] * len(region.shape)
        while math.prod(_counts(region.shape, every)) > _LOOKED_AT * self._most:
            _thin(region.shape, every)
        while (reached := self._of("reachable", every)).sum() > self._most:
            _thin(region.shape, every)
        places = [name in _PLACES for name in region.names]
        widths = np.array([one * axis.width for axis, one in zip(region.axes, every, strict=True)])
        first = [float(axis.middles(slice(one // 2, one // 2 + 1))[0])
                 for axis, one in zip(region.axes, every, strict=True)]  # fmt: skip
        indices = np.argwhere(reached)
        own = indices * every + [one // 2 for one in every]
        at = first + indices * widths
        if self.spec.over_joints:
            points = self._led(self._of("configuration", every)[reached])
        elif any(places):
            points = region.poses(self.spec.home, at)[0]
        else:
            points = self._turned(at, first + np.argwhere(np.full(reached.shape, True)) * widths)
        values, quantities = self._quantities(reached, every)
        return Cloud(
            tuple(
                AxisShown(name, self._dataset[name].attrs["units"], low, float(width), count, one,
                          moves or self.spec.over_joints)
                for name, low, width, count, one, moves in zip(
                    region.names, first, widths, reached.shape, every, places, strict=True
                )
            ),
            np.ravel_multi_index(tuple(own.T), region.shape).astype(np.uint32),
            indices.astype(np.uint32),
            points,
            self._edges(at, widths, places),
            self._size(points),
            quantities,
            values,
            done,
            region.size,
        )  # fmt: skip

    def _of(self, name: str, every: list[int]) -> NDArray[Any]:
        """Of those cells that are shown, from the middle of what each stands for."""
        return np.asarray(self._dataset[name][tuple(slice(one // 2, None, one) for one in every)].values)

    def _turned(self, at: Array, everywhere: Array) -> Array:
        """(n, 3) m, on a ball about where the node is, at values (n, axes) of turns.

        Args:
            at: cells that are reached.
            everywhere: likewise, all.
        """
        region, spec = self.spec.region, self.spec
        spread = region.poses(spec.home, everywhere)[1].var(axis=0).sum(axis=0)  # of the node's x, y and z
        axis = int(2 - np.argmax(spread[::-1] > 0.5 * spread.max()))  # that which moves most is what one sees
        points, rotations = region.poses(spec.home, at)
        return points + _BALL * spec.mechanism.length * rotations[:, :, axis]

    def _led(self, configurations: Array) -> Array:
        """(n, 3) m, where the node is in configurations (n, nq)."""
        model, points = self.spec.mechanism.model, np.empty((len(configurations), 3))
        data, frame = model.createData(), self.spec.mechanism.frame_id(self.spec.node)
        for point, q in zip(points, configurations, strict=True):
            pin.forwardKinematics(model, data, q)
            point[:] = pin.updateFramePlacement(model, data, frame).translation
        return points

    def _edges(self, at: Array, widths: Array, places: list[bool]) -> Array | None:
        """(n, 2, 3) m, across cells whose middles are at (n, axes)."""
        if sum(places) != 2:
            return None
        edges = []
        for half in 0.5 * np.diag(widths)[places]:
            before, behind = (self.spec.region.poses(self.spec.home, at + way * half)[0] for way in (-1.0, 1.0))
            edges.append(behind - before)
        return np.stack(edges, axis=1)

    def _size(self, points: Array) -> float:
        from scipy.spatial import cKDTree

        length = self.spec.mechanism.length
        apart = points[np.unique(np.round(points / length, 9) @ _MIXED, return_index=True)[1]]
        if len(apart) < 2:
            return _ALONE * length
        some = apart[:: max(1, len(apart) // _SAMPLE)]
        return float(np.median(cKDTree(apart).query(some, 2)[0][:, 1]))

    def _quantities(
        self, reached: NDArray[np.bool_], every: list[int]
    ) -> tuple[dict[str, NDArray[np.float32]], tuple[QuantityShown, ...]]:
        values, found = {}, []
        for name in self.spec.quantities:
            values[name] = self._of(name, every)[reached].astype(np.float32)
            known = values[name][np.isfinite(values[name])].astype(float)
            attributes = self._dataset[name].attrs
            whole = np.issubdtype(self._dataset[name].dtype, np.integer)
            low, high = 0.0, 1.0
            if len(known):
                low, high = np.percentile(known, [0.0, 100.0] if whole else [_PERCENT, 100.0 - _PERCENT]).tolist()
            found.append(
                QuantityShown(
                    name, str(attributes["units"]), str(attributes["long_name"]), low, high,
                    float(known.min()) if len(known) else None, float(known.max()) if len(known) else None,
                )
            )  # fmt: skip
        return values, tuple(found)


_PLACES = ("x", "y", "z", "azimuth", "elevation", "radius", "distance")
"""Coordinates that say where a node is."""


def _counts(shape: tuple[int, ...], every: list[int]) -> list[int]:
    return [len(range(one // 2, count, one)) for count, one in zip(shape, every, strict=True)]


def _thin(shape: tuple[int, ...], every: list[int]) -> None:
    """Half as many along the axis that has most."""
    every[int(np.argmax(_counts(shape, every)))] *= 2
