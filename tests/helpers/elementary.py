"""Elementary transforms and a robot's tree by their plain product: what the tests of this folder hold robots against.

Written from the definition alone (W. Khalil and J.-F. Kleinfinger, "A new geometric notation for open and closed-loop
robots", IEEE conf. on Robotics and Automation, 1986), with numpy and nothing of the packages but the values of a
document.
"""

import math
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

import numpy as np

import raff2urdf
from raff2urdf.raff.document import Document, JointType, RaffBase, RaffFrame, RaffLink, RaffRobot

ROBOTS = Path(__file__).resolve().parents[2] / "robots"


def turn(axis: str, angle: float) -> np.ndarray:
    """(4, 4) rotation by `angle` (rad) about x, y or z."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    m = np.eye(4)
    m[j, j] = m[k, k] = math.cos(angle)
    m[k, j] = math.sin(angle)
    m[j, k] = -math.sin(angle)
    return m


def shift(axis: str, length: float) -> np.ndarray:
    """(4, 4) translation along x, y or z."""
    m = np.eye(4)
    m["xyz".index(axis), 3] = length
    return m


def kleinfinger(gamma: float, epsilon: float, alpha: float, d: float, theta: float, r: float) -> np.ndarray:
    """The product of six elementary transforms."""
    axis = turn("z", gamma) @ shift("z", epsilon) @ turn("x", alpha)
    return axis @ shift("x", d) @ turn("z", theta) @ shift("z", r)


@cache
def document(name: str) -> Document:
    """What robots/<name>.raff says."""
    return raff2urdf.load(ROBOTS / f"{name}.raff")


def length(text: Document, value: float) -> float:
    """A length of the file in metres."""
    return value / {"um": 1e6, "mm": 1e3, "cm": 1e2, "m": 1.0}[text.units]


def link(text: Document, number: int, robot: str | None = None) -> RaffLink | RaffFrame:
    """A link or frame of the file by its number."""
    node = text.robot(robot).nodes[number]
    assert not isinstance(node, RaffBase)
    return node


def local(text: Document, part: RaffBase | RaffLink | RaffFrame, value: float | None = None) -> np.ndarray:
    """Where a node stands on its father, its joint at `value` (rad, m) or as written."""
    p = part.parameters
    theta, r = math.radians(p.theta), length(text, p.r)
    if value is not None and isinstance(part, RaffLink):
        theta = value if part.type is JointType.REVOLUTE else theta
        r = value if part.type is JointType.PRISMATIC else r
    return kleinfinger(
        math.radians(p.gamma), length(text, p.epsilon), math.radians(p.alpha), length(text, p.d), theta, r
    )


def placed(text: Document, robot: RaffRobot, q: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Where each node stands in the world, joints by name at q (rad, m)."""
    by_number = {0: local(text, robot.base)}
    left = list(robot.parts)
    while left:  # a file may name a node before its father
        ready = [part for part in left if part.pred in by_number]
        for part in ready:
            by_number[part.number] = by_number[part.pred] @ local(text, part, q.get(part.joint))
        left = [part for part in left if part.number not in by_number]
    return {robot.nodes[number].node: place for number, place in by_number.items()}


def values(mechanism, q: np.ndarray) -> dict[str, float]:
    """A configuration as joint values by name."""
    return {joint: float(q[mechanism.q_index(joint)]) for joint in mechanism.joints}


def at(mechanism, q: np.ndarray, joints: Iterable[str]) -> np.ndarray:
    """The values of some joints."""
    return np.array([q[mechanism.q_index(joint)] for joint in joints])


def limits(mechanism, joints: Iterable[str]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper position limits of some joints."""
    model = mechanism.model
    index = [mechanism.q_index(joint) for joint in joints]
    return model.lowerPositionLimit[index], model.upperPositionLimit[index]


def within_limits(mechanism, q: np.ndarray) -> bool:
    """Whether every joint is inside its limits, exactly."""
    return bool((q >= mechanism.model.lowerPositionLimit).all() and (q <= mechanism.model.upperPositionLimit).all())


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles in [-pi, pi)."""
    return (np.asarray(angle) + math.pi) % (2.0 * math.pi) - math.pi


def angle_between(rotation: np.ndarray, other: np.ndarray) -> float:
    """The angle (rad) between two (3, 3) rotations, exact for small ones."""
    m = rotation.T @ other
    sine = 0.5 * np.linalg.norm([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    return float(math.atan2(sine, 0.5 * (np.trace(m) - 1.0)))
