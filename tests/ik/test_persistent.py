"""A dead end whose way out is known: a planar arm whose first joint is limited, and the other of its two postures."""

import math

import numpy as np
import pinocchio as pin
import pytest

from cinegen import PersistentSolver, Solver, Status

ARM = """robot r { base { }
  link 1 { parameters { theta 20 } type 2 pred 0 limits { -30 30 } }
  link 2 { parameters { d 400 theta 60 } type 2 pred 1 }
  frame 3 { parameters { d 300 } pred 2 name "tool" } }"""
A, B = 0.4, 0.3
THERE = np.radians([10.0, -60.0])
"""The tool is reached with the elbow on the other side only: by the law of cosines the posture with the elbow as it is
has the first joint at -41 degrees."""


def dead_end(solver_of, arm):
    solver = solver_of(arm, 0.02)
    task = solver.add_task("tool", rotation=0, axes="world")
    first, second = THERE[0], THERE.sum()
    task.target = pin.SE3(
        np.eye(3), np.array([A * math.cos(first) + B * math.cos(second), A * math.sin(first) + B * math.sin(second), 0])
    )
    return solver, task


def test_a_solver_stays_at_the_limit_and_a_persistent_one_goes_round(raff):
    arm = raff(ARM)
    solver, _ = dead_end(Solver, arm)
    for _ in range(400):
        step = solver.step()
    assert step.status is Status.AT_LIMIT
    assert step.q[0] == pytest.approx(math.radians(-30))
    persistent, _ = dead_end(PersistentSolver, arm)
    seen = set()
    for _ in range(400):
        step = persistent.step()
        seen.add(step.status)
        assert abs(step.q[0]) <= math.radians(30) + 1e-9
    assert step.status is Status.FOLLOWING
    assert step.q == pytest.approx(THERE, abs=1e-6)
    assert Status.DETOUR in seen


def test_beside_a_task_that_follows_a_twist_nothing_is_looked_for(raff):
    persistent, _ = dead_end(PersistentSolver, raff(ARM))
    persistent.add_task("link1", translation=0, rotation=1, weight=1e-6).twist = np.zeros(6)
    statuses = {persistent.step().status for _ in range(400)}
    assert Status.DETOUR not in statuses


def test_a_target_that_is_moved_ends_the_detour(raff):
    """The tasks take over at once, and lead to a target that the arm reaches as it is."""
    arm = raff(ARM)
    persistent, task = dead_end(PersistentSolver, arm)
    near = arm.placement(arm.q_home, "tool")
    while persistent.step().status is not Status.DETOUR:
        assert persistent.q[1] > 0.0
    task.target = near
    for _ in range(400):
        step = persistent.step()
        assert step.status is not Status.DETOUR
    assert step.q == pytest.approx(arm.q_home, abs=1e-6)
