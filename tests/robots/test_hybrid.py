"""The hybrid: a tripod with three legs (3-RPS) that carries a wrist.

K.-M. Lee and D. K. Shah, "Kinematic analysis of a three-degrees-of-freedom in-parallel actuated manipulator", IEEE
Journal of Robotics and Automation 4, 1988: each leg stays in the vertical plane of its hinge, which ties three of the
plate's six coordinates to the others.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from elementary import at, document, length, link, turn

HINGES, JACKS = ("joint1", "joint6", "joint8"), ("joint2", "joint7", "joint9")
GAMMAS = (0.0, math.radians(120.0), math.radians(240.0))


TEXT = document("hybrid")
BASE, PLATE = (length(TEXT, link(TEXT, number).parameters.d) for number in (1, 12))


def balls_of_legs(mechanism, q: np.ndarray) -> np.ndarray:
    """(3, 3) ball joints as the legs have them: a jack leans inward by its hinge, in its own vertical plane."""
    legs = zip(GAMMAS, at(mechanism, q, HINGES), at(mechanism, q, JACKS), strict=True)
    return np.array(
        [
            turn("z", gamma)[:3, :3] @ [BASE - jack * math.sin(lean), 0.0, jack * math.cos(lean)]
            for gamma, lean, jack in legs
        ]
    )


def balls_of_plate(mechanism, q: np.ndarray) -> np.ndarray:
    """(3, 3) ball joints as the plate has them: on a circle about its centre."""
    plate = mechanism.placement(q, "plate")
    return np.array([plate.act(turn("z", gamma)[:3, :3] @ [PLATE, 0.0, 0.0]) for gamma in GAMMAS])


def closed(mechanism) -> list[np.ndarray]:
    return [mechanism.q_home] + [q for seed in range(20) for q in mechanism.random_closed(5, seed)]


def test_the_ball_joints_of_legs_and_plate_coincide(robot):
    hybrid = robot("hybrid")
    for q in closed(hybrid):
        assert balls_of_plate(hybrid, q) == pytest.approx(balls_of_legs(hybrid, q), abs=1e-11)


def test_the_plate_drifts_as_lee_and_shahs_constraints_say(robot):
    """With u, v the plate's x and y axes: u_y = v_x, p_x = h (u_x - v_y) / 2, p_y = -h u_y."""
    hybrid = robot("hybrid")
    for q in closed(hybrid):
        plate = hybrid.placement(q, "plate")
        u, v, p = plate.rotation[:, 0], plate.rotation[:, 1], plate.translation
        assert u[1] == pytest.approx(v[0], abs=1e-10)
        assert p[0] == pytest.approx(PLATE * (u[0] - v[1]) / 2.0, abs=1e-10)
        assert p[1] == pytest.approx(-PLATE * u[1], abs=1e-10)
