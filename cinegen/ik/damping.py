"""Damping that sets in only where a singularity is near.

A. A. Maciejewski and C. A. Klein, "Numerical filtering for the operation of robotic manipulators through
kinematically singular configurations", Journal of Robotic Systems 5, 1988: damp only the singular directions that
are about to be lost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.thresholds import NEAR

Array = NDArray[np.float64]


def damping(sigma: Array, error: float, near: float = NEAR) -> Array:
    """(k,) what is added to each squared singular value: exactly 0 from `near` on.

    (1 - (sigma / near)^2)^2 (near^2 / 4 + error) below. The term in the error's size is what keeps a robot at rest
    that is stretched towards a target out of its reach: there the step is proportional to the small singular value
    and the error to its square, and undamped the two play ping-pong (T. Sugihara, "Solvability-unconcerned inverse
    kinematics by the Levenberg-Marquardt method", IEEE Trans. Robotics 27, 2011).

    Args:
        sigma: (k,) singular values.
        error: size of what is to be done, dimensionless.
        near: the singular value from which on nothing is damped.
    """
    part = np.maximum(0.0, 1.0 - (sigma / near) ** 2) ** 2
    return np.asarray(part * (0.25 * near * near + error))
