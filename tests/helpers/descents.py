"""Scenes to descend a potential in, and derivatives by differences."""

import math
from functools import cache
from pathlib import Path

import clearings
import numpy as np
import pinocchio as pin

from cinegen.collision import load_scene
from cinegen.collision.links import link_bodies

ROBOTS = Path(__file__).resolve().parents[2] / "robots"


@cache
def figure(name):
    return load_scene(ROBOTS / "scenes" / f"{name}.toml")


def moved(scene, q, step):
    """q moved by a step without unit."""
    return pin.integrate(scene.mechanism.model, q, np.asarray(step) * scene.mechanism.scale)


def slopes_at(value, point, step):
    """Central differences by coordinates."""
    return np.array([value(point + e) - value(point - e) for e in step * np.eye(len(point))]) / (2.0 * step)


def slopes(scene, value, q, step):
    """Central differences by rad and lengths."""
    return slopes_at(lambda e: value(moved(scene, q, e)), np.zeros(scene.mechanism.model.nv), step)


def apart(scene, q, obstacle):
    """By joint, how far its bodies are from an obstacle, as coal says it of each two."""
    mechanism = scene.mechanism
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    distances = {}
    for body in bodies(scene):
        if body.joint:
            at = data.oMi[body.joint] * body.placement
            d = clearings.apart(body.shape, at, obstacle.shape, obstacle.placement)
            distances[body.joint] = min(d, distances.get(body.joint, math.inf))
    return np.array(list(distances.values()))


def attraction(scene, q):
    """Of goals that are points of the plane."""
    way = scene.mechanism.placement(q, scene.node).translation - scene.goal.translation
    return 0.5 * float(way[:2] @ way[:2]) / scene.mechanism.length**2


def bodies(scene):
    return link_bodies(scene.mechanism)
