"""The axis of something round: along z of its frame, or between two ends."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from cinegen.collision.scene.table import LEAST, Table


def axis(table: Table) -> tuple[pin.SE3, float]:
    """A frame in its middle whose z runs along it, in the obstacle's frame, and its length, m.

    Its keys: `length`, m, or `ends`, two points in the obstacle's frame (of two numbers: z is 0).

    Raises:
        SceneError: a value is none, there are both keys, or the ends are one point.
    """
    if "ends" not in table:
        return pin.SE3.Identity(), table.size("length")
    if "length" in table:
        raise table.wrong("length", "can't stand beside ends: leave one out")
    ends = np.zeros((2, 3))
    given = table.points("ends", 2, 3)
    if len(given) != 2:
        raise table.wrong("ends", f"must be 2 points, not {len(given)}")
    for end, point in zip(ends, given, strict=True):
        end[: len(point)] = point
    along = ends[1] - ends[0]
    length = float(np.linalg.norm(along))
    if length < LEAST:
        raise table.wrong("ends", "are one point: for a ball, write kind = 'sphere'")
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along / length)
    return pin.SE3(turn.toRotationMatrix(), ends.mean(axis=0)), length
