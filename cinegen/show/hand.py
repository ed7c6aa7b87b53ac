"""A person's hand in the page: which part of which robot it holds, and where it leads it.

The browser says it in JSON, at most `LONGEST` characters at a time:

    {"take": {"robot": "delta4", "node": "link5", "point": [x, y, z]}}   the point as seen from the node, m
    {"lead": [x, y, z]}                                                  where that point should be in the world, m
    {"let go": true}
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

LONGEST = 1000
"""Characters of a message."""

FURTHEST = 1e6
"""m: no point is further away."""

Point = tuple[float, float, float]


class HandError(ValueError):
    """A message that makes no sense; says why."""


@dataclass(frozen=True, slots=True)
class Hand:
    """What a hand holds.

    Attributes:
        robot: its name in the page.
        node: of the robot.
        point: of the node, as seen from it, m.
        target: where that should be, in the world, m; None until the hand moves.
    """

    robot: str
    node: str
    point: Point
    target: Point | None = None


def after(message: str | bytes, hand: Hand | None, nodes: Mapping[str, Collection[str]]) -> Hand | None:
    """What a hand holds after a message.

    Args:
        message: what the browser says.
        hand: what it held before.
        nodes: of each robot that there is.

    Raises:
        HandError: the message makes no sense.
    """
    said = _read(message)
    if "let go" in said:
        return None
    if "lead" in said:
        return None if hand is None else replace(hand, target=_point(said["lead"]))  # late, after it let go
    taken = said.get("take")
    if not isinstance(taken, dict):
        raise HandError("a message takes, leads or lets go")
    robot, node = taken.get("robot"), taken.get("node")
    if not isinstance(robot, str) or robot not in nodes:
        raise HandError("there is no such robot")
    if not isinstance(node, str) or node not in nodes[robot]:
        raise HandError("there is no such part")
    return Hand(robot, node, _point(taken.get("point")))


def _read(message: str | bytes) -> dict[str, Any]:
    if not isinstance(message, str):
        raise HandError("a message is text")
    if len(message) > LONGEST:
        raise HandError(f"a message has {LONGEST} characters at most")
    try:
        said = json.loads(message)
    except (ValueError, RecursionError):
        raise HandError("a message is JSON") from None
    if not isinstance(said, dict):
        raise HandError("a message is an object")
    return said


def _point(said: Any) -> Point:
    good = isinstance(said, list) and len(said) == 3 and all(type(x) in (int, float) for x in said)
    if not good or not all(math.isfinite(x) and abs(x) <= FURTHEST for x in said):
        raise HandError("a point is three numbers, in metres")
    x, y, z = map(float, said)
    return x, y, z
