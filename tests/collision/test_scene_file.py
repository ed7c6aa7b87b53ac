"""Scenes as files: those of the repository, what is wrong with others, and starts and goals of all robots."""

import copy
import json
import math
from functools import reduce
from operator import getitem

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes_of_tables import refusal, refused
from small_robots import four_bar
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.collision import PlanningError, SceneError, load_scene, scene_of
from cinegen.collision.obstacle_kinds import KINDS
from cinegen.errors import CinegenError

# --- the scenes of the paper's figures ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rod", "generic"])
def test_scenes_of_the_figures_read_back_as_the_same(root, text_file, name):
    path = root / "robots" / "scenes" / f"{name}.toml"
    scene = load_scene(path)
    assert (scene.name, scene.path, scene.folder) == (name, path, path.parent)
    assert (scene.translation, scene.rotation) == (2, 0)
    # as JSON, beside the robots
    text_file("planar_3r.raff", (root / "robots" / "planar_3r.raff").read_text())
    again = load_scene(text_file(f"scenes/{name}.json", json.dumps(scene.document())))
    assert (again.start == scene.start).all()
    assert again.goal.isApprox(scene.goal, 1e-15)  # the rounding of what turns are written as
    for a, b in zip(again.obstacles, scene.obstacles, strict=True):
        assert (a.name, a.written) == (b.name, b.written)
        assert a.placement.isApprox(b.placement, 1e-15)
    said = [{k: v for k, v in loaded.document().items() if k != "obstacle"} for loaded in (scene, again)]
    assert said[0] == said[1]


# --- files that are wrong -------------------------------------------------------------------------------------------

