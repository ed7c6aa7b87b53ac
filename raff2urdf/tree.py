"""A robot's kinematic tree in numpy: placements, and its loops as a `LoopSystem`, without any robotics library.

The converter needs it to count mobility and to choose the actuated joints. `cinegen` computes the same with Pinocchio;
tests compare the two.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raff2urdf.document import Document, JointType, LoopKind, Parameters, RaffBase, RaffLink, RaffPart, RaffRobot
from raff2urdf.kleinfinger import Kleinfinger, transform
from raff2urdf.placement import inverse
from raff2urdf.residual import loop_residual

WORLD = "world"
"""The link that does not move: the root of a URDF whose base is not at the world's origin."""

BASE_JOINT = "joint0"
"""The joint that places the base in the world, if the base is not simply at the world's origin."""

_POINT = 1e-15  # m: a robot no larger than this is a point

Array = NDArray[np.float64]


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
    base = transform(kleinfinger(document, robot.base.parameters))
    parameters = {part.number: kleinfinger(document, part.parameters) for part in robot.parts}
    values = {part.number: q[part.joint] for part in robot.parts if q is not None and part.joint in q}
    return {0: base} | _placed(robot.outward, parameters, values, base)


def _placed(
    parts: Iterable[RaffPart], parameters: Mapping[int, Kleinfinger], values: Mapping[int, float], root: Array
) -> dict[int, Array]:
    """Return placements by number. Parents precede their children; what has no parent here is on `root` (4, 4)."""
    found: dict[int, Array] = {}
    for part in parts:
        own = parameters[part.number]
        if part.number in values:
            own = moved(part, own, values[part.number])
        found[part.number] = found.get(part.pred, root) @ transform(own)
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
        branches = [_branches(robot, i) for i in loops]
        moving = {part.number for pair in branches for branch in pair for part in branch}
        self.parts = [part for part in robot.outward if part.number in moving] if moving else []
        self.joints = [p for p in robot.links if p.number in moving and p.type is not JointType.FIXED]
        self.home = np.array([home(document, joint) for joint in self.joints])
        self._prismatic = np.array([joint.type is JointType.PRISMATIC for joint in self.joints], dtype=bool)[:, None]
        self.scale = np.where(self._prismatic[:, 0], length, 1.0)
        self._parameters = {part.number: kleinfinger(document, part.parameters) for part in self.parts}
        self._signs = [self._sign(*pair) for pair in branches]

    def _sign(self, first: Sequence[RaffPart], second: Sequence[RaffPart]) -> Array:
        """Return the sign (joints, 1) with which joints move the second end relative to the first; 0 where not."""
        signs = {part.number: -1.0 for part in first} | {part.number: 1.0 for part in second}
        return np.array([signs.get(joint.number, 0.0) for joint in self.joints]).reshape(-1, 1)

    def with_kinds(self, kinds: Sequence[LoopKind]) -> Cluster:
        """Return the same loops, closed by other kinds of joints."""
        by_loop = dict(zip(self.loops, kinds, strict=True))
        return Cluster(self.document, self.robot, self.loops, by_loop, self.length)

    def integrate(self, q: Array, step: Array) -> Array:
        """Return the joint values reached from q by a dimensionless step."""
        return np.asarray(q + step * self.scale)

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return the residual of the loops and its derivative by the dimensionless step."""
        fixed = np.eye(4)  # the nearest common ancestor, and an end that no joint of the loop moves
        values = {joint.number: value for joint, value in zip(self.joints, q.tolist(), strict=True)}
        placed = _placed(self.parts, self._parameters, values, fixed)
        joints = np.array([placed[joint.number] for joint in self.joints]).reshape(-1, 4, 4)
        axes, origins = joints[:, :3, 2], joints[:, :3, 3]
        residuals, blocks = [], []
        for index, kind, sign in zip(self.loops, self.kinds, self._signs, strict=True):
            loop = self.robot.loops[index]
            first, second = placed.get(loop.first, fixed), placed.get(loop.second, fixed)
            residual, derivative = loop_residual(kind, inverse(first) @ second, self.length)
            z = sign * axes
            angular = np.where(self._prismatic, 0.0, z)
            linear = np.where(self._prismatic, z, _cross(z, first[:3, 3] - origins))
            residuals.append(residual)
            blocks.append(derivative @ np.vstack([first[:3, :3].T @ linear.T, first[:3, :3].T @ angular.T]))
        return np.concatenate(residuals), np.vstack(blocks) * self.scale


def clusters(document: Document, robot: RaffRobot, kinds: Mapping[int, LoopKind], length: float) -> Iterator[Cluster]:
    """Yield the robot's loops, grouped into those that share nodes: each group can be closed by itself."""
    groups: list[tuple[set[int], list[int]]] = []  # of nodes, and of loops; no node is in two
    for i in range(len(robot.loops)):
        nodes, loops, apart = {part.number for branch in _branches(robot, i) for part in branch}, [i], []
        for group in groups:
            if group[0].isdisjoint(nodes):
                apart.append(group)
            else:
                nodes, loops = nodes | group[0], loops + group[1]
        groups = [*apart, (nodes, sorted(loops))]
    for _, loops in sorted(groups, key=lambda group: group[1]):
        yield Cluster(document, robot, loops, kinds, length)


def _branches(robot: RaffRobot, loop: int) -> tuple[list[RaffPart], list[RaffPart]]:
    """Return the nodes from each end of a loop (included) to their nearest common ancestor (excluded)."""
    sides: tuple[list[RaffPart], list[RaffPart]] = ([], [])
    heads = [robot.loops[loop].first, robot.loops[loop].second]
    while heads[0] != heads[1]:
        deeper = int(robot.depth[heads[1]] > robot.depth[heads[0]])
        part = robot.nodes[heads[deeper]]
        assert not isinstance(part, RaffBase)
        sides[deeper].append(part)
        heads[deeper] = part.pred
    return sides


def _cross(a: Array, b: Array) -> Array:
    """Return the row-by-row cross product of (n, 3) arrays; np.cross takes ten times as long for few rows."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
