"""Damped least squares that damps only where it must.

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


def gains(sigma: Array, error: float) -> Array:
    """What each singular value is inverted to: 1 / sigma above `NEAR`, damped below, 0 at 0.

    The damping is (1 - (sigma / NEAR)^2)^2 (NEAR^2 / 4 + error). The term in the error's size is what keeps a robot
    at rest that is stretched towards a target out of its reach: there the step is proportional to the small
    singular value and the error to its square, and undamped the two play ping-pong (T. Sugihara, "Solvability-
    unconcerned inverse kinematics by the Levenberg-Marquardt method", IEEE Trans. Robotics 27, 2011).

    Args:
        sigma: (k,) singular values.
        error: size of what is to be done, dimensionless.
    """
    near = np.maximum(0.0, 1.0 - (sigma / NEAR) ** 2) ** 2
    squared = sigma * sigma + near * (0.25 * NEAR * NEAR + error)
    return np.divide(sigma, squared, out=np.zeros_like(sigma), where=squared > 0.0)


def damped_solution(matrix: Array, error: Array) -> tuple[Array, Array]:
    """The damped least-squares solution y of matrix y = error, of least norm, and the singular values."""
    if 0 in matrix.shape:
        return np.zeros(matrix.shape[1]), np.zeros(0)
    u, sigma, vt = np.linalg.svd(matrix, full_matrices=False)
    return vt.T @ (gains(sigma, float(np.linalg.norm(error))) * (u.T @ error)), sigma
