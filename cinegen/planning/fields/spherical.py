"""The spherically symmetric potential: equation 2 of De Medio and Oriolo 1991, around a ball."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.planning.fields.nearness import apart
from cinegen.planning.fields.parameter import FieldError, positive, vector

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spherical:
    """U_r1 = k / (|p - p_A| - r)^(2 gamma), which is equation 2 for a point (r = 0). "Potential (2) can be easily
    modified for the case of obstacles with center in A and maximum radius r, by letting it go to infinity at a distance
    r from A": the distance is measured from the ball around the obstacle.

    Its contours bend more than those of the attraction, so one such obstacle makes no minimum. But all of the ball is
    forbidden, a long rod's too. It has no range: it falls, and never ends.

    Attributes:
        centre: (3,) p_A, m, of the ball around the obstacle.
        radius: r, m, of the ball; 0 for a point.
        strength: k, J m^(2 gamma).
        exponent: gamma; the greater, the faster it falls.

    Raises:
        FieldError: the centre is not finite, the radius below 0, or another not above 0.
    """

    centre: Array
    radius: float = 0.0
    strength: float = 1.0
    exponent: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", vector("the centre of a spherical potential", self.centre))
        if not (np.isfinite(self.radius) and self.radius >= 0.0):
            raise FieldError(f"the radius of a spherical potential is {self.radius!r}; give 0 or a number above it")
        positive("the strength of a spherical potential", self.strength)
        positive("the exponent of a spherical potential", self.exponent)

    def value(self, points: ArrayLike) -> Array:
        """(m,) J, at points (m, 3); infinite in the ball."""
        away = np.linalg.norm(np.asarray(points, dtype=float) - self.centre, axis=-1)
        value = self.strength / apart(away - self.radius) ** (2.0 * self.exponent)
        return np.where(np.isnan(value), np.inf, value)

    def gradient(self, points: ArrayLike) -> Array:
        """(m, 3) N: -2 gamma k / (|p - p_A| - r)^(2 gamma + 1) n, with n away from A; nan in the ball."""
        offset = np.asarray(points, dtype=float) - self.centre
        away = np.linalg.norm(offset, axis=-1)
        outside = apart(away - self.radius)
        slope = -2.0 * self.exponent * self.strength / outside ** (2.0 * self.exponent + 1.0)
        return np.asarray((slope / np.where(away > 0.0, away, np.nan))[..., None] * offset)
