"""FIRAS, the potential that repels from obstacles, in plain numpy.

O. Khatib, "Real-time obstacle avoidance for manipulators and mobile robots", The International Journal of Robotics
Research 5(1), 1986; equation 3 of C. De Medio and G. Oriolo, "Robot obstacle avoidance using vortex fields", Advances
in Robot Kinematics, Springer 1991. Potentials are in J and gradients in N, of forces that act on nothing: only their
ratios matter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.collision.errors import PlanningError

Array = NDArray[np.float64]

CONTACT = 1e-12
"""Largest distance, m, that counts as contact."""


class FieldError(PlanningError):
    """An invalid parameter of a field; the message names it, and the valid values."""


def require_positive(name: str, value: float) -> None:
    """Raise FieldError unless the value is a finite number above 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise FieldError(f"{name} is {value!r}; give a finite number above 0")


def nan_at_contact(distances: ArrayLike) -> Array:
    """Return distances (m,), m; NaN at contact (up to 1e-12 m) and below, where no field is defined."""
    d = np.asarray(distances, dtype=float)
    return np.where(d > CONTACT, d, np.nan)


def closeness(distances: ArrayLike, reach: float) -> Array:
    """Return 1/d - 1/d_r (m,), 1/m, for distances d < d_r; 0 beyond and NaN at contact.

    The bracket of the FIRAS potential (equation 3): continuous, and unbounded toward the obstacle.
    """
    return np.maximum(1.0 / nan_at_contact(distances) - 1.0 / reach, 0.0)


@dataclass(frozen=True)
class Firas:
    """FIRAS potential: U_f = k/2 (1/d - 1/d_r)^2 for 0 < d < d_r, and 0 beyond. It and its gradient are continuous.

    It needs only the distance and the normal, so it fits an obstacle of any shape. Along a flat side its contours are
    flat at every distance: there the total field has local minima.

    Attributes:
        strength: k, J m^2.
        reach: d_r, m: range of influence.

    Raises:
        FieldError: the strength or the reach is not a finite number above 0.
    """

    strength: float
    reach: float

    def __post_init__(self) -> None:
        require_positive("the strength of a FIRAS potential", self.strength)
        require_positive("the reach of a FIRAS potential", self.reach)

    def value(self, distances: ArrayLike) -> Array:
        """Return the potential (m,), J, at distances (m,), m; infinite at contact."""
        value = 0.5 * self.strength * closeness(distances, self.reach) ** 2
        return np.where(np.isnan(value), np.inf, value)

    def gradient(self, distances: ArrayLike, normals: ArrayLike) -> Array:
        """Return -k (1/d - 1/d_r) / d^2 n (m, 3), N; NaN at contact.

        Args:
            distances: (m,) from the obstacle, m.
            normals: (m, 3) unit vectors from the nearest point of the obstacle: the gradient of the distance.
        """
        slope = -self.strength * closeness(distances, self.reach) / nan_at_contact(distances) ** 2
        return np.asarray(slope[..., None] * np.asarray(normals, dtype=float))
