"""Planar mechanisms and their closed forms."""

import math

import numpy as np
from small_robots import four_bar

ROCKER = four_bar((20, 10, 100), words=("", "", "actuated 1"))
"""The four-bar of robots/, its actuator on the rocker: at a dead point its crank and its coupler lie in one line."""


def singular_values(columns: np.ndarray) -> tuple[float, float]:
    """Of a (2, 2) matrix: the greater and the smaller."""
    square, area = float((columns**2).sum()), abs(float(np.linalg.det(columns)))
    root = math.sqrt(max(square**2 - 4.0 * area**2, 0.0))
    return math.sqrt(0.5 * (square + root)), area / math.sqrt(0.5 * (square + root))


def two_r(a: float, b: float, first: float, second: float) -> np.ndarray:
    """(2, 2) Jacobian of the end of two links (lengths; rad)."""
    end = first + second
    far = b * np.array([-math.sin(end), math.cos(end)])
    return np.column_stack([a * np.array([-math.sin(first), math.cos(first)]) + far, far])


def root(function, low: float, high: float) -> float:
    """Where a function that is negative at `low` and positive at `high` passes through 0."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if function(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)
