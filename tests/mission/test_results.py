"""Planned ways as recordings."""

import pytest

from cinegen.collision import load_scene, scene_of
from cinegen.mission import MissionError, Player, Recording, check, resampled
from cinegen.mission.results import record_plan
from cinegen.planning import plan


@pytest.fixture(scope="module")
def rod(root):
    """A way of a planar arm."""
    return plan(load_scene(root / "robots/scenes/rod.toml"), seconds=600.0)


@pytest.fixture(scope="module")
def disc():
    """A way of a mobile robot, which has no limits of speed."""
    values = {"mobile": {"radius": 0.1}, "goal": {"point": [2, 0]}}
    return plan(scene_of(values | {"obstacle": [{"kind": "disc", "radius": 0.3, "point": [1, 0.05]}]}), seconds=600.0)


def test_a_recording_holds_the_motion(rod, tmp_path):
    motion = record_plan(rod, tmp_path / "rod.jsonl")
    recording = Recording.load(tmp_path / "rod.jsonl")
    name = rod.scene.mechanism.name
    assert recording.robots == (name,)
    assert (recording.q[name] == motion.q).all()
    assert recording.times == pytest.approx(motion.times, abs=2e-9)
    assert Player(recording).seconds == pytest.approx(motion.times[-1])
    (task,) = recording.tasks[name][0]
    assert (task.node, task.translation, task.rotation) == ("tool", 2, 0)
    assert task.target.isApprox(rod.scene.goal, 1e-12)
    with pytest.raises(MissionError, match="exists, and is a mission"):
        record_plan(rod, tmp_path / "rod.jsonl")


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
