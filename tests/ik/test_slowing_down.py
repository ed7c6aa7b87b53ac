"""Where loops don't close even after braking, a robot with limits of acceleration slows down in some ticks; it stopped
at once before, at any speed."""

import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen.ik import Status

MOVING = [  # acceleration, period, configuration, velocities: passive joints are near their limits, at speed
    (3.204, 0.05, [3.48995211, -2.48454798, 1.24917948, 1.85432657, -2.09810192], [0.337, -0.112, 0.194, -0.078, 0.11]),
    (1.219, 0.1, [1.46108826, -0.18966074, 1.75656009, 0.08889345, -0.57402602], [0.049, -0.054, 0.145, -0.211, 0.061]),
    (3.234, 0.05, [2.78157794, -2.67829267, 0.08590642, 2.7826502, -2.76527136], [-0.979, -0.067, -1.87, 1.15, -0.324]),
]  # fmt: skip
AIMS = [(-0.115, 0.314, 0.0), (6.368, 0.673, 0.0), (0.172, 0.953, 0.0)]


@pytest.mark.parametrize(("moving", "aim"), [*zip(MOVING, AIMS, strict=True)])
def test_it_slows_down_where_loops_do_not_close_after_braking(robot, moving, aim):
    acceleration, dt, q, v = moving
    mechanism = robot("five_bar")
    solver = cinegen.Solver(mechanism, dt, q=mechanism.close(np.array(q)), acceleration=acceleration)
    solver.add_task(mechanism.end, pin.SE3(np.eye(3), np.array(aim)), rotation=0)
    solver._memory.last[:] = np.array(v) * dt / mechanism.scale
    before = np.abs(v).max()
    step = solver.step()
    assert step.status is not Status.REFUSED
    assert 0.0 < np.abs(step.v).max() < before
    assert step.v @ np.array(v) > 0.0  # not back
    for _ in range(30):
        assert mechanism.closure(step.q) <= 1e-10
        assert mechanism.limits.within(step.q)
        assert (np.abs(step.v) <= mechanism.limits.velocity * (1.0 + 1e-9)).all()
        step = solver.step()
