"""Where a node is to go: `[goal]`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.collision.scene.place import about_z, rotation
from cinegen.collision.scene.table import LEAST, Table


@dataclass(frozen=True, eq=False)
class Goal:
    """A place, and how many components of it count, in the world's axes (`FrameTask` with `axes="world"`).

    Attributes:
        placement: of the node, in the world.
        translation: 3 all, 2 only x and y.
        rotation: 3 all, 1 only the turn about z, 0 none.
    """

    placement: pin.SE3
    translation: int
    rotation: int


def goal(table: Table, node: pin.SE3) -> Goal:
    """Reads one.

    Its keys: `point`, three numbers, or two: then z does not count and is the node's at the start; m. With `rpy`, how
    the node is turned there; with `angle`, only where its x axis points, seen from above, rad. With neither, its
    orientation does not count.

    Args:
        table: of a scene.
        node: where the node is at the start.

    Raises:
        SceneError: a value is wrong, or there is no point.
    """
    given = table.vector("point", 2, 3)
    point = np.array([*given, node.translation[2]])[:3]
    turned, count = rotation(table), 3 if "rpy" in table else int("angle" in table)
    if count == 1:
        if np.linalg.norm(node.rotation[:2, 0]) < LEAST:
            raise table.wrong("angle", "can't be told: the node's x axis is upright at the start; write rpy")
        turned = about_z(table.number("angle") - _heading(node)) @ node.rotation
    table.finish()
    return Goal(pin.SE3(turned, point), len(given), count)


def said_goal(goal: Goal) -> dict[str, Any]:
    """The keys that `goal` reads."""
    found: dict[str, Any] = {"point": goal.placement.translation[: goal.translation].tolist()}
    if goal.rotation == 3:
        found["rpy"] = pin.rpy.matrixToRpy(goal.placement.rotation).tolist()
    elif goal.rotation == 1:
        found["angle"] = _heading(goal.placement)
    return found


def _heading(placement: pin.SE3) -> float:
    """Where its x axis points, seen from above, rad."""
    return math.atan2(placement.rotation[1, 0], placement.rotation[0, 0])
