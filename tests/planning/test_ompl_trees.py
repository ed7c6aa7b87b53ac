"""Trees of OMPL that grow in turns."""

from __future__ import annotations

import math

import numpy as np

from cinegen.planning.ompl_trees import Trees

LOW, HIGH = np.zeros(2), np.ones(2)
START, GOAL = np.array([0.1, 0.5]), np.array([0.9, 0.5])


def through_a_door(begin, end):
    """Whether a motion passes the wall at x = 0.5 by its door, y from 0.8 to 0.83."""
    if (begin[0] < 0.5) == (end[0] < 0.5):
        return True
    y = begin[1] + (end[1] - begin[1]) * (0.5 - begin[0]) / (end[0] - begin[0])
    return 0.8 < y < 0.83


def test_after_a_path_the_trees_find_another_one():
    trees = Trees(LOW, HIGH, START, [GOAL], through_a_door, 0.1, 3)
    one, other = (trees.grow(math.inf) for _ in range(2))
    assert one.shape != other.shape or not np.allclose(one, other)
