"""What the writers for simulators take from a URDF's joints."""

from __future__ import annotations

import math

import pytest
import yourdfpy

from raff2urdf.writers.tree_at_home import TreeAtHome

INFINITE = (-math.inf, math.inf)


@pytest.mark.parametrize(
    ("kind", "limit", "expected"),
    [
        ("revolute", None, INFINITE),
        ("revolute", {"effort": 1.0, "velocity": 2.0}, INFINITE),
        ("revolute", {"lower": -1.0, "upper": 2.0}, (-1.0, 2.0)),
        ("prismatic", {"upper": 2.0}, (0.0, 2.0)),  # as URDF says of the one that is left out
        ("prismatic", {"lower": -1.0}, (-1.0, 0.0)),
        ("prismatic", {"lower": -1e30, "upper": 0.5}, (-math.inf, 0.5)),
        ("revolute", {"lower": -0.5, "upper": 1e30}, (-0.5, math.inf)),
        ("continuous", {"lower": -1.0, "upper": 2.0}, INFINITE),
    ],
)
def test_limits_are_those_of_the_urdf_and_infinite_where_it_gives_none(kind, limit, expected):
    joint = yourdfpy.Joint("joint", type=kind, limit=None if limit is None else yourdfpy.Limit(**limit))
    assert TreeAtHome.limits(joint) == expected
