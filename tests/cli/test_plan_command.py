"""The command `cinegen plan`: a way around obstacles, or to another assembly mode; as text, JSON and a recording."""

import json
import math
import re
from functools import partial

import coal
import numpy as np
import pinocchio as pin
import pytest
from firas import firas

import cinegen
from cinegen.collision import load_scene, obstacle_kinds
from cinegen.collision.body import PlacedShape
from cinegen.mission import MissionError, Recording
from cinegen.planning import plan
from cinegen.plotting import draw_plan
from cinegen.session import scene_setup

DISC = {"kind": "disc", "radius": 0.1}


@pytest.fixture
def typed(printed):
    """`typed("rod", "--json")`: what the command prints."""
    return partial(printed, "plan")


@pytest.fixture
def scene(tmp_path):
    """`scene(obstacle=[...])`: the file of a disc that is to go from the origin to x = 1."""

    def write(**values):
        path = tmp_path / "scene.json"
        path.write_text(json.dumps({"mobile": {"radius": 0.1}, "goal": {"point": [1, 0]}} | values))
        return path

    return write


# --- what is told ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rod", "generic"])
def test_scenes_of_the_paper_are_reached_and_the_answer_says_how(root, typed, name):
    said = typed(name)
    toml_scene = load_scene(root / f"robots/scenes/{name}.toml")
    lines = said.splitlines()
    assert lines[0].startswith(f"{name}: ")
    assert all(obstacle.name in said for obstacle in toml_scene.obstacles)
    assert f"reached: {toml_scene.node} is at its goal" in lines
    numbers = {words[0]: words[1:] for words in (line.split() for line in lines if line.startswith("  ")) if words}
    assert float(numbers["clearance"][0]) >= toml_scene.safety
    assert f"{toml_scene.safety:g} m required" in said
    assert int(numbers["steps"][0]) > 0
    assert "strategy" in said
    assert "no contact on this path: proved where shapes are more than" in " ".join(said.split())
    assert max(map(len, lines)) <= 100


def test_paths_of_robots_with_loops_are_not_called_proved(root, typed, text_file):
    """Of closed loops the motion between two configurations is estimated, not bounded."""
    post = {"name": "post", "kind": "box", "size": [0.05, 0.05, 0.3], "point": [0.25, 0.3, -2.3]}
    delta = {"robot": str(root / "robots/delta4.raff"), "goal": {"point": [0.3, 0.0, -1.9]}, "obstacle": [post]}
    said = " ".join(typed(text_file("scene.json", json.dumps(delta))).split())
    assert "reached: platform is at its goal" in said
    assert "no contact on this path, checked every 0.00404 m of motion: an estimate, as loops" in said
    assert "proved" not in said


@pytest.fixture
def repelled(monkeypatch):
    """Every plan follows a repulsive potential, which gets stuck in front of the rod."""
    monkeypatch.setattr(cinegen.planning, "plan", lambda scene, **settings: plan(scene, **settings | {"field": firas}))


@pytest.mark.usefixtures("repelled")
def test_what_repels_gets_stuck_and_it_is_said_where(root, typed):
    """Figure 5; vortices get there in figure 6."""
    said = " ".join(typed("rod", code=1).split())
    assert " from 'rod'" in said
    assert "Try --planner auto: it also samples configurations" in said
    planned = plan(load_scene(root / "robots/scenes/rod.toml"), field=firas)
    words = said.split("stuck: tool at x ")[1]
    x, y = words.split(" m,")[0].split(", y ")
    assert [float(x), float(y)] == pytest.approx(planned.trace[-1][:2], abs=5e-4)
    left = float(words.split(" m, ")[1].split(" m from its goal")[0])
    assert left == pytest.approx(math.dist(planned.trace[-1][:2], (0.6, 0.3)), abs=5e-4)
    mm = " ".join(typed("rod", "--units", "mm", code=1).split())
    assert f"stuck: tool at x {1e3 * float(x):g}, y {1e3 * float(y):g} mm, {1e3 * left:g} mm from its goal" in mm
    document = json.loads(typed("rod", "--json", code=1))
    assert (document["status"], document["field"], len(document["attempts"])) == ("stuck", "firas", 1)


@pytest.mark.parametrize(
    ("x", "status", "advice"),
    [
        (0.0, "start in collision: 'mobile' penetrates 'disc 1' by 0.2 m", "Choose another start"),
        (1.205, "goal in collision: 'mobile' is 0.005 m from 'disc 1', below", "move the goal or the obstacle"),
    ],
)
def test_what_can_not_be_is_said_at_once_with_what_to_do(typed, scene, x, status, advice):
    said = typed(scene(obstacle=[{**DISC, "point": [x, 0.0]}]), code=1)
    assert status in said
    assert advice in said
    assert "attempt" not in said


# --- JSON --------------------------------------------------------------------------------------------------------


def test_json_holds_a_way_from_the_start_to_the_goal(root, typed):
    said = json.loads(typed("rod", "--json"))
    toml_scene = load_scene(root / "robots/scenes/rod.toml")
    mechanism = toml_scene.mechanism
    assert (said["scene"], said["status"], said["planner"]) == ("rod", "reached", "auto")
    path = [mechanism.configuration(values) for values in said["path"]]
    assert set(said["path"][0]) == set(mechanism.joints)
    assert (path[0] == toml_scene.start).all()
    end = mechanism.placement(path[-1], toml_scene.node).translation
    goal = toml_scene.goal.translation[: toml_scene.translation]
    assert end[: toml_scene.translation] == pytest.approx(goal, abs=2e-4 * mechanism.length)
    assert said["trace"][-1] == pytest.approx(end)
    assert len(said["clearances"]) == len(path) == said["attempts"][-1]["steps"] + 1
    assert min(said["clearances"]) >= said["clearance"] >= said["safety"] == toml_scene.safety
    assert said["length"] >= math.dist(said["trace"][0], said["trace"][-1])
    steps = np.linalg.norm(np.diff(said["trace"], axis=0), axis=1).sum()
    assert said["length"] == pytest.approx(steps, rel=0.02)
    assert [attempt["status"] for attempt in said["attempts"]][-1] == "reached"


