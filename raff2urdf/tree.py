"""A robot's kinematic tree in numpy: placements, and its loops as a `LoopSystem`, without any robotics library.

The converter needs it to count mobility and to choose motors; `cinegen` does the same with Pinocchio, and the
tests hold one against the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raff2urdf.document import Document, JointType, LoopKind, RaffBase, RaffLink, RaffNode, RaffPart, RaffRobot
from raff2urdf.kleinfinger import Kleinfinger, transform
from raff2urdf.loops import ROWS, gap
from raff2urdf.placement import inverse

BASE_JOINT = "joint0"
"""The joint that places the base in the world, where it does not simply stand at its origin."""

_POINT = 1e-15  # m: a robot no larger than this is a point

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Columns = NDArray[np.intp]


def kleinfinger(document: Document, part: RaffNode) -> Kleinfinger:
    """The six parameters of a node as written, in metres and radians."""
    p = part.parameters
    return Kleinfinger(
        gamma=math.radians(p.gamma),
        epsilon=document.metres(p.epsilon),
        alpha=math.radians(p.alpha),
        d=document.metres(p.d),
        theta=math.radians(p.theta),
        r=document.metres(p.r),
    )


def home(document: Document, link: RaffLink) -> float:
    """The joint variable as written: theta (rad) of a revolute, r (m) of a prismatic joint."""
    parameters = kleinfinger(document, link)
    return parameters.r if link.type is JointType.PRISMATIC else parameters.theta


def limits(document: Document, link: RaffLink) -> tuple[float, float]:
    """A joint's limits in rad or m; infinite where the file gives none."""
    if link.limits is None:
        return -math.inf, math.inf
    low, high = link.limits
    if link.type is JointType.PRISMATIC:
        return document.metres(low), document.metres(high)
    return math.radians(low), math.radians(high)


def velocity(document: Document, link: RaffLink) -> float:
    """A joint's greatest speed in rad/s or m/s; infinite where the file gives none."""
    if link.velocity is None:
        return math.inf
    return document.metres(link.velocity) if link.type is JointType.PRISMATIC else math.radians(link.velocity)


def placements(document: Document, robot: RaffRobot, q: Mapping[str, float] | None = None) -> dict[int, Array]:
    """World placement (4, 4) of every node, by number, at home or at joint values `q` by joint name (rad, m)."""
    found = {0: transform(kleinfinger(document, robot.base))}
    for part in robot.outward:
        parameters = kleinfinger(document, part)
        if q is not None and part.joint in q:
            parameters = _moved(part, parameters, q[part.joint])
        found[part.number] = found[part.pred] @ transform(parameters)
    return found


def _moved(part: RaffPart, parameters: Kleinfinger, value: float) -> Kleinfinger:
    kind = part.type if isinstance(part, RaffLink) else JointType.FIXED
    if kind is JointType.REVOLUTE:
        return parameters._replace(theta=value)
    return parameters._replace(r=value) if kind is JointType.PRISMATIC else parameters


def characteristic_length(origins: Array) -> float:
    """The length (m) that makes translations commensurable with angles: the radius of a robot's nodes.

    The largest distance of a node from their centroid at home, (n, 3) in metres; 1 if they all coincide. It
    follows a change of unit, and does not depend on where the robot stands or how its links are numbered.
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
        self._fixed = {part.number: kleinfinger(document, part) for part in self.parts}
        self._columns = [self._moving(*pair) for pair in branches]

    def _moving(self, first: list[RaffPart], second: list[RaffPart]) -> tuple[Columns, Array, Mask]:
        """Of a loop: columns of the joints on both branches, their signs (n, 1), whether they slide (n, 1)."""
        column = self._column
        on = [column[part.number] for part in (*first, *second) if part.number in column]
        before = sum(part.number in column for part in first)
        sign = np.array([-1.0] * before + [1.0] * (len(on) - before))[:, None]
        slides = np.array([self.joints[i].type is JointType.PRISMATIC for i in on], dtype=bool)[:, None]
        return np.array(on, dtype=np.intp), sign, slides

    def relaxed(self, kinds: Sequence[LoopKind]) -> Cluster:
        """The same loops, closed by other kinds of joints."""
        by_loop = dict(zip(self.loops, kinds, strict=True))
        return Cluster(self.document, self.robot, self.loops, by_loop, self.length)

    def integrate(self, q: Array, step: Array) -> Array:
        """The joint values reached from q by a dimensionless step."""
        return np.asarray(q + step * self.scale)

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Residual of the loops and its derivative by the dimensionless step."""
        placed = self._placed(q)
        joints = np.array([placed[joint.number] for joint in self.joints]).reshape(-1, 4, 4)
        axes, origins = joints[:, :3, 2], joints[:, :3, 3]
        residuals, blocks = [], []
        for index, kind, (on, sign, slides) in zip(self.loops, self.kinds, self._columns, strict=True):
            first, second = self._ends(placed, index)
            residual, derivative = gap(kind, inverse(first) @ second, self.length)
            z = sign * axes[on]
            turning = np.where(slides, 0.0, z)
            sliding = np.where(slides, z, _cross(z, first[:3, 3] - origins[on]))
            block = np.zeros((len(residual), len(self.joints)))
            block[:, on] = derivative @ np.vstack([first[:3, :3].T @ sliding.T, first[:3, :3].T @ turning.T])
            residuals.append(residual)
            blocks.append(block * self.scale)
        return np.concatenate(residuals), np.vstack(blocks)

    def gaps(self, q: Array) -> list[float]:
        """The largest residual of each loop."""
        residual = self.evaluate(q)[0]
        ends = np.cumsum([ROWS[kind] for kind in self.kinds])[:-1]
        return [float(np.abs(part).max()) for part in np.split(residual, ends)]

    def _placed(self, q: Array) -> dict[int, Array]:
        """Placements of the loops' nodes as seen from the node they all stand on."""
        placed: dict[int, Array] = {}
        values = q.tolist()
        for part in self.parts:
            parameters = self._fixed[part.number]
            if part.number in self._column:
                parameters = _moved(part, parameters, values[self._column[part.number]])
            local = transform(parameters)
            father = placed.get(part.pred)
            placed[part.number] = local if father is None else father @ local
        return placed

    def _ends(self, placed: Mapping[int, Array], loop: int) -> tuple[Array, Array]:
        still = np.eye(4)  # an end that no joint of the loop moves
        ends = self.robot.loops[loop]
        return placed.get(ends.first, still), placed.get(ends.second, still)


def clusters(document: Document, robot: RaffRobot, kinds: Mapping[int, LoopKind], length: float) -> Iterator[Cluster]:
    """The robot's loops, gathered into those that share nodes: each can be closed by itself."""
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
    """The nodes from the nearest common father (left out) out to each of two nodes, both ends included."""
    sides: tuple[list[RaffPart], list[RaffPart]] = ([], [])
    met: dict[int, tuple[int, int]] = {}
    heads: list[int | None] = [first, second]
    turn = 0
    while heads[0] is not None or heads[1] is not None:
        at = heads[turn]
        if at is not None:
            if at in met:
                other, place = met[at]
                if other != turn:  # the other side passed here: cut it back to this node
                    del sides[other][place:]
                    return sides
            met[at] = (turn, len(sides[turn]))
            part = robot.nodes[at]
            if isinstance(part, RaffBase):
                heads[turn] = None
            else:
                sides[turn].append(part)
                heads[turn] = part.pred
        turn = 1 - turn
    return sides


def _cross(a: Array, b: Array) -> Array:
    """Row by row cross product of (n, 3) arrays; np.cross costs ten times as much on few rows."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]
