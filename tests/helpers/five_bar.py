"""Arms of two bars in closed form, by plane geometry and numpy alone."""

import numpy as np


def two_bar_angles(x, y, first, second, elbow):
    """Both angles of an arm of two bars whose end is at x and y, the second one positive for an elbow of 1 and negative
    for -1, and whether it reaches."""
    c = (x * x + y * y - first**2 - second**2) / (2.0 * first * second)
    two = elbow * np.arccos(np.clip(c, -1.0, 1.0))
    return np.arctan2(y, x) - np.arctan2(second * np.sin(two), first + second * np.cos(two)), two, np.abs(c) <= 1.0
