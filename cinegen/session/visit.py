"""`Visit`: to a configuration, as a person would drag it there."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.errors import CinegenError
from cinegen.ik import Solver
from cinegen.ik.blend import eased
from cinegen.ik.objectives import Posture
from cinegen.model import Mechanism
from cinegen.session.motion import Way
from cinegen.tolerances import CLOSURE

Array = NDArray[np.float64]

_SPEED = 0.6  # characteristic lengths or rad a second, on average
_SHORTEST, _LONGEST = 0.4, 10.0  # s
_LAG = 0.01  # lengths or rad that the node may be behind; the task waits for what is further
_PATIENCE = 0.4  # s that it waits in all
_WHOLE = 6  # freedoms: with fewer, how the node is turned follows from its place


class Visit:
    """A node is pulled straight to where it is to be, at a limited speed, and the joints that this leaves free go to
    where they are to be. What is left in the end (another branch, a way that goes out of reach) motors lead, or where
    they can't, the robot is put there at once, as `Way` does. Loops are closed all along.

    Args:
        mechanism: which goes.
        q: (nq,) where it is, loops closed.
        goal: (nq,) where it is to be, loops closed.
        node: that is pulled.
        dt: s, a tick.

    Raises:
        ConfigurationError: the goal is no configuration.
        CinegenError: it leaves loops open.
    """

    name = "visit"

    def __init__(self, mechanism: Mechanism, q: Array, goal: Array, node: str, dt: float) -> None:
        self.trouble = ""
        self._mechanism, self._goal, self._dt = mechanism, mechanism.checked(goal), dt
        closure = mechanism.closure(self._goal)
        if closure > CLOSURE:
            raise CinegenError(f"there loops of {mechanism.name} would be open by {closure:.2g}: it stays here")
        self._solver = Solver(mechanism, dt, q)
        self._task = self._solver.add_task(node, rotation=3 if mechanism.mobility >= _WHOLE else 0)
        self._from, self._to = mechanism.placement(q, node), mechanism.placement(self._goal, node)
        self._turn = pin.log3(self._from.rotation.T @ self._to.rotation)
        far = float(np.linalg.norm(self._to.translation - self._from.translation)) / mechanism.length
        if self._task.rotation:
            far = max(far, float(np.linalg.norm(self._turn)))
        self._seconds = min(max(far / _SPEED, _SHORTEST), _LONGEST)
        self._solver.objectives = (Posture(self._goal, rate=3.0 / self._seconds),)
        self._time = self._waited = 0.0
        self._way: Way | None = None

    def advance(self, dt: float) -> Array | None:
        """See `Motion`."""
        if self.trouble:
            return None
        if self._way is not None:
            q = self._way.advance(dt)
            self.trouble = self._way.trouble if q is None else ""
            return q
        self._task.target = self._on_the_way(eased(min(self._time / self._seconds, 1.0)))
        step = self._solver.step()
        metres, turned = step.errors[0]
        if max(metres / self._mechanism.length, turned) > _LAG:
            self._waited += dt
        else:
            self._time += dt
        if self._time > self._seconds or self._waited > _PATIENCE:
            self._way = Way(self._mechanism, self._solver.q, self._goal, self.name)
        return self._solver.q

    def halt(self, q: Array, trouble: str) -> None:
        """See `Motion`: it waits at q (nq,), and ends there where what is in the way stays."""
        if self._way is not None:
            self._way.halt(q, trouble)
            return
        self._solver.q = q
        self._waited += self._dt
        if self._waited > _PATIENCE:
            self.trouble = trouble

    def _on_the_way(self, part: float) -> pin.SE3:
        """Where the node is to be when so much of the way is gone."""
        rotation = self._from.rotation @ pin.exp3(part * self._turn)
        return pin.SE3(rotation, (1.0 - part) * self._from.translation + part * self._to.translation)
