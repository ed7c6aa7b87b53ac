"""A robot's kinematic tree in numpy: placements, and its loops as a `LoopSystem`, without any robotics library.

The converter needs it to count mobility and to choose the actuated joints. `cinegen` computes the same with Pinocchio;
tests compare the two.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raff2urdf.document import Document, JointType, LoopKind, Parameters, RaffLink, RaffPart, RaffRobot
from raff2urdf.kleinfinger import Kleinfinger, transform
from raff2urdf.placement import inverse
from raff2urdf.residual import ROWS, loop_residual

WORLD = "world"
"""The link that does not move: the root of a URDF whose base is not at the world's origin."""

BASE_JOINT = "joint0"
"""The joint that places the base in the world, if the base is not simply at the world's origin."""

_POINT = 1e-15  # m: a robot no larger than this is a point

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Columns = NDArray[np.intp]


def kleinfinger(document: Document, written: Parameters) -> Kleinfinger:
    """Return six parameters as written, in metres and radians."""
    return Kleinfinger(
        gamma=math.radians(written.gamma),
        epsilon=document.metres(written.epsilon),
        alpha=math.radians(written.alpha),
        d=document.metres(written.d),
        theta=math.radians(written.theta),
        r=document.metres(written.r),
    )


def joint_units(document: Document, link: RaffLink, value: float) -> float:
    """Convert a value of a link's joint to m (prismatic) or rad (revolute)."""
    return document.metres(value) if link.type is JointType.PRISMATIC else math.radians(value)


def home(document: Document, link: RaffLink) -> float:
    """Return the joint variable as written: theta (rad) of a revolute, r (m) of a prismatic joint."""
    p = link.parameters
    return joint_units(document, link, p.r if link.type is JointType.PRISMATIC else p.theta)


def limits(document: Document, link: RaffLink) -> tuple[float, float]:
    """Return a joint's limits in rad or m; infinite if the file gives none."""
    if link.limits is None:
        return -math.inf, math.inf
    low, high = link.limits
    return joint_units(document, link, low), joint_units(document, link, high)


def velocity(document: Document, link: RaffLink) -> float:
    """Return a joint's velocity limit in rad/s or m/s; infinite if the file gives none."""
    return math.inf if link.velocity is None else joint_units(document, link, link.velocity)


def placements(document: Document, robot: RaffRobot, q: Mapping[str, float] | None = None) -> dict[int, Array]:
    """Return the world placement (4, 4) of every node, by number, as written or at joint values `q` (rad, m)."""
    found = {0: transform(kleinfinger(document, robot.base.parameters))}
    for part in robot.outward:
        parameters = kleinfinger(document, part.parameters)
        if q is not None and part.joint in q:
            parameters = moved(part, parameters, q[part.joint])
        found[part.number] = found[part.pred] @ transform(parameters)
    return found


def moved(part: RaffPart, parameters: Kleinfinger, value: float) -> Kleinfinger:
    """Return the parameters of a part at a value of its joint (rad, m); those of a fixed one do not change."""
    kind = part.type if isinstance(part, RaffLink) else JointType.FIXED
    if kind is JointType.REVOLUTE:
        return parameters._replace(theta=value)
    return parameters._replace(r=value) if kind is JointType.PRISMATIC else parameters


def characteristic_length(origins: Array) -> float:
    """Return the length (m) that makes translations commensurable with angles: the radius of a robot's nodes.

    The largest distance of a node from their centroid at home, (n, 3) in metres; 1 if they all coincide. It scales
    with the unit, and depends neither on the base pose nor on the numbers of the links.
    """
    radius = float(np.sqrt(((origins - origins.mean(axis=0)) ** 2).sum(axis=1).max())) if len(origins) else 0.0
    return radius if radius > _POINT else 1.0


