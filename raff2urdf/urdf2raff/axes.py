"""Kleinfinger's frames on the axes of any tree of joints.

Each moving body gets a frame whose z is its joint's axis. Along a chain its x lies on the common perpendicular to the
next joint's axis, so that the next frame needs neither gamma nor epsilon; where a body branches, the other frames say
them (W. Khalil and J.-F. Kleinfinger, "A new geometric notation for open and closed-loop robots", IEEE conf. on
Robotics and Automation, 1986). Metres and radians; placements are in the world, where every joint is at 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raff2urdf.kleinfinger import Kleinfinger, parameters, transform
from raff2urdf.placement import inverse
from raff2urdf.urdf2raff.tidy import TIDY, tidy

Array = NDArray[np.float64]

EXACT = 1e-12
"""Two frames that differ by less (sines of angles, and parts of the robot's size) are one frame."""

_LOOSE = 0.01  # sine of an angle: of axes nearer to parallel, gamma and r are not well determined
_ASIDE = 0.1  # sine of an angle: axes that are nearer to parallel are not at a right angle
_FAR = 10.0  # of the robot's size: no origin should be further away, as some common perpendiculars are


@dataclass(slots=True, eq=False)
class RigidBody:
    """What moves as one: all links that are fixed to one another behind a joint.

    Attributes:
        joint: that moves it; None for the root.
        father: the body that the joint stands on.
        links: names and placements (4, 4); first the link that the joint holds.
        axis: (3,) of the joint; the root's is the z of its first link.
        children: bodies that stand on it.
        frame: (4, 4) its frame, once chosen.
        size: how many bodies it carries, itself counted.
    """

    joint: Any
    father: RigidBody | None
    links: list[tuple[str, Array]]
    axis: Array
    children: list[RigidBody] = field(default_factory=list)
    frame: Array = field(default_factory=lambda: np.eye(4))
    size: int = 1

    @property
    def own(self) -> Array:
        """Where the link stands that the joint holds: its origin is a point of the axis."""
        return self.links[0][1]


def choose_frame(body: RigidBody, length: float) -> Array:
    """The frame (4, 4) of a body: its own link's where that will do, else one for the child that carries most.

    It will do if its z is the axis, and nothing stands on it, or more than one, or one that needs neither gamma nor
    epsilon there.

    Args:
        body: whose children are known.
        length: the robot's size, m.
    """
    if np.abs(body.own[:3, 2] - body.axis).max() <= EXACT and (
        len(body.children) != 1 or _on_perpendicular(body.own, body.children[0], length)
    ):
        return body.own
    if not body.children:
        return _frame(body.axis, body.own[:3, 0], body.own[:3, 3])
    child = max(body.children, key=lambda one: one.size)
    at, x = body.own[:3, 3], body.own[:3, 0]
    between = child.own[:3, 3] - at
    cross = np.cross(body.axis, child.axis)
    sine = float(np.linalg.norm(cross))
    along = float(np.cross(between, child.axis) @ cross) / sine**2 if sine > 1e3 * EXACT else math.inf
    if abs(along) <= _FAR * length:  # the foot of the common perpendicular
        x = cross / sine
        at = at + body.axis * along
        if (child.own[:3, 3] - at) @ x < -EXACT * length:
            x = -x
    else:
        aside = between - float(between @ body.axis) * body.axis
        if np.linalg.norm(aside) > EXACT * length:
            x = aside
    return _frame(body.axis, x, at)


def way(father: Array, child: Array, length: float, branches: bool = True) -> list[Kleinfinger]:
    """Parameters that lead from one frame (4, 4) to another: of one step, or of two.

    The common perpendicular of axes that are nearly parallel may be far away, and rounding would grow with it: between
    such frames stands a third, at a right angle to both.

    Args:
        father: (4, 4) where it begins.
        child: (4, 4) where it ends.
        length: the robot's size, m.
        branches: whether gamma and epsilon may be said.
    """
    relative = inverse(father) @ child
    found = step(relative, length)
    near = max(abs(found.epsilon), abs(found.d), abs(found.r)) <= 4.0 * _FAR * length
    near = near and (branches or (found.gamma == 0.0 and found.epsilon == 0.0))
    if near and _error(found, relative) <= 10.0 * EXACT * max(length, 1.0):
        return [found]
    x, y, z = child[:3, :3].T
    aside = x if np.linalg.norm(np.cross(x, father[:3, 2])) > _ASIDE else y
    between = _frame(aside, np.cross(aside, z), child[:3, 3])
    first = step(inverse(father) @ between, length)
    return [first, step(inverse(father @ transform(first)) @ child, length)]


def step(relative: Array, length: float) -> Kleinfinger:
    """The parameters of a placement (4, 4), without gamma and epsilon where it can be said so."""
    sine = math.hypot(relative[0, 2], relative[1, 2])
    if sine <= EXACT:  # parallel, but for rounding
        z = np.array([0.0, 0.0, math.copysign(1.0, relative[2, 2])])
        relative = _frame(z, relative[:3, 0], relative[:3, 3])
    alpha = math.atan2(-relative[1, 2], relative[2, 2])
    ca, sa = math.cos(alpha), math.sin(alpha)
    d, y, z = relative[:3, 3].tolist()
    x = relative[:3, 0]
    simple = Kleinfinger(
        gamma=0.0,
        epsilon=0.0,
        alpha=alpha,
        d=d,
        theta=math.atan2(ca * x[1] + sa * x[2], x[0]),
        r=-sa * y + ca * z,
    )
    if _error(simple, relative) <= EXACT * max(length, 1.0):
        return simple
    found = parameters(relative)
    return _settled(found, relative) if EXACT < sine < _LOOSE and found.alpha % math.pi else found


def _settled(found: Kleinfinger, relative: Array) -> Kleinfinger:
    """Parameters of nearly parallel axes, where gamma and r are known but for rounding over the sine of their angle.

    They are made short within that, and the others follow: else each reading of what was written would change them.
    """
    sine = math.sin(found.alpha)
    gamma = math.radians(tidy(math.degrees(found.gamma), math.degrees(TIDY) / abs(sine)))
    cg, sg, ca = math.cos(gamma), math.sin(gamma), math.cos(found.alpha)
    (px, py, pz), (x, y, z) = relative[:3, 3].tolist(), relative[:3, 0].tolist()
    r = tidy((sg * px - cg * py) / sine, TIDY / abs(sine))
    return Kleinfinger(
        gamma=gamma,
        epsilon=pz - r * ca,
        alpha=found.alpha,
        d=cg * px + sg * py,
        theta=math.atan2(ca * (cg * y - sg * x) + sine * z, cg * x + sg * y),
        r=r,
    )


def _error(found: Kleinfinger, relative: Array) -> float:
    return float(np.abs(transform(found) - relative).max())


def _on_perpendicular(frame: Array, child: RigidBody, length: float) -> bool:
    """Whether a child's axis crosses the frame's x at a right angle: then it needs neither gamma nor epsilon."""
    inward = frame[:3, :3].T
    axis, point = inward @ child.axis, inward @ (child.own[:3, 3] - frame[:3, 3])
    return bool(abs(axis[0]) <= EXACT and abs(point[1] * axis[2] - point[2] * axis[1]) <= EXACT * length)


def _frame(z: Array, x: Array, origin: Array) -> Array:
    """A placement with that z, and x as near as can be to the one given."""
    across = x - float(x @ z) * z
    if np.linalg.norm(across) < 0.1 * np.linalg.norm(x):  # x lies along z
        aside = np.eye(3)[int(np.argmin(np.abs(z)))]
        across = aside - float(aside @ z) * z
    across = across / np.linalg.norm(across)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([across, np.cross(z, across), z])
    frame[:3, 3] = origin
    return frame


def gather(root: RigidBody, joints_on: dict[str, list[Any]], joint_axis: Any, placed_on: Any) -> list[RigidBody]:
    """All bodies, fathers first.

    Args:
        root: with its first link.
        joints_on: the joints that stand on a link, by its name.
        joint_axis: of a joint, in its own frame (3,); None where it is fixed.
        placed_on: of a joint, its child's name and where that stands on its parent (4, 4).
    """
    found = [root]
    for body in found:
        for link, at in body.links:
            for joint in joints_on.get(link, []):
                child, relative = placed_on(joint)
                axis = joint_axis(joint)
                there = at @ relative
                if axis is None:
                    body.links.append((child, there))
                    continue
                moved = RigidBody(joint, body, [(child, there)], there[:3, :3] @ (axis / np.linalg.norm(axis)))
                body.children.append(moved)
                found.append(moved)
    for body in reversed(found):
        if body.father is not None:
            body.father.size += body.size
    return found


def reach(bodies: Sequence[RigidBody]) -> float:
    """The robot's size (m): how far any of its links is from the base, 1 if nowhere."""
    base = bodies[0].own[:3, 3]
    furthest = max(float(np.abs(at[:3, 3] - base).max()) for body in bodies for _, at in body.links)
    return furthest if furthest > 1e-9 else 1.0
