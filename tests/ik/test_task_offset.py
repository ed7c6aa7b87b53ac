"""A part may be pulled anywhere: `at` is as good as a frame of the file that stands there."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import cinegen
import raff2urdf
from cinegen.ik import FrameTask
from raff2urdf.raff.document import RaffFrame, RaffParameters
from raff2urdf.raff.kleinfinger import transform
from raff2urdf.tree import kleinfinger

ROBOTS = Path(__file__).resolve().parents[2] / "robots"
GRIP = RaffParameters(theta=30, r=120, d=80, alpha=50, gamma=-20, epsilon=40)  # mm and degrees


@pytest.fixture(params=["arm7", "delta4"], scope="module")
def twins(request, tmp_path_factory):
    """A robot with a frame `grip` on its last link, that link's name, and the frame's placement on it."""
    path, folder = ROBOTS / f"{request.param}.raff", tmp_path_factory.mktemp("twins")
    document = raff2urdf.load(path)
    robot = document.robot()
    father = robot.links[-1]
    frame = RaffFrame(9999, GRIP, father.number, "grip")
    other = replace(robot, parts=(*robot.parts, frame))
    text = raff2urdf.dumps(replace(document, robots=(other,)))
    shutil.copytree(ROBOTS / "graphics", folder / "graphics")
    (folder / "twin.raff").write_text(text)
    at = pin.SE3(transform(kleinfinger(document, frame.parameters)))
    return cinegen.load(folder / "twin.raff"), father.node, at


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
    there = robot.placement(q, node) * at
    found = cinegen.inverse_kinematics(robot, [FrameTask(node, there, rotation=0, offset=at)], limits=False)
    assert found
    assert np.allclose((robot.placement(found.q, node) * at).translation, there.translation, atol=1e-6)
    assert max(found.errors[0][:1]) < 1e-6
    solver, other = cinegen.Solver(robot, 0.01), cinegen.Solver(robot, 0.01)
    task, twin = solver.add_task(node, rotation=0, offset=at), other.add_task("grip", rotation=0)
    for one in (task, twin):
        one.target = pin.SE3(one.target.rotation, one.target.translation + np.array([0.0, 0.0, 10.0 * robot.length]))
    ahead, beyond = cinegen.forecast_motion(solver, 1.0), cinegen.forecast_motion(other, 1.0)
    assert [event.kind for event in ahead.events] == [event.kind for event in beyond.events]


@pytest.mark.parametrize("at", ["here", (1.0, 2.0), (0.0, np.nan, 0.0), pin.SE3(np.eye(3), np.full(3, np.inf))])
def test_what_is_no_place_is_refused(robot, at):
    with pytest.raises(cinegen.CinegenError, match="three finite numbers"):
        cinegen.Solver(robot("arm7"), 0.01).add_task("tool", offset=at)
