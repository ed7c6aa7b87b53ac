"""Scripted sensors: a node follows a closed path that is fitted into its workspace, or its only motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik import Solver, Status
from cinegen.model import ForwardKinematics, Mechanism
from cinegen.sensor import Reading, TimedSensor
from raff2urdf.closure import rank

SHAPES: Mapping[str, Callable[[float], tuple[float, float]]] = {
    "circle": lambda angle: (math.cos(angle), math.sin(angle)),
    "figure8": lambda angle: (math.sin(angle), math.sin(2.0 * angle) / 2.0),
    "line": lambda angle: (math.sin(angle), 0.0),
}
"""Curves of size 1 in a plane, as functions of an angle, rad."""

_RAMP = 1.5  # s: the path grows from a point, so that the target does not jump at the start
_SMALLEST = 1e-3  # characteristic lengths: smallest path
_ON_PATH = 1e-3  # characteristic lengths: largest lag of a node on a path within its workspace
_STEPS = 180  # of an actuated joint's revolution, or of a characteristic length
_MARGIN = 0.04  # part of a sweep that is left out at each end, where loops may be singular


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


@dataclass(frozen=True, slots=True)
class JointSweep:
    """Motion of a node while the actuated joint of a mechanism of mobility 1 moves to and fro, or round and round.

    Attributes:
        node: node that follows it.
        poses: poses of the node at equal steps of the joint, in the world.
        start: index of the pose at home.
        closed: whether the joint revolves: the last pose is the first.
        period: time of one revolution, or to and fro, s.
    """

    shape: ClassVar[str] = "sweep"
    rotation: ClassVar[int] = 0
    node: str
    poses: tuple[pin.SE3, ...]
    start: int
    closed: bool
    period: float

    @property
    def size(self) -> float:
        """Extent of the motion, m."""
        points = np.array([pose.translation for pose in self.poses])
        return float(np.linalg.norm(np.ptp(points, axis=0)))

    def target(self, time: float) -> pin.SE3:
        """Return the target pose at a time (s)."""
        time = time * time / (2.0 * _RAMP) if time < _RAMP else time - 0.5 * _RAMP
        last, part = len(self.poses) - 1, 2.0 * math.pi * time / self.period
        if self.closed:
            at = (self.start + last * time / self.period) % last
        else:
            half = 0.5 * last
            at = half + half * math.sin(part + math.asin(self.start / half - 1.0))
        k = min(int(at), last - 1)
        return pin.SE3.Interpolate(self.poses[k], self.poses[k + 1], at - k)


def fit_path(
    mechanism: Mechanism, node: str, shape: str = "circle", period: float = 6.0, q: Array | None = None
) -> ScriptedPath | JointSweep:
    """Return the largest path of a shape around a node's pose (at most half the characteristic length) that the node
    can follow.

    The path is horizontal if the node can move in all directions; else it lies in the plane of its motion. Sizes are
    tried by following the path once, within joint limits. A mechanism of mobility 1 has only one motion: its actuated
    joint moves through its range.

    Args:
        mechanism: mechanism.
        node: node that follows the path.
        shape: one of `SHAPES`.
        period: of one revolution, s.
        q: (nq,) configuration at the start; home unless given.

    Raises:
        UnknownNameError: no such node.
    """
    start = mechanism.q_home if q is None else q
    home = mechanism.placement(start, node)
    if mechanism.mobility == 1 and len(mechanism.actuated) == 1:
        sweep = _sweep(mechanism, node, period, start)
        if sweep is not None:
            return sweep
    axes, dof, keeps = _easiest_plane(mechanism, node, home, start)
    if dof == 0:
        return ScriptedPath(node, shape, home, axes, 0.0, period, 0)
    path = ScriptedPath(
        node, shape if dof > 1 else "line", home, axes, 0.5 * mechanism.length, period, 3 if keeps else 0
    )
    while path.size > _SMALLEST * mechanism.length and not _follows(mechanism, path, dof, start):
        path = replace(path, size=0.75 * path.size)
    return path


def _sweep(mechanism: Mechanism, node: str, period: float, start: Array) -> JointSweep | None:
    """Return the motion of a node while the actuated joint moves as far as limits and loops allow, if it moves."""
    joint = mechanism.actuated[0]
    at, limits = mechanism.q_index(joint), mechanism.limits[joint]
    revolute = mechanism.scale[mechanism.v_index(joint)] == 1.0
    step = (2.0 * math.pi if revolute else mechanism.length) / _STEPS

    def walk(direction: int) -> list[pin.SE3]:
        forward, passed = ForwardKinematics(mechanism, start), list[pin.SE3]()
        for k in range(1, _STEPS + 1):
            try:
                q = forward.move({joint: float(start[at]) + direction * k * step})
            except CinegenError:
                break
            if not ((mechanism.limits.lower <= q) & (q <= mechanism.limits.upper)).all():
                break
            passed.append(mechanism.placement(q, node))
        return passed

    middle, upwards = mechanism.placement(start, node), walk(1)
    closed = revolute and len(upwards) == _STEPS and upwards[-1].isApprox(middle, 1e-9)
    downwards = [] if closed else walk(-1)
    poses = [*reversed(downwards), middle, *upwards]
    if not closed:
        cut = round(_MARGIN * len(poses))
        first, last = min(cut, len(downwards)), min(cut, len(upwards))
        poses, downwards = poses[first : len(poses) - last], downwards[: len(downwards) - first]
    span = (len(poses) - 1) * step
    slowest = span / limits.velocity * (1.0 if closed else math.pi)
    path = JointSweep(node, tuple(poses), len(downwards), closed, max(period, 1.1 * slowest))
    return path if len(poses) > 2 and path.size > _SMALLEST * mechanism.length else None


def _easiest_plane(mechanism: Mechanism, node: str, home: pin.SE3, q: Array) -> tuple[Array, int, bool]:
    """Return the plane (3, 2) of a node's easiest motion, its translational DoF, and whether it can keep its
    orientation."""
    motions = np.eye(mechanism.model.nv)
    if mechanism.is_constrained:
        _, _, vt = np.linalg.svd(mechanism.structure.system.evaluate(q)[1])
        motions = vt[mechanism.loop_rank :].T
    jacobian = mechanism.jacobian(q, node) * mechanism.scale @ motions
    u, sigma, _ = np.linalg.svd(home.rotation @ jacobian[:3])
    dof = int(np.count_nonzero(sigma > 1e-6 * mechanism.length))
    scaled = jacobian / np.array([mechanism.length] * 3 + [1.0] * 3)[:, None]
    keeps = rank(scaled) - rank(scaled[3:])  # directions of motion without rotation
    plane = np.eye(3)[:, :2] if dof == 3 else u[:, :2]  # horizontal
    return plane, dof, keeps == dof and rank(scaled[3:]) > 0


def _follows(mechanism: Mechanism, path: ScriptedPath, dof: int, q: Array) -> bool:
    """Return whether the node stays on the path for one revolution."""
    ticks = 120
    dt = path.period / ticks
    solver = Solver(mechanism, dt, q)
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

    def __init__(self, path: ScriptedPath | JointSweep) -> None:
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
