"""Scripted sensors: a node follows a closed path that is fitted into its workspace."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik import Solver, Status
from cinegen.model import Mechanism
from cinegen.sensor import Reading, TimedSensor
from raff2urdf.closure import rank

Array = NDArray[np.float64]

SHAPES: Mapping[str, Callable[[float], tuple[float, float]]] = {
    "circle": lambda angle: (math.cos(angle), math.sin(angle)),
    "figure8": lambda angle: (math.sin(angle), math.sin(2.0 * angle) / 2.0),
    "line": lambda angle: (math.sin(angle), 0.0),
}
"""Curves of size 1 in a plane, as functions of an angle, rad."""

_RAMP = 1.5  # s: the path grows from a point, so that the target does not jump at the start
_SMALLEST = 1e-3  # characteristic lengths: smallest path
_ON_PATH = 1e-3  # characteristic lengths: largest lag of a node on a path within its workspace


@dataclass(frozen=True, slots=True)
class ScriptedPath:
    """Closed path around a pose.

    Attributes:
        node: node that follows the path.
        shape: one of `SHAPES`.
        home: pose of the node at the centre of the path, in the world.
        axes: (3, 2) orthonormal basis of the path's plane, in the world.
        size: radius, or half the length, m.
        period: time of one revolution, s.
        rotation: number of constrained rotations: 3 if the mechanism can keep the orientation, else 0.
    """

    node: str
    shape: str
    home: pin.SE3
    axes: Array
    size: float
    period: float
    rotation: int

    def target(self, time: float) -> pin.SE3:
        """Return the target pose at a time (s)."""
        grown = min(1.0, time / _RAMP)
        size = self.size * grown * grown * (3.0 - 2.0 * grown)
        offset = self.axes @ np.array(SHAPES[self.shape](2.0 * math.pi * time / self.period))
        return pin.SE3(self.home.rotation, self.home.translation + size * offset)


def fit_path(mechanism: Mechanism, node: str, shape: str = "circle", period: float = 6.0) -> ScriptedPath:
    """Return the largest path of a shape around a node's home (at most half the characteristic length) that the node
    can follow.

    The path is horizontal if the node can move in all directions; else it lies in the plane of its motion. If the node
    can only move along a line, circle and figure eight become a line. Sizes are tried by following the path once,
    within joint limits.

    Raises:
        UnknownNameError: no such node.
    """
    home = mechanism.placement(mechanism.q_home, node)
    axes, dof, keeps = _easiest_plane(mechanism, node, home)
    if dof == 0:
        return ScriptedPath(node, shape, home, axes, 0.0, period, 0)
    path = ScriptedPath(
        node, shape if dof > 1 else "line", home, axes, 0.5 * mechanism.length, period, 3 if keeps else 0
    )
    while path.size > _SMALLEST * mechanism.length and not _follows(mechanism, path, dof):
        path = replace(path, size=0.75 * path.size)
    return path


def _easiest_plane(mechanism: Mechanism, node: str, home: pin.SE3) -> tuple[Array, int, bool]:
    """Return the plane (3, 2) of a node's easiest motion, its translational DoF, and whether it can keep its
    orientation."""
    motions = np.eye(mechanism.model.nv)
    if mechanism.loops:
        _, _, vt = np.linalg.svd(mechanism.system.evaluate(mechanism.q_home)[1])
        motions = vt[mechanism.loop_rank :].T
    if mechanism.floating and node != mechanism.nodes[0]:  # a base is fixed unless a task moves it
        motions = motions * np.concatenate([np.zeros(6), np.ones(mechanism.model.nv - 6)])[:, None]
    jacobian = mechanism.jacobian(mechanism.q_home, node) * mechanism.scale @ motions
    u, sigma, _ = np.linalg.svd(home.rotation @ jacobian[:3])
    dof = int(np.count_nonzero(sigma > 1e-6 * mechanism.length))
    scaled = jacobian / np.array([mechanism.length] * 3 + [1.0] * 3)[:, None]
    keeps = rank(scaled) - rank(scaled[3:])  # directions of motion without rotation
    plane = np.eye(3)[:, :2] if dof == 3 else u[:, :2]  # horizontal
    return plane, dof, keeps == dof and rank(scaled[3:]) > 0


def _follows(mechanism: Mechanism, path: ScriptedPath, dof: int) -> bool:
    """Return whether the node stays on the path for one revolution."""
    ticks = 120
    dt = path.period / ticks
    solver = Solver(mechanism, dt)
    task = solver.add_task(path.node, path.home, rotation=path.rotation)
    near = _ON_PATH if dof > 1 else 0.2 * path.size / mechanism.length  # a curve is no line
    for tick in range(ticks + round(_RAMP / dt)):
        task.target = path.target(tick * dt)
        step = solver.step()
        if step.status is Status.REFUSED or step.errors[0][0] > near * mechanism.length:
            return False
    return True


class ScriptedSensor(TimedSensor):
    """Sensor whose target runs along a path from its start.

    Args:
        path: path, for instance of `fit_path`.
    """

    def __init__(self, path: ScriptedPath) -> None:
        super().__init__(f"path:{path.shape}")
        self.path = path

    def reading_at(self, seconds: float) -> Reading:
        """Return the target of this moment; it is always new."""
        self._count += 1
        return Reading(seconds, target=self.path.target(seconds))

    @property
    def progress(self) -> str:
        """Node, shape and size of the path."""
        return f"{self.path.node} follows a {self.path.shape} of {self.path.size:.3g} m"
