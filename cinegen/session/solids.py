"""Shapes that a mechanism is drawn as where its URDF can't say them: they stand in its constraints, so that a copy in
another process, or in a recording, shows the same.

    {"shape": "box", "numbers": [x, y, z], "at": [7 numbers]}              sizes, m
    {"shape": "sphere", "numbers": [radius], "at": ...}
    {"shape": "cylinder" or "capsule", "numbers": [radius, length], "at": ...}   along z
    {"shape": "hull", "numbers": [x, y, z, x, y, z ...], "at": ...}        the corners

A placement is x y z (m) and a quaternion x y z w, as seen from the mechanism's last node.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from cinegen.collision.body import PlacedShape
from cinegen.collision.convex_hull import hull
from cinegen.model import Mechanism

KEY = "solids"
"""In the constraints."""


def said(solids: Iterable[PlacedShape]) -> list[dict[str, Any]]:
    """Shapes as JSON can hold them."""
    return [_said(solid) for solid in solids]


def solids_of(mechanism: Mechanism) -> list[PlacedShape]:
    """What a mechanism is drawn as, in the frame of its last node; nothing where its URDF says it."""
    return [_read(one) for one in (mechanism.source.constraints or {}).get(KEY, ())]


def _said(solid: PlacedShape) -> dict[str, Any]:
    match solid.shape:
        case coal.Box():
            shape, numbers = "box", 2.0 * solid.shape.halfSide
        case coal.Sphere():
            shape, numbers = "sphere", np.array([solid.shape.radius])
        case coal.Cylinder():
            shape, numbers = "cylinder", np.array([solid.shape.radius, 2.0 * solid.shape.halfLength])
        case coal.Capsule():
            shape, numbers = "capsule", np.array([solid.shape.radius, 2.0 * solid.shape.halfLength])
        case coal.Convex():
            shape, numbers = "hull", np.array(solid.shape.points()).ravel()
        case _:
            raise TypeError(f"a {type(solid.shape).__name__} is not drawn")
    return {"shape": shape, "numbers": _numbers(numbers), "at": _numbers(pin.SE3ToXYZQUAT(solid.placement))}


def _read(one: dict[str, Any]) -> PlacedShape:
    at, numbers = pin.XYZQUATToSE3(np.array(one["at"])), np.array(one["numbers"])
    match one["shape"]:
        case "box":
            shape = coal.Box(numbers)
        case "sphere":
            shape = coal.Sphere(*numbers)
        case "cylinder":
            shape = coal.Cylinder(*numbers)
        case "capsule":
            shape = coal.Capsule(*numbers)
        case _:
            shape = hull(numbers.reshape(-1, 3)).shape
    return PlacedShape(at, shape)


def _numbers(values: ArrayLike) -> list[float]:
    numbers: list[float] = np.asarray(values, dtype=float).tolist()
    return numbers
