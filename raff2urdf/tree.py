"""A robot's kinematic tree in numpy: placements, and its loops as a `LoopSystem`, without any robotics library.

The converter needs it to count mobility and to choose the actuated joints. `cinegen` computes the same with Pinocchio;
tests compare the two.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.coupling import Coupling, coupled_scales, followed
from raff2urdf.inertia import Inertia
from raff2urdf.joint_dynamics import JointDynamics
from raff2urdf.loops.idle import Edge
from raff2urdf.loops.length import characteristic_length, cut_screws
from raff2urdf.placement import cross, inverse
from raff2urdf.raff.compound import expanded, spherical_joints
from raff2urdf.raff.document import (
    Document,
    DriveKind,
    JointType,
    LoopKind,
    RaffBase,
    RaffInertial,
    RaffLink,
    RaffParameters,
    RaffPart,
    RaffRobot,
)
from raff2urdf.raff.kleinfinger import Kleinfinger, transform
from raff2urdf.residual import loop_residual

WORLD = "world"
"""The link that does not move: the root of a URDF whose base is not at the world's origin."""

BASE_JOINT = "joint0"
"""The joint that places the base in the world, if the base is not simply at the world's origin."""


def kleinfinger(document: Document, written: RaffParameters) -> Kleinfinger:
    """Return six parameters as written, in metres and radians."""
    return Kleinfinger(
        gamma=math.radians(written.gamma),
        epsilon=document.metres(written.epsilon),
        alpha=math.radians(written.alpha),
        d=document.metres(written.d),
        theta=math.radians(written.theta),
        r=document.metres(written.r),
    )


