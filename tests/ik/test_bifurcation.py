"""A flat parallelogram: two branches of closed configurations meet, and most velocities that its Jacobian allows belong
to neither."""

import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen.ik import Status

FLAT = """RAFF flat
robot r {
  link 1 { parameters { d 0 } type 2 pred 0 velocity 20 actuated 1 }
  link 2 { parameters { d 300 } type 2 pred 1 velocity 20 }
  link 3 { parameters { d 500 } type 2 pred 0 velocity 20 }
  frame 4 { parameters { d 500 } pred 2 }
  frame 5 { parameters { d 300 } pred 3 }
  constraint { frame 4 frame 5 type 2 }
}
"""


@pytest.fixture
def flat(tmp_path):
    path = tmp_path / "flat.raff"
    path.write_text(FLAT, encoding="utf-8")
    return cinegen.load(path)


def drag(flat, dt, node, to, count=400):
    solver = cinegen.Solver(flat, dt, q=np.zeros(3))
    task = solver.add_task(node, rotation=0)
    task.target = pin.SE3(np.eye(3), np.array(to))
    return solver, [solver.step() for _ in range(count)]


@pytest.mark.parametrize("dt", [1e-2, 4e-3])
@pytest.mark.parametrize(("node", "to"), [("frame4", (0.64, -0.12, 0.0)), ("link2", (0.38, -0.17, 0.0))])
def test_it_is_left_along_a_branch_within_the_limits_of_velocity(flat, dt, node, to, monkeypatch):
    solver, steps = drag(flat, dt, node, to)
    q = np.zeros(3)
    for step in steps:
        assert step.status is not Status.REFUSED
        assert step.closure <= 1e-10
        assert flat.closure(step.q) <= 1e-10
        assert (step.q - q) / dt == pytest.approx(step.v, abs=1e-9)
        assert np.abs(step.v).max() <= np.radians(20.0) + 1e-9
        q = step.q
    assert q == pytest.approx(solver.q, abs=0.0)
    assert np.abs(q).max() > 0.05
    monkeypatch.setattr(cinegen.Solver, "_leave_bifurcation", lambda self: None)
    assert {step.status for step in drag(flat, dt, node, to, 20)[1]} == {Status.REFUSED}
