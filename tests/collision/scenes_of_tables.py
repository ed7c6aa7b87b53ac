"""Scenes that tests read, and distances between bodies."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from cinegen.collision import SceneError, scene_of


def scene_with(*obstacles, **keys):
    """A point at the origin, among obstacles."""
    values = {"mobile": {"radius": 0.0}, "goal": {"point": [1.0, 0.0]}, "obstacle": list(obstacles)} | keys
    return scene_of({key: value for key, value in values.items() if value is not None})


def refused(*obstacles, **keys):
    """What is said of a scene that is wrong."""
    with pytest.raises(SceneError) as error:
        scene_with(*obstacles, **keys)
    return str(error.value)


def distance(one, other):
    """Between two bodies that stand in the world, m; below 0 where they overlap."""
    places = [coal.Transform3s(body.placement.rotation, body.placement.translation) for body in (one, other)]
    result = coal.DistanceResult()
    return coal.distance(one.shape, places[0], other.shape, places[1], coal.DistanceRequest(), result)


def to_point(bodies, point):
    """From a point (3,) to the nearest of some bodies, m."""
    ball = scene_of({"mobile": {"radius": 0}, "goal": {"point": [0, 0]}}).bodies[0]
    at = pin.SE3(np.eye(3), np.asarray(point, dtype=float))
    return min(distance(type(ball)("point", 0, at, ball.shape), body) for body in bodies)
