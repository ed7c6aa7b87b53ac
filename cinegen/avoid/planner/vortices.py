"""`Vortices`: leads a mechanism to its goal, and turns it around what is in the way."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.avoid.clearance import Clearance
from cinegen.avoid.fields import folding, turning_axis
from cinegen.avoid.kernel.turn import AWAKE, AXIS, STATE_WIDTH
from cinegen.avoid.planner.attraction import Attraction
from cinegen.avoid.planner.turning import Turning
from cinegen.solve.objectives import State

Array = NDArray[np.float64]

STRENGTH = 1.5
"""Of a vortex by the attraction at the same point, where links are stopped: more than 1, or it would not get round."""

_AHEAD = 60  # steps that are looked ahead to see what is in the way
_EVERY = 4  # steps: so often it is looked again


class Vortices:
    """An objective: the attraction, and around each obstacle that is in its way a vortex.

    What the paper leaves open, and what experience added:

    - Only what is in the way turns. A vortex wakes when a link comes within its reach, is led into the obstacle, and
      going on without it would hit. It rests when no link is led into the obstacle any more: the paper's point Q.
    - The axis is chosen when it wakes, and kept. All links go round an obstacle about the same axis.
    - What leads a link's nearest point is how the attraction moves that point, J_i dq, not the tool's.
    - The strength of a vortex is relative to that: no gain has to be tuned, nor does it depend on units.

    Args:
        clearance: of the mechanism.
        attraction: that leads to the goal.
        turning: which way round.
        reach: m: from where on vortices act.
        stop: m: where links are stopped.
        safety: m: nearer than this counts as hit.
        around: for each pair the number of what it goes round.
        plane: normal of the plane in which all moves, if all does.
    """

    def __init__(
        self,
        clearance: Clearance,
        attraction: Attraction,
        turning: Turning,
        reach: float,
        stop: float,
        safety: float,
        around: NDArray[np.int64],
        plane: Array | None = None,
        base: Array | None = None,
    ) -> None:
        self.clearance, self.attraction, self.turning = clearance, attraction, turning
        self.reach, self.stop, self.safety, self.plane = reach, stop, safety, plane
        self.base = np.zeros(3) if base is None else base
        self.around = around
        count = int(around.max(initial=-1)) + 1
        self.states = np.zeros((count, STATE_WIDTH))
        self.hit: frozenset[int] = frozenset()
        self._looked = -_EVERY
        self._ticks = 0

    def velocity(self, state: State) -> Array:
        """(nv,) rad/s and m/s."""
        q = state.q
        model = self.clearance.mechanism.model
        motion = np.asarray(pin.difference(model, q, self.attraction.ahead(q)[0]))
        turned, asks = self.clearance.turned(q, motion, self.around, self.states, self.reach, self.stop, STRENGTH)
        self._ticks += 1
        if (asks >= 0).any():
            if self._ticks - self._looked >= _EVERY:
                self.hit, self._looked = self._ahead(q), self._ticks
                self.clearance.see(q)
            woken = [g for g in np.flatnonzero(asks >= 0) if int(g) in self.hit]
            for g in woken:
                self.states[g, AXIS:] = self._axis(int(asks[g]), motion)
                self.states[g, AWAKE] = 1.0
            if woken:
                turned, _ = self.clearance.turned(q, motion, self.around, self.states, self.reach, self.stop, STRENGTH)
        return np.asarray(turned / state.dt)

    @property
    def awake(self) -> NDArray[np.intp]:
        """What is gone round at present."""
        return np.flatnonzero(self.states[:, AWAKE])

    def _ahead(self, q: Array) -> frozenset[int]:
        """What would be hit first if nothing turned."""
        here = q
        for _ in range(_AHEAD // 10):
            way = self.attraction.ahead(here, 10)
            for there in way:
                distances = self.clearance.distances(there)
                bad = np.flatnonzero(distances < self.safety)
                if len(bad):
                    return frozenset(self.around[bad].tolist())
            if np.abs(way[-1] - here).max(initial=0.0) < 1e-6:
                break
            here = way[-1]
        return frozenset()

    def _axis(self, pair: int, motion: Array) -> Array:
        """(3,) about which a vortex begins to turn, as the nearest link sees it."""
        one, _, normal = self.clearance.points(pair)
        led = self.clearance.motion_of(pair, motion)
        towards = {
            Turning.FOLDING: folding(one, self.base, self.plane),
            Turning.SHORTER: led,
            Turning.LONGER: led,
            Turning.UP: np.array([0.0, 0.0, 1.0]),
            Turning.DOWN: np.array([0.0, 0.0, -1.0]),
            Turning.ASIDE: np.cross(normal, led),
        }[self.turning]
        axis = turning_axis(-normal, towards, led, plane=self.plane)
        return -axis if self.turning is Turning.LONGER else axis
