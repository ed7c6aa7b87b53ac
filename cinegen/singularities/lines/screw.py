"""Screws: what a line becomes when a pitch is added; a rigid motion's velocity, or a force with its couple.

A screw (w, v) of six numbers has the pitch h = w.v / w.w and the axis (w, v - h w); it is a line where h = 0 (R. S.
Ball, "A treatise on the theory of screws", Cambridge 1900). As a twist, w is the angular velocity and v the velocity of
the point at the origin. A force along a line (d, m) does no work on it where d.v + m.w = 0: then they are reciprocal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.lines.line import Line, LineAtInfinity

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Screw:
    """A motion: a turn about an axis and `pitch` along it per radian.

    Attributes:
        axis: of the turn. At infinity for a pure translation, which is along the axis's `normal`.
        pitch: length per radian, positive for a right-hand thread; 0 for a pure rotation, infinite for a translation.
    """

    axis: Line | LineAtInfinity
    pitch: float

    @property
    def coordinates(self) -> Array:
        """(6,) (w, v), w a unit vector and v = p x w + h w the origin's velocity; (0, normal) for a translation."""
        screw = self.axis.coordinates
        if isinstance(self.axis, Line):
            screw[3:] += self.pitch * self.axis.direction
        return screw

    @property
    def rotates(self) -> bool:
        """Whether it is a pure rotation."""
        return self.pitch == 0.0

    @property
    def translates(self) -> bool:
        """Whether it is a pure translation."""
        return math.isinf(self.pitch)
