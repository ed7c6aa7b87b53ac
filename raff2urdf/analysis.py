"""The effect of a robot's loops on its motion: mobility, actuated joints, and home with all loops closed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raff2urdf.closure import close_from_afar, close_within, gaps, generic_rank, passive, why_open
from raff2urdf.errors import Problem, RaffClosureError, RaffError, did_you_mean
from raff2urdf.raff.check import check_sizes
from raff2urdf.raff.compound import expanded
from raff2urdf.raff.document import Document, JointType, LoopKind, RaffRobot
from raff2urdf.tree import Cluster, clusters, home, length_of, limits

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Analysis:
    """The effect of a robot's loops.

    Attributes:
        mobility: degrees of freedom that the loops leave, at random closed configurations (a base that can move adds
            six).
        rows: equations of loops and couplings, all kinds together.
        rank: number of independent ones.
        actuated: names of the actuated joints, in file order.
        gap: largest gap of a loop at the configuration as written (rad or characteristic lengths).
        closure: likewise, at home.
        kinds: of all loops.
        home: the value of each joint (rad, m) by name, in file order: as written, moved to where all loops are closed,
            within the limits if possible.
        length: characteristic length at home, m.
        uncontrolled: passive joints that neither the loops nor the actuated joints determine.
        dependent: actuated joints that the loops and the others determine.
    """

    mobility: int
    rows: int
    rank: int
    actuated: tuple[str, ...]
    gap: float
    closure: float
    kinds: tuple[LoopKind, ...]
    home: Mapping[str, float]
    length: float
    uncontrolled: tuple[str, ...] = ()
    dependent: tuple[str, ...] = ()


def loop_kinds(robot: RaffRobot, replaced: Mapping[str, str] | None = None) -> dict[int, LoopKind]:
    """Return the kind of each loop by its index.

    Args:
        robot: with loops.
        replaced: kinds that replace the file's, by the loop's name.

    Raises:
        RaffError: no such loop, or no such kind.
    """
    kinds = {i: loop.kind for i, loop in enumerate(robot.loops)}
    for name, kind in (replaced or {}).items():
        if name not in robot.loop_names:
            raise RaffError(f"robot '{robot.name}' has no loop '{name}'{did_you_mean(name, robot.loop_names)}")
        kinds[robot.loop_names.index(name)] = loop_kind(kind)
    return kinds


def loop_kind(name: str) -> LoopKind:
    """Return the kind of loop of that name: rigid, prismatic, revolute or ball.

    Raises:
        RaffError: no such kind.
    """
    known = [kind.name.lower() for kind in LoopKind]
    if name not in known:
        raise RaffError(f"'{name}' is not a kind of loop{did_you_mean(str(name), known)}")
    return LoopKind[name.upper()]


def declared_actuated(robot: RaffRobot) -> dict[str, bool | None]:
    """Return whether each joint that moves is actuated, as the file declares; None where it leaves that open. If the
    file names actuated joints, all others are passive."""
    declared = {link.joint: link.actuated for link in expanded(robot).links if link.type is not JointType.FIXED}
    named = any(declared.values())
    return {joint: bool(actuated) if named else actuated for joint, actuated in declared.items()}


def analyse(document: Document, robot: RaffRobot, loops: Mapping[str, str] | None = None) -> Analysis:
    """Close the robot's loops, beginning at the configuration as written, and count its degrees of freedom.

    Args:
        document: that holds the robot.
        robot: the robot.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name.

    Raises:
        RaffClosureError: the loops can't be closed.
        RaffError: `loops` names a loop or a kind that does not exist; a length is too large.
    """
    check_sizes(document, robot)
    kinds, written = loop_kinds(robot, loops), robot
    robot = expanded(robot)
    joints = [link for link in robot.links if link.type is not JointType.FIXED]
    rows, rank, gap, closure, length = 0, 0, 0.0, 0.0, length_of(document, written, kinds)
    determined: set[str] = set()  # joints that the others move
    declared = declared_actuated(written)
    problems: list[Problem] = []
    values = {joint.joint: home(document, joint) for joint in joints}
    if robot.loops or robot.couplings:
        for cluster in clusters(document, robot, kinds, length):
            gap = max(gap, *gaps(cluster, cluster.home))
            closing = close_from_afar(cluster, cluster.start)
            if not closing.closed:
                why = why_open(cluster, cluster.names, cluster.start, closing, raff=True)
                problems.append(document.source.problem(f"robot '{robot.name}': {why}"))
                continue
            bounds = np.array([limits(document, joint) for joint in cluster.joints]).reshape(-1, 2)
            inside = close_within(cluster, closing.q, *bounds.T)
            closure = max(closure, *gaps(cluster, inside))
            values.update(zip((joint.joint for joint in cluster.joints), inside.tolist(), strict=True))
            count, q = generic_rank(cluster, closing.q)
            jacobian = cluster.evaluate(q)[1]
            rows, rank = rows + len(jacobian), rank + count
            order = _outermost_first(cluster, declared)
            determined |= {cluster.joints[i].joint for i in passive(jacobian, order)}
    if problems:
        raise RaffClosureError(problems)
    actuated = tuple(joint for joint, has in declared.items() if has or (has is None and joint not in determined))
    uncontrolled = tuple(joint for joint in declared if joint not in actuated and joint not in determined)
    dependent = tuple(joint for joint in actuated if joint in determined)
    mobility = len(joints) + (6 if robot.movable else 0) - rank
    if rows:
        length = length_of(document, written, kinds, values)
    kinds_of = tuple(kinds.values())
    return Analysis(mobility, rows, rank, actuated, gap, closure, kinds_of, values, length, uncontrolled, dependent)


def _outermost_first(cluster: Cluster, actuated: Mapping[str, bool | None]) -> Sequence[int]:
    """Return the cluster's joints from the outermost inwards, beginning with those that the file declares passive, and
    then those that follow others in couplings."""
    moving = {joint.number for joint in cluster.joints}
    depth: dict[int, int] = {}
    for part in cluster.parts:
        depth[part.number] = depth.get(part.pred, 0) + (part.number in moving)
    followers = {cluster.robot.couplings[i].follower for i in cluster.couplings}
    keys = [
        (actuated[joint.joint] is not False, joint.number not in followers, -depth[joint.number], -i)
        for i, joint in enumerate(cluster.joints)
    ]
    return sorted(range(len(keys)), key=keys.__getitem__)
