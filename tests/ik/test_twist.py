"""Tasks by a speed."""

import math

import numpy as np
import pinocchio as pin
import pytest

from cinegen import Solver, Status

DT = 1 / 240


SIX = """robot r { base { }
  link 1 { parameters { r 500 theta 90 alpha 90 } type 1 pred 0 }
  link 2 { parameters { r 500 theta 90 alpha 90 } type 1 pred 1 }
  link 3 { parameters { r 500 theta 90 alpha 90 } type 1 pred 2 }
  link 4 { parameters { theta 40 } type 2 pred 3 }
  link 5 { parameters { theta 70 alpha 90 } type 2 pred 4 }
  link 6 { parameters { theta 20 alpha -90 } type 2 pred 5 }
  frame 7 { parameters { r 100 } pred 6 name "tool" } }"""
"""Three slides at right angles and a wrist: goes anywhere, without limits."""


def carried(begin: pin.SE3, twist: np.ndarray, seconds: float, axes: str) -> pin.SE3:
    """Where a constant twist leads: the origin along its line (its screw, in the node's own axes), turned apart."""
    linear, angular = seconds * twist[:3], seconds * twist[3:]
    if axes == "world":
        return pin.SE3(pin.exp3(angular) @ begin.rotation, begin.translation + linear)
    return pin.SE3(begin.rotation @ pin.exp3(angular), begin.translation + begin.rotation @ linear)


@pytest.mark.parametrize("axes", ["world", "target", "tool"])
@pytest.mark.parametrize("way", ["line", "turn", "both"])
def test_a_twist_moves_the_node_by_itself_times_the_seconds(raff, axes, way):
    arm = raff(SIX)
    twist = np.zeros(6)
    twist[:3] = [0.1, -0.2, 0.05] if way in ("line", "both") else 0.0
    twist[3:] = [0.0, 0.0, 0.2] if way == "both" else [0.1, -0.2, 0.3] if way == "turn" else 0.0
    solver = Solver(arm, DT)
    begin = arm.placement(solver.q, "tool")
    task = solver.add_task("tool", axes=axes)
    task.twist = twist
    turning = axes in ("target", "tool")
    for seconds in (1, 2):
        for _ in range(240):
            step = solver.step()
            assert step.status is Status.FOLLOWING
        expected = carried(begin, twist, seconds, "tool" if turning else "world")
        if turning and way == "both":  # the line turns with the node, tick by tick
            expected = begin
            for _ in range(240 * seconds):
                expected = carried(expected, twist, DT, "tool")
        pose = arm.placement(solver.q, "tool")
        late = 0.5 * (DT * float(np.linalg.norm(twist[3:]))) ** 2  # of second order in the last tick alone
        assert pose.translation == pytest.approx(expected.translation, abs=late + 1e-11)
        assert pose.rotation == pytest.approx(expected.rotation, abs=late + 1e-11)
    task.twist = np.zeros(6)
    solver.step()
    pose = arm.placement(solver.q, "tool")  # exactly, now that it rests
    # but axes that turn with the node are taken where it is, not where it should be: of second order in a tick
    exact = 1e-6 if turning and twist[3:].any() else 1e-11
    assert pose.translation == pytest.approx(expected.translation, abs=exact)
    assert pose.rotation == pytest.approx(expected.rotation, abs=exact)


@pytest.mark.parametrize("axes", ["target", "world"])
def test_what_is_0_in_a_twist_does_not_drift_in_thousands_of_ticks(raff, axes):
    arm = raff(SIX)
    solver = Solver(arm, 1e-3)
    begin = arm.placement(solver.q, "tool")
    task = solver.add_task("tool", axes=axes)
    for tick in range(2500):
        task.twist = [0.1 * math.sin(1e-3 * tick), 0.0, 0.0, 0.0, 0.0, 0.0]
        solver.step()
    gone = arm.placement(solver.q, "tool")
    way = gone.translation - begin.translation
    along = begin.rotation.T @ way if axes == "target" else way
    assert abs(along[0]) > 0.1
    assert along[1:] == pytest.approx([0.0, 0.0], abs=1e-11)
    assert gone.rotation == pytest.approx(begin.rotation, abs=1e-11)


@pytest.mark.parametrize(("name", "way"), [("serial_5dof", 2), ("delta4", 2), ("five_bar", 1)])
def test_a_twist_against_a_wall_winds_nothing_up_and_leads_back_at_once(robot, name, way):
    mechanism = robot(name)
    node = mechanism.nodes[-1]
    solver = Solver(mechanism, 1 / 60)
    task = solver.add_task(node, rotation=0, axes="world")
    twist = np.zeros(6)
    twist[way] = -0.3 * mechanism.length
    task.twist = twist
    for _ in range(1200):  # six lengths
        step = solver.step()
    assert step.status in (Status.AT_LIMIT, Status.SINGULAR, Status.OUT_OF_REACH)
    at_the_wall = mechanism.placement(step.q, node).translation[way]
    task.twist = -twist
    for tick in range(30):
        step = solver.step()
        if tick == 2:
            assert mechanism.placement(step.q, node).translation[way] > at_the_wall + 1e-4 * mechanism.length
    assert mechanism.placement(step.q, node).translation[way] > at_the_wall + 0.05 * mechanism.length


def test_a_target_and_a_twist_in_turn_end_each_other(raff):
    """Back by the target and on by the twist, tick by tick: it gets nowhere, and does not drift."""
    arm = raff(SIX)
    solver = Solver(arm, DT)
    begin = arm.placement(solver.q, "tool")
    task = solver.add_task("tool", axes="world")
    twist = np.array([0.3, 0.1, 0.0, 0.0, 0.0, 0.2])
    for tick in range(400):
        if tick % 2 == 0:
            task.twist = twist
            assert task.twist == pytest.approx(twist)
        else:
            task.target = begin
            assert task.twist is None
        step = solver.step()
        gone = arm.placement(step.q, "tool").translation - begin.translation
        assert gone == pytest.approx(DT * twist[:3] if tick % 2 == 0 else np.zeros(3), abs=1e-4)
