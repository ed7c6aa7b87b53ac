"""`Cloud`: the cells of a map that robots reach, where they are in the world, and what the map knows of each."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

if TYPE_CHECKING:
    from cinegen.study.maps.region import Region
    from cinegen.study.maps.survey import Survey

Array = NDArray[np.float64]

MOST = 200_000
"""Cells that are shown."""

_LOOKED_AT = 10  # times as many cells may be looked at, for most may be out of reach
_PERCENT = 1.0  # of the values, that may be beyond either end of the colours
_BALL = 0.25  # characteristic lengths: the ball that turns are shown on
_ALONE = 0.05  # characteristic lengths: how wide cells are that are all in one place
_MIXED = np.array([1.0, np.sqrt(2.0), np.sqrt(3.0)])  # no two points of a grid are one number by these
_SAMPLE = 2000  # cells, that the distance to the next one is taken from


@dataclass(frozen=True)
class AxisShown:
    """A coordinate of the map, as it is shown.

    Attributes:
        name: of the coordinate.
        unit: m or rad.
        low: the middle of the first cell that is shown, m or rad.
        step: from there to the next one.
        count: how many are shown.
        every: cells of the map from one that is shown to the next.
        places: whether it moves the cell; else it turns the node there.
    """

    name: str
    unit: str
    low: float
    step: float
    count: int
    every: int
    places: bool


@dataclass(frozen=True)
class QuantityShown:
    """A quantity of the map.

    Attributes:
        name: short.
        unit: "1" where it has none.
        words: what it is.
        low: where the colours begin; values may be below.
        high: where they end.
        least: of the cells that are shown; None where no cell has a value.
        most: of them.
    """

    name: str
    unit: str
    words: str
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
        done: cells of the map that are settled.
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
        from cinegen.study.maps import open_map
        from cinegen.study.maps.store import Store

        self._store = Store(Path(path).absolute())
        self._dataset: Any = open_map(path)
        self._most = most
        self._lock = threading.Lock()
        self._cloud: Cloud | None = None

    @property
    def survey(self) -> Survey:
        """What the map shows."""
        return self._store.survey

    def cloud(self) -> Cloud:
        """The cells as they are now; read again only where the map has grown."""
        with self._lock:
            if self._cloud is None or self._cloud.done < self._cloud.cells:
                done = self._done()
                if self._cloud is None or self._cloud.done < done:
                    self._cloud = self._read(done)
            return self._cloud

    def configuration(self, number: int) -> Array | None:
        """(nq,) of a cell by its number in the map; None where there is no such cell, or it is not reached."""
        region = self.survey.region
        if not 0 <= number < region.size:
            return None
        at = np.unravel_index(number, region.shape)
        with self._lock:
            q = np.asarray(self._dataset["configuration"][at].values, dtype=float)
        return q if np.isfinite(q).all() else None

    def _done(self) -> int:
        return sum(self._store.size(index) for index, there in self._store.look() if there)

    # --- reading -------------------------------------------------------------------------------------------------

    def _read(self, done: int) -> Cloud:
        region = self.survey.region
        every = [1] * len(region.shape)
        while math.prod(_counts(region.shape, every)) > _LOOKED_AT * self._most:
            _thin(region.shape, every)
        while (reached := self._of("reachable", every)).sum() > self._most:
            _thin(region.shape, every)
        shown = replace(region, axes=tuple(_wider(axis, one) for axis, one in zip(region.axes, every, strict=True)))
        places = [name in _PLACES for name in region.names]
        indices = np.argwhere(reached)
        own = indices * every + [one // 2 for one in every]
        points = self._points(shown, reached, every, any(places))
        values, quantities = self._quantities(reached, every)
        return Cloud(
            tuple(
                AxisShown(axis.name, self._dataset[axis.name].attrs["units"], float(axis.middles()[0]), axis.width,
                          axis.count, one, moves or self.survey.of_motors)
                for axis, one, moves in zip(shown.axes, every, places, strict=True)
            ),
            np.ravel_multi_index(tuple(own.T), region.shape).astype(np.uint32),
            indices.astype(np.uint32),
            points,
            self._edges(shown, reached.ravel(), places),
            self._size(points),
            quantities,
            values,
            done,
            region.size,
        )  # fmt: skip

    def _of(self, name: str, every: list[int]) -> NDArray[Any]:
        """Of those cells that are shown, from the middle of what each stands for."""
        return np.asarray(self._dataset[name][tuple(slice(one // 2, None, one) for one in every)].values)

    def _points(self, shown: Region, reached: NDArray[np.bool_], every: list[int], placed: bool) -> Array:
        survey, mask = self.survey, reached.ravel()
        if survey.of_motors:
            return self._led(self._of("configuration", every)[reached])
        points, rotations = shown.poses(survey.home, _all(shown))
        if placed:
            return points[mask]
        spread = rotations.var(axis=0).sum(axis=0)  # of x, y and z: that which moves most is what one sees
        axis = int(2 - np.argmax(spread[::-1] > 0.5 * spread.max()))
        turned = np.broadcast_to(rotations, (len(points), 3, 3))[:, :, axis]
        return (points + _BALL * survey.mechanism.length * turned)[mask]

    def _led(self, configurations: Array) -> Array:
        """(n, 3) m, where the node is in configurations (n, nq)."""
        model, points = self.survey.mechanism.model, np.empty((len(configurations), 3))
        data, frame = model.createData(), self.survey.mechanism.frame_id(self.survey.node)
        for point, q in zip(points, configurations, strict=True):
            pin.forwardKinematics(model, data, q)
            point[:] = pin.updateFramePlacement(model, data, frame).translation
        return points

    def _edges(self, shown: Region, mask: NDArray[np.bool_], places: list[bool]) -> Array | None:
        if sum(places) != 2:
            return None
        edges = []
        for k in np.flatnonzero(places):
            ends = []
            for half in (-0.5, 0.5):
                axes = list(shown.axes)
                shift = half * axes[k].width
                axes[k] = replace(axes[k], low=axes[k].low + shift, high=axes[k].high + shift)
                ends.append(replace(shown, axes=tuple(axes)).poses(self.survey.home, _all(shown))[0])
            edges.append((ends[1] - ends[0])[mask])
        return np.stack(edges, axis=1)

    def _size(self, points: Array) -> float:
        from scipy.spatial import cKDTree

        length = self.survey.mechanism.length
        apart = points[np.unique(np.round(points / length, 9) @ _MIXED, return_index=True)[1]]
        if len(apart) < 2:
            return _ALONE * length
        some = apart[:: max(1, len(apart) // _SAMPLE)]
        return float(np.median(cKDTree(apart).query(some, 2)[0][:, 1]))

    def _quantities(
        self, reached: NDArray[np.bool_], every: list[int]
    ) -> tuple[dict[str, NDArray[np.float32]], tuple[QuantityShown, ...]]:
        values, found = {}, []
        for name in self.survey.quantities:
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


_PLACES = ("x", "y", "z", "azimuth", "elevation", "radius", "way")
"""Coordinates that say where a node is."""


def _counts(shape: tuple[int, ...], every: list[int]) -> list[int]:
    return [len(range(one // 2, count, one)) for count, one in zip(shape, every, strict=True)]


def _thin(shape: tuple[int, ...], every: list[int]) -> None:
    """Half as many along the axis that has most."""
    every[int(np.argmax(_counts(shape, every)))] *= 2


def _wider(axis: Any, every: int) -> Any:
    """An axis of every so manieth cell, each as wide as what it stands for; its middles are those of the cells."""
    count = len(range(every // 2, axis.count, every))
    low = axis.low + (every // 2 + 0.5 - 0.5 * every) * axis.width
    return replace(axis, low=low, high=low + count * every * axis.width, count=count)


def _all(region: Region) -> tuple[slice, ...]:
    return tuple(slice(0, count) for count in region.shape)
