"""What leads a mechanism to its goal, obstacles apart."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik import Solver
from cinegen.ik.objectives import State
from cinegen.model import Mechanism

Array = NDArray[np.float64]

_GAIN = 0.25  # part of what is left that a step makes good; and that of 0.2 lengths at most
_LONGEST = 0.06  # rad or lengths: a step in the joints


class Attraction(Protocol):
    """Steps that would lead to the goal if nothing were in the way."""

    words: str

    def ahead(self, q: Array, steps: int = 1) -> Array:
        """(steps, nq) where it would lead from q (nq,), loops closed and limits kept."""
        ...

    def left(self, q: Array) -> float:
        """How far it is from q (nq,), in rad or characteristic lengths."""
        ...


class TaskAttraction:
    """Leads a node straight to its goal, as the solver follows a task: down the paraboloid of equation 1, by the
    pseudo-inverse of the Jacobian instead of its transpose, so that no step has to be searched for.

    Args:
        mechanism: which moves.
        node: that is to reach the goal.
        goal: where, in the world.
        translation: how many translations count, along the world's axes.
        rotation: how many rotations.
    """

    def __init__(self, mechanism: Mechanism, node: str, goal: pin.SE3, translation: int, rotation: int) -> None:
        self.words = f"{node} straight to the goal"
        self._solver = Solver(mechanism, 1.0, gain=-math.log1p(-_GAIN))
        self._task = self._solver.add_task(node, goal, translation, rotation, axes="world")

    def ahead(self, q: Array, steps: int = 1) -> Array:
        """(steps, nq) where it would lead from q (nq,)."""
        solver = self._solver
        solver.q = q
        return np.array([solver.step().q for _ in range(steps)])

    def left(self, q: Array) -> float:
        """How far the node is from its goal, in rad or characteristic lengths."""
        mechanism, task = self._solver.mechanism, self._task
        straight, turn = task.errors(mechanism.placement(q, task.node), np.eye(3))
        return float(np.hypot(np.linalg.norm(straight) / mechanism.length, np.linalg.norm(turn)))


class PostureAttraction:
    """Leads all joints straight to a posture in which the goal is reached.

    Args:
        mechanism: which moves.
        posture: (nq,).
        words: what it is called.
    """

    def __init__(self, mechanism: Mechanism, posture: Array, words: str) -> None:
        self.words = words
        self.posture = posture
        self._mechanism = mechanism
        self._solver = Solver(mechanism, 1.0) if mechanism.loops else None
        if self._solver is not None:
            self._solver.objectives = (_Toward(self),)

    def ahead(self, q: Array, steps: int = 1) -> Array:
        """(steps, nq) where it would lead from q (nq,)."""
        found, here = [], q
        if self._solver is not None:
            self._solver.q = q
        for _ in range(steps):
            if self._solver is not None:
                here = self._solver.step().q
            else:
                here = self._mechanism.integrate(here, self.step(here))
            found.append(here)
        return np.array(found)

    def step(self, q: Array) -> Array:
        """(nv,) rad and m, loops apart."""
        way = self._mechanism.difference(q, self.posture)
        return way * min(1.0, _LONGEST / max(self.left(q), 1e-300))

    def left(self, q: Array) -> float:
        """How far the joints are from the posture: the furthest of them, rad or characteristic lengths."""
        return self._mechanism.distance(q, self.posture)


class _Toward:
    """A posture attraction as an objective: loops are the solver's business."""

    def __init__(self, attraction: PostureAttraction) -> None:
        self._attraction = attraction

    def velocity(self, state: State) -> Array:
        """(nv,) rad/s and m/s."""
        return np.asarray(self._attraction.step(state.q) / state.dt)
