"""`ServedMap`: a map for the page, as a description and one block of numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.cockpit.messages import ArrayDescription, MapCell, MapDescription
from cinegen.session.cloud import Cloud, ShownMap
from cinegen.session.setup import MapOverlay
from cinegen.typed_json import encode


class ServedMap:
    """A map that is drawn with its robot. Threads may share it.

    Args:
        overlay: map and robot.

    Raises:
        MapError: there is no map.
    """

    def __init__(self, overlay: MapOverlay) -> None:
        self._overlay, self._map = overlay, ShownMap(overlay.path)
        self._cloud = self._map.cloud()

    def about(self) -> bytes:
        """Return the description of the map as it is now, as JSON."""
        self._cloud = self._map.cloud()
        return encode(self._description(self._cloud, _arrays(self._cloud)))

    def block(self) -> bytes:
        """Return the map as `about` last described it, for it may grow meanwhile: four bytes with the length of the
        description, the description as JSON, and all arrays, four bytes a number, the lowest first."""
        cloud = self._cloud
        arrays = _arrays(cloud)
        text = encode(self._description(cloud, arrays))
        text += b" " * (-len(text) % 4)  # typed arrays start at multiples of four
        return b"".join([len(text).to_bytes(4, "little"), text, *(array.tobytes() for array in arrays.values())])

    def cell(self, number: int) -> bytes | None:
        """Return the configuration of a cell by its number in the map, as JSON; None if there is none."""
        q = self._map.configuration(number)
        return None if q is None else encode(MapCell(self._overlay.robot, self._overlay.node, q.tolist()))

    def _description(self, cloud: Cloud, arrays: dict[str, NDArray[Any]]) -> MapDescription:
        described, at = {}, 0
        for name, array in arrays.items():
            described[name] = ArrayDescription(at, array.size, array.dtype.kind == "u")
            at += array.nbytes
        return MapDescription(
            robot=self._overlay.robot,
            node=self._overlay.node,
            axes=cloud.axes,
            quantities=cloud.quantities,
            quantity=self._overlay.quantity or next((one.name for one in cloud.quantities), None),
            size=cloud.size,
            surface=cloud.edges is not None,
            shown=len(cloud.points),
            done=cloud.done,
            cells=cloud.cells,
            arrays=described,
        )


def _arrays(cloud: Cloud) -> dict[str, NDArray[Any]]:
    """Return arrays by name; the values of a quantity are "value " and its name."""
    edges = {} if cloud.edges is None else {"edges": cloud.edges.astype("<f4")}
    return {
        "numbers": cloud.numbers.astype("<u4"),
        "indices": cloud.indices.astype("<u4"),
        "points": cloud.points.astype("<f4"),
        **edges,
        **{f"value {name}": np.asarray(values).astype("<f4") for name, values in cloud.values.items()},
    }
