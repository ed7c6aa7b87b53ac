"""`Vortices`: turn what leads a mechanism around the obstacles that are in its way."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from cinegen.collision._kernels.turn import AWAKE, AXIS, STATE_WIDTH
from cinegen.collision.clearance import Clearance
from cinegen.planning.fields import folding, turning_axis
from cinegen.planning.keep import stop
from cinegen.planning.planar import plane_of

Array = NDArray[np.float64]

STRENGTH = 1.5
"""Of a vortex by what leads to the same point, where links are stopped: more than 1, or it would not get round."""


class Turning(Enum):
    """Which way a link goes round what it meets; the value says it in words."""

    FOLDING = "toward the base"
    SHORTER = "the shorter way"
    LONGER = "the other way"
    UP = "upward"
    DOWN = "downward"
    ASIDE = "aside"


class Vortices:
    """Around each obstacle one, that turns while the obstacle is in the way.

    What the paper leaves open, and what experience added:

    - Only what is in the way turns. A vortex wakes when a link comes within its reach, is led into the obstacle, and
      going on without it would hit. It rests when no link is led into the obstacle any more: the paper's point Q.
    - The axis is chosen when it wakes, and kept. All links go round an obstacle about the same axis.
    - What leads a link's nearest point is how the mechanism's motion moves that point, J_i dq, not the tool's.
    - The strength of a vortex is relative to that: no gain has to be tuned, nor does it depend on units.

    Args:
        clearance: of the mechanism.
        around: for each pair the number of what it goes round.
        reach: m: from where on vortices act.
        safety: m: the distance that is kept.
        turning: which way round.
        strength: of vortices; 0 and none turns.
        up: (3,) which way is up; along z unless given.

    Attributes:
        states: (vortices, 4) whether each turns, and its axis.
        turning: which way those go round that wake from now on.
        plane: (3,) normal of the plane in which all moves; None in space.
    """

    def __init__(
        self,
        clearance: Clearance,
        around: NDArray[np.int64],
        reach: float,
        safety: float,
        turning: Turning = Turning.SHORTER,
        strength: float = STRENGTH,
        up: Array | None = None,
    ) -> None:
        self.clearance, self.around, self.turning, self.strength = clearance, around, turning, strength
        self.safety, self.stop = safety, stop(clearance.mechanism, safety)
        self.reach = max(reach, 2.0 * self.stop)
        self.states = np.zeros((int(around.max(initial=-1)) + 1, STATE_WIDTH))
        self.plane = plane_of(clearance.mechanism)
        self._up = np.array([0.0, 0.0, 1.0]) if up is None else np.asarray(up)
        model = clearance.mechanism.model
        self._base = np.array(model.jointPlacements[min(1, model.njoints - 1)].translation)

    @property
    def awake(self) -> NDArray[np.intp]:
        """Numbers of what is gone round at present."""
        return np.flatnonzero(self.states[:, AWAKE])

    def rest(self) -> None:
        """All of them rest."""
        self.states[:] = 0.0

    def turn(self, q: Array, motion: Array, in_the_way: Callable[[], frozenset[int]]) -> Array:
        """(nv,) a motion, turned around what is in the way.

        Args:
            q: (nq,) where the mechanism is.
            motion: (nv,) that leads it, rad and m.
            in_the_way: asked where something might have to be gone round: numbers of what would be hit.
        """
        turned, asks = self.clearance.turned(q, motion, self.around, self.states, self.reach, self.stop, self.strength)
        if not (asks >= 0).any():
            return turned
        hit = in_the_way()
        self.clearance.see(q)
        woken = [g for g in np.flatnonzero(asks >= 0).tolist() if g in hit]
        for g in woken:
            self.states[g, AXIS:] = self._axis(int(asks[g]), motion)
            self.states[g, AWAKE] = 1.0
        if not woken:
            return turned
        return self.clearance.turned(q, motion, self.around, self.states, self.reach, self.stop, self.strength)[0]

    def hits(self, q: Array) -> frozenset[int]:
        """Numbers of what the mechanism would be too near to at q (nq,)."""
        return frozenset(self.around[self.clearance.distances(q) < self.safety].tolist())

    def _axis(self, pair: int, motion: Array) -> Array:
        """(3,) about which a vortex begins to turn, as the nearest link sees it."""
        one, _, normal = self.clearance.points(pair)
        led = self.clearance.motion_of(pair, motion)
        towards = {
            Turning.FOLDING: folding(one, self._base, self.plane),
            Turning.SHORTER: led,
            Turning.LONGER: led,
            Turning.UP: self._up,
            Turning.DOWN: -self._up,
            Turning.ASIDE: np.cross(normal, led),
        }[self.turning]
        axis = turning_axis(-normal, towards, led, plane=self.plane)
        return -axis if self.turning is Turning.LONGER else axis
