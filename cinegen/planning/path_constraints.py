"""Constraints of a node along a path, as equations of its pose."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.scene import Scene
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.task import FrameTask
from cinegen.tolerances import CLOSURE

Projection = Callable[[Array], Array | None]
"""Returns a configuration (nq,) near a given one, on which all equations are satisfied; None without one."""

_RESIDUAL = 1e-9  # rad or characteristic lengths


def path_tasks(scene: Scene) -> tuple[FrameTask, ...]:
    """Return tasks whose rows are 0 where a scene's `path_constraints` are satisfied."""
    here, constraints, found = scene.mechanism.placement(scene.start, scene.node), scene.path_constraints, []
    if constraints.upright:  # z of a frame that is parallel to the world's at the start remains vertical
        upright = pin.SE3(here.rotation.T, np.zeros(3))
        found.append(FrameTask(scene.node, pin.SE3(np.eye(3), here.translation), 0, 2, offset=upright))
    for direction, weights in ((constraints.line, [1, 1, 0]), (constraints.plane, [0, 0, 1])):
        if direction is not None:
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction).toRotationMatrix()
            target = pin.SE3(turn, here.translation)
            found.append(FrameTask(scene.node, target, axes="target", weights=[*weights, 0, 0, 0]))
    return tuple(found)


def projection(scene: Scene) -> Projection | None:
    """Return the projection onto the configurations on which a scene's path constraints are satisfied and loops are
    closed, within limits; None without path constraints."""
    if not scene.path_constraints:
        return None
    local = LocalIK(scene.mechanism, path_tasks(scene))

    def project(q: Array) -> Array | None:
        return local.best if local.solve(q, _RESIDUAL) and local.closure <= CLOSURE else None

    return project
