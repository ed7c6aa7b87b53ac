"""Weights of tasks, however far apart: what can be met together is met; what can't is in weighted least squares."""

import bipeds
import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen import Solver, Status


def reached(solver: Solver, most: int) -> int:
    """The number of ticks until all tasks are met to a micrometre; loops stay closed."""
    for tick in range(most):
        step = solver.step()
        assert step.closure <= 1e-11
        if max(max(error) for error in step.errors) < 1e-6:
            return tick
    raise AssertionError(f"{step.status} after {most} ticks: {step.errors}")


@pytest.mark.parametrize("weight", [1.0, 1e6])
def test_a_trunk_moves_over_feet_of_any_weight(tmp_path, weight):
    """From straight legs, a singularity, down to a squat, and then sideways."""
    path = tmp_path / "biped.urdf"
    path.write_text(bipeds.URDF)
    biped = cinegen.load(path)
    solver, furthest = Solver(biped, 0.01), 0.0
    trunk = solver.add_task("trunk")
    for foot in bipeds.FEET:
        solver.add_task(foot, weight=weight)
    for way in ((0.0, 0.0, -0.15), (0.03, 0.02, -0.1)):
        trunk.target = pin.SE3(trunk.target.rotation, trunk.target.translation + np.array(way))
        for _ in range(400):
            step = solver.step()
            furthest = max(furthest, *(error[0] for error in step.errors[1:]))
            if max(max(error) for error in step.errors) < 1e-7:
                break
        assert max(max(error) for error in step.errors) < 1e-7, step
    assert step.status is Status.FOLLOWING
    assert furthest < 0.1 / weight


@pytest.mark.parametrize("name", ["two_arms", "five_bar", "gough", "sr400"])
def test_what_can_be_met_together_is_met_whatever_the_weights(robot, name):
    mechanism, rng = robot(name), np.random.default_rng(3)
    nodes = [node for node in mechanism.nodes if mechanism.jacobian(mechanism.q_home, node).any()]
    for _ in range(8):
        solver = Solver(mechanism, 0.01)
        first, *others = rng.choice(nodes, min(3, len(nodes)), replace=False)
        task = solver.add_task(first)
        away = task.target.translation + 0.1 * mechanism.length * rng.normal(size=3)
        task.target = pin.SE3(task.target.rotation, away)
        for _ in range(60):
            there = solver.step().q
        solver = Solver(mechanism, 0.01)
        for node in (first, *others):
            solver.add_task(node, mechanism.placement(there, node), weight=10.0 ** rng.uniform(-4.0, 4.0))
        reached(solver, 400)


def test_a_conflict_ends_at_the_weighted_mean(robot):
    """Two targets of one point: the sum of squared weights times squared distances is least at their mean."""
    for ratio in (2.0, 1e2, 1e4):
        solver = Solver(robot("arm7"), 0.01)
        tasks = [solver.add_task("tool", rotation=0, weight=weight) for weight in (ratio, 1.0)]
        start = tasks[0].target.translation
        places = start + np.array([0.02, 0.03, -0.02]), start + np.array([0.01, 0.04, -0.03])
        for task, place in zip(tasks, places, strict=True):
            task.target = pin.SE3(np.eye(3), place)
        for _ in range(300):
            q = solver.step().q
        mean = (ratio**2 * places[0] + places[1]) / (ratio**2 + 1.0)
        assert solver.mechanism.placement(q, "tool").translation == pytest.approx(mean, abs=2e-8)


def test_a_light_task_is_as_fast_as_alone(tmp_path):
    """One of two arms is stretched by a task of weight 0.2 as it is by that task alone, while the other is held."""
    parts = [
        f"""<joint name="{s}1" type="continuous"><parent link="base"/><child link="{s}_upper"/><origin xyz="0 {y} 0"/>
        <axis xyz="0 1 0"/></joint><joint name="{s}2" type="continuous"><parent link="{s}_upper"/>
        <child link="{s}_lower"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/></joint><joint name="{s}3" type="fixed">
        <parent link="{s}_lower"/><child link="{s}_hand"/><origin xyz="0.4 0 0"/></joint>"""
        for s, y in (("left", 0.3), ("right", -0.3))
    ]
    links = ["base", *(f"{s}_{part}" for s in ("left", "right") for part in ("upper", "lower", "hand"))]
    text = "".join(f"<link name={name!r}/>" for name in links) + "".join(parts)
    mechanism, paths = cinegen.load(f"<robot name='arms'>{text}</robot>"), []
    start = mechanism.configuration({"left1": 0.3, "left2": 0.8, "right1": 0.2, "right2": 0.9})
    for is_held in (True, False):
        solver = Solver(mechanism, 0.01, q=start)
        hand = solver.add_task("left_hand", rotation=0, weight=0.2)
        if is_held:
            solver.add_task("right_hand", rotation=0)
        hand.target = pin.SE3(np.eye(3), np.array([2.0, 0.3, 0.5]))
        paths.append(np.array([solver.step().q for _ in range(150)]))
    assert paths[0] == pytest.approx(paths[1], abs=1e-9)
    assert abs(paths[0][-1] - start).max() > 0.5
