"""Tasks of all kinds in a session: they come as plain data, hold while parts are dragged, and are undone."""

import json

import bipeds
import numpy as np
import pinocchio as pin
import pytest
import two_armed
from leading import run

import cinegen
from cinegen.collision import load_scene
from cinegen.ik import State
from cinegen.ik.tasks.kinds import KINDS
from cinegen.mission import BasePose, Recording
from cinegen.session import CommandError, Session, arrange, decode_command, scene_setup
from cinegen.session import commands as c
from cinegen.session.other_robots import OtherRobots

HANDS = {"kind": "relative_pose", "node": "left_hand", "other": "right_hand"}
UPRIGHT = {"kind": "axis_along", "node": "left_hand", "axis": None}
OF_EACH_KIND = [
    HANDS,
    {"kind": "center_of_mass", "position": [0.3, 0.01, 0.9], "axes": "xy"},
    {"kind": "look_at", "node": "left_hand", "point": [1.5, 0.0, 0.5], "axis": [1, 0, 0]},
    UPRIGHT,
    {"kind": "point_on_line", "node": "left_hand", "through": [0.8, 0, 0.9], "direction": [0, 1, 0]},
    {"kind": "point_in_plane", "node": "left_hand", "through": [0, 0, 0.8]},
    {"kind": "point_at_distance", "node": "left_hand", "centre": [0, 0, 0], "distance": 0.4, "on": "right_hand"},
    {"kind": "joint_values", "values": {"to_waist": 0.2}},
    {"kind": "joint_equality", "coefficients": {"to_left4": 1, "to_right4": -1}, "constant": 0.1},
    {"kind": "damping"},
    {"kind": "range", "task": UPRIGHT, "radius": 0.1},
]


@pytest.fixture
def two(closing):
    """Return a session of a robot with two arms, of the given name and base pose."""

    def session(bases=None, **options):
        return closing(Session(arrange({"duo": cinegen.load(two_armed.URDF)}, bases, **options)))

    return session


def add(session, description, robot="duo"):
    """Add a task as a message does, and return what the session has of it."""
    message = json.dumps({"type": "add_task", "robot": robot, "description": description})
    session.obey(decode_command(message, session.setup))
    described = session.state().robots[robot].described
    return described[-1] if described else None


def seen(session):
    robot = session.robots["duo"]
    return State(robot.mechanism, robot.q, 0.01)


def drag_around(session, node, goals):
    """Drag a node through goals (m) relative to where it is, and yield after each tick."""
    start = session.robots["duo"].placement(node).translation
    session.obey(c.StartDrag("duo", node))
    for goal in goals:
        session.obey(c.MoveDrag(tuple(start + goal)))
        for _ in range(300):
            session.tick()
            yield
    session.obey(c.EndDrag())


def test_every_kind_is_one_of_messages_and_is_reached(two):
    assert {kind.__name__.lower() for kind in KINDS} <= {message["kind"].replace("_", "") for message in OF_EACH_KIND}
    for description in OF_EACH_KIND:
        session = two()
        before = session.robots["duo"].q
        task = add(session, description)
        state = run(session, 1.5).robots["duo"].described
        assert [entry.id for entry in state] == [task.id]
        assert state[0].reached, state
        assert max(state[0].error) < 1e-6
        stays = description["kind"] in ("relative_pose", "axis_along", "damping", "range")
        assert np.allclose(session.robots["duo"].q, before, atol=1e-9) == stays
        session.obey(c.RemoveTask(task.id))
        assert not session.state().robots["duo"].described


def test_hands_that_are_pinned_together_stay_so_while_one_is_dragged_anywhere(two):
    session, goals = two(), np.random.default_rng(0).uniform(-0.6, 0.6, (3, 3))
    add(session, HANDS)
    before = seen(session).frame("left_hand", "right_hand")
    for _ in drag_around(session, "left_hand", goals):
        error = pin.log6(before.actInv(seen(session).frame("left_hand", "right_hand"))).vector
        assert np.abs(error).max() <= 1e-6
    assert not np.allclose(session.robots["duo"].q, session.robots["duo"].home)