GOOD = """mobile = { radius = 0.1 }
[goal]
point = [1.0, 2.0]
[[obstacle]]
name = "post"
kind = "disc"
radius = 0.2
point = [0.5, 0.5]
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("radius = 0.2", "radius = 0.0", ": obstacle 1 'post': radius must be above 0, not 0.0"),
        ("radius = 0.2", "radius = ", ":7:10: invalid TOML: Invalid value"),
        ("[goal]\npoint = [1.0, 2.0]\n", "", ": goal is missing"),
        ("[goal]\n", "[goal]\npiont = 1\n", ": goal: unknown key 'piont': did you mean 'point'?"),
        ("mobile = { radius = 0.1 }", "", ": robot is missing"),
        ("mobile =", "safety = -0.1\nmobile =", ": safety must not be below 0"),
        ("mobile =", "node = 'hand'\nmobile =", ": node 'hand' is not a node of mobile (known: ground, rail, mobile)"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_with_its_place(text_file, old, new, said):
    assert load_scene(text_file("shelf.toml", GOOD)).obstacles[0].name == "post"
    assert old in GOOD
    path = text_file("shelf.toml", GOOD.replace(old, new))
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert str(error.value).startswith(f"{path}{said}")


BALL = {"kind": "sphere", "radius": 1}
BAR = {"name": "bar", "kind": "box", "size": [0.05, 0.05, 0.4], "node": "tool"}

# a robot, values of a scene, and what is said of them; without a robot, obstacles of a mobile
SENSELESS = [
    (None, [{"kind": "sphere", "radius": math.nan}], "radius must be finite, not nan"),
    (None, [{"kind": "sphere", "radius": 1e7}], "radius is 1e+07: the largest value is 1e+06"),
    (None, [{"kind": "sphere", "radius": 1e-9}], "radius is 1e-09 m: the least size"),
    (None, [{"kind": "sphere", "radius": "0.1 pc"}], "radius is wrong: '0.1 pc': unknown unit 'pc'"),
    (None, [{"kind": "sphere", "raduis": 1.0}], "radius is missing: is 'raduis' misspelled?"),
    (None, [{"kind": "disc", "radius": 1, "hieght": 2}], "unknown key 'hieght': did you mean 'height'?"),
    (None, [{"kind": "spheer", "radius": 1}], "kind 'spheer' is unknown: did you mean 'sphere'?"),
    (None, [{"kind": "box", "size": [1]}], "size must be a list of 2 or 3 numbers"),
    (None, [{"kind": "capsule", "radius": 1, "ends": [[0, 0], [0, 0, 0]]}], "ends coincide: for a sphere, write kind"),
    (None, [{"kind": "half_plane", "normal": [0, 0]}], "normal must be a direction: [0.0, 0.0] has length 0"),

    (None, [BALL | {"name": "a"}, BALL | {"name": "a"}], "obstacle 2 'a': name 'a' is used by another"),
    (None, [BALL | {"name": "sphere 2"}, BALL], "name 'sphere 2' is used by another"),
    (None, [{"kind": "polygon", "points": [[0, 0], [1, 0]]}], "must be at least 3, not 2"),
    (None, [{"kind": "polygon", "points": [[0, 0], [1, 1], [1, 0], [0, 1]]}],
     "cross or touch each other: the side from point 1 meets the side from"),
    (None, [{"kind": "polygon", "points": [[0, 0], [1, 0], [2, 0]]}], "enclose no area"),
    (None, [{"kind": "polygon", "points": [[0, 0], [1, 0], [1, 0], [0, 1]]}], "repeat [1.0, 0.0] (points 2 and 3)"),
    (None, [{"kind": "polygon", "points": 7}], "must be a list of points, not 7"),
    (None, [{"kind": "polygon", "points": np.zeros((2002, 2))}], "are 2001: the largest number is 2000"),
    ("arm7", {"allowed_collisions": [["tool", "lnk5"]]}, "'lnk5' is not a node of arm: did you mean 'link5'?"),
    ("arm7", {"allowed_collisions": [["tool", "tool"]]}, "names 'tool' twice"),
    ("arm7", {"allowed_collisions": ["tool", "link5"]}, "list of pairs of names"),
    ("arm7", {"weights": {"elbow": 1.0}}, "weights: 'elbow' is not a joint of"),
    ("arm7", {"weights": {"joint2": 0.0}}, "weights: joint2 must be a weight from 0.01 to 100, not 0"),
    ("arm7", {"weights": {"joint2": "heavy"}}, "joint2 must be a number"),
    ("arm7", {"goal": {"joints": {"joint9": 0.0}}}, "'joint9' is not a joint"),
    ("arm7", {"goal": {"joints": {"joint4": 2.5}}}, "its limits are"),
    ("arm7", {"goal": {"joints": {"joint1": 0.1}}, "locked": ["joint1"]}, "also a joint of the goal"),
    ("arm7", {"goal": {"joints": {"joint1": 0.1}}, "locked": ["jiont1"]}, "did you mean 'joint1'"),
    ("planar_3r", {"start": {"joints": {"joint9": 1.0}}},
     "scene: start: joints: 'joint9' is not a joint of arm: did you mean"),
    ("planar_3r", {"start": {"joints": {"joint1": "up"}}},
     "start: joints: joint1 is wrong: 'up' is not an angle: write a number"),

    ("planar_3r", {"start": {"joints": {"joint1": 3.0}}},
     "scene: start: joints 'joint1' is at 171.887 deg, its limits are -170 deg and 170 deg"),
    ("planar_3r", {"start": {"joint": {}}}, "start: unknown key 'joint'"),
    ("planar_3r", {"goal": {"point": [0, 0], "angle": 1, "rpy": [0, 0, 0]}}, "goal: angle cannot be combined with rpy"),
    ("planar_3r", {"goal": {"angle": 1}}, "goal: point is missing"),
    ("planar_3r", {"goal": {"point": [0]}}, "goal: point must be a list of 2 or 3 numbers"),
    ("arm7", {"path": {"line": [0, 0, 1], "plane": [0, 0, 1]}}, "cannot be combined"),
    ("arm7", {"path": {"lien": [0, 0, 1]}}, "did you mean 'line'"),
    ("arm7", {"goal": {"point": [0.4, 0, 0.4], "tolerance": [0.1, -0.1, 0]}}, "tolerance must not be below 0"),
    ("arm7", {"goal": {"point": [0.4, 0, 0.4], "cone": 0.1}}, "cone needs rpy"),
    ("arm7", {"goal": {"point": [0.4, 0, 0.4], "rpy": [0, 0, 0], "cone": 4.0}}, "0 to 180 deg"),
    ("arm7", {"attached": [BAR | {"node": "hand"}]}, "attached 1 'bar': node 'hand' is not a node of"),
    ("arm7", {"attached": [BAR | {"touches": ["finger"]}]}, "touches 'finger' is not a node of"),
    ("arm7", {"attached": [BAR | {"name": "link2"}]}, "name 'link2' is used by another object or node"),
    ("arm7", {"attached": [{"kind": "half_space", "normal": [0, 0, 1], "node": "tool"}]},
     "'half_space' is unbounded: it can't be attached"),
    ("arm7", {"attached": [BAR | {"weight": 3}]}, "unknown key 'weight'"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "values", "said"), SENSELESS, ids=[row[2] for row in SENSELESS])
def test_what_makes_no_sense_is_refused_by_its_key(robot, name, values, said):
    if name:
        document = {"goal": {"point": [0.4, 0.3, 0.4]}} | values
    else:
        document = {"mobile": {"radius": 0.0}, "goal": {"point": [1.0, 0.0]}, "obstacle": values}
    words = refusal(document, mechanism=robot(name) if name else None)
    assert words.startswith("scene: ")
    assert said in words


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("shelf.json", b'{"goal": ', "shelf.json:1:10: invalid JSON"),
        ("shelf.json", b'{"goal": {"point": [0, 0]},\n "goal": {}}', "invalid JSON: key 'goal' occurs twice"),
        ("shelf.json", b"[" * 100_000, "invalid JSON"),
        ("gone.toml", None, "can't be read"),
        ("gone/x.toml", None, "can't be read"),
        ("scene.txt", b"", "a scene is a .toml or a .json file"),
        ("latin.toml", b"name = '\xe4'", "this is not text in utf-8"),
    ],
)
def test_what_is_no_scene_is_said(tmp_path, name, content, said):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError) as error:
        load_scene(path)
    assert str(error.value).startswith(str(path))
    assert said in str(error.value)
    assert issubclass(SceneError, PlanningError)
    assert issubclass(PlanningError, CinegenError)


def test_a_robot_that_is_shipped_is_found_by_its_name_from_any_folder(tmp_path, monkeypatch, robot):
    monkeypatch.chdir(tmp_path)
    scene = tmp_path / "scene.toml"
    other = "[[obstacle]]\nkind = 'robot'\nfile = 'five_bar'\n"
    scene.write_text(f"robot = 'planar_3r'\ngoal = {{ point = [0.6, 0.3] }}\n{other}")
    loaded = load_scene(scene)
    assert loaded.mechanism.name == robot("planar_3r").name
    assert [obstacle.kind for obstacle in loaded.obstacles] == ["robot"]
    assert "did you mean 'planar_3r'" in refusal({"robot": "planar_3", "goal": {"point": [0, 0]}}, tmp_path)
    (tmp_path / "planar_3r").write_text("mine")  # a file of that name comes first
    with pytest.raises(SceneError, match="a RAFF file begins with"):
        load_scene(scene)


def test_robots_that_are_not_there_or_damaged(tmp_path, root):
    goal = {"goal": {"point": [0, 0]}}
    assert "robot: " not in refusal(goal | {"robot": "gone.raff"}, tmp_path)
    assert "does not exist" in refusal(goal | {"robot": "gone.raff"}, tmp_path)
    stranger = "~nobody-is-called-so/x.raff"
    assert f"robot '{stranger}' can't be read" in refusal(goal | {"robot": stranger})
    (tmp_path / "bad.raff").write_text("RAFF bad\nrobot a { base { } link 1 { type 9 pred 0 } }")
    (tmp_path / "bad.urdf").write_text("<robot><link></robot>")
    (tmp_path / "bad.txt").write_text("hello")
    for name in ("bad.raff", "bad.urdf", "bad.txt"):
        said = refusal(goal | {"robot": name}, tmp_path)
        assert said.startswith("scene: robot can't be loaded: ")
        assert name in said
    robots = root / "robots"
    several = goal | {"robot": {"file": "two_arms.raff", "name": "right"}}
    assert scene_of(several, robots).mechanism.name == "right"
    assert scene_of(several, robots).document()["robot"] == several["robot"]
    several["robot"]["name"] = "middle"
    assert "can't be loaded" in refusal(several, robots)
    assert "robot: unknown key 'nmae'" in refusal(goal | {"robot": {"file": "two_arms.raff", "nmae": "left"}}, robots)
    assert "mobile cannot be combined with a robot" in refused(robot="two_arms.raff")


# --- starts ---------------------------------------------------------------------------------------------------------


def _begins(mechanism, joints=None, **keys):
    start = {} if joints is None else {"start": {"joints": joints}}
    return scene_of({"goal": {"point": [0.0, 0.0, 0.0]}} | start | keys, ".", mechanism)


def test_joints_that_are_not_named_stay_at_home(robot):
    arm = robot("arm7")
    scene = _begins(arm, {"joint3": 0.3})
    expected = arm.q_home.copy()
    expected[arm.q_index("joint3")] = 0.3
    assert (scene.start == expected).all()
    assert not scene.start.flags.writeable
    assert (_begins(arm).start == arm.q_home).all()
    assert (scene.robot, scene.node, scene.safety, scene.influence, scene.up) == (None, arm.end, 0.01, None, None)
    assert scene.bodies is None
    for bound in (arm.model.lowerPositionLimit[0], arm.model.upperPositionLimit[0]):
        assert _begins(arm, {"joint1": float(bound)}).start[0] == bound


@pytest.mark.parametrize("name", ["delta4", "five_bar", "hybrid"])
@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_motors_stand_where_they_are_said_to_and_loops_are_closed(robot, name, seed):
    mechanism = robot(name)
    rng = np.random.default_rng(seed)
    away = rng.uniform(-0.02, 0.02, mechanism.model.nv) * mechanism.scale
    all_values = mechanism.values(mechanism.integrate(mechanism.q_home, away))
    values = {joint: all_values[joint] for joint in mechanism.actuated}
    scene = _begins(mechanism, values)
    for joint, value in values.items():
        assert scene.start[mechanism.q_index(joint)] == value
    assert mechanism.closure(scene.start) < 1e-12
    again = scene_of(scene.document(), ".", mechanism)
    assert np.abs(again.start - scene.start).max() < 1e-12


def test_a_long_way_from_home_keeps_the_way_of_assembling(robot):
    linkage = robot("five_bar")
    home = linkage.q_home
    # Ahead of the motors' way in a hundred small steps, each closed from the one before: what hardware would do.
    motors = {joint: float(home[linkage.q_index(joint)]) + move for joint, move in (("joint1", 0.7), ("joint3", -0.5))}
    q = home.copy()
    for t in np.linspace(0, 1, 101)[1:]:
        for joint, value in motors.items():
            i = linkage.q_index(joint)
            q[i] = home[i] + t * (value - home[i])
        q = linkage.close(q, locked=linkage.actuated)
    assert np.abs(_begins(linkage, motors).start - q).max() < 1e-9


def crank_rocker(crank: float) -> cinegen.Mechanism:
    """A four-bar with a crank of a length (mm)."""
    tool = 'frame 6 { name "tool" parameters { d 220 gamma 40 } pred 2 }'
    return cinegen.load(four_bar(lengths=(crank, 400, 360, 240), words=("actuated 1", "", ""), more=tool))


def test_passive_joints_choose_between_ways_of_assembling():
    linkage = crank_rocker(120.0)
    rng = np.random.default_rng(3)
    tools = set()
    for guess in rng.uniform(-2.5, 2.5, (20, 2)):
        values = {"joint1": 0.8} | dict(zip(("joint2", "joint3"), guess.tolist(), strict=True))
        q = _begins(linkage, values).start
        assert q[linkage.q_index("joint1")] == 0.8
        assert linkage.closure(q) < 1e-12
        tools.add(tuple(linkage.placement(q, "tool").translation.round(6).tolist()))
        # and what a scene there writes comes back to it
        assert np.abs(scene_of(_begins(linkage, values).document(), ".", linkage).start - q).max() < 1e-12
    # coupler and rocker form a triangle on the line between crank and rocker's pivot, which stands on either side
    assert len(tools) == 2


def test_a_start_that_can_not_be_closed_is_refused():
    linkage = crank_rocker(300.0)
    # At pi the crank's end is 700 mm from the rocker's pivot: coupler and rocker reach 600.
    said = refusal({"goal": {"point": [0, 0]}, "start": {"joints": {"joint1": math.pi}}}, mechanism=linkage)
    assert said.startswith("scene: start: joints do not allow closed loops: bars can't be closed")
    within = math.acos((0.4**2 + 0.3**2 - 0.59**2) / (2 * 0.4 * 0.3))
    assert linkage.closure(_begins(linkage, {"joint1": within}).start) < 1e-12


def test_a_floating_base_may_be_placed(tmp_path):
    joints = [UrdfJoint("float", "world", "body", kind="floating"), UrdfJoint("j", "body", "arm", limit=(-1.0, 1.0))]
    (tmp_path / "free.urdf").write_text(urdf_text(joints))
    start = {"point": [1, 2, 3], "rpy": [0.1, 0.2, 0.3], "joints": {"j": 0.4}}
    scene = scene_of({"robot": "free.urdf", "goal": {"point": [0, 0, 0]}, "start": start}, tmp_path)
    placement = scene.mechanism.placement(scene.start, "body")
    assert placement.isApprox(pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([1.0, 2, 3])), 1e-12)
    again = scene_of(json.loads(json.dumps(scene.document())), tmp_path)
    assert np.abs(again.start - scene.start).max() < 1e-12


# --- goals ----------------------------------------------------------------------------------------------------------


def test_goals_count_what_is_written(robot):
    arm = robot("planar_3r")
    z = arm.placement(arm.q_home, "tool").translation[2]
    for goal, counted, at in [
        ({"point": [0.1, 0.2]}, (2, 0), [0.1, 0.2, z]),
        ({"point": [0.1, 0.2, 0.3]}, (3, 0), [0.1, 0.2, 0.3]),
        ({"point": [0.1, 0.2], "angle": 0.5}, (2, 1), [0.1, 0.2, z]),
        ({"point": [0.1, 0.2, 0.3], "rpy": [0.1, 0.2, 0.3]}, (3, 3), [0.1, 0.2, 0.3]),
    ]:
        scene = scene_of({"goal": goal}, ".", arm)
        assert (scene.translation, scene.rotation) == counted
        assert scene.goal.translation == pytest.approx(at)
        again = scene_of(scene.document(), ".", arm)
        assert again.goal.isApprox(scene.goal, 1e-12)
        assert (again.translation, again.rotation) == counted


@given(st.floats(-3, 3), st.integers(0, 2**32 - 1))
def test_an_angle_is_that_of_the_nodes_x_axis_seen_from_above(robot, angle, seed):
    arm = robot("arm7")
    q = arm.q_home + np.random.default_rng(seed).uniform(-0.5, 0.5, arm.model.nq)
    q = np.clip(q, arm.model.lowerPositionLimit, arm.model.upperPositionLimit)
    start = {joint: float(q[arm.q_index(joint)]) for joint in arm.joints}
    x = arm.placement(q, arm.end).rotation[:, 0]
    if np.linalg.norm(x[:2]) < 1e-3:
        return
    scene = _begins(arm, start, goal={"point": [0.1, 0.2, 0.3], "angle": angle})
    rotation = scene.goal.rotation
    assert math.atan2(rotation[1, 0], rotation[0, 0]) == pytest.approx(math.remainder(angle, 2 * math.pi), abs=1e-9)
    # turned about the vertical only: every axis rises as it did
    assert rotation[2] == pytest.approx(arm.placement(q, arm.end).rotation[2], abs=1e-12)
    again = scene_of(scene.document(), ".", arm)
    assert again.goal.isApprox(scene.goal, 1e-9)


# --- scene garbage ----------------------------------------------------------------------------------------------------
# Whatever stands in a scene: it is read, or refused with a SceneError that names a place.


FULL = {
    **{"name": "all", "robot": "planar_3r.raff", "node": "tool", "safety": 0.02, "influence": 0.3, "up": [0, 0, 1]},
    "start": {"joints": {"joint1": 0.1, "joint2": 0.2}},
    "goal": {"point": [0.5, 0.2], "angle": 0.1},
    "obstacle": [
        {"kind": "sphere", "name": "a", "radius": 0.1, "point": [2, 2, 0]},
        {"kind": "box", "size": [0.1, 0.2, 0.3], "rpy": [0.1, 0.2, 0.3]},
        {"kind": "capsule", "radius": 0.1, "ends": [[0, 0], [1, 1]]},
        {"kind": "half_plane", "normal": [1, 0]},
        {"kind": "disc", "radius": 0.1, "height": 1, "angle": 1},
        {"kind": "polygon", "points": [[0, 0], [1, 0], [0, 1]]},
        {"kind": "mesh", "file": "box.stl", "scale": 0.1, "convex": "hull"},
    ],
}

known = st.sampled_from([*KINDS, "tool", "joint1", [], {}, [0, 0], [[0, 0], [1, 0], [0, 1]]])
keys = st.sampled_from([*FULL, "kind", "x"])
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4) | known,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=3),
    max_leaves=6,
)


def _places(value, path=()):
    """The path of each value in a document."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from _places(inner, (*path, key))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the mesh lies."""
    made = tmp_path_factory.mktemp("scenes")
    trimesh.creation.box((1, 1, 1)).export(made / "box.stl")
    return made


PLACES = list(_places(FULL))


def _put(path, value):
    """The document with a value at a path."""
    if not path:
        return value
    values = copy.deepcopy(FULL)
    reduce(getitem, path[:-1], values)[path[-1]] = value
    return values


@settings(max_examples=500)
@given(st.sampled_from(PLACES), json_values)
def test_any_value_anywhere_is_read_or_refused(robot, folder, path, value):
    values = _put(path, value)
    try:
        scene = scene_of(values, folder, robot("planar_3r"))
    except SceneError as refusal:
        said = str(refusal)
        assert said.startswith("scene"), said
        assert path == () or any(str(key) in said for key in path if isinstance(key, str)), said
        return
    # what is read is read the same again
    again = scene_of(json.loads(json.dumps(scene.document(), allow_nan=False)), folder, robot("planar_3r"))
    assert again.start.tolist() == scene.start.tolist()
    assert len(again.obstacles) == len(scene.obstacles)
