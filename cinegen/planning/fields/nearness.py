"""How close a point is to an obstacle, as fields count it: 0 where the obstacle's range ends, infinite at contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

CONTACT = 1e-12
"""Distance, m, at and below which a point touches the obstacle: no field is defined there, and gradients are nan."""


def apart(distances: ArrayLike) -> Array:
    """(m,) distances, m; nan at contact."""
    d = np.asarray(distances, dtype=float)
    return np.where(d > CONTACT, d, np.nan)


def closeness(distances: ArrayLike, reach: float) -> Array:
    """(m,) 1/d - 1/d_r in 1/m for distances d < d_r, 0 from there on, nan at contact.

    The bracket of the FIRAS potential (equation 3). It is continuous, and rises without bound toward the obstacle.
    """
    return np.maximum(1.0 / apart(distances) - 1.0 / reach, 0.0)