class Cluster:
    """Loops that share joints, and those joints: a `LoopSystem` of its own (q: the joints in file order)."""

    def __init__(
        self, document: Document, robot: RaffRobot, loops: Sequence[int], kinds: Mapping[int, LoopKind], length: float
    ) -> None:
        self.document, self.robot, self.loops, self.length = document, robot, loops, length
        self.kinds = [kinds[i] for i in loops]
        branches = [_branches(robot, robot.loops[i].first, robot.loops[i].second) for i in loops]
        moving = {part.number for pair in branches for branch in pair for part in branch}
        self.parts = [part for part in robot.outward if part.number in moving] if moving else []
        self.joints = [p for p in robot.links if p.number in moving and p.type is not JointType.FIXED]
        self.scale = np.array([length if joint.type is JointType.PRISMATIC else 1.0 for joint in self.joints])
        self.home = np.array([home(document, joint) for joint in self.joints])
        self._column = {joint.number: i for i, joint in enumerate(self.joints)}
        self._fixed = {part.number: kleinfinger(document, part.parameters) for part in self.parts}
        self._columns = [self._moving(*pair) for pair in branches]

    def _moving(self, first: list[RaffPart], second: list[RaffPart]) -> tuple[Columns, Array, Mask]:
        """Return columns, signs (n, 1) and a mask of prismatic joints (n, 1), for the joints on both branches."""
        column = self._column
        on = [column[part.number] for part in (*first, *second) if part.number in column]
        before = sum(part.number in column for part in first)
        sign = np.array([-1.0] * before + [1.0] * (len(on) - before))[:, None]
        prismatic = np.array([self.joints[i].type is JointType.PRISMATIC for i in on], dtype=bool)[:, None]
        return np.array(on, dtype=np.intp), sign, prismatic

    def relaxed(self, kinds: Sequence[LoopKind]) -> Cluster:
        """Return the same loops, closed by other kinds of joints."""
        by_loop = dict(zip(self.loops, kinds, strict=True))
        return Cluster(self.document, self.robot, self.loops, by_loop, self.length)

    def integrate(self, q: Array, step: Array) -> Array:
        """Return the joint values reached from q by a dimensionless step."""
        return np.asarray(q + step * self.scale)

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return the residual of the loops and its derivative by the dimensionless step."""
        placed = self._placed(q)
        joints = np.array([placed[joint.number] for joint in self.joints]).reshape(-1, 4, 4)
        axes, origins = joints[:, :3, 2], joints[:, :3, 3]
        residuals, blocks = [], []
        fixed = np.eye(4)  # an end that no joint of the loop moves
        for index, kind, (on, sign, prismatic) in zip(self.loops, self.kinds, self._columns, strict=True):
            loop = self.robot.loops[index]
            first, second = placed.get(loop.first, fixed), placed.get(loop.second, fixed)
            residual, derivative = loop_residual(kind, inverse(first) @ second, self.length)
            z = sign * axes[on]
            angular = np.where(prismatic, 0.0, z)
            linear = np.where(prismatic, z, _cross(z, first[:3, 3] - origins[on]))
            block = np.zeros((len(residual), len(self.joints)))
            block[:, on] = derivative @ np.vstack([first[:3, :3].T @ linear.T, first[:3, :3].T @ angular.T])
            residuals.append(residual)
            blocks.append(block * self.scale)
        return np.concatenate(residuals), np.vstack(blocks)

    def gaps(self, q: Array) -> list[float]:
        """Return the largest residual of each loop."""
        residual = self.evaluate(q)[0]
        ends = np.cumsum([ROWS[kind] for kind in self.kinds])[:-1]
        return [float(np.abs(part).max()) for part in np.split(residual, ends)]

    def _placed(self, q: Array) -> dict[int, Array]:
        """Return placements of the loops' nodes relative to their nearest common ancestor."""
        placed: dict[int, Array] = {}
        values = q.tolist()
        for part in self.parts:
            parameters = self._fixed[part.number]
            if part.number in self._column:
                parameters = moved(part, parameters, values[self._column[part.number]])
            local = transform(parameters)
            parent = placed.get(part.pred)
            placed[part.number] = local if parent is None else parent @ local
        return placed


def clusters(document: Document, robot: RaffRobot, kinds: Mapping[int, LoopKind], length: float) -> Iterator[Cluster]:
    """Yield the robot's loops, grouped into those that share nodes: each group can be closed by itself."""
    leader = list(range(len(robot.loops)))

    def find(i: int) -> int:
        while leader[i] != i:
            leader[i] = leader[leader[i]]
            i = leader[i]
        return i

    owner: dict[int, int] = {}
    for i, loop in enumerate(robot.loops):
        for branch in _branches(robot, loop.first, loop.second):
            for part in branch:
                leader[find(i)] = find(owner.setdefault(part.number, i))
    groups: dict[int, list[int]] = {}
    for i in range(len(robot.loops)):
        groups.setdefault(find(i), []).append(i)
    for group in groups.values():
        yield Cluster(document, robot, group, kinds, length)


def _branches(robot: RaffRobot, first: int, second: int) -> tuple[list[RaffPart], list[RaffPart]]:
    """Return the nodes from the nearest common ancestor (excluded) to each of two nodes (included)."""
    sides: tuple[list[RaffPart], list[RaffPart]] = ([], [])
    met: dict[int, tuple[int, int]] = {}
    heads: list[int | None] = [first, second]
    side = 0
    while heads[0] is not None or heads[1] is not None:
        at = heads[side]
        if at is not None:
            other, count = met.setdefault(at, (side, len(sides[side])))
            if other != side:  # the other side passed here: cut it back to this node
                del sides[other][count:]
                return sides
            part = robot.nodes[at]
            heads[side] = None
            if isinstance(part, RaffPart):
                sides[side].append(part)
                heads[side] = part.pred
        side = 1 - side
    return sides


def _cross(a: Array, b: Array) -> Array:
    """Return the row-by-row cross product of (n, 3) arrays; np.cross takes ten times as long for few rows."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
