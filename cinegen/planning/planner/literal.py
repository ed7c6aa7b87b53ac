"""`Literal`: the vortex method of De Medio and Oriolo 1991 as it is printed, to be compared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.body import Body
from cinegen.collision.scene import Scene
from cinegen.ik.objectives import State
from cinegen.planning.fields import Vortex, facing, folding, scissors, turning_axis
from cinegen.planning.planar import plane_of
from cinegen.planning.planner.descent import LONGEST, Descent, Goal, Links

Array = NDArray[np.float64]

PULL = 1.0
"""Lengths: in the middle of its range a vortex moves a point as fast as a goal so far away."""

GAIN = 0.1
"""k_g, without unit: part of the antigradient that a step makes while a vortex turns; of `LONGEST` at most."""


class Literal:
    """An objective: equation 6, dq = -k_g (grad_q U_a + sum_i J_i' grad U_v(L_i)).

    All obstacles in range turn, whether they are in the way or not, in the sense that the first link to come in range
    asks for: toward the base, of a mobile robot the shorter way. The attractive vector is that of the node that has a
    goal, also for points of other links. What the paper says for the plane is used in it; in space, where the sine of
    alpha jumps (`cinegen.planning.fields.discarding`), the weight is that which it is in the plane. While no vortex
    turns, steps are searched for along the antigradient of U_a. Self-collision is left to the barrier.

    Args:
        scene: what is where.
        bodies: of the robot.
        reach: m, range of influence.
        task: how strong vortices are, see `PULL`.
        gain: k_g.
    """

    def __init__(
        self, scene: Scene, bodies: Sequence[Body], reach: float, task: float = PULL, gain: float = GAIN
    ) -> None:
        mechanism = scene.mechanism
        self._goal, self._gain, self._scale = Goal(scene), gain, mechanism.scale
        self._owner = [i for i, obstacle in enumerate(scene.obstacles) for _ in obstacle.bodies]
        self._links = Links(mechanism, bodies, [body for obstacle in scene.obstacles for body in obstacle.bodies])
        self._straight = Descent(mechanism, self._goal.value, self._goal.gradient)
        self._vortex, self._reach = Vortex(task / mechanism.length * reach, reach), reach
        self._plane, self._mobile = plane_of(mechanism), scene.mobile is not None
        self._base = np.array(mechanism.model.jointPlacements[min(1, mechanism.model.njoints - 1)].translation)
        self._axes: dict[int, Array] = {}

    def velocity(self, state: State) -> Array:
        """(nv,) rad/s and m/s."""
        goal, turned, turns = self._goal.way(state.q), np.zeros(len(self._scale)), False
        for near, obstacle in zip(self._links.near(state.q), self._owner, strict=True):
            inside = np.flatnonzero(near.distances < self._reach)
            if not len(inside):
                continue
            if obstacle not in self._axes:
                first = int(near.distances.argmin())
                towards = goal if self._mobile else folding(near.points[first], self._base, self._plane)
                self._axes[obstacle] = turning_axis(near.normals[first], towards, goal, plane=self._plane)
            vortices = self._vortex.velocity(near.distances, near.normals, self._axes[obstacle])
            attraction = np.broadcast_to(goal, vortices.shape)
            weights = facing(attraction, near.normals)
            if self._plane is not None:
                weights = scissors(attraction, vortices, near.normals)
            turns = turns or bool(weights[inside].any())
            turned += self._links.moved(near, weights[:, None] * vortices)
        if not turns:
            return self._straight.velocity(state)
        step = self._gain * (turned - self._goal.gradient(state.q))
        step *= min(1.0, LONGEST / max(float(np.abs(step).max()), 1e-300))
        return np.asarray(step * self._scale / state.dt)
