"""Planar mechanisms and their closed forms."""

import math

import numpy as np
from small_robots import four_bar

ROCKER = four_bar((20, 10, 100), words=("", "", "actuated 1"))
"""The four-bar of robots/, its actuator on the rocker: at a dead point its crank and its coupler lie in one line."""


def two_r(a: float, b: float, first: float, second: float) -> np.ndarray:
    """(2, 2) Jacobian of the end of two links (lengths; rad)."""
    end = first + second
    far = b * np.array([-math.sin(end), math.cos(end)])
    return np.column_stack([a * np.array([-math.sin(first), math.cos(first)]) + far, far])
