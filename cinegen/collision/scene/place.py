"""Where something stands: `point`, and how it is turned, `rpy` or `angle`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.scene.table import Table

Array = NDArray[np.float64]


def placement(table: Table) -> pin.SE3:
    """In the world; at its origin, and not turned, unless the table says so.

    Its keys: `point` (two numbers: z is 0), m; `rpy`, turns about the fixed x, y and z, as a URDF has them, or `angle`,
    the turn about z, rad.

    Raises:
        SceneError: a value is none, or there are both `rpy` and `angle`.
    """
    point = np.zeros(3)
    if "point" in table:
        given = table.vector("point", 2, 3)
        point[: len(given)] = given
    return pin.SE3(rotation(table), point)


def rotation(table: Table) -> Array:
    """(3, 3) of `rpy` or `angle`.

    Raises:
        SceneError: as `placement` does.
    """
    if "rpy" in table and "angle" in table:
        raise table.wrong("angle", "can't stand beside rpy: leave one out")
    if "rpy" in table:
        return np.asarray(pin.rpy.rpyToMatrix(table.vector("rpy", 3)))
    return about_z(table.number("angle") if "angle" in table else 0.0)


def about_z(angle: float) -> Array:
    """(3, 3) a turn about z."""
    return np.asarray(pin.rpy.rpyToMatrix(0.0, 0.0, angle))


def said(placement: pin.SE3) -> dict[str, Any]:
    """The keys that `placement` reads."""
    return {"point": placement.translation.tolist(), "rpy": pin.rpy.matrixToRpy(placement.rotation).tolist()}
