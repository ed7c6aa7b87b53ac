"""What a tick reports of each task: which value is wrong, and how the others fare."""

import contextlib
import math
import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from elementary import ROBOTS
from ticking import beside

import cinegen
import raff2urdf
from cinegen import Solver
from cinegen.ik import FrameTask
from cinegen.ik.step import Status
from cinegen.session.robot import DrivenRobot
from raff2urdf.raff.document import RaffFrame, RaffParameters
from raff2urdf.raff.kleinfinger import transform
from raff2urdf.tree import kleinfinger

DT = 1.0 / 240.0
UNIT = np.eye(3)


@pytest.mark.parametrize(("name", "value", "says"), [
    ("target", None, "target of the task of 'tool' is None: give a pinocchio.SE3"),
    ("target", pin.SE3(UNIT, np.array([0.0, np.nan, 0.0])), r"has the position \[0.0, nan, 0.0\]: give three"),
    ("target", pin.SE3(2.0 * UNIT, np.zeros(3)), "that is no rotation, by 3: give an orthonormal matrix"),
    ("target", pin.SE3(-UNIT, np.zeros(3)), "orientation that is a reflection"),
    ("target", pin.SE3(1e200 * UNIT, np.zeros(3)), "orientation that is no rotation, by inf"),
    ("twist", [math.inf] * 6, r"target of the task of 'tool' is \[inf, .* as a twist six finite numbers"),
    ("weight", 0.0, "weight of the task of 'tool' is 0.0: give a positive, finite number"),
    ("weights", [1, 1], r"weights of the task of 'tool' is \[1, 1\]: give six finite numbers"),
    ("translation", 7, "translation of the task of 'tool' is 7: give a number of constrained axes, 0 to 3"),
    ("rotation", "all", "rotation of the task of 'tool' is 'all': give a number of constrained axes"),
    *(("rotation", value, "give a number of constrained axes") for value in (-1, True)),
    ("weight", np.inf, "give a positive, finite number"),
    ("weights", np.full(6, np.nan), "give six finite numbers"),
    ("node", "thumb", "node of the task of 'tool' is 'thumb': give the name of a base, link or frame"),
    ("node", [], r"node of the task of 'tool' is \[\]: give the name"),
    ("axes", "thumb", "axes of the task of 'tool' is 'thumb': give target, world, or the name"),
    ("offset", (0.0, np.nan, 0.0), "give a point of three finite numbers"),
    ("offset", [1.0], r"offset of the task of 'tool' is \[1.0\]: give a point of three finite numbers"),
])  # fmt: skip
def test_a_bad_value_is_named_and_what_it_must_be(robot, name, value, says):
    arm = robot("arm7")
    solver = Solver(arm, DT)
    bad, good = solver.add_task("tool"), solver.add_task("link3", rotation=0)
    before = getattr(bad, name)
    setattr(bad, name, value)
    step = solver.step()
    assert step.status is Status.BAD_TARGET
    assert step.problems == (bad.problem, "") == (bad.problem, good.problem)
    assert re.search(says, bad.problem), bad.problem
    assert step.task_statuses == (Status.BAD_TARGET, Status.FOLLOWING)
    assert np.isnan([*step.errors[0], *bad.error]).all()
    assert np.isfinite(step.errors[1]).all()
    assert np.array_equal(step.q, arm.q_home)
    bad.translation = bad.translation  # another value does not hide it
    assert not bad.is_valid()
    assert not bad.copy().is_valid()
    if name == "twist":
        bad.twist = np.zeros(6)
    else:
        setattr(bad, name, before)
    step = solver.step()
    assert step.problems == ("", "")
    assert Status.BAD_TARGET not in step.task_statuses
    assert bad.is_valid()


def test_a_rotation_is_one_up_to_rounding_of_files(robot):
    solver = Solver(robot("arm7"), DT)
    task = solver.add_task("tool")
    task.target = pin.SE3(task.target.rotation + 1e-5, task.target.translation)
    assert solver.step().status is not Status.BAD_TARGET


def test_a_target_that_is_changed_in_place_is_named_too(robot):
    solver = Solver(robot("delta4"), DT)
    task = solver.add_task("platform", rotation=0)
    task.target.translation[:] = math.nan
    assert "nan, nan, nan" in solver.step().problems[0]


