"""The effect of a robot's loops on its motion: mobility, actuated joints, and home with all loops closed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.closure import CLOSED, close, close_from_afar, closed_walk, gaps, generic_rank
from raff2urdf.errors import NearlyRedundantError, Problem, RaffClosureError, RaffError, did_you_mean
from raff2urdf.loops.home import Beyond, close_within, moved_within, outside
from raff2urdf.loops.idle import Edge, motions, spins
from raff2urdf.loops.near_redundancy import near_redundancy
from raff2urdf.loops.open_loops import why_open
from raff2urdf.loops.play import play, steps_of
from raff2urdf.loops.play import text as play_text
from raff2urdf.loops.selection import Candidate, determined
from raff2urdf.loops.slips import DRAWN_OPEN, Fault
from raff2urdf.raff.closing_edits import slips_of
from raff2urdf.raff.compound import expanded
from raff2urdf.raff.document import Document, JointType, LoopKind, RaffLink, RaffRobot
from raff2urdf.raff.sizes import check_sizes
from raff2urdf.tree import Cluster, clusters, coupling_of, edges, effort, length_of, limits, velocity
from raff2urdf.tree import home as home_of


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
        moved: of each loop whose ends are moved, by its index, the placements (4, 4) of both ends on their nodes.
        origins: of each joint that healing moves, by its name, its placement (4, 4) on its parent, at zero.
        remarks: what concerns users, in the words of `cinegen.load`.
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
    moved: Mapping[int, tuple[Array, Array]] = field(default_factory=dict)
    origins: Mapping[str, Array] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


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


def analyse(
    document: Document, robot: RaffRobot, loops: Mapping[str, str] | None = None, exact: bool = False
) -> Analysis:
    """Close the robot's loops, beginning at the configuration as written, and count its degrees of freedom.

    Args:
        document: that holds the robot.
        robot: the robot.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name.
        exact: take all loops as written. Otherwise pins with play (`raff2urdf.loops.play`) are closed in the plane.

    Raises:
        RaffClosureError: the loops can't be closed.
        NearlyRedundantError: loops are nearly redundant, unless `exact`.
        RaffError: `loops` names a loop or a kind that does not exist; a length is too large.
    """
    check_sizes(document, robot)
    kinds, written = loop_kinds(robot, loops), robot
    robot = expanded(robot)
    joints = [link for link in robot.links if link.type is not JointType.FIXED]
    length, declared = length_of(document, written, kinds), declared_actuated(written)
    problems, parts = list[Problem](), list[_ClosedCluster]()
    for cluster in clusters(document, robot, kinds, length) if robot.loops or robot.couplings else ():
        part = _closed(cluster, exact)
        if isinstance(part, _ClosedCluster):
            parts.append(part)
        else:
            edit = None if problems else slips_of(document, written, kinds, Fault.OPEN)
            why = part if edit is None else f"{part}\n  {edit}"
            problems.append(document.source.problem(f"robot '{robot.name}': {why}"))
    if problems:
        raise RaffClosureError(problems)
    start = {joint.joint: home_of(document, joint) for joint in joints}
    closed, home, *elsewhere = (start | {k: v for part in parts for k, v in part.values(i)} for i in range(4))
    in_loops = {joint.joint for part in parts for joint in part.cluster.joints}
    for joint in joints:
        if joint.joint not in in_loops:
            low, high = limits(document, joint)
            home[joint.joint] = min(max(home[joint.joint], low), high)
    gap = max((part.gap for part in parts), default=0.0)
    remarks = [part.remark for part in parts if part.remark]
    if gap > CLOSED and (edit := slips_of(document, written, kinds, Fault.ELSEWHERE)) is not None:
        remarks.insert(0, DRAWN_OPEN + edit)
    everywhere = [edges(document, robot, kinds, length, values) for values in (home, *elsewhere)]
    determined = _determined(document, robot, parts, everywhere, declared)
    actuated = tuple(joint for joint, has in declared.items() if has or (has is None and joint not in determined))
    rows, rank = sum(part.rows for part in parts), sum(part.rank for part in parts)
    return Analysis(
        mobility=len(joints) + (6 if robot.movable else 0) - rank,
        rows=rows,
        rank=rank,
        actuated=actuated,
        gap=gap,
        closure=max((part.closure for part in parts), default=0.0),
        kinds=tuple(kinds.values()),
        home=home,
        length=length_of(document, written, kinds, home) if rows else length,
        uncontrolled=tuple(joint for joint in declared if joint not in actuated and joint not in determined),
        dependent=tuple(joint for joint in actuated if joint in determined),
        moved={loop: ends for part in parts for loop, ends in part.moved.items()},
        remarks=(*remarks, *_beyond(document, joints, closed, home)),
    )


@dataclass(frozen=True, slots=True)
class _ClosedCluster:
    """A cluster of loops that are closed.

    Attributes:
        cluster: with pins with play closed in the plane.
        configurations: closed ones: nearest to that as written, home, another one, and one where the generic rank is
            reached.
        rows: number of its equations.
        rank: number of independent ones.
        gap: see `Analysis`.
        closure: see `Analysis`.
        moved: see `Analysis`.
        remark: about pins with play; empty without any.
    """

    cluster: Cluster
    configurations: tuple[Array, Array, Array, Array]
    rows: int
    rank: int
    gap: float
    closure: float
    moved: Mapping[int, tuple[Array, Array]]
    remark: str

    def values(self, i: int) -> Iterator[tuple[str, float]]:
        """Yield the name and the value of each joint in one of the configurations."""
        return zip((joint.joint for joint in self.cluster.joints), self.configurations[i].tolist(), strict=True)


def _closed(cluster: Cluster, exact: bool) -> _ClosedCluster | str:
    """Close a cluster of loops, or return why it stays open.

    Raises:
        NearlyRedundantError: see `analyse`.
    """
    gap, closing = max(gaps(cluster, cluster.home)), close(cluster, cluster.start)
    offsets = {} if closing.closed or exact else play(cluster, cluster.start, closing)
    remark, moved = "", dict[int, tuple[Array, Array]]()
    if offsets:
        remark, steps = play_text(cluster.names, cluster.ends, offsets), steps_of(offsets)
        moved = {cluster.loops[i]: ends for i, ends in steps.items()}
        cluster = cluster.with_moved(steps)
        closing = close(cluster, cluster.start)
    if not exact and near_redundancy(cluster, closing.q, cluster.start) is not None:
        what = f"robot '{cluster.robot.name}': nearly redundant loops: {', '.join(cluster.names)}"
        raise NearlyRedundantError(cluster.document.source.problem(what))
    closing = closing if closing.closed else close_from_afar(cluster, cluster.start)
    if not closing.closed:
        return why_open(cluster, cluster.names, cluster.start, closing, raff=True)
    bounds = np.array([limits(cluster.document, joint) for joint in cluster.joints]).reshape(-1, 2)
    home = close_within(cluster, cluster.start, closing.q, *bounds.T)
    rank, generic = generic_rank(cluster, home)
    configurations = closing.q, home, next(closed_walk(cluster, generic, 1), generic), generic
    rows, closure = len(cluster.evaluate(generic)[1]), max(gaps(cluster, home))
    return _ClosedCluster(cluster, configurations, rows, rank, gap, closure, moved, remark)


def _beyond(
    document: Document, joints: Sequence[RaffLink], closed: Mapping[str, float], home: Mapping[str, float]
) -> list[str]:
    """Return what was moved to be within limits, or stays outside; not what is written outside, of which `check` warns.

    Args:
        document: that holds the robot.
        joints: that move.
        closed: their values with loops closed.
        home: likewise, within the limits if possible.
    """
    beyond: dict[bool, list[Beyond]] = {False: [], True: []}
    for joint in joints:
        low, high = limits(document, joint)
        for is_home, values in ((False, closed), (True, home)):
            value = values[joint.joint]
            written = low <= home_of(document, joint) <= high
            if not low <= value <= high and (written or is_home):
                slides = joint.type is JointType.PRISMATIC
                beyond[is_home].append(Beyond(joint.joint, slides, value, low if value < low else high))
    before, after = beyond[False], beyond[True]
    return [outside(after)] if after else [moved_within(before)] if before else []


def _determined(
    document: Document,
    robot: RaffRobot,
    parts: Sequence[_ClosedCluster],
    everywhere: Sequence[Sequence[Edge]],
    actuated: Mapping[str, bool | None],
) -> set[str]:
    """Return the joints that the others determine, see `raff2urdf.loops.selection`.

    Args:
        document: that holds the robot.
        robot: the robot, `expanded`.
        parts: its clusters.
        everywhere: all joints at home and the other configurations of clusters.
        actuated: whether joints are, in file order; None: not stated.
    """
    joints = [link.joint for link in robot.links if link.type is not JointType.FIXED]
    in_loops = {joint.joint for part in parts for joint in part.cluster.joints}
    coupled = {joint for i in range(len(robot.couplings)) for joint in coupling_of(document, robot, i).terms}
    fixed = [i for i, joint in enumerate(joints) if actuated[joint] or joint not in in_loops or joint in coupled]
    idle = spins(everywhere, fixed)
    names: set[str] = set()
    for part in parts:
        cluster, (_, *configurations) = part.cluster, part.configurations
        columns = [joints.index(joint.joint) for joint in cluster.joints]
        rows = [motions(edges, idle, len(joints))[:, columns] for edges in everywhere]
        jacobians = [np.vstack([cluster.evaluate(q)[1], row]) for q, row in zip(configurations, rows, strict=True)]
        turning = np.abs(rows[-1]).max(axis=0, initial=0.0) > 0.0
        names.update(determined(jacobians, _candidates(document, cluster, actuated, turning)))
    return names


def _candidates(
    document: Document, cluster: Cluster, actuated: Mapping[str, bool | None], spins: Sequence[bool]
) -> list[Candidate]:
    moving = {joint.number for joint in cluster.joints}
    depth: dict[int, int] = {}
    for part in cluster.parts:
        depth[part.number] = depth.get(part.pred, 0) + (part.number in moving)
    followers = {cluster.robot.couplings[i].follower for i in cluster.couplings}
    return [
        Candidate(
            joint.joint,
            i,
            depth[joint.number],
            actuated[joint.joint],
            joint.number in followers,
            joint.type is JointType.PRISMATIC,
            any(map(math.isfinite, (limits(document, joint)[1], velocity(document, joint), effort(joint)))),
            bool(spins[i]),
        )
        for i, joint in enumerate(cluster.joints)
    ]
