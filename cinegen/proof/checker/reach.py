"""Boxes of poses without a configuration: equation 8 of docs/proof.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from flint import arb, arb_mat

from cinegen.proof.checker.equations import ALONG, ONE, POINT, Robot, Value, rotations


def excludes(robot: Robot, low: Sequence[float], high: Sequence[float]) -> bool:
    """Return whether no pose of a box has a configuration: equation 8."""
    values = robot.point([arb(0)] * len(robot.unknown), [arb(a).union(arb(b)) for a, b in zip(low, high, strict=True)])
    turning = {k for k in robot.unknown if not robot.variables[k]["prismatic"]}
    for k in {*robot.unknown} - turning:
        ends = [
            inf if end is None or not robot.data["bounds"]["limits"] else end for end in robot.variables[k]["limits"]
        ]
        values[k] = Value(arb(ends[0]).union(arb(ends[1])), [], arb(0))
    return any(
        _is_open(robot, closure, values, turning)
        for closure in robot.data["closures"]
        if len(closure["translations"]) == 3
    )


def _is_open(robot: Robot, closure: Mapping[str, Any], values: Sequence[Value], turning: set[int]) -> bool:
    """Return whether one of a closure's rods, between unknown rotations, is longer than all others together."""
    sides = list[list[arb_mat]]()
    for side in ("first", "second"):
        rods, along = list[arb_mat](), ONE
        for index, k in [*closure[side], (closure[f"{side}_end"], None)]:
            along = along * robot.placements[index]
            if k is None or k in turning:
                rods.append(along * POINT)
                along = ONE
            elif robot.variables[k]["prismatic"]:
                along = along * (ONE + ALONG * values[k].c)
            else:
                along = along * rotations(values[k].c, 0)[0]
        sides.append(rods)
    (a, *first), (b, *second) = sides
    vectors = [[m[i, 3] for i in range(3)] for m in (a - b, *first, *second)]
    shortest, longest = (
        [sum((size(x) ** 2 for x in rod), arb(0)).sqrt() for rod in vectors] for size in (arb.abs_lower, arb.abs_upper)
    )
    return any(a + b > sum(longest, arb(0)) for a, b in zip(shortest, longest, strict=True))
