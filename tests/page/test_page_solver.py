"""The solver of the page does what Python's does, for tasks that change while it runs."""

import bipeds
import numpy as np
import pinocchio as pin
import pytest
from hostile_names import urdf
from node import needs_three, run
from variants import slow

import cinegen
from cinegen.ik import Solver
from cinegen.ik.singular_values import gained
from cinegen.page.tables import robot_tables
from cinegen.singularities.ball_joints import CountedLoops, balls

RATE, TICKS = 240.0, 12
GAIN, DAMPING = 100.0, 0.05
ROBOTS = ["delta4", "rx90", *slow("sr400", "scara", "planetary_gear")]

pytestmark = needs_three


def in_javascript(tables, calls, folder):
    return run("run_solver.js", folder, tables=tables, dt=1.0 / RATE, calls=calls)


def some_calls(mechanism, count, seed):
    """Random tasks at random configurations: one to three, of any nodes, offsets and numbers of rows."""
    rng, calls = np.random.default_rng(seed), []
    samples = mechanism.random_closed(count, seed)
    for i in range(count):
        q, tasks = samples[i % len(samples)], []
        for _ in range(rng.integers(1, 4)):
            node = int(rng.integers(1, len(mechanism.nodes)))
            offset = pin.SE3(pin.exp3(rng.normal(size=3)), 0.2 * mechanism.length * rng.normal(size=3))
            pose = mechanism.placement(q, mechanism.nodes[node]) * offset
            moved = pin.SE3(pin.exp3(0.2 * rng.normal(size=3)), 0.05 * mechanism.length * rng.normal(size=3))
            translation, rotation = [(3, 3), (3, 0), (2, 1), (1, 2), (0, 3)][rng.integers(5)]
            offset, target = (pin.SE3ToXYZQUAT(placement).tolist() for placement in (offset, pose * moved))
            weight = float(rng.choice([0.5, 1.0, 3.0]))
            counts = {"translation": translation, "rotation": rotation}
            tasks.append({"node": node, "offset": offset, "target": target, "weight": weight} | counts)
        calls.append({"q": q.tolist(), "tasks": tasks, "ticks": TICKS, "gain": GAIN, "damping": DAMPING})
    return calls


def python_tasks(mechanism, call):
    for task in call["tasks"]:
        target, offset = (pin.XYZQUATToSE3(np.array(task[name])) for name in ("target", "offset"))
        yield mechanism.nodes[task["node"]], target, offset, task


@pytest.mark.parametrize("name", [*ROBOTS, "biped"])
def test_ticks_are_those_of_python(any_robot, tmp_path, name):
    mechanism = any_robot(name)
    calls = some_calls(mechanism, 12, 3)
    for call, answer in zip(calls, in_javascript(robot_tables(mechanism, RATE), calls, tmp_path), strict=True):
        solver = Solver(mechanism, 1.0 / RATE, np.array(call["q"]), gain=GAIN)
        solver.damping_threshold = DAMPING
        for node, target, offset, task in python_tasks(mechanism, call):
            solver.add_task(node, target, task["translation"], task["rotation"], task["weight"], offset=offset)
        for step in answer["steps"]:
            expected = solver.step()
            assert step["status"] == expected.status.name
            assert step["q"] == pytest.approx(expected.q, abs=1e-8)
            assert step["closure"] <= 1e-10
            assert np.array(step["errors"]) == pytest.approx(np.array(expected.errors), abs=1e-8)


@pytest.fixture
def any_robot(robot):
    """A shipped robot, or one with a floating base."""
    return lambda name: cinegen.load(bipeds.URDF) if name == "biped" else robot(name)


@pytest.mark.parametrize("name", [*ROBOTS, "biped"])
def test_singular_values_are_those_of_python(any_robot, tmp_path, name):
    mechanism = any_robot(name)
    calls = [call | {"ticks": 0} for call in some_calls(mechanism, 12, 5)]
    counted = CountedLoops(mechanism) if balls(mechanism) else mechanism.structure.own_system()
    inner = {mechanism.model.getJointId(joint) for names in balls(mechanism) for joint in names[:2]}
    for call, answer in zip(calls, in_javascript(robot_tables(mechanism, RATE), calls, tmp_path), strict=True):
        q = np.array(call["q"])
        solver, loops = Solver(mechanism, 1.0 / RATE, q), counted
        for node, _, offset, task in python_tasks(mechanism, call):
            target = mechanism.placement(q, node) * offset
            solver.add_task(node, target, task["translation"], task["rotation"], task["weight"], offset=offset)
            if mechanism.model.frames[mechanism.frame_id(node)].parentJoint in inner:
                loops = mechanism.structure.own_system()
        lost, uncontrolled = solver.step().lost_dof_in(loops), gained(mechanism, q, loops)
        assert answer["type1"] == (None if lost is None else pytest.approx(lost.values[-1], abs=1e-8))
        assert answer["type2"] == (None if uncontrolled is None else pytest.approx(uncontrolled.values[-1], abs=1e-8))


def test_a_name_can_not_leave_its_comment(tmp_path):
    mechanism = cinegen.load(urdf("x */ throw new Error('it runs'); /*", ("a",), ("j",)))
    assert "*/" in mechanism.name
    (answer,) = in_javascript(robot_tables(mechanism, RATE), some_calls(mechanism, 1, 0), tmp_path)
    assert len(answer["steps"]) == TICKS
