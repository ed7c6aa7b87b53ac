"""The attraction of the goal: a paraboloid. C. De Medio and G. Oriolo, "Robot obstacle avoidance using vortex fields",
Advances in Robot Kinematics, Springer 1991, equation 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.planning.fields.parameter import positive, vector

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Paraboloid:
    """U_a = k/2 |p - p_G|^2, whose gradient grows with the distance to the goal.

    Attributes:
        goal: (3,) p_G, m.
        stiffness: k_g, N/m.

    Raises:
        FieldError: the goal is not finite, or the stiffness not above 0.
    """

    goal: Array
    stiffness: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "goal", vector("the goal of an attraction", self.goal))
        positive("the stiffness of an attraction", self.stiffness)

    def value(self, points: ArrayLike) -> Array:
        """(m,) J, at points (m, 3)."""
        error = np.asarray(points, dtype=float) - self.goal
        return np.asarray(0.5 * self.stiffness * (error * error).sum(axis=-1))

    def gradient(self, points: ArrayLike) -> Array:
        """(m, 3) N: k (p - p_G) at points (m, 3). The attraction is the opposite of it."""
        return np.asarray(self.stiffness * (np.asarray(points, dtype=float) - self.goal))

    def joint_gradient(self, jacobian: ArrayLike, point: ArrayLike) -> Array:
        """(n,) equation 1: k J' (p - p_G), N m for joints that turn and N for those that slide.

        Args:
            jacobian: (3, n) of the point's velocity, m/rad or m/m.
            point: (3,) m.
        """
        return np.asarray(np.asarray(jacobian, dtype=float).T @ self.gradient(point))
