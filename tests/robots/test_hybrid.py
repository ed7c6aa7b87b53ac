"""The hybrid: a tripod with three legs (3-RPS) that carries a wrist.

K.-M. Lee and D. K. Shah, "Kinematic analysis of a three-degrees-of-freedom in-parallel actuated manipulator", IEEE
Journal of Robotics and Automation 4, 1988: each leg stays in the vertical plane of its hinge, which ties three of the
plate's six coordinates to the others.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from elementary import at, document, length, link, product, shift, turn, values

import cinegen

HINGES, JACKS = ("joint1", "joint6", "joint8"), ("joint2", "joint7", "joint9")
GAMMAS = (0.0, math.radians(120.0), math.radians(240.0))


def of(number: int, parameter: str) -> float:
    text = document("hybrid")
    return length(text, getattr(link(text, number).parameters, parameter))


BASE, PLATE = of(1, "d"), of(12, "d")


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


def test_its_mobility_is_5_three_of_the_tripod_and_two_of_the_wrist(robot):
    hybrid = robot("hybrid")
    assert hybrid.mobility == 5
    assert hybrid.loop_rank == hybrid.loop_jacobian(hybrid.q_home).shape[0] == 6
    assert hybrid.actuated == ("joint2", "joint7", "joint9", "joint10", "joint11")
    assert [loop.kind.name for loop in hybrid.loops] == ["BALL", "BALL"]


def test_the_ball_joints_of_legs_and_plate_coincide(robot):
    hybrid = robot("hybrid")
    for q in closed(hybrid):
        assert balls_of_plate(hybrid, q) == pytest.approx(balls_of_legs(hybrid, q), abs=1e-11)


def test_each_leg_lies_in_the_vertical_plane_of_its_hinge(robot):
    hybrid = robot("hybrid")
    for q in closed(hybrid):
        for gamma, node, ball in zip(GAMMAS, ("link2", "link7", "link9"), balls_of_plate(hybrid, q), strict=True):
            aside = np.array([-math.sin(gamma), math.cos(gamma), 0.0])
            assert hybrid.placement(q, node).translation @ aside == pytest.approx(0.0, abs=1e-11)
            assert hybrid.placement(q, node).rotation[:, 2] @ aside == pytest.approx(0.0, abs=1e-11)
            assert ball @ aside == pytest.approx(0.0, abs=1e-11)


def test_the_plate_drifts_as_lee_and_shahs_constraints_say(robot):
    """With u, v the plate's x and y axes: u_y = v_x, p_x = h (u_x - v_y) / 2, p_y = -h u_y."""
    hybrid = robot("hybrid")
    for q in closed(hybrid):
        plate = hybrid.placement(q, "plate")
        u, v, p = plate.rotation[:, 0], plate.rotation[:, 1], plate.translation
        assert u[1] == pytest.approx(v[0], abs=1e-10)
        assert p[0] == pytest.approx(PLATE * (u[0] - v[1]) / 2.0, abs=1e-10)
        assert p[1] == pytest.approx(-PLATE * u[1], abs=1e-10)


def test_the_jacks_are_as_long_as_the_way_from_hinge_to_ball(robot):
    hybrid = robot("hybrid")
    hinges = np.array([[BASE * math.cos(gamma), BASE * math.sin(gamma), 0.0] for gamma in GAMMAS])
    for q in closed(hybrid):
        expected = np.linalg.norm(balls_of_plate(hybrid, q) - hinges, axis=1)
        assert np.abs(at(hybrid, q, JACKS)) == pytest.approx(expected, abs=1e-11)


def test_the_hand_stands_on_the_plate_by_its_two_axes(robot):
    hybrid = robot("hybrid")
    neck, hand = of(10, "r"), of(20, "r")
    for q in closed(hybrid):
        t = values(hybrid, q)
        wrist = product(shift("z", neck), turn("z", t["joint10"]), turn("x", math.pi / 2), turn("z", t["joint11"]),
                        turn("x", -math.pi / 2), shift("z", hand))  # fmt: skip
        expected = hybrid.placement(q, "plate").homogeneous @ wrist
        assert hybrid.placement(q, "tool").homogeneous == pytest.approx(expected, abs=1e-13)


def test_dragging_the_hand_leaves_the_legs_in_their_planes(robot):
    hybrid, rng = robot("hybrid"), np.random.default_rng(0)
    solver = cinegen.Solver(hybrid, dt=1 / 60)
    task = solver.add_task("tool", rotation=2)
    home = hybrid.placement(hybrid.q_home, "tool")
    for tick in range(400):
        if tick % 40 == 0:
            task.target = home.copy()
            task.target.translation = home.translation + rng.normal(0.0, 0.3, 3)
        q = solver.step().q
        assert balls_of_plate(hybrid, q) == pytest.approx(balls_of_legs(hybrid, q), abs=1e-9)
