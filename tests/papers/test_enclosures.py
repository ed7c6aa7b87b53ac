"""Balls and boxes hold what they stand for."""

import math

import coal
import numpy as np
import pinocchio as pin
import pytest
from enclosures import Enclosure
from hypothesis import given
from hypothesis import strategies as st

from cinegen.collision.body import Body

Z = np.array([0.0, 0.0, 1.0])
turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(lambda rpy: pin.rpy.rpyToMatrix(*rpy))
sizes = st.floats(0.05, 2.0)
shapes = st.one_of(
    st.builds(coal.Sphere, sizes),
    st.builds(coal.Capsule, sizes, sizes),
    st.builds(coal.Cylinder, sizes, sizes),
    st.builds(coal.Box, sizes, sizes, sizes),
)


def sampled(body):
    """Points of its surface: the furthest along many directions."""
    rng = np.random.default_rng(0)
    shape, found = body.shape, []
    for way in rng.normal(size=(300, 3)):
        way = way / np.linalg.norm(way)
        match shape:
            case coal.Sphere():
                at = shape.radius * way
            case coal.Capsule():
                at = shape.radius * way + [0.0, 0.0, math.copysign(shape.halfLength, way[2])]
            case coal.Cylinder():
                side = np.append(way[:2] / np.linalg.norm(way[:2]) * shape.radius, 0.0)
                at = side + math.copysign(shape.halfLength, way[2]) * Z
            case coal.Box():
                at = np.copysign(np.array(shape.halfSide), way)
        found.append(body.placement.act(np.asarray(at)))
    return np.array(found)


@given(shapes, turns, st.sampled_from([None, "plane"]))
def test_ball_and_box_hold_what_they_stand_for(shape, turn, where):
    plane = None if where is None else turn[:, 1]  # any plane
    body = Body("thing", 0, pin.SE3(turn, np.array([0.3, -0.2, 0.5])), shape)
    enclosure, points = Enclosure(body, plane), sampled(body)
    middle, half, axes = enclosure.box
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert (np.abs((points - middle) @ axes) <= half + 1e-9).all()
    centre, radius = enclosure.ball.placement.translation, enclosure.ball.shape.radius
    off = points - centre
    if plane is not None:
        off = off - np.outer(off @ plane, plane)
        assert half[2] == math.inf
        assert abs(axes[:, 2] @ plane) == pytest.approx(1.0)
    away = np.linalg.norm(off, axis=1)
    assert (away <= radius + 1e-9).all()
