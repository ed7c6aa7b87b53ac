"""A scripted sensor: a closed path for a node to follow, fitted into the workspace."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik import Solver, Status
from cinegen.model import Mechanism
from raff2urdf.closure import rank

Array = NDArray[np.float64]

SHAPES: Mapping[str, Callable[[float], tuple[float, float]]] = {
    "circle": lambda turn: (math.cos(turn), math.sin(turn)),
    "figure8": lambda turn: (math.sin(turn), math.sin(2.0 * turn) / 2.0),
    "line": lambda turn: (math.sin(turn), 0.0),
}
"""Each shape as a curve of size 1 in a plane, by the angle turned."""

_RAMP = 1.5  # s: the path grows from a point, so that nothing jumps at the start
_SMALLEST = 1e-3  # characteristic lengths: a smaller path is none
_ON_PATH = 1e-3  # characteristic lengths: how far a node may lag on a path that is within the workspace


@dataclass(frozen=True, slots=True)
class Path:
    """A closed path around a place.

    Attributes:
        node: that follows it.
        shape: one of `SHAPES`.
        home: the node's placement that the path runs around, in the world.
        axes: (3, 2) the path's plane, orthonormal, in the world.
        size: radius, or half the length, m.
        period: seconds for one turn.
        rotation: rotations held at home's: 3 where the mechanism can hold them, 0 where it can't.
    """

    node: str
    shape: str
    home: pin.SE3
    axes: Array
    size: float
    period: float
    rotation: int

    def target(self, time: float) -> pin.SE3:
        """Where the node should be at a time (s)."""
        grown = min(1.0, time / _RAMP)
        size = self.size * grown * grown * (3.0 - 2.0 * grown)
        offset = self.axes @ np.array(SHAPES[self.shape](2.0 * math.pi * time / self.period))
        return pin.SE3(self.home.rotation, self.home.translation + size * offset)


def fitted(mechanism: Mechanism, node: str, shape: str = "circle", period: float = 6.0) -> Path:
    """The largest path of a shape around a node's home (half the characteristic length at most) that it can follow.

    The path is horizontal where the node can move in all directions; else it lies in the plane of its motion. Where
    the node can only move along a line, a circle and a figure eight become a line. Every size is tried by following it
    once, joint limits and all.

    Raises:
        UnknownNameError: no such node.
    """
    home = mechanism.placement(mechanism.q_home, node)
    axes, freedoms, holds = _freedoms(mechanism, node, home)
    if freedoms == 0:
        return Path(node, shape, home, axes, 0.0, period, 0)
    path = Path(node, shape if freedoms > 1 else "line", home, axes, 0.5 * mechanism.length, period, 3 if holds else 0)
    while path.size > _SMALLEST * mechanism.length and not _follows(mechanism, path, freedoms):
        path = replace(path, size=0.75 * path.size)
    return path


def _freedoms(mechanism: Mechanism, node: str, home: pin.SE3) -> tuple[Array, int, bool]:
    """The plane (3, 2) of easiest motion of a node, how many directions it has, whether it can keep its orientation."""
    motions = np.eye(mechanism.model.nv)
    if mechanism.loops:
        _, _, vt = np.linalg.svd(mechanism.system.evaluate(mechanism.q_home)[1])
        motions = vt[mechanism.loop_rank :].T
    if mechanism.floating and node != mechanism.nodes[0]:  # a base moves only when it is pulled itself
        motions = motions * np.concatenate([np.zeros(6), np.ones(mechanism.model.nv - 6)])[:, None]
    jacobian = mechanism.jacobian(mechanism.q_home, node) * mechanism.scale @ motions
    u, sigma, _ = np.linalg.svd(home.rotation @ jacobian[:3])
    freedoms = int(np.count_nonzero(sigma > 1e-6 * mechanism.length))
    scaled = jacobian / np.array([mechanism.length] * 3 + [1.0] * 3)[:, None]
    keeps = rank(scaled) - rank(scaled[3:])  # directions in which it can move without turning
    plane = np.eye(3)[:, :2] if freedoms == 3 else u[:, :2]  # horizontal where it can be
    return plane, freedoms, keeps == freedoms and rank(scaled[3:]) > 0


def _follows(mechanism: Mechanism, path: Path, freedoms: int) -> bool:
    """Whether the node stays on the path for one turn."""
    ticks = 120
    dt = path.period / ticks
    solver = Solver(mechanism, dt)
    task = solver.add_task(path.node, path.home, rotation=path.rotation)
    near = _ON_PATH if freedoms > 1 else 0.2 * path.size / mechanism.length  # a point on a curve can't follow a line
    for tick in range(ticks + round(_RAMP / dt)):
        task.target = path.target(tick * dt)
        step = solver.step()
        if step.status is Status.REFUSED or step.errors[0][0] > near * mechanism.length:
            return False
    return True
