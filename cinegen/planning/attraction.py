"""Attractions to the goal, and the objective that follows one, deflected by vortices."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.ik import Solver
from cinegen.ik.state import State
from cinegen.model import Mechanism
from cinegen.planning.vortices import Vortices

_GAIN = 0.25  # fraction of the remaining error that a step corrects, of at most 0.2 characteristic lengths
_LONGEST = 0.06  # rad or characteristic lengths: largest step of a joint
_AHEAD = 60  # steps that are predicted to find what obstructs the motion
_CHUNK = 10  # of them at a time
_EVERY = 4  # steps between two predictions
_ARRIVED = 1e-6  # rad or characteristic lengths


class Attraction(Protocol):
    """Steps that lead to the goal if nothing obstructs them.

    Attributes:
        label: description for reports.
    """

    label: str

    def rollout(self, q: Array, steps: int = 1) -> Array:
        """Return the configurations (steps, nq) that follow q (nq,), loops closed, within limits."""
        ...

    def remaining(self, q: Array) -> float:
        """Return the distance of q (nq,) from the goal, rad or characteristic lengths."""
        ...


class TaskAttraction:
    """Moves a node straight to its goal, as the solver follows a task: down the paraboloid of equation 1, by the
    pseudo-inverse of the Jacobian instead of its transpose, so that no line search is needed.

    Args:
        mechanism: robot.
        node: node that is to reach the goal.
        goal: goal pose in the world.
        translation: number of translations that count, along the world's axes.
        rotation: number of rotations that count.
    """

    def __init__(self, mechanism: Mechanism, node: str, goal: pin.SE3, translation: int, rotation: int) -> None:
        self.label = f"{node} straight to the goal"
        self._solver = Solver(mechanism, 1.0, gain=-math.log1p(-_GAIN))
        self._task = self._solver.add_task(node, goal, translation, rotation, axes="world")

    def rollout(self, q: Array, steps: int = 1) -> Array:
        """Return the configurations (steps, nq) that follow q (nq,)."""
        self._solver.q = q
        return np.array([self._solver.step().q for _ in range(steps)])

    def remaining(self, q: Array) -> float:
        """Return the distance of the node from its goal, rad or characteristic lengths."""
        distance, angle = self._task.distances(self._solver.mechanism, q)
        return math.hypot(distance / self._solver.mechanism.length, angle)


class ConfigurationAttraction:
    """Moves all joints straight to a configuration in which the goal is reached.

    Args:
        mechanism: robot.
        configuration: (nq,).
        label: description for reports.
    """

    def __init__(self, mechanism: Mechanism, configuration: Array, label: str) -> None:
        self.label, self.configuration, self._mechanism = label, configuration, mechanism
        self._solver = Solver(mechanism, 1.0) if mechanism.is_constrained else None  # closes the loops
        if self._solver is not None:
            self._solver.objectives = (self,)

    def rollout(self, q: Array, steps: int = 1) -> Array:
        """Return the configurations (steps, nq) that follow q (nq,)."""
        if self._solver is not None:
            self._solver.q = q
            return np.array([self._solver.step().q for _ in range(steps)])
        path = [q]
        for _ in range(steps):
            path.append(self._mechanism.integrate(path[-1], self._step(path[-1])))
        return np.array(path[1:])

    def velocity(self, state: State) -> Array:
        """Return the joint velocity (nv,) toward the configuration, rad/s and m/s, regardless of loops."""
        return self._step(state.q) / state.dt

    def _step(self, q: Array) -> Array:
        """Return the next step (nv,), rad and m."""
        difference = self._mechanism.difference(q, self.configuration)
        return difference * min(1.0, _LONGEST / max(self.remaining(q), 1e-300))

    def remaining(self, q: Array) -> float:
        """Return the largest distance of a joint from the configuration, rad or characteristic lengths."""
        return self._mechanism.distance(q, self.configuration)


class DeflectedAttraction:
    """Objective: an attraction, deflected by vortices around the obstacles that it would come too near to.

    Args:
        attraction: motion to the goal.
        vortices: vortices around obstacles.
    """

    def __init__(self, attraction: Attraction, vortices: Vortices) -> None:
        self.attraction, self.vortices = attraction, vortices
        self._ticks, self._predicted = 0, -_EVERY
        self._obstructing: frozenset[int] = frozenset()

    def velocity(self, state: State) -> Array:
        """Return the joint velocity (nv,), rad/s and m/s."""
        q = state.q
        motion = state.mechanism.difference(q, self.attraction.rollout(q)[0])
        self._ticks += 1
        return self.vortices.deflect(q, motion, lambda: self._find_obstructing(q)) / state.dt

    def _find_obstructing(self, q: Array) -> frozenset[int]:
        """Return the groups to which the attraction would first come too near."""
        if self._ticks - self._predicted < _EVERY:
            return self._obstructing
        self._predicted, self._obstructing = self._ticks, frozenset()
        for _ in range(_AHEAD // _CHUNK):
            path = self.attraction.rollout(q, _CHUNK)
            self._obstructing = next((groups for groups in map(self.vortices.violated, path) if groups), frozenset())
            if self._obstructing or np.abs(path[-1] - q).max(initial=0.0) < _ARRIVED:
                break
            q = path[-1]
        return self._obstructing
