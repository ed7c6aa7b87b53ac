"""The hybrid: a tripod with three legs (3-RPS) that carries a wrist.

K.-M. Lee and D. K. Shah, "Kinematic analysis of a three-degrees-of-freedom in-parallel actuated manipulator", IEEE
Journal of Robotics and Automation 4, 1988: each leg stays in the vertical plane of its hinge, which ties three of the
plate's six coordinates to the others.
"""

import numpy as np
import pytest
from elementary import document, length, link

TEXT = document("hybrid")
PLATE = length(TEXT, link(TEXT, 12).parameters.d)


def closed(mechanism) -> list[np.ndarray]:
    return [mechanism.q_home] + [q for seed in range(20) for q in mechanism.random_closed(5, seed)]


def test_the_plate_drifts_as_lee_and_shahs_constraints_say(robot):
    """With u, v the plate's x and y axes: u_y = v_x, p_x = h (u_x - v_y) / 2, p_y = -h u_y."""
    hybrid = robot("hybrid")
    for q in closed(hybrid):
        plate = hybrid.placement(q, "plate")
        u, v, p = plate.rotation[:, 0], plate.rotation[:, 1], plate.translation
        assert u[1] == pytest.approx(v[0], abs=1e-10)
        assert p[0] == pytest.approx(PLATE * (u[0] - v[1]) / 2.0, abs=1e-10)
        assert p[1] == pytest.approx(-PLATE * u[1], abs=1e-10)
