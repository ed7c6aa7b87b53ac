"""`--lock` of `cinegen plan`, `drive` and `ik`: joints that do not move."""

import json

import numpy as np
import pytest

from cinegen.cli import main


@pytest.fixture
def scene(tmp_path, root):
    """A scene of an arm whose tool is to go a little upwards."""
    text = {
        "robot": str(root / "robots/planar_3r.raff"),
        "node": "tool",
        "start": {"joints": {"joint1": -67.61, "joint2": 56.72, "joint3": 50.42}},
        "goal": {"point": [0.62, -0.25]},
    }
    (tmp_path / "scene.json").write_text(json.dumps(text))
    return str(tmp_path / "scene.json")


def test_a_plan_does_not_move_what_is_locked(scene, capsys):
    assert main(["plan", scene, "--lock", "joint3", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["locked"] == ["joint3"]
    assert {q["joint3"] for q in found["path"]} == {np.radians(50.42)}
    assert np.ptp([q["joint1"] for q in found["path"]]) > 0.01


def test_ik_holds_a_joint_at_a_value(root, capsys):
    arm = str(root / "robots/planar_3r.raff")
    assert main(["ik", arm, "--at", "0.5,0.1,0", "--lock", "joint2=70", "--json"]) == 0
    (solution,) = json.loads(capsys.readouterr().out)["solutions"]
    assert solution["joints"]["joint2"] == pytest.approx(np.radians(70.0))


def test_a_snapshot_with_a_locked_joint_is_drawn(root, tmp_path, capsys):
    arm, to = str(root / "robots/planar_3r.raff"), tmp_path / "arm.html"
    assert main(["drive", arm, "--lock", "joint2", "--snapshot", str(to)]) == 0
    assert to.stat().st_size > 1000
