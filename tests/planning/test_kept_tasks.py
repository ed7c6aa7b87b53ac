"""Plans that keep tasks of any kind, and ranges, all along the path."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from cinegen.collision import PlanningError
from cinegen.ik.barrier import Range
from cinegen.ik.state import State
from cinegen.ik.tasks.kinds import AxisAlong, PointInPlane
from cinegen.planning import PlanStatus, plan

CONE = np.radians(10.0)


def turned(pose: pin.SE3, angle: float) -> pin.SE3:
    """A pose that is rotated about the world's z axis, as a tool is that goes round the robot."""
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3)) * pose


def errors(mechanism, task, path) -> tuple[float, float]:
    """The largest error on a path, and half way between its configurations."""
    between = [mechanism.interpolate(*ends, 0.5) for ends in pairwise(path)]
    return tuple(
        max(float(np.linalg.norm(task.error(State(mechanism, q, 1.0)))) for q in some) for some in (path, between)
    )


@pytest.fixture(scope="module")
def round_a_box(robot):
    """A tool that goes round a box, its axis as at the start: the mechanism, the task, and what plans."""
    arm = robot("arm7")
    here = arm.placement(arm.q_home, "tool")
    box = {"name": "box", "kind": "box", "size": [0.25, 0.25, 0.4], "point": turned(here, 0.6).translation.tolist()}
    task = AxisAlong("tool", (0.0, 0.0, 1.0), here.rotation.T[:, 2])
    return arm, task, lambda tasks: plan(arm, turned(here, 1.2), obstacles=[box], tasks=tasks, seconds=60.0)


def test_a_tool_stays_upright_round_a_box(round_a_box):
    arm, task, planned = round_a_box
    found = planned([task])
    assert found.status is PlanStatus.REACHED
    along, between = errors(arm, task, found.path)
    assert along < 1e-6
    assert between < 1e-3
    assert errors(arm, task, planned([]).path)[0] > CONE  # it is no accident


def test_a_tool_stays_within_a_cone(round_a_box):
    arm, task, planned = round_a_box
    found = planned([Range(task, radius=CONE)])
    assert found.status is PlanStatus.REACHED
    along, between = errors(arm, task, found.path)
    assert along <= CONE + 1e-6
    assert between < CONE + 1e-3


def test_a_platform_stays_in_a_plane(robot):
    """Loops and a task together."""
    gough = robot("gough")
    here = gough.placement(gough.q_home, gough.end)
    task = PointInPlane(gough.end, here.translation, (0.0, 0.6, 0.8))
    goal = here * pin.SE3(pin.exp3(np.array([0.05, -0.1, 0.1])), np.zeros(3))
    goal.translation = here.translation + 0.04 * gough.length * np.array([1.0, 0.8, -0.6])
    found = plan(gough, goal, tasks=[task])
    assert found.status is PlanStatus.REACHED
    assert max(gough.closure(q) for q in found.path) <= 1e-11
    along, between = errors(gough, task, found.path)
    assert along < 1e-6
    assert between < 1e-4


def test_what_can_t_be_kept_is_refused(robot):
    arm = robot("arm7")
    goal = turned(arm.placement(arm.q_home, "tool"), 0.5)
    found = plan(arm, goal, tasks=[AxisAlong("tool", (1.0, 0.0, 0.0))])
    assert found.status is PlanStatus.OUT_OF_REACH
    assert "not satisfied at the start" in found.reason
    with pytest.raises(PlanningError, match=r"error\(state\) and jacobian\(state\)"):
        plan(arm, goal, tasks=["upright"])
    with pytest.raises(PlanningError, match="constraints along a path need RRT-Connect"):
        plan(arm, goal, tasks=[AxisAlong("tool")], planner="vortex")
