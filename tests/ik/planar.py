"""Planar mechanisms and their closed forms."""

import math

import numpy as np

TWO_R = """
  robot r { base { }
    link 1 { parameters { theta %(first)s } type 2 pred 0 }
    link 2 { parameters { theta %(second)s d %(a)s } type 2 pred 1 }
    frame 3 { parameters { d %(b)s } pred 2 name "tool" } }"""
"""Two links of lengths a and b (mm), joints at first and second (degrees)."""

ROCKER = """
  robot r { base { }
    link 1 { parameters { theta 20 } type 2 pred 0 }
    link 2 { parameters { theta 10 d 120 } type 2 pred 1 }
    link 3 { parameters { theta 100 d 400 } type 2 pred 0 actuated 1 }
    frame 4 { parameters { d 360 } pred 2 }
    frame 5 { parameters { d 240 } pred 3 }
    constraint { frame 4 frame 5 type 2 } }"""
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