def test_tasks_that_are_broken_reached_and_out_of_reach_are_told_apart(robot):
    arm = robot("arm7")
    solver = Solver(arm, DT)
    base = solver.add_task(arm.nodes[0], rotation=0)  # the base never moves: reached
    far = solver.add_task("tool", beside(arm.placement(arm.q_home, "tool"), [0.0, 0.0, 100.0 * arm.length]), rotation=0)
    base.weight = math.nan
    assert solver.step().task_statuses == (Status.BAD_TARGET, Status.FOLLOWING)  # it moves there
    base.weight = 1.0
    for _ in range(3000):
        step = solver.step()
        if step.status is not Status.FOLLOWING:
            break
    assert step.status in (Status.OUT_OF_REACH, Status.AT_LIMIT, Status.SINGULAR)
    assert step.task_statuses == (Status.FOLLOWING, step.status)
    assert (base.problem, far.problem) == ("", "")


def test_a_session_tells_people_which_value_is_wrong(robot):
    driven = DrivenRobot("arm7", Solver(robot("arm7"), DT))
    driven.solver.add_task("tool").weight = math.nan
    driven.step = driven.solver.step()
    assert driven.status().name == "BAD_TARGET"
    assert driven.status().description.endswith("weight of the task of 'tool' is nan: give a positive, finite number")


# --- task offset ------------------------------------------------------------------------------------------------------
# A part may be pulled anywhere: `at` is as good as a frame of the file that stands there.


GRIP = RaffParameters(theta=30, r=120, d=80, alpha=50, gamma=-20, epsilon=40)  # mm and degrees


@pytest.fixture(params=["arm7", "delta4"], scope="module")
def twins(request):
    """A robot with a frame `grip` on its last link, that link's name, and the frame's placement on it."""
    document = raff2urdf.load(ROBOTS / f"{request.param}.raff")
    robot = document.robot()
    father = robot.links[-1]
    frame = RaffFrame(9999, GRIP, father.number, "grip")
    other = replace(robot, parts=(*robot.parts, frame))
    at = pin.SE3(transform(kleinfinger(document, frame.parameters)))
    with contextlib.chdir(ROBOTS):  # of its graphics
        return cinegen.load(raff2urdf.dumps(replace(document, robots=(other,)))), father.node, at


@pytest.mark.parametrize(("rotation", "axes"), [(0, "world"), (1, "target"), (2, "base"), (3, "target")])
def test_a_grip_moves_as_a_frame_does(twins, rotation, axes):
    robot, node, at = twins
    solver, other = cinegen.Solver(robot, 0.01), cinegen.Solver(robot, 0.01)
    task = solver.add_task(node, rotation=rotation, axes=axes, offset=at)
    twin = other.add_task("grip", rotation=rotation, axes=axes)
    assert task.target.isApprox(twin.target, 1e-9)
    rng = np.random.default_rng(0)
    for _ in range(40):
        step = 0.01 * np.r_[robot.length * rng.normal(size=3), rng.normal(size=3)]
        target = task.target * pin.exp6(step)
        task.target, twin.target = target, target
        ours, theirs = solver.step(), other.step()
        assert np.allclose(ours.q, theirs.q, atol=1e-9)
        assert ours.status is theirs.status
        assert np.allclose(ours.errors, theirs.errors, atol=1e-9)
        assert np.allclose(ours.singular_values, theirs.singular_values, atol=1e-9)


def test_reach_and_forecast_know_of_it(twins):
    robot, node, at = twins
    q = robot.random_closed(1)[0]
    target = robot.placement(q, node) * at
    result = cinegen.inverse_kinematics(robot, [FrameTask(node, target, rotation=0, offset=at)], limits=False)
    assert result
    assert np.allclose((robot.placement(result.q, node) * at).translation, target.translation, atol=1e-6)
    assert max(result.errors[0][:1]) < 1e-6
    solver, other = cinegen.Solver(robot, 0.01), cinegen.Solver(robot, 0.01)
    task, twin = solver.add_task(node, rotation=0, offset=at), other.add_task("grip", rotation=0)
    for moved in (task, twin):
        moved.target = pin.SE3(
            moved.target.rotation, moved.target.translation + np.array([0.0, 0.0, 10.0 * robot.length])
        )
    ahead, beyond = cinegen.forecast_motion(solver, 1.0), cinegen.forecast_motion(other, 1.0)
    assert [event.kind for event in ahead.events] == [event.kind for event in beyond.events]
