"""The planar 3-RPR of `robots/cusp_3rpr.raff` in closed form, from the numbers that its papers print: the yardstick of
its assembly modes and singularities."""

import itertools
import math

import numpy as np

from cinegen.collision import scene_of

BASE = np.array([[0.0, 0.0], [0.1591, 0.0], [0.0, 0.1]])  # m
SIDES = 0.1704, 0.1654, 0.2084  # m: of the platform, B1B2, B2B3, B3B1
LENGTHS = np.array([0.1498, 0.1538, 0.12])  # m: of the legs at home
LEGS = "joint2", "joint5", "joint7"
NODES = "base", "link1", "link2", "link3", "link4", "link5", "link6", "link7"

_ANGLE = math.acos((SIDES[0] ** 2 + SIDES[2] ** 2 - SIDES[1] ** 2) / (2.0 * SIDES[0] * SIDES[2]))
PLATFORM = np.array([[0.0, 0.0], [SIDES[0], 0.0], [SIDES[2] * math.cos(_ANGLE), SIDES[2] * math.sin(_ANGLE)]])


def scene(root, **more):
    """Return a scene of the platform without obstacles, whose legs are in different planes: they don't collide."""
    allowed = [list(pair) for pair in itertools.combinations(NODES, 2)]
    goal = {"point": [0.0, 0.0]}
    return scene_of({"robot": str(root / "robots/cusp_3rpr.raff"), "goal": goal, "allowed_collisions": allowed} | more)


def legs(pose):
    """Return the legs (3, 2) from base to platform at a pose (x, y, angle), m and rad, and their lever arms (3, 2)."""
    x, y, angle = pose
    rotation = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    arms = PLATFORM @ rotation.T
    return np.array([x, y]) + arms - BASE, arms


def pose_of(mechanism, q):
    """Return x, y and angle of the platform at q, m and rad."""
    placement = mechanism.placement(q, "platform")
    return np.array([*placement.translation[:2], math.atan2(placement.rotation[1, 0], placement.rotation[0, 0])])


def determinant_at(pose):
    """Return the determinant of the legs' unit lines, with moments in m: 0 at a singularity of type 2."""
    vectors, arms = legs(pose)
    lines = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return float(np.linalg.det(np.c_[lines, arms[:, 0] * lines[:, 1] - arms[:, 1] * lines[:, 0]]))


def determinant(mechanism, q):
    """Return `determinant_at` of the pose at q."""
    return determinant_at(pose_of(mechanism, q))


def configuration(mechanism, pose, near=None):
    """Return q at a pose, each angle within half a revolution of that of another configuration, by default of home."""
    vectors, _ = legs(pose)
    first, second, third = np.arctan2(vectors[:, 1], vectors[:, 0])
    length1, length2, length3 = np.linalg.norm(vectors, axis=1)
    q = np.array([first, length1, pose[2] - first - math.pi / 2.0, second, length2, third - math.pi / 2.0, length3])
    angles = [0, 2, 3, 5]
    away = q[angles] - (mechanism.q_home if near is None else near)[angles]
    q[angles] -= 2.0 * math.pi * np.round(away / (2.0 * math.pi))
    return mechanism.close(q)  # the file's numbers are rounded