def test_json_is_json_where_there_is_no_way_and_nothing_to_meet(typed, scene):
    said = json.loads(typed(scene(), "--json"), parse_constant=pytest.fail)
    assert said["clearance"] is None
    assert set(said["clearances"]) == {None}
    said = json.loads(typed(scene(obstacle=[DISC]), "--json", code=1))
    assert (said["status"], said["attempts"]) == ("start in collision", [])
    assert said["path"] == [{"x": 0.0, "y": 0.0}]


# --- recordings -------------------------------------------------------------------------------------------------


def test_a_way_is_recorded_for_replay_and_export(typed, printed, tmp_path):
    path = tmp_path / "way.jsonl"
    said = json.loads(typed("rod", "--json", "-o", path))
    recording = Recording.load(path)
    (robot,) = recording.robots
    mechanism = recording.mechanism(robot)
    expected = np.array([mechanism.configuration(values) for values in said["path"]])
    assert recording.q[robot][[0, -1]] == pytest.approx(expected[[0, -1]], abs=1e-9)
    assert "checked: joints within their limits" in printed("export", path, "--to", "csv")
    rows = np.loadtxt(tmp_path / "way.csv", delimiter=",", skiprows=1)
    assert rows[-1, 1:] == pytest.approx(expected[-1], abs=1e-9)


@pytest.mark.usefixtures("repelled")
def test_a_way_that_ends_early_is_recorded_as_far_as_it_came_and_none_is_not(typed, scene, tmp_path):
    path = tmp_path / "way.jsonl"
    assert "up to where the path ends" in typed("rod", "-o", path, code=1)
    assert len(Recording.load(path).times) > 2
    none = tmp_path / "none.jsonl"
    said = typed(scene(obstacle=[DISC]), "-o", none, code=1)
    assert f"there is no path: {none} is not written" in said
    assert not none.exists()


@pytest.mark.usefixtures("session_in_a_thread", "repelled")
def test_the_page_of_what_got_stuck_leaves_the_exit_code(typed, tmp_path):
    options = ["--view", "--seconds", "0.2", "--no-browser"]
    assert "page: http://127.0.0.1:" in typed("rod", *options, code=1)
    assert not list(tmp_path.iterdir())


def test_a_recording_replaces_no_other_before_it_is_complete(typed, text_file, monkeypatch):
    def fail(_):
        raise MissionError("the motion fails")

    path = text_file("out.jsonl", "old")
    monkeypatch.setattr("cinegen.mission.results.timed_path", fail)
    assert "the motion fails" in typed("rod", "-o", path, "--force", code=1)
    assert path.read_text() == "old"


# --- to another assembly mode ----------------------------------------------------------------------------------------


def test_a_path_through_a_singularity_is_reported(typed):
    text = " ".join(typed("cusp", "--modes", 2, "--singular", "cross", "--timeout", 4).split())
    assert "to assembly mode 2 with the start's values of the actuated joints" in text
    assert "reached: assembly mode 2 of 6, through" in text
    assert re.search(r"singular after step \d+: sigma [-.e\d]+ of type 2", text)
    assert "1 time limit 0 RRT-Connect, around singularities 2 reached" in text
    assert "the actuated joints lose control: only momentum or gravity" in text


def test_no_path_is_no_proof(typed):
    text = " ".join(typed("cusp", "--modes", 2, "--timeout", 0.5, code=1).split())
    assert "time limit: no path was found in 0.5 s, which is no proof that there is none" in text
    assert "Try --timeout 3, or --singular cross." in text


@pytest.mark.parametrize("shape", [coal.Cone(0.2, 1.0), coal.Ellipsoid(0.2, 0.2, 0.5)], ids=["known", "unknown"])
def test_a_kind_of_obstacle_that_is_added_is_planned_with_drawn_and_recorded(
    typed, scene, tmp_path, monkeypatch, shape
):
    added = {"added": lambda table, folder: [PlacedShape(pin.SE3.Identity(), shape)]}
    monkeypatch.setattr(obstacle_kinds, "KINDS", {**obstacle_kinds.KINDS, **added})
    path, record = scene(obstacle=[{"kind": "added", "point": [0.5, 0.0]}]), tmp_path / "added.jsonl"
    assert "reached" in typed(path, "-o", record)
    assert Recording.load(record).times.size > 2
    (obstacle,) = scene_setup(load_scene(path)).obstacles.values()
    (drawn,) = obstacle.shapes
    corners = np.reshape(drawn.numbers, (-1, 3))
    assert drawn.shape == "hull"
    assert np.abs(corners[:, 2]).max() == pytest.approx(0.5)
    assert np.abs(corners[:, :2]).max() == pytest.approx(0.2, rel=0.01)
    assert np.isclose(corners[:, 2], 0.5).sum() == (1 if isinstance(shape, coal.Cone) else 4)
    assert draw_plan(plan(load_scene(path))).axes
