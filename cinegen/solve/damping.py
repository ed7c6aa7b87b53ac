"""Damping that sets in only where a singularity is near.

A. A. Maciejewski and C. A. Klein, "Numerical filtering for the operation of robotic manipulators through
kinematically singular configurations", Journal of Robotic Systems 5, 1988: damp only the singular directions that
are about to be lost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NEAR = 0.05
"""A singular value (dimensionless) below this is near a singularity: damping sets in, smoothly."""

RESTING = 6.25e-4
"""NEAR^2 / 4: what is added to a squared singular value of 0, at least.

Much less, and a robot at its limits would swing through all its redundancy to win next to nothing.
"""


def damping(sigma: Array, error: float) -> Array:
    """(k,) what is added to each squared singular value: exactly 0 from `NEAR` on.

    (1 - (sigma / NEAR)^2)^2 (RESTING + error) below. The term in the error's size is what keeps a robot at rest
    that is stretched towards a target out of its reach: there the step is proportional to the small singular value
    and the error to its square, and undamped the two play ping-pong (T. Sugihara, "Solvability-unconcerned inverse
    kinematics by the Levenberg-Marquardt method", IEEE Trans. Robotics 27, 2011).

    Args:
        sigma: (k,) singular values.
        error: size of what is to be done, dimensionless.
    """
    near = np.maximum(0.0, 1.0 - (sigma / NEAR) ** 2) ** 2
    return np.asarray(near * (RESTING + error))
