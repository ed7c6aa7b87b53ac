"""The FIRAS potential: O. Khatib, "Real-time obstacle avoidance for manipulators and mobile robots", The International
Journal of Robotics Research 5(1), 1986; equation 3 of De Medio and Oriolo 1991."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.planning.fields.nearness import apart, closeness
from cinegen.planning.fields.parameter import positive

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Firas:
    """U_f = k/2 (1/d - 1/d_r)^2 for 0 < d < d_r, and 0 farther away. It and its gradient are continuous.

    It follows an obstacle of any shape, of which it knows no more than the distance and the normal. Along a flat side
    its contours are flat at every distance: there the total field has minima where nothing is.

    Attributes:
        strength: k, J m^2.
        reach: d_r, m: its range.

    Raises:
        FieldError: one of them is not above 0.
    """

    strength: float
    reach: float

    def __post_init__(self) -> None:
        positive("the strength of a FIRAS potential", self.strength)
        positive("the reach of a FIRAS potential", self.reach)

    def value(self, distances: ArrayLike) -> Array:
        """(m,) J, at distances (m,), m; infinite at contact."""
        value = 0.5 * self.strength * closeness(distances, self.reach) ** 2
        return np.where(np.isnan(value), np.inf, value)

    def gradient(self, distances: ArrayLike, normals: ArrayLike) -> Array:
        """(m, 3) N: -k (1/d - 1/d_r) / d^2 n; nan at contact.

        Args:
            distances: (m,) from the obstacle, m.
            normals: (m, 3) unit vectors from the nearest point of the obstacle: the gradient of the distance.
        """
        slope = -self.strength * closeness(distances, self.reach) / apart(distances) ** 2
        return np.asarray(slope[..., None] * np.asarray(normals, dtype=float))
