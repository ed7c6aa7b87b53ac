"""The vortex method of C. De Medio and G. Oriolo, "Robot obstacle avoidance using vortex fields", Advances in Robot
Kinematics, Springer 1991, exactly as published, for comparison with `cinegen.planning.plan`.

    python examples/papers/literal_vortices.py robots/scenes/discs.toml

Readings of what the paper leaves open:

- Modulus of a point's vortex: the text has "inversely proportional to the square of its distance", equation 4 has 1/r.
  The formula is taken: its primitive is the arctan that the paper draws, and 1/r^2 has none.
- Around other shapes, the distance d to the shape, not to a point in it: only then the field grows toward the surface.
- At the end of the range, 1/d - 1/d_r, the bracket of equation 3: 1/d would drop from 1/d_r to 0.
- Discarding by the factor sin alpha: max(0, -n.a) of the outward normal n and the unit attraction a, in the plane just
  that; beyond Q it is 0.
- Direction: toward the axis of the base's joint; for mobile robots, which the paper omits, along the shorter side.
- Equation 6: k_g occurs in U_t already; the motion follows the antigradient, as in equation 1.
"""

from __future__ import annotations

import sys

import numpy as np
from firas import LONGEST, Descent, GoalPotential, LinkPoints
from numpy.typing import ArrayLike, NDArray
from vortex_field import Vortex, facing

from cinegen.collision import Clearance, Scene, load_scene
from cinegen.ik import State
from cinegen.model.motion_plane import motion_plane
from cinegen.planning import Plan, plan
from cinegen.planning.vortices import folding, rotation_axis

Array = NDArray[np.float64]

STRENGTH = 1.0
"""Characteristic lengths: at half its range a vortex moves a point as fast as a goal at that distance."""

GAIN = 0.1
"""k_g, dimensionless: fraction of the antigradient that a step makes while a vortex is active; `LONGEST` at most."""


class LiteralVortices:
    """Objective: equation 6, dq = -k_g (grad_q U_a + sum_i J_i' grad U_v(L_i)).

    All obstacles in range have an active vortex, whether they obstruct the motion or not, in the sense that the first
    link in range determines: toward the base, for a mobile robot along the shorter side. The attraction is that of the
    node that has a goal, also for points of other links. In the plane the weight is the paper's; in space, where the
    sine of alpha is discontinuous (`vortex_field.py`), it is the one that agrees with it in the plane.
    While no vortex is active, steps follow the antigradient of U_a by line search. Self-collision is left to the
    barrier.

    Args:
        scene: scene.
        clearance: distances of its robot.
        reach: range of influence, m.
    """

    def __init__(self, scene: Scene, clearance: Clearance, reach: float) -> None:
        mechanism, self._scene = scene.mechanism, scene
        self._goal, self._scale = GoalPotential(scene), mechanism.scale
        self._owner = [i for i, obstacle in enumerate(scene.obstacles) for _ in obstacle.bodies]
        bodies = [body for obstacle in scene.obstacles for body in obstacle.bodies]
        self._links = LinkPoints(mechanism, clearance.links, bodies)
        self._descent = Descent(mechanism, self._goal.value, self._goal.gradient)
        self._vortex, self._reach = Vortex(STRENGTH / mechanism.length * reach, reach), reach
        self._plane, self._mobile = motion_plane(mechanism), scene.mobile is not None
        self._base = np.array(mechanism.model.jointPlacements[min(1, mechanism.model.njoints - 1)].translation)
        self._axes: dict[int, Array] = {}

    def velocity(self, state: State) -> Array:
        """Return the joint velocity (nv,), rad/s and m/s."""
        goal, vortices, active = self._offset(state), np.zeros(len(self._scale)), False
        for near, obstacle in zip(self._links.near(state.q), self._owner, strict=True):
            inside = np.flatnonzero(near.distances < self._reach)
            if not len(inside):
                continue
            if obstacle not in self._axes:
                first = int(near.distances.argmin())
                towards = goal if self._mobile else folding(near.points[first], self._base, self._plane)
                self._axes[obstacle] = rotation_axis(near.normals[first], towards, goal, plane=self._plane)
            velocities = self._vortex.velocity(near.distances, near.normals, self._axes[obstacle])
            attraction = np.broadcast_to(goal, velocities.shape)
            if self._plane is None:
                weights = facing(attraction, near.normals)
            else:
                weights = scissors(attraction, velocities, near.normals)
            active = active or bool(weights[inside].any())
            vortices += self._links.torques(near, weights[:, None] * velocities)
        if not active:
            return self._descent.velocity(state)
        step = GAIN * (vortices - self._goal.gradient(state.q))
        step *= min(1.0, LONGEST / max(float(np.abs(step).max()), 1e-300))
        return np.asarray(step * self._scale / state.dt)

    def _offset(self, state: State) -> Array:
        """Return the offset (3,) from the node to its goal, m; 0 along translations that do not count."""
        offset = self._scene.goal.translation - state.mechanism.placement(state.q, self._scene.node).translation
        return np.where(np.arange(3) < self._scene.translation, offset, 0.0)


def scissors(attractions: ArrayLike, vortices: ArrayLike, normals: ArrayLike) -> Array:
    """Return the paper's weight (m,): sin(alpha) before Q, 0 from there on; 0 where a or v is 0.

    Args:
        attractions: (m, 3) a, of any unit.
        vortices: (m, 3) v, of any unit.
        normals: (m, 3) outward unit normals n of the obstacle.
    """
    sine = np.linalg.norm(np.cross(_unit(attractions), _unit(vortices)), axis=-1)
    return np.where(facing(attractions, normals) > 0.0, sine, 0.0)


def _unit(vectors: ArrayLike) -> Array:
    """Return unit vectors (m, 3); 0 stays 0."""
    v = np.asarray(vectors, dtype=float)
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(v / np.where(size > 0.0, size, 1.0))


def plan_literally(scene: Scene) -> Plan:
    """Return the plan of the method, which makes one attempt."""
    return plan(scene, field=LiteralVortices)


if __name__ == "__main__":
    for path in sys.argv[1:]:
        print(f"{path}: {plan_literally(load_scene(path))}")
