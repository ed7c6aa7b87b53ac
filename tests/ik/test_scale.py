"""Sizes do not matter: micro and giant robots move alike, and so do screws of any pitch."""

import numpy as np
import pinocchio as pin
import pytest
from ticking import pull

import cinegen
from cinegen import Solver, Status
from cinegen.ik import LimitMargin, Manipulability, Posture

DT = 1.0 / 240.0

QUILL = """robot arm {{ base {{ }}
  link 1 {{ type 2 pred 0 parameters {{ theta 0 }} }}
  link 2 {{ type 2 pred 1 parameters {{ theta 40 d 200 }} }}
  link 3 {{ type 2 pred 2 parameters {{ theta 0 d 200 }} }}
  link 4 {{ type 1 pred 3 parameters {{ r 100 }} limits {{ 0 500 }} }}
  frame 5 {{ pred 4 name "tool" parameters {{ {frame} }} }}
  coupling {{ link 4 link 3 lead {lead} offset 100 }} }}"""


@pytest.mark.parametrize(("unit", "factor", "wishes", "to"), [
    ("um", 1e-3, (Posture, LimitMargin, Manipulability), 1e-7), ("m", 1e3, (), 1e-11),
])  # fmt: skip
@pytest.mark.parametrize("name", ["scara", "gough", "hybrid"])
@pytest.mark.filterwarnings("ignore")
def test_micro_and_giant_robots_move_alike(root, name, unit, factor, wishes, to):
    """The same numbers in another unit."""
    text = (root / f"robots/{name}.raff").read_text()
    robots = [cinegen.load(text.replace("\n", f"\nunits {symbol}\n", 1)) for symbol in ("mm", unit)]
    first, second = robots
    assert second.length == pytest.approx(factor * first.length, rel=1e-12)
    assert (first.mobility, first.actuated) == (second.mobility, second.actuated)
    solvers = [Solver(robot, DT) for robot in robots]
    for robot, solver in zip(robots, solvers, strict=True):
        task = solver.add_task(robot.end, rotation=0)
        way = robot.length * np.array([0.05, -0.04, 0.03])
        task.target = pin.SE3(task.target.rotation, task.target.translation + way)
        solver.objectives = [kind(rate=2.0) for kind in wishes]
    for _ in range(30):
        steps = [solver.step() for solver in solvers]
        assert steps[0].status is steps[1].status
        moved = [robot.scaled_difference(robot.q_home, step.q) for robot, step in zip(robots, steps, strict=True)]
        assert np.abs(moved[0] - moved[1]).max() < to
        assert steps[0].speed_scale == pytest.approx(steps[1].speed_scale, rel=max(to, 1e-9))
        assert np.abs(steps[0].singular_values - steps[1].singular_values).max() < to


@pytest.mark.parametrize("lead", [20.0, 0.1, 0.001])
def test_a_screw_of_any_pitch_lifts_the_tool_on_its_axis(raff, lead):
    """The joint that turns the shaft carries it, and nothing off its axis. Before it counted by its angle, the arm was
    singular everywhere, and did not lift the tool."""
    arm, reference = raff(QUILL.format(lead=lead, frame="d 0")), raff(QUILL.format(lead=1.0, frame="d 0"))
    solvers = Solver(arm, DT), Solver(reference, DT)
    for solver in solvers:
        pull(solver, "tool", [0.01, -0.02, 0.05], rotation=0)
    for _ in range(100):
        step, expected = (solver.step() for solver in solvers)
        assert step.status is expected.status
        assert np.abs(step.singular_values - expected.singular_values).max() < 1e-6
        assert np.abs(step.q[[0, 1, 3]] - expected.q[[0, 1, 3]]).max() < 1e-6
    assert step.status is Status.FOLLOWING
    assert step.errors[0][0] < 1e-9
    turns = (step.q[2] - arm.q_home[2]) / (2.0 * np.pi)
    assert turns * lead / 1000.0 == pytest.approx(0.05, abs=1e-9)


def test_a_screw_that_swings_a_tool_around_its_axis_counts_by_its_angle(raff):
    arm = raff(QUILL.format(lead=0.1, frame="d 50"))
    assert arm.scale[arm.v_index("joint3")] == 1.0