def test_a_biped_that_is_dragged_keeps_its_feet(closing):
    session = closing(Session(arrange({"duo": cinegen.load(bipeds.URDF)})))
    add(session, {"kind": "relative_pose", "node": "left_foot", "other": "right_foot"})
    session.obey(c.Pin("duo", "right_foot"))
    session.obey(c.ChangeTask(session.state().robots["duo"].tasks[0].id, priority=0))
    feet = [session.robots["duo"].placement(foot) for foot in bipeds.FEET]
    for _ in drag_around(session, "trunk", [np.array([0.3, 0.05, -0.2])]):
        pass
    assert np.linalg.norm(session.robots["duo"].placement("trunk").translation - [0, 0, bipeds.HEIGHT]) > 0.2
    for foot, before in zip(bipeds.FEET, feet, strict=True):
        assert session.robots["duo"].placement(foot).isApprox(before, 1e-6)
    refused = add(session, {"kind": "center_of_mass", "position": [0, 0, 0.5]})
    assert refused.description.__struct_config__.tag == "relative_pose"  # still the only one
    assert "biped has no masses" in session.state().notices[-1].text


def test_points_and_directions_are_those_of_the_sessions_world(two):
    base = pin.SE3(pin.exp3(np.array([0.2, 0.3, 1.5])), np.array([1.0, 2.0, 0.3]))
    session = two({"duo": BasePose(placement=base)})
    robot = session.robots["duo"]
    add(session, {"kind": "look_at", "node": "left_hand", "point": [3.0, 2.0, 1.0], "axis": [1, 0, 0]})
    add(session, {"kind": "point_in_plane", "node": "right_hand", "through": [0, 0, 1.2]})
    run(session, 2.0)
    hand = robot.placement("left_hand")
    away = np.array([3.0, 2.0, 1.0]) - hand.translation
    assert hand.rotation[:, 0] == pytest.approx(away / np.linalg.norm(away), abs=1e-6)
    assert robot.placement("right_hand").translation[2] == pytest.approx(1.2, abs=1e-6)
    robot.set_base(pin.SE3(pin.exp3(np.array([0.0, 0.1, 1.2])), np.array([1.0, 2.1, 0.4])))
    run(session, 2.0)
    assert robot.placement("right_hand").translation[2] == pytest.approx(1.2, abs=1e-6)


def test_a_task_is_changed_and_each_change_is_undone_and_redone(two):
    session = two()
    task = add(session, {"kind": "point_in_plane", "node": "left_hand", "through": [0, 0, 0.8]})
    run(session, 0.5)
    command = {"type": "change_task", "task": task.id, "weight": 2, "priority": 3}
    session.obey(decode_command(json.dumps(command), session.setup))
    description = {"kind": "point_in_plane", "node": "left_hand", "through": [0, 0, 0.9]}
    run(session, 0.5, decode_command(json.dumps(command | {"description": description}), session.setup))

    def now():
        state = run(session, 3.0).robots["duo"]
        values = [(entry.id, entry.description.weight, entry.description.through[2]) for entry in state.described]
        return values, session.robots["duo"].placement("left_hand").translation[2]

    after = now()
    assert after == ([(task.id, 2.0, 0.9)], pytest.approx(0.9, abs=1e-6))
    steps = session.state().undo
    states = []
    for command in (c.Undo(), c.Redo()):
        for _ in range(steps):
            session.obey(command)
            states.append(now())
    assert states[steps - 1] == ([], pytest.approx(two().robots["duo"].placement("left_hand").translation[2], abs=1e-6))
    assert ([(task.id, 1.0, 0.8)], pytest.approx(0.8, abs=1e-3)) in states
    assert states[-1] == after


def test_tasks_wait_during_motions_and_are_undone_with_home(two):
    session = two()
    add(session, {"kind": "joint_equality", "coefficients": {"to_left4": 1, "to_right4": 1}})
    run(session, 1.0, c.MoveJoint("duo", "to_left4", 0.7), c.EndJointMotion())
    robot = session.robots["duo"]
    left, right = (robot.q[robot.mechanism.q_index(f"to_{side}4")] for side in ("left", "right"))
    assert left == pytest.approx(-right, abs=1e-6)
    assert run(session, 3.0, c.MoveHome("duo")).robots["duo"].described == ()
    assert np.allclose(robot.q, robot.home)
    assert len(run(session, 3.0, c.Undo()).robots["duo"].described) == 1


def test_tasks_survive_the_reload_of_a_file_as_far_as_their_parts_do(two):
    session = two()
    add(session, HANDS)
    add(session, UPRIGHT)
    before = session.state().robots["duo"].described
    other = cinegen.load(session.robots["duo"].mechanism.source.urdf.replace("right_hand", "claw"))
    session.exchange(OtherRobots.of(arrange({"duo": other}), 1))
    assert [entry.id for entry in session.state().robots["duo"].described] == [before[1].id]
    assert "right_hand" in session.state().notices[-1].text
    assert "relative_pose has ended" in session.state().notices[-1].text


