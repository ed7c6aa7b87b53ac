"""Choose Kleinfinger's frames for any tree of joints.

Each moving body gets a frame whose z is its joint's axis. Along a chain its x lies on the common perpendicular to the
next joint's axis, so that the next frame needs neither gamma nor epsilon; where a body branches, the other frames need
them (W. Khalil and J.-F. Kleinfinger, "A new geometric notation for open and closed-loop robots", IEEE conf. on
Robotics and Automation, 1986). Metres and radians; placements are in the world, with every joint at 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.placement import inverse, with_z
from raff2urdf.raff.kleinfinger import Kleinfinger, completed, parameters, transform
from raff2urdf.readers.urdf import axis, ends, joints, origin

EXACT = 1e-12
"""Two frames that differ by less (sines of angles, and parts of the robot's size) are one frame."""

TIDY = 1e-13
"""Largest change of a length (m) or an angle (rad) by `tidy`."""

_NEARLY_PARALLEL = 0.01  # sine of an angle: of axes nearer to parallel, gamma and r are badly determined
_NEARLY_NORMAL = 0.1  # sine of an angle: axes that are nearer to parallel are not at a right angle
_FAR = 10.0  # of the robot's size: some common perpendiculars are further away, and no origin should be


def tidy(value: float, tolerance: float) -> float:
    """Round a number to decimals within a tolerance: 90 instead of 90.00000000000001. To tidy it again has no effect.

    (The shortest number within the tolerance could be even shorter, but tidying it again might change it.)
    """
    return round(value, math.ceil(-math.log10(2.0 * tolerance))) + 0.0  # no -0.0


@dataclass(slots=True, eq=False)
class RigidBody:
    """Links that are fixed to one another, moved by one joint.

    Attributes:
        joint: that moves it; None for the root.
        parent: the body that carries the joint.
        links: names and placements (4, 4); first the link that is the joint's child.
        axis: (3,) of the joint; for the root, z of its first link.
        children: bodies whose parent it is.
        frame: (4, 4) its frame, once chosen.
        size: number of bodies from here outwards, including itself.
        number: of its node in RAFF, once it has one.
    """

    joint: Any
    parent: RigidBody | None
    links: list[tuple[str, Array]]
    axis: Array
    children: list[RigidBody] = field(default_factory=list)
    frame: Array = field(default_factory=lambda: np.eye(4))
    size: int = 1
    number: int = 0

    @property
    def placed(self) -> Array:
        """Placement of the joint's child: its origin is a point of the axis."""
        return self.links[0][1]


def gather(root: RigidBody, tree: Any, name: str) -> list[RigidBody]:
    """Return all bodies, parents first.

    Args:
        root: with its first link.
        tree: the URDF's root element.
        name: of the file, in errors.
    """
    joints_on: dict[str, list[Any]] = {}
    for joint in joints(tree):
        joints_on.setdefault(ends(joint)[0], []).append(joint)
    bodies = [root]
    for body in bodies:
        for link, placed in body.links:
            for joint in joints_on.get(link, ()):
                child, at = ends(joint)[1], placed @ origin(joint, name)
                if joint.get("type") == "fixed":
                    body.links.append((child, at))
                    continue
                direction = axis(joint, name)
                moved = RigidBody(joint, body, [(child, at)], at[:3, :3] @ (direction / np.linalg.norm(direction)))
                body.children.append(moved)
                bodies.append(moved)
    for body in reversed(bodies):
        if body.parent is not None:
            body.parent.size += body.size
    return bodies


def robot_size(bodies: Sequence[RigidBody]) -> float:
    """Return the largest distance (m) of a link from the base, along an axis; 1 if all coincide."""
    base = bodies[0].placed[:3, 3]
    furthest = max(float(np.abs(at[:3, 3] - base).max()) for body in bodies for _, at in body.links)
    return furthest if furthest > 1e-9 else 1.0


def choose_frame(body: RigidBody, length: float) -> Array:
    """Return the frame (4, 4) of a body: that of its own link if possible, else one for the child with most bodies.

    The link's own frame is used if its z is the axis, and the body has no child, several, or one that needs neither
    gamma nor epsilon in this frame.

    Args:
        body: whose children are known.
        length: the robot's size, m.
    """
    if np.abs(body.placed[:3, 2] - body.axis).max() <= EXACT and (
        len(body.children) != 1 or _on_perpendicular(body.placed, body.children[0], length)
    ):
        return body.placed
    at, x = body.placed[:3, 3], body.placed[:3, 0]
    if not body.children:
        return _frame(body.axis, x, at)
    child = max(body.children, key=lambda other: other.size)
    between = child.placed[:3, 3] - at
    cross = np.cross(body.axis, child.axis)
    sine = float(np.linalg.norm(cross))
    along = float(np.cross(between, child.axis) @ cross) / sine**2 if sine > 1e3 * EXACT else math.inf
    if abs(along) <= _FAR * length:  # the foot of the common perpendicular
        x = cross / sine
        at = at + body.axis * along
        if (child.placed[:3, 3] - at) @ x < -EXACT * length:
            x = -x
    else:
        aside = between - float(between @ body.axis) * body.axis
        if np.linalg.norm(aside) > EXACT * length:
            x = aside
    return _frame(body.axis, x, at)


def path(start: Array, end: Array, length: float, branches: bool = True) -> list[Kleinfinger]:
    """Return the parameters from one frame (4, 4) to another: of one step, or of two.

    The common perpendicular of axes that are nearly parallel may be far away, and rounding would grow with it: between
    such frames a third one is inserted, at a right angle to both.

    Args:
        start: (4, 4).
        end: (4, 4).
        length: the robot's size, m.
        branches: whether gamma and epsilon may differ from 0.
    """
    relative = inverse(start) @ end
    direct = step(relative, length)
    near = max(abs(direct.epsilon), abs(direct.d), abs(direct.r)) <= 4.0 * _FAR * length
    near = near and (branches or (direct.gamma == 0.0 and direct.epsilon == 0.0))
    if near and _error(direct, relative) <= 10.0 * EXACT * max(length, 1.0):
        return [direct]
    x, y, z = end[:3, :3].T
    aside = x if np.linalg.norm(np.cross(x, start[:3, 2])) > _NEARLY_NORMAL else y
    between = _frame(aside, np.cross(aside, z), end[:3, 3])
    first = step(inverse(start) @ between, length)
    return [first, step(inverse(start @ transform(first)) @ end, length)]


def step(relative: Array, length: float) -> Kleinfinger:
    """Return the parameters of a placement (4, 4), with gamma and epsilon 0 if that is possible."""
    sine = math.hypot(relative[0, 2], relative[1, 2])
    if sine <= EXACT:  # parallel, except for rounding
        z = np.array([0.0, 0.0, math.copysign(1.0, relative[2, 2])])
        relative = _frame(z, relative[:3, 0], relative[:3, 3])
    alpha = math.atan2(-relative[1, 2], relative[2, 2])
    _, y, z = relative[:3, 3].tolist()
    r = -math.sin(alpha) * y + math.cos(alpha) * z
    simple = completed(relative, 0.0, alpha, r)._replace(epsilon=0.0)
    if _error(simple, relative) <= EXACT * max(length, 1.0):
        return simple
    general = parameters(relative)
    return _shortened(general, relative) if EXACT < sine < _NEARLY_PARALLEL and general.alpha % math.pi else general


def _shortened(general: Kleinfinger, relative: Array) -> Kleinfinger:
    """Return parameters of nearly parallel axes with short gamma and r.

    Both are known up to rounding divided by the sine of the axes' angle. They are tidied within that, and the others
    follow: otherwise each reading of the written numbers would change them.
    """
    sine = math.sin(general.alpha)
    gamma = math.radians(tidy(math.degrees(general.gamma), math.degrees(TIDY) / abs(sine)))
    px, py, _ = relative[:3, 3].tolist()
    r = tidy((math.sin(gamma) * px - math.cos(gamma) * py) / sine, TIDY / abs(sine))
    return completed(relative, gamma, general.alpha, r)


def _error(kleinfinger: Kleinfinger, relative: Array) -> float:
    return float(np.abs(transform(kleinfinger) - relative).max())


def _on_perpendicular(frame: Array, child: RigidBody, length: float) -> bool:
    """Return whether a child's axis meets the frame's x at a right angle: then it needs neither gamma nor epsilon."""
    inward = frame[:3, :3].T
    axis, point = inward @ child.axis, inward @ (child.placed[:3, 3] - frame[:3, 3])
    return bool(abs(axis[0]) <= EXACT and abs(point[1] * axis[2] - point[2] * axis[1]) <= EXACT * length)


def _frame(z: Array, x: Array, at: Array) -> Array:
    """Return a placement with that z and origin (`at`), and x as near as possible to the given one."""
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = with_z(z, x), at
    return frame
