"""Planned ways as recordings."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from cinegen.collision import load_scene, scene_of
from cinegen.mission import MissionError, Player, Recording, check, resampled
from cinegen.mission.results import passes, record_plan
from cinegen.planning import plan

REVOLUTE, PRISMATIC = 1.0, 0.25
"""rad/s and m/s of joints without a velocity limit, as docs/avoidance.md states them. 0.25 m/s is the reduced speed of
industrial robots (ISO 10218-1)."""


@pytest.fixture(scope="module")
def rod(root):
    """A way of a planar arm."""
    return plan(load_scene(root / "robots/scenes/rod.toml"))


@pytest.fixture(scope="module")
def disc():
    """A way of a mobile robot, which has no limits of speed."""
    values = {"mobile": {"radius": 0.1}, "goal": {"point": [2, 0]}}
    return plan(scene_of(values | {"obstacle": [{"kind": "disc", "radius": 0.3, "point": [1, 0.05]}]}))


def test_a_recording_holds_the_way_itself(rod, tmp_path):
    times = record_plan(rod, tmp_path / "rod.jsonl")
    recording = Recording.load(tmp_path / "rod.jsonl")
    name = rod.scene.mechanism.name
    assert recording.robots == (name,)
    assert (recording.q[name] == rod.path).all()
    assert recording.times == pytest.approx(times, abs=2e-9)
    assert Player(recording).seconds == pytest.approx(times[-1])
    (task,) = recording.tasks[name][0]
    assert (task.node, task.translation, task.rotation) == ("tool", 2, 0)
    assert task.target.isApprox(rod.scene.goal, 1e-12)


@pytest.mark.parametrize("name", ["rod", "disc"])
def test_some_joint_is_always_as_fast_as_it_may_be_and_none_is_faster(request, name):
    way = request.getfixturevalue(name)
    mechanism = way.scene.mechanism
    limits = mechanism.model.upperVelocityLimit
    limits = np.where(np.isfinite(limits), limits, PRISMATIC)
    times = passes(mechanism, way.path)
    for (a, b), seconds in zip(pairwise(way.path), np.diff(times), strict=True):
        parts = np.abs(pin.difference(mechanism.model, a, b)) / (limits * seconds)
        assert parts.max() == pytest.approx(1.0, rel=1e-6)


def test_what_follows_motors_through_loops_does_not_hold_them_up(robot):
    """The delta's motors have limits, its other joints none."""
    delta = robot("delta4")
    q = delta.configuration({name: delta.q_home[delta.q_index(name)] + 0.1 for name in delta.actuated})
    path = np.array([delta.q_home, delta.close(q, locked=delta.actuated)])
    slowest = min(delta.model.upperVelocityLimit[delta.v_index(name)] for name in delta.actuated)
    assert passes(delta, path) == pytest.approx([0.0, 0.1 / slowest])


def test_a_base_that_can_move_and_joints_without_a_limit_are_slow(raff):
    text = "robot r { base { } link 1 { type 2 pred 0 } link 2 { type 1 pred 1 } }"
    mechanism = raff(text)
    if np.isfinite(mechanism.model.upperVelocityLimit).any():
        pytest.fail("a limit was made up")
    turned = passes(mechanism, np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.5]]))
    slides = [mechanism.is_prismatic(name) for name in mechanism.joints]
    speeds = [PRISMATIC if slide else REVOLUTE for slide in slides]
    assert turned == pytest.approx(np.cumsum([0.0, *(0.5 / speed for speed in speeds)]))


@pytest.mark.parametrize("name", ["rod", "disc"])
def test_it_can_be_handed_on_to_a_robot(request, tmp_path, name):
    way = request.getfixturevalue(name)
    record_plan(way, tmp_path / "way.jsonl")
    trajectory = resampled(Recording.load(tmp_path / "way.jsonl"))
    assert trajectory.q[-1] == pytest.approx(way.path[-1], abs=1e-9)
    assert not check(trajectory).serious
    # as smooth as that is, it is still clear
    assert min(way._clearance.least(q) for q in trajectory.q) >= way.scene.safety


def test_what_does_not_move_is_refused(tmp_path):
    way = plan(scene_of({"mobile": {"radius": 0.1}, "goal": {"point": [0, 0]}}))
    with pytest.raises(MissionError, match="there is no path to record: reached"):
        record_plan(way, tmp_path / "way.jsonl")
    assert not list(tmp_path.iterdir())


def test_a_recording_is_not_overwritten(rod, tmp_path):
    record_plan(rod, tmp_path / "rod.jsonl")
    with pytest.raises(MissionError, match="exists, and is a mission"):
        record_plan(rod, tmp_path / "rod.jsonl")