def test_a_robot_among_obstacles_follows_tasks_and_takes_no_ranges(root, closing):
    session = closing(Session(scene_setup(load_scene(root / "robots/scenes/rod.toml"))))
    (name,) = session.robots
    folded = {"kind": "joint_equality", "coefficients": {"joint2": 1, "joint3": -1}}
    add(session, folded, name)
    (task,) = run(session, 3.0, c.StartDrag(name, "tool"), c.MoveDrag((0.55, -0.2, 0.0))).robots[name].described
    q = session.robots[name].q
    assert task.reached
    assert q[1] == pytest.approx(q[2], abs=1e-6)
    assert len(session.state().robots[name].tasks) == 1
    add(session, {"kind": "range", "task": folded, "low": 0.0}, name)
    assert "may have to brake beyond a range" in session.state().notices[-1].text
    assert len(session.state().robots[name].described) == 1


@pytest.mark.parametrize(
    ("description", "why"),
    [
        ({"kind": "juggle"}, "Invalid value 'juggle' - at `$.description.kind`"),
        ({"kind": "look_at", "node": "nose", "point": [0, 0, 0]}, "Unknown node 'nose' - at `$.description.node`"),
        ({"kind": "range", "task": {**HANDS, "other": "nose"}, "high": 1}, "'nose' - at `$.description.task.other`"),
        ({**HANDS, "target": [0, 0, 0, 0, 0, 0, 0]}, "quaternion x y z w of length 1 - at `$.description`"),
        ({"kind": "joint_values", "values": {"knee": 1}}, "Unknown joint 'knee' - at `$.description.values`"),
        ({**UPRIGHT, "weight": 0}, ">= 0.01 - at `$.description.weight`"),
        ({**UPRIGHT, "direction": [0, 0, 0]}, "AxisAlong.direction must be three finite numbers that are not all 0"),
        ({"kind": "joint_values", "values": {}}, "JointValues.values must be numbers by the names of joints"),
        ({"kind": "joint_values", "values": {"to_waist": 1}, "unit": "m"}, "give unit=['rad']"),
        ({"kind": "range", "task": HANDS, "low": [1, 2]}, "low and high of a range are one number, or 6"),
        ({"kind": "range", "task": HANDS, "low": [0, 0], "high": [1, 1, 1]}, "must not exceed its high, row by row"),
        ({"kind": "range", "task": HANDS}, "a range has low or high or both, or a radius"),
    ],
)  # fmt: skip
def test_what_is_no_task_is_refused_by_name_and_changes_nothing(two, description, why):
    session = two()
    add(session, UPRIGHT)
    before = session.state()
    try:
        add(session, description)
        reason = session.state().notices[-1].text
    except CommandError as error:
        reason = str(error)
    assert why in reason
    run(session, 0.1)
    assert session.state().robots["duo"].described == before.robots["duo"].described
    assert session.state().undo == 1


def test_a_frame_has_no_description_and_a_kind_no_degrees_of_freedom(two):
    session = two()
    session.obey(c.Pin("duo", "left_hand"))
    described = add(session, UPRIGHT)
    (pinned,) = session.state().robots["duo"].tasks
    session.obey(c.ChangeTask(pinned.id, priority=4))
    assert session.state().robots["duo"].tasks[0].priority == 4
    session.obey(c.ChangeTask(pinned.id, description=described.description))
    assert f"task {pinned.id} is a frame" in session.state().notices[-1].text
    session.obey(c.ChangeTask(described.id, rotation=2))
    assert "axis_along has no rotation to change" in session.state().notices[-1].text


def test_a_recording_keeps_tasks_and_their_changes(two, tmp_path):
    session = two(record=str(tmp_path / "mission.jsonl"))
    run(session, 0.1)
    task = add(session, UPRIGHT)
    run(session, 0.1)
    run(session, 0.1, c.ChangeTask(task.id, weight=3.0))
    run(session, 0.1, c.RemoveTask(task.id))
    session.close()
    described = Recording.load(tmp_path / "mission.jsonl").described["duo"]
    weights = [tuple(entry.weight for entry in each) for each in described]
    assert list(dict.fromkeys(weights)) == [(), (1.0,), (3.0,)]
    assert weights[-1] == ()
    text = (tmp_path / "mission.jsonl").read_text()
    assert text.count('"axis_along"') == 2  # where it changes


def test_a_task_can_be_removed_while_an_undo_removes_it(two):
    session = two()
    task = add(session, {"kind": "point_in_plane", "node": "left_hand", "through": [0, 0, 0.7]})
    run(session, 0.5)
    session.obey(c.Undo())
    session.tick()
    assert session.robots["duo"].motion is not None
    assert run(session, 0.1, c.RemoveTask(task.id)).robots["duo"].described == ()
