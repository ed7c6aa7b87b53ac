"""A map as the page has it: what there is to say of it as JSON, and its cells as one block of numbers."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.cockpit.frames import finite, numbers
from cinegen.session import Cloud, MapBeside, ShownMap


class Chart:
    """A map beside a robot. Threads may share it.

    Args:
        beside: which map, and which robot.

    Raises:
        MapError: there is no map.
    """

    def __init__(self, beside: MapBeside) -> None:
        self._beside, self._map = beside, ShownMap(beside.path)
        self._cloud = self._map.cloud()

    def told(self) -> dict[str, Any]:
        """What there is to say of the map as it is now, and where each array begins among all of `block`, bytes."""
        self._cloud = self._map.cloud()
        return self._said(self._cloud, _arrays(self._cloud))

    def block(self) -> bytes:
        """The map as it was when last told, in one, for it may grow meanwhile: how many bytes are said of it, four;
        what is said, JSON; and all arrays one behind the other, four bytes a number. The lowest byte first."""
        cloud = self._cloud
        arrays = _arrays(cloud)
        said = json.dumps(self._said(cloud, arrays)).encode()
        said += b" " * (-len(said) % 4)  # browsers want numbers at whole multiples of four
        return b"".join([len(said).to_bytes(4, "little"), said, *(array.tobytes() for array in arrays.values())])

    def cell(self, number: int) -> dict[str, Any] | None:
        """The configuration of a cell by its number in the map; None where there is none."""
        q = self._map.configuration(number)
        return None if q is None else {"robot": self._beside.robot, "node": self._beside.node, "q": numbers(q)}

    def _said(self, cloud: Cloud, arrays: dict[str, NDArray[Any]]) -> dict[str, Any]:
        beside = self._beside
        places, at = {}, 0
        for name, array in arrays.items():
            places[name] = {"at": at, "count": array.size, "whole": array.dtype.kind == "u"}
            at += array.nbytes
        return {
            "robot": beside.robot,
            "node": beside.node,
            "axes": [
                {"name": a.name, "unit": a.unit, "low": a.low, "step": a.step, "count": a.count, "every": a.every,
                 "places": a.places}
                for a in cloud.axes
            ],
            "quantities": [
                {"name": q.name, "unit": q.unit, "words": q.words, "low": q.low, "high": q.high, "least": q.least,
                 "most": q.most}
                for q in cloud.quantities
            ],
            "quantity": beside.quantity or next((one.name for one in cloud.quantities), None),
            "size": finite(cloud.size),
            "surface": cloud.edges is not None,
            "shown": len(cloud.points),
            "done": cloud.done,
            "cells": cloud.cells,
            "arrays": places,
        }  # fmt: skip


def _arrays(cloud: Cloud) -> dict[str, NDArray[Any]]:
    """By name; values of a quantity by "value " and its name."""
    edges = {} if cloud.edges is None else {"edges": cloud.edges.astype("<f4")}
    return {
        "numbers": cloud.numbers.astype("<u4"),
        "indices": cloud.indices.astype("<u4"),
        "points": cloud.points.astype("<f4"),
        **edges,
        **{f"value {name}": np.asarray(values).astype("<f4") for name, values in cloud.values.items()},
    }
