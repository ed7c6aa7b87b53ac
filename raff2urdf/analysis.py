"""What a robot's loops leave of its motion: mobility, which joints have motors, and home with all loops closed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raff2urdf.check import check_sizes
from raff2urdf.closure import Closing, close, close_from_afar, generic_rank, passive, why_open
from raff2urdf.document import Document, JointType, LoopKind, RaffRobot
from raff2urdf.errors import Problem, RaffClosureError, RaffError, did_you_mean
from raff2urdf.tree import Cluster, characteristic_length, clusters, home, limits, placements

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Analysis:
    """What the loops do to a robot.

    Attributes:
        mobility: degrees of freedom that the loops leave, on random closed configurations (a base that can move
            adds six).
        rows: loop rows, all kinds together.
        rank: how many of them are independent.
        actuated: names of the joints that have a motor, in file order.
        gap: how far the loops stand open as written (rad or characteristic lengths).
        kinds: of each loop, as asked.
        home: the value of each joint (rad, m) by name, in file order: as written, moved to where all loops are closed,
            inside the limits if that can be had.
    """

    mobility: int
    rows: int
    rank: int
    actuated: tuple[str, ...]
    gap: float
    kinds: tuple[LoopKind, ...]
    home: Mapping[str, float]


def loop_kinds(robot: RaffRobot, asked: Mapping[str, str] | None = None) -> dict[int, LoopKind]:
    """The kind of each loop by its index, with those that were asked for by name instead of the file's.

    Raises:
        RaffError: no such loop, or no such kind.
    """
    kinds = {i: loop.kind for i, loop in enumerate(robot.loops)}
    for name, kind in (asked or {}).items():
        if name not in robot.loop_names:
            raise RaffError(f"robot '{robot.name}' has no loop '{name}'{did_you_mean(name, robot.loop_names)}")
        kinds[robot.loop_names.index(name)] = loop_kind(kind)
    return kinds


def loop_kind(word: str) -> LoopKind:
    """The kind of loop of that name: rigid, prismatic, revolute or ball.

    Raises:
        RaffError: no such kind.
    """
    known = [kind.name.lower() for kind in LoopKind]
    if word not in known:
        raise RaffError(f"'{word}' is no kind of loop{did_you_mean(str(word), known)}")
    return LoopKind[word.upper()]


def analyse(document: Document, robot: RaffRobot, loops: Mapping[str, str] | None = None) -> Analysis:
    """Closes the robot's loops from the written posture and counts what is left of its motion.

    Raises:
        RaffClosureError: the loops can't be closed.
        RaffError: `loops` names a loop or a kind that does not exist; a length is too great to compute with.
    """
    check_sizes(document, robot)
    kinds = loop_kinds(robot, loops)
    joints = [link for link in robot.links if link.type is not JointType.FIXED]
    free = len(joints) + (6 if robot.movable else 0)
    rows = rank = 0
    gap = 0.0
    determined: set[str] = set()  # joints that the others move
    why: list[Problem] = []
    values = {joint.joint: home(document, joint) for joint in joints}
    if robot.loops:
        origins = np.array([placed[:3, 3] for placed in placements(document, robot).values()])
        for cluster in clusters(document, robot, kinds, characteristic_length(origins)):
            gap = max(gap, *cluster.gaps(cluster.home))
            closing = close_from_afar(cluster, cluster.home)
            if not closing.closed:
                why.append(_why_open(document, robot, cluster, closing))
                continue
            inside = _inside(document, cluster, closing.q)
            values.update(zip((joint.joint for joint in cluster.joints), inside.tolist(), strict=True))
            count, q = generic_rank(cluster, closing.q)
            jacobian = cluster.evaluate(q)[1]
            rows, rank = rows + len(jacobian), rank + count
            order = _outermost_first(robot, cluster)
            determined |= {cluster.joints[i].joint for i in passive(jacobian, order)}
    if why:
        raise RaffClosureError(why)
    said = {joint.joint: joint.actuated for joint in joints}
    if True in said.values():
        actuated = [name for name, has in said.items() if has]
    else:
        actuated = [name for name, has in said.items() if has is None and name not in determined]
    return Analysis(free - rank, rows, rank, tuple(actuated), gap, tuple(kinds.values()), values)


def _inside(document: Document, cluster: Cluster, closed: Array) -> Array:
    """The closed configuration, with joints that are beyond a limit led back to it, if loops can be closed so."""
    low, high = np.array([limits(document, joint) for joint in cluster.joints]).reshape(-1, 2).T
    q, free = closed, np.ones(len(closed), dtype=bool)
    for _ in range(3):
        outside = (q < low) | (q > high)
        if not outside.any():
            return q
        free &= ~outside
        closing = close(cluster, np.clip(q, low, high), free)
        if not closing.closed:
            break
        q = closing.q
    return closed


def _why_open(document: Document, robot: RaffRobot, cluster: Cluster, closing: Closing) -> Problem:
    names = [robot.loop_names[i] for i in cluster.loops]
    why = why_open(names, cluster.kinds, cluster.gaps, cluster.relaxed, cluster.home, closing)
    return document.source.problem(f"robot '{robot.name}': {why}")


def _outermost_first(robot: RaffRobot, cluster: Cluster) -> Sequence[int]:
    """The cluster's joints from the one furthest from the base inwards; those said to have no motor before all."""
    moving = {joint.number for joint in cluster.joints}
    depth: dict[int, int] = {}
    for part in cluster.parts:
        depth[part.number] = depth.get(part.pred, 0) + (part.number in moving)
    keys = [(joint.actuated is not False, -depth[joint.number], -i) for i, joint in enumerate(cluster.joints)]
    return sorted(range(len(keys)), key=keys.__getitem__)