def stated_inertia(document: Document, inertial: RaffInertial) -> Inertia:
    """Return a stated mass with its centre and moments, in the node's own frame, kg and m."""
    xx, yy, zz = (document.metres(document.metres(moment)) for moment in inertial.moments)
    xy, xz, yz = (document.metres(document.metres(product)) for product in inertial.products)
    centre = np.array([document.metres(x) for x in inertial.centre])
    return Inertia(inertial.mass or 0.0, centre, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


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


def effort(link: RaffLink) -> float:
    """Return the limit of the torque (N m) or force (N) of a joint's actuator; infinite if the file gives none."""
    return math.inf if link.effort is None else link.effort


def joint_dynamics(document: Document, link: RaffLink) -> JointDynamics:
    """Return the inertia of a joint's rotors and its friction in SI units; 0 what the file does not give."""
    return in_si(document, link, JointDynamics(link.armature or 0.0, link.damping or 0.0, link.friction or 0.0))


def in_si(document: Document, link: RaffLink, written: JointDynamics) -> JointDynamics:
    """Return the dynamics of a link's joint, given in the file's units, in SI units."""
    armature, damping = written.armature, written.damping / joint_units(document, link, 1.0)
    if link.type is not JointType.PRISMATIC:
        armature = document.metres(document.metres(armature))
    return JointDynamics(armature, damping, written.friction)


def placements(document: Document, robot: RaffRobot, q: Mapping[str, float] | None = None) -> dict[int, Array]:
    """Return the world placement (4, 4) of every node, by number, as written or at joint values `q` (rad, m)."""
    base, robot = transform(kleinfinger(document, robot.base.parameters)), expanded(robot)
    parameters = {part.number: kleinfinger(document, part.parameters) for part in robot.parts}
    values = {part.number: q[part.joint] for part in robot.parts if q is not None and part.joint in q}
    return {0: base} | _placed(robot.outward, parameters, values, base)


def _placed(
    parts: Iterable[RaffPart], parameters: Mapping[int, Kleinfinger], values: Mapping[int, float], root: Array
) -> dict[int, Array]:
    """Return placements by number. Parents precede their children; what has no parent here is on `root` (4, 4)."""
    placed: dict[int, Array] = {}
    for part in parts:
        numbers = parameters[part.number]
        if part.number in values:
            numbers = moved(part, numbers, values[part.number])
        placed[part.number] = placed.get(part.pred, root) @ transform(numbers)
    return placed


def moved(part: RaffPart, parameters: Kleinfinger, value: float) -> Kleinfinger:
    """Return the parameters of a part at a value of its joint (rad, m); those of a fixed one do not change."""
    kind = part.type if isinstance(part, RaffLink) else JointType.FIXED
    if kind is JointType.REVOLUTE:
        return parameters._replace(theta=value)
    return parameters._replace(r=value) if kind is JointType.PRISMATIC else parameters


def length_of(
    document: Document, robot: RaffRobot, kinds: Mapping[int, LoopKind], q: Mapping[str, float] | None = None
) -> float:
    """Return a robot's characteristic length, m.

    Args:
        document: that holds the robot.
        robot: the robot, not `expanded`.
        kinds: of its loops.
        q: joint values (rad, m), by name; as written unless given.
    """
    rotations = {joint: i for joints in spherical_joints(robot).values() for i, joint in enumerate(joints)}
    nodes, robot = robot.nodes, expanded(robot)
    placed = placements(document, robot, q)
    screws, moving = [np.zeros((6, 0))], []
    for link in robot.links:
        if link.type is not JointType.FIXED:
            kind = LoopKind.PRISMATIC if link.type is JointType.PRISMATIC else LoopKind.REVOLUTE
            screw = cut_screws(kind, placed[link.number])
            if link.joint in rotations:  # one of three about a point
                screw = cut_screws(LoopKind.BALL, placed[link.number])[:, [rotations[link.joint]]]
            screws.append(screw)
            moving.append(link.number)
    screws += [cut_screws(kinds[i], placed[loop.first]) for i, loop in enumerate(robot.loops)]
    together = np.hstack(screws)
    columns = {number: column for column, number in enumerate(moving)}
    carried = {0: np.zeros(together.shape[1], dtype=bool)}
    for part in robot.outward:
        row = carried[part.number] = carried[part.pred].copy()
        if part.number in columns:
            row[columns[part.number]] = True
    points = np.array([placed[number][:3, 3] for number in nodes])
    return characteristic_length(together, points, np.array([carried[number] for number in nodes]))


def edges(
    document: Document, robot: RaffRobot, kinds: Mapping[int, LoopKind], length: float, q: Mapping[str, float]
) -> list[Edge]:
    """Return all joints, and then those that were cut, as connections of bodies, at joint values (rad, m) by name.

    Args:
        document: that holds the robot.
        robot: the robot, `expanded`.
        kinds: of its loops.
        length: characteristic length, m.
        q: of all joints that move, which are the columns of a step in file order.
    """
    placed, bodies, connections = placements(document, robot, q), {0: 0}, list[Edge]()
    columns = {link.number: i for i, link in enumerate(p for p in robot.links if p.type is not JointType.FIXED)}
    unit = np.repeat([length, 1.0], 3)[:, None]
    for part in robot.outward:
        parent = bodies[part.pred]
        column = columns.get(part.number)
        bodies[part.number] = parent if column is None else column + 1
        if column is not None:
            slides = isinstance(part, RaffLink) and part.type is JointType.PRISMATIC
            screws = cut_screws(LoopKind.PRISMATIC if slides else LoopKind.REVOLUTE, placed[part.number])
            connections.append(Edge(parent, column + 1, screws if slides else screws / unit, (column,)))
    for i, loop in enumerate(robot.loops):
        screws = cut_screws(kinds[i], placed[loop.first])
        slides = kinds[i] is LoopKind.PRISMATIC
        connections.append(Edge(bodies[loop.first], bodies[loop.second], screws if slides else screws / unit))
    return connections


class Cluster:
    """Loops and couplings (by indices in the robot) that share joints, and those joints: a `LoopSystem`.

    q is of the joints in file order, `scale` the m or rad of a dimensionless step of each; `length` is the
    characteristic length, m, and `steps` has placements by which both ends of a loop are moved, by its index."""

    def __init__(
        self,
        document: Document,
        robot: RaffRobot,
        loops: Sequence[int],
        couplings: Sequence[int],
        kinds: Mapping[int, LoopKind],
        length: float,
        steps: Mapping[int, tuple[Array, Array]] | None = None,
    ) -> None:
        self.document, self.robot, self.length = document, robot, length
        self._steps = steps or {}
        self.loops, self.couplings = loops, couplings
        self.kinds = [kinds[i] for i in loops]
        branches = [_branches(robot, i) for i in loops]
        moving = {part.number for pair in branches for branch in pair for part in branch}
        moving |= {number for i in couplings for number in _coupled(robot, i)}
        self.parts = [part for part in robot.outward if part.number in moving] if moving else []
        self.joints = [p for p in robot.links if p.number in moving and p.type is not JointType.FIXED]
        self.home = np.array([home(document, joint) for joint in self.joints])
        self._prismatic = np.array([joint.type is JointType.PRISMATIC for joint in self.joints], dtype=bool)[:, None]
        self.scale = np.where(self._prismatic[:, 0], length, 1.0)
        self._parameters = {part.number: kleinfinger(document, part.parameters) for part in self.parts}
        self._signs = [self._sign(*pair) for pair in branches]
        self._columns = {joint.joint: i for i, joint in enumerate(self.joints)}
        equations = [coupling_of(document, robot, i) for i in couplings]
        ranges = {joint.joint: limits(document, joint) for joint in self.joints}
        alone = dict(zip(self._columns, self.scale.tolist(), strict=True))
        scales = coupled_scales(equations, alone, _outermost(robot), ranges)
        self.scale = np.array(list(scales.values()))
        self._equations = [(equation, equation.size(scales, ranges)) for equation in equations]

    @property
    def names(self) -> list[str]:
        """Names of the loops, then of the couplings."""
        return [self.robot.loop_names[i] for i in self.loops] + [self.robot.coupling_names[i] for i in self.couplings]

    def _sign(self, first: Sequence[RaffPart], second: Sequence[RaffPart]) -> Array:
        """Return the sign (joints, 1) with which joints move the second end relative to the first; 0 where not."""
        signs = {part.number: -1.0 for part in first} | {part.number: 1.0 for part in second}
        return np.array([signs.get(joint.number, 0.0) for joint in self.joints]).reshape(-1, 1)

    def with_kinds(self, kinds: Sequence[LoopKind]) -> Cluster:
        """Return the same loops, closed by other kinds of joints."""
        by_loop = dict(zip(self.loops, kinds, strict=True))
        return Cluster(self.document, self.robot, self.loops, self.couplings, by_loop, self.length, self._steps)

    def with_moved(self, steps: Mapping[int, tuple[Array, Array]]) -> Cluster:
        """Return the same loops, some loops' ends moved by placements (4, 4) in their own axes."""
        kinds = dict(zip(self.loops, self.kinds, strict=True))
        return Cluster(self.document, self.robot, self.loops, self.couplings, kinds, self.length, steps)

    @property
    def ends(self) -> list[tuple[str, str]]:
        """Names of the nodes at both ends of each loop."""
        nodes, loops = self.robot.nodes, (self.robot.loops[i] for i in self.loops)
        return [(nodes[loop.first].node, nodes[loop.second].node) for loop in loops]

    def placements(self, q: Array) -> list[Array]:
        """Return the placement (4, 4) of each loop's second end in its first, at q (nq,); m."""
        return [inverse(first) @ second for first, second in self._ends(self._placed(q))]

    def _placed(self, q: Array) -> dict[int, Array]:
        values = {joint.number: value for joint, value in zip(self.joints, q.tolist(), strict=True)}
        return _placed(self.parts, self._parameters, values, np.eye(4))

    def _ends(self, placed: Mapping[int, Array]) -> Iterator[tuple[Array, Array]]:
        """Yield the placements (4, 4) of both ends of each loop."""
        fixed = np.eye(4)  # the nearest common ancestor, and an end that no joint of the loop moves
        for i, index in enumerate(self.loops):
            loop = self.robot.loops[index]
            ends = placed.get(loop.first, fixed), placed.get(loop.second, fixed)
            steps = self._steps.get(i)
            yield ends if steps is None else (ends[0] @ steps[0], ends[1] @ steps[1])

    @property
    def start(self) -> Array:
        """Home as written, but with joints that follow others in couplings where these drive them."""
        written = dict(zip(self._columns, self.home.tolist(), strict=True))
        return np.array(list(followed([equation for equation, _ in self._equations], written).values()))

    def integrate(self, q: Array, step: Array) -> Array:
        """Return the joint values reached from q by a dimensionless step."""
        return np.asarray(q + step * self.scale)

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return the residual of the loops and couplings, and its derivative by the dimensionless step."""
        placed = self._placed(q)
        joints = np.array([placed[joint.number] for joint in self.joints]).reshape(-1, 4, 4)
        axes, origins = joints[:, :3, 2], joints[:, :3, 3]
        residuals, blocks = [], []
        for (first, second), kind, sign in zip(self._ends(placed), self.kinds, self._signs, strict=True):
            residual, derivative = loop_residual(kind, inverse(first) @ second, self.length)
            z = sign * axes
            angular = np.where(self._prismatic, 0.0, z)
            linear = np.where(self._prismatic, z, cross(z, first[:3, 3] - origins))
            residuals.append(residual)
            blocks.append(derivative @ np.vstack([first[:3, :3].T @ linear.T, first[:3, :3].T @ angular.T]))
        by_name = dict(zip(self._columns, q.tolist(), strict=True))
        for equation, size in self._equations:
            lack, slopes = equation.evaluate(by_name)
            row = np.zeros((1, len(q)))
            for joint, slope in slopes.items():
                row[0, self._columns[joint]] = slope / size
            residuals.append(np.array([lack / size]))
            blocks.append(row)
        return np.concatenate(residuals), np.vstack(blocks) * self.scale


def clusters(document: Document, robot: RaffRobot, kinds: Mapping[int, LoopKind], length: float) -> Iterator[Cluster]:
    """Yield the robot's loops and couplings, grouped into those that share nodes: each group can be closed by itself.

    Only the loops' kinds are given: couplings have none.
    """
    singles = [
        ({part.number for branch in _branches(robot, i) for part in branch}, i, -1) for i in range(len(robot.loops))
    ]
    singles += [(_coupled(robot, i), -1, i) for i in range(len(robot.couplings))]
    groups: list[tuple[set[int], list[int], list[int]]] = []  # of nodes, loops, couplings; no node is in two
    for nodes, loop, coupling in singles:
        loops, couplings, apart = [loop] * (loop >= 0), [coupling] * (coupling >= 0), []
        for group in groups:
            if group[0].isdisjoint(nodes):
                apart.append(group)
            else:
                nodes, loops, couplings = nodes | group[0], loops + group[1], couplings + group[2]
        groups = [*apart, (nodes, sorted(loops), sorted(couplings))]
    for _, loops, couplings in sorted(groups, key=lambda group: (not group[1], group[1], group[2])):
        yield Cluster(document, robot, loops, couplings, kinds, length)


def coupling_of(document: Document, robot: RaffRobot, index: int) -> Coupling:
    """Return a coupling as an equation in rad and m: follower - sum of the drives' terms = offset. One unit of the file
    is u rad or m (degrees, mm), so a polynomial's c_k x^k becomes c_k u_follower / u_drive^k x^k."""

    def unit(number: int) -> tuple[str, bool, float]:
        """Return the name of a link's joint, whether it is prismatic, and its u."""
        link = robot.nodes[number]
        assert isinstance(link, RaffLink)
        return link.joint, link.type is JointType.PRISMATIC, joint_units(document, link, 1.0)

    coupling = robot.couplings[index]
    follower, slides, size = unit(coupling.follower)
    terms: dict[str, tuple[float, ...]] = {follower: (1.0,)}
    for drive in coupling.drives:
        joint, _, other = unit(drive.link)
        factors = drive.numbers
        if drive.kind in (DriveKind.LEAD, DriveKind.RADIUS):
            metres = document.metres(drive.numbers[0])  # per revolution, or per radian
            metres = metres / math.tau if drive.kind is DriveKind.LEAD else metres
            factors = (metres if slides else _quotient(1.0, metres),)
        elif drive.kind is DriveKind.POLYNOMIAL:
            factors = tuple(_quotient(c * size, other**power) for power, c in enumerate(factors, 1))
        terms[joint] = tuple(-factor for factor in factors)
    link = robot.nodes[coupling.follower]
    assert isinstance(link, RaffLink)
    return Coupling(robot.coupling_names[index], terms, joint_units(document, link, coupling.offset))


def _quotient(a: float, b: float) -> float:
    """Return a / b with b >= 0; infinite where b is too small for a number."""
    return a / b if b or not a else math.copysign(math.inf, a)


def _coupled(robot: RaffRobot, coupling: int) -> set[int]:
    """Return the numbers of the links whose joints a coupling names."""
    equation = robot.couplings[coupling]
    return {equation.follower, *(drive.link for drive in equation.drives)}


def _outermost(robot: RaffRobot) -> set[str]:
    """Return the joints behind which there are no other joints and no ends of loops, by name."""
    moving = [link for link in robot.links if link.type is not JointType.FIXED]
    inner = {0}
    for number in (*(link.pred for link in moving), *(end for c in robot.loops for end in (c.first, c.second))):
        while number not in inner:
            inner.add(number)
            part = robot.nodes[number]
            assert not isinstance(part, RaffBase)
            number = part.pred
    return {link.joint for link in moving if link.number not in inner}


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
