"""Scenes that tests read, and distances between bodies."""

import numpy as np
import pinocchio as pin
import pytest
from clearings import apart

from cinegen.collision import SceneError, scene_of


def _point_among(*obstacles, **keys):
    return {"mobile": {"radius": 0.0}, "goal": {"point": [1.0, 0.0]}, "obstacle": list(obstacles)} | keys


def scene_with(*obstacles, folder=".", **keys):
    """A point at the origin, among obstacles whose files are in a folder."""
    return scene_of(_point_among(*obstacles, **keys), folder)


def refusal(values, folder=".", mechanism=None):
    """What is said of a scene that is wrong."""
    with pytest.raises(SceneError) as error:
        scene_of(values, folder, mechanism)
    return str(error.value)


def refused(*obstacles, folder=".", **keys):
    """What is said of such a point."""
    return refusal(_point_among(*obstacles, **keys), folder)


def to_point(bodies, point):
    """From a point (3,) to the nearest of some bodies, m."""
    ball = scene_of({"mobile": {"radius": 0}, "goal": {"point": [0, 0]}}).bodies[0]
    at = pin.SE3(np.eye(3), np.asarray(point, dtype=float))
    return min(apart(ball.shape, at, body.shape, body.placement) for body in bodies)
