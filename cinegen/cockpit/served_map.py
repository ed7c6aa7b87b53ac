"""`ServedMap`: a map for the page, as a description and one block of numbers: its reachable cells, with their positions
in the robot's world and the values of its quantities."""

from __future__ import annotations

import math
import threading
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.arrays import Array
from cinegen.cockpit.map_messages import ArrayDescription, AxisShown, MapCell, MapDescription, QuantityShown
from cinegen.joints import kinematic_data
from cinegen.session.setup import MapOverlay
from cinegen.typed_json import encode

MOST = 200_000
"""Largest number of cells that are shown."""

_READ = 10  # times as many cells may be read, since most may be unreachable
_PERCENT = 1.0  # of the values that may be beyond either end of the colours
_BALL = 0.25  # characteristic lengths: radius of the ball on which rotations are shown
_ALONE = 0.05  # characteristic lengths: size of cells that are all at one point
_MIXED = np.array([1.0, np.sqrt(2.0), np.sqrt(3.0)])  # projects different grid points to different numbers
_SAMPLE = 2000  # cells from which the distance to the nearest is measured
_TRANSLATIONS = ("x", "y", "z", "azimuth", "elevation", "radius", "distance")


class MapCells(NamedTuple):
    """The reachable cells of a map at a moment; maps may be incomplete.

    Attributes:
        description: description of the map, and of its arrays as they are served.
        arrays: arrays by name: "numbers" (n,) of the cells in the map, the last axis fastest; "indices" (n, axes) of
            each cell along each axis, among those that are shown; "points" (n, 3), positions in the robot's world, m;
            "edges" (n, 2, 3) of the cells as tiles of a surface, m, if they make one; and the values (n,) of each
            quantity, as "value " and its name.
    """

    description: MapDescription
    arrays: dict[str, NDArray[Any]]


class ServedMap:
    """A map that is drawn with its robot, and may grow meanwhile. Threads may share it.

    Args:
        overlay: map and robot.
        most: largest number of cells that are shown; of a larger map every second, every fourth ... along some axes.

    Raises:
        MapError: there is no map.
    """

    def __init__(self, overlay: MapOverlay, most: int = MOST) -> None:
        from cinegen.workspace import open_map
        from cinegen.workspace.zarr_store import MapStore

        self._store = MapStore(overlay.path)
        self.spec = self._store.spec
        self._overlay, self._most = overlay, most
        self._dataset: Any = open_map(overlay.path)
        self._lock = threading.Lock()
        self._cells = self._read(self._store.done)

    def about(self) -> bytes:
        """Return the description of the map as it is now, as JSON."""
        return encode(self.cells().description)

    def block(self) -> bytes:
        """Return the map as it was last described, for it may grow meanwhile: four bytes with the length of the
        description, the description as JSON, and all arrays, four bytes a number, the lowest first."""
        description, arrays = self._cells
        text = encode(description)
        text += b" " * (-len(text) % 4)  # typed arrays start at multiples of four
        numbers = (array.astype("<u4" if _is_integer(array) else "<f4").tobytes() for array in arrays.values())
        return b"".join([len(text).to_bytes(4, "little"), text, *numbers])

    def cell(self, number: int) -> bytes | None:
        """Return a cell and its configuration, as the command `move_to` takes them; None if it is not reached."""
        region = self.spec.region
        if not 0 <= number < region.size:
            return None
        at = np.unravel_index(number, region.shape)
        with self._lock:
            q = np.asarray(self._dataset["configuration"][at].values, dtype=float)
        return encode(MapCell(self._overlay.robot, self._overlay.node, q.tolist())) if np.isfinite(q).all() else None

    def cells(self) -> MapCells:
        """Return the present cells; they are read again only if the map has grown."""
        with self._lock:
            before = self._cells.description
            if before.done < before.cells:
                done = self._store.done
                if before.done < done:
                    self._cells = self._read(done)
            return self._cells

    # --- reading -------------------------------------------------------------------------------------------------

    def _read(self, done: int) -> MapCells:
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
        cells = indices * every + np.array(every) // 2
        edges = self._edges(at, widths, translates)
        arrays = {
            "numbers": np.ravel_multi_index(tuple(cells.T), region.shape),
            "indices": indices,
            "points": points,
            **({} if edges is None else {"edges": edges}),
            **{f"value {name}": array for name, array in values.items()},
        }
        starts = np.cumsum([0, *(4 * array.size for array in arrays.values())]).tolist()
        description = MapDescription(
            robot=self._overlay.robot,
            node=self._overlay.node,
            axes=tuple(
                AxisShown(name, self._dataset[name].attrs["units"], low, width, count, n, moves or spec.over_joints)
                for name, low, width, count, n, moves in axes
            ),
            quantities=tuple(self._quantity(name, values[name]) for name in spec.quantities),
            quantity=self._overlay.quantity or next(iter(spec.quantities), None),
            size=self._size(points),
            surface=edges is not None,
            shown=len(points),
            done=done,
            cells=region.size,
            arrays={
                name: ArrayDescription(start, array.size, _is_integer(array))
                for start, (name, array) in zip(starts, arrays.items(), strict=False)
            },
        )
        return MapCells(description, arrays)

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
        data, frame = kinematic_data(model), self.spec.mechanism.frame_id(self.spec.node)
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


def _is_integer(array: NDArray[Any]) -> bool:
    return array.dtype.kind in "iu"
