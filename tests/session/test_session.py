"""A session as people at it meet it: taking, leading, pinning, undoing, motors, home, sensors, robots on robots."""

import re
from dataclasses import replace
from types import SimpleNamespace

import bipeds
import numpy as np
import pinocchio as pin
import pytest
from leading import run

import cinegen
from cinegen.devices import Reading, ReadingRecorder
from cinegen.mission import BasePose
from cinegen.session import Session, Setup, arrange, replay_setup
from cinegen.session import commands as c


def at(session, name, node, point=(0.0, 0.0, 0.0)):
    """Where a point of a node is in the world."""
    return session.robots[name].placement(node).act(np.array(point))


def test_out_of_reach_is_said_with_how_far(session):
    """Links of 400, 300 and 200 mm reach 0.9 m when stretched towards a target at 50 m."""
    live_session = session("planar_3r")
    end = live_session.setup.robots["planar_3r"].end
    state = run(live_session, 3.0, c.StartDrag("planar_3r", end, (0, 0, 0)), c.MoveDrag((50.0, 0.0, 0.0)))
    status = state.robots["planar_3r"].status
    assert status.name == "OUT_OF_REACH"
    assert status.description == cinegen.Status.OUT_OF_REACH.value
    number = re.fullmatch(r"out of reach by (\S+) mm", status.label)
    assert number, status.label
    assert float(number[1]) == pytest.approx(49_100.0, rel=1e-3)
    assert at(live_session, "planar_3r", end) == pytest.approx([0.9, 0.0, 0.0], abs=1e-5)
    status = run(live_session, 3.0, c.MoveDrag((0.9002, 0.0, 0.0))).robots["planar_3r"].status
    assert status.label == "out of reach by 0.2 mm"


def test_what_is_let_go_as_a_pin_stays_held_and_what_was_pinned_is_pinned_again_where_it_was_led(session):
    live_session = session("delta4")
    begin = at(live_session, "delta4", "platform")
    aside = c.MoveDrag(tuple(begin + np.array([0.1, 0, 0])))
    state = run(live_session, 0.5, c.StartDrag("delta4", "platform", (0, 0, 0)), aside, c.EndDrag(True))
    assert [task.source for task in state.robots["delta4"].tasks] == ["pin"]
    down = c.MoveDrag(tuple(begin + np.array([0, 0, -0.2])))
    state = run(live_session, 0.5, c.StartDrag("delta4", "platform", (0, 0, 0)), down)
    assert [task.source for task in state.robots["delta4"].tasks] == ["pointer"]
    state = run(live_session, 0.5, c.EndDrag())
    (task,) = state.robots["delta4"].tasks
    assert task.source == "pin"
    assert np.linalg.norm(task.target.translation - begin - [0, 0, -0.2]) < 1e-6
    assert run(live_session, 0.01, c.RemoveTask(task.id)).robots["delta4"].tasks == ()


def test_undo_goes_the_way_back_and_redo_goes_it_again(session):
    name = "delta4"
    live_session = session(name)
    home = live_session.state().robots[name].q
    end = live_session.setup.robots[name].end
    begin = at(live_session, name, end)
    length = live_session.setup.robots[name].length
    run(live_session, 1.5, c.StartDrag(name, end, (0, 0, 0)), c.MoveDrag(tuple(begin + 0.05 * length * np.ones(3))))
    at_goal = run(live_session, 0.02, c.EndDrag(True))
    assert at_goal.undo == 1
    q = at_goal.robots[name].q
    assert np.abs(q - home).max() > 1e-3
    state = run(live_session, 2.0, c.Undo())
    assert np.abs(state.robots[name].q - home).max() < 1e-9
    assert (state.undo, state.redo, state.robots[name].tasks) == (0, 1, ())
    state = run(live_session, 2.0, c.Redo())
    assert np.abs(state.robots[name].q - q).max() < 1e-6
    assert [task.source for task in state.robots[name].tasks] == ["pin"]
    assert (state.undo, state.redo) == (1, 0)
    assert state.robots[name].closure < 1e-10


def test_undo_takes_back_a_drag_in_progress(session):
    live = session("planar_3r")
    home, begin = live.state().robots["planar_3r"].q, at(live, "planar_3r", "tool")
    run(live, 1.0, c.StartDrag("planar_3r", "tool", (0, 0, 0)), c.MoveDrag(tuple(begin - [0.2, 0.0, 0.0])))
    state = run(live, 2.0, c.Undo())
    assert np.abs(state.robots["planar_3r"].q - home).max() < 1e-9
    assert (state.undo, state.redo) == (0, 1)


def test_a_motor_goes_where_its_slider_says_and_loops_stay_closed(session):
    name = "gough"
    live_session = session(name)
    mechanism = live_session.setup.robots[name]
    joint = mechanism.actuated[0]
    i = mechanism.q_index(joint)
    goal = mechanism.q_home[i] + 0.05
    state = run(live_session, 1.0, c.MoveJoint(name, joint, goal))
    assert state.robots[name].q[i] == goal
    assert state.robots[name].closure < 1e-10
    assert state.moving == "joints"
    others = [mechanism.q_index(other) for other in mechanism.actuated[1:]]
    assert np.array_equal(state.robots[name].q[others], mechanism.q_home[others])
    assert run(live_session, 0.1, c.EndJointMotion()).moving is None


def test_a_switch_ties_a_sensor_to_a_node_and_the_hand_borrows_it(session):
    live = session("delta4")
    state = run(live, 0.2, c.SelectSensor("delta4", "platform", "gamepad"))
    assert [(task.source, task.label) for task in state.robots["delta4"].tasks] == [("sensor", "sensor gamepad")]
    begin = at(live, "delta4", "platform")
    for _ in range(20):
        state = run(live, 0.01, c.GamepadInput((0, 0, -1, 0, 0, 0), frozenset()))
    moved = at(live, "delta4", "platform") - begin
    assert moved[2] < -0.5 * 0.2 * state.settings.linear_speed
    assert np.abs(moved[:2]).max() < 1e-6
    state = run(live, 0.1, c.StartDrag("delta4", "platform", (0, 0, 0)))
    assert [task.source for task in state.robots["delta4"].tasks] == ["pointer"]
    state = run(live, 0.1, c.EndDrag())
    assert [task.source for task in state.robots["delta4"].tasks] == ["sensor"]
    state = run(live, 0.1, c.StartDrag("delta4", "platform", (0, 0, 0)), c.EndDrag(True))  # a pin takes its place
    assert [task.source for task in state.robots["delta4"].tasks] == ["pin"]
    assert state.switches["delta4", "platform"] is None
    state = run(live, 0.1, c.SelectSensor("delta4", "platform", "gamepad"), c.SelectSensor("delta4", "platform", None))
    assert [task.source for task in state.robots["delta4"].tasks] == ["pin"]


@pytest.mark.parametrize(
    ("frame", "way"), [("world", [0, 1, 0]), ("base", [-1, 0, 0]), ("view", [-1, 0, 0]), ("tool", None)]
)
def test_a_sensor_moves_along_the_frame_of_command(robot, closing, frame, way):
    """A push away from oneself: the robot stands turned by a quarter about z, and is looked at along the world's -x."""
    turned = BasePose(placement=pin.SE3(pin.rpy.rpyToMatrix(0, 0, np.pi / 2), np.array([1.0, 0.0, 0.0])))
    setup = arrange({"arm": robot("rx90")})
    session = closing(Session(Setup(setup.robots, {"arm": turned}, setup.devices, setup.switches)))
    eye = (0.5, 0.5, 0.5, 0.5)  # x to the right is the world's y, y up its z, z towards the viewer its x
    seen = c.ChangeSettings(frame=frame), c.SetView(eye), c.SelectSensor("arm", "tool", "gamepad")
    run(session, 0.01, *seen, c.GamepadInput((0, 1, 0, 0, 0, 0), frozenset()))
    begin = at(session, "arm", "tool")
    tool_y = session.robots["arm"].placement("tool").rotation[:, 1]
    run(session, 0.1)
    moved = at(session, "arm", "tool") - begin
    assert moved / np.linalg.norm(moved) == pytest.approx(tool_y if way is None else way, abs=1e-3)


def test_the_command_frame_base_is_turned_as_the_file_turns_the_base(closing):
    """Sliders on a base whose y axis is the world's z; a sensor that commands two translations along it."""
    sliders = "link 1 { type 1 pred 0 } link 2 { parameters { alpha 90 } type 1 pred 1 } frame 3 { pred 2 }"
    robot = f"base {{ parameters {{ gamma 90 alpha 90 }} }} {sliders} constraint {{ frame 3 sensor ( 0 1 ) }}"
    sensor = 'sensor 1 { port "gamepad:" translation 2 rotation 0 }'
    gantry = cinegen.load(f"RAFF R\nunits mm robot g {{ {robot} }} {sensor}")
    session = closing(Session(arrange({"g": gantry})))
    begin = session.robots["g"].placement("frame3").translation
    push = c.ChangeSettings(frame="base"), c.SelectSensor("g", "frame3", "1")
    run(session, 0.2, *push, c.GamepadInput((0, 1, 0, 0, 0, 0), frozenset()))
    moved = session.robots["g"].placement("frame3").translation - begin
    assert moved / np.linalg.norm(moved) == pytest.approx([0, 0, 1], abs=1e-3)


def test_targets_of_programs_are_in_the_sessions_world(robot, closing, tmp_path):
    aside = BasePose(placement=pin.SE3(pin.rpy.rpyToMatrix(0, 0, 1.0), np.array([1.0, 2.0, 0.0])))
    arm = robot("rx90")
    target = aside.placement * arm.placement(arm.q_home, "tool")
    target.translation += [0.02, 0.0, 0.01]
    with ReadingRecorder(tmp_path / "run.jsonl") as recorder:
        recorder.write(Reading(0.0, target=target))
    setup = arrange({"arm": arm}, sensors=[f"tool=replay:{tmp_path}/run.jsonl"])
    session = closing(Session(replace(setup, bases={"arm": aside})))
    run(session, 0.3)
    assert session.robots["arm"].placement("tool").isApprox(target, 1e-6)


def test_a_robot_on_another_goes_along_and_what_is_pinned_stays_in_the_world(session):
    live_session = session("rx90", "arm7", bases=["arm7=rx90.tool@0,0,0.05"])
    state = live_session.state()
    tool = live_session.robots["rx90"].placement("tool")
    assert state.robots["arm7"].base.isApprox(tool * pin.SE3(np.eye(3), np.array([0, 0, 0.05])))
    run(live_session, 0.01, c.Pin("arm7", "tool"))
    pinned = live_session.robots["arm7"].placement("tool")
    begin = tool.translation
    aside = c.MoveDrag(tuple(begin + np.array([0.02, -0.03, 0.03])))
    state = run(live_session, 1.0, c.StartDrag("rx90", "tool", (0, 0, 0)), aside)
    assert np.linalg.norm(state.robots["arm7"].base.translation - begin) > 0.01
    assert np.linalg.norm(pin.log6(pinned.actInv(live_session.robots["arm7"].placement("tool"))).vector) < 1e-4


def test_hundreds_of_random_commands_never_stop_it(session):
    rng = np.random.default_rng(8)
    live_session = session("delta4", "planar_3r", follow="circle")
    names = {"delta4": ("link5", "link8", "platform"), "planar_3r": ("link1", "link3")}
    for _ in range(300):
        name = rng.choice(list(names))
        node, value = str(rng.choice(names[name])), float(rng.normal())
        kinds = [
            c.StartDrag(name, node, tuple(rng.normal(size=3)), False), c.StartDrag(name, node, None, True),
            c.MoveDrag(tuple(rng.normal(size=3, scale=3))), c.EndDrag(bool(rng.integers(2))), c.Pin(name, node),
            c.RemoveTask(int(rng.integers(50))), c.ChangeTask(int(rng.integers(50)), weight=2.0),
            c.ChangeTask(int(rng.integers(50)), 1, 2),
            c.MoveJoint(name, "joint1", value), c.EndJointMotion(), c.MoveHome(None), c.Undo(), c.Redo(),
            c.Pause(bool(rng.integers(2))), c.ChangeSettings(frame="tool"), c.ChangeSettings(gain=100.0),
            c.SelectSensor("delta4", "platform", ["path delta4", "gamepad", None][rng.integers(3)]),
            c.GamepadInput(tuple(rng.uniform(-1, 1, 6)), frozenset()), c.ControlPlayback(playing=True),
        ]  # fmt: skip
        live_session.obey(kinds[rng.integers(len(kinds))])
        for _ in range(int(rng.integers(20))):
            live_session.tick()
        state = live_session.state()
        assert all(robot.closure <= 1e-9 for robot in state.robots.values())
    state = run(live_session, 4.0, c.Pause(False), c.MoveHome(None))
    for name in names:
        assert np.isfinite(state.robots[name].q).all()


def test_a_recording_is_shown_and_can_not_be_driven(session, tmp_path, closing):
    live_session = session("delta4", record=str(tmp_path / "run.jsonl"), follow="circle")
    run(live_session, 1.0)
    live_session.close()
    shown = closing(Session(replay_setup(tmp_path / "run.jsonl")))
    state = run(shown, 0.5)
    assert state.playback.playing
    assert state.playback.time == pytest.approx(0.5, abs=1e-6)
    state = run(shown, 0.1, c.StartDrag("delta4", "platform", None))
    assert any("recording" in notice.text for notice in state.notices)
    changes = [{"playing": False}, {"time": 0.2}, {"speed": 0.5}]
    state = run(shown, 0.01, *(c.ControlPlayback(**change) for change in changes))
    assert (state.playback.playing, state.playback.speed) == (False, 0.5)
    assert state.robots["delta4"].closure < 1e-10


def test_a_motion_that_leads_astray_ends_and_is_told(session):
    live_session = session("delta4")
    before = live_session.state().robots["delta4"].q
    torn = live_session.setup.robots["delta4"].q_home + 0.1
    live_session.robots["delta4"].motion = SimpleNamespace(name="home", trouble="", advance=lambda dt: torn)
    state = run(live_session, 0.01)
    assert np.array_equal(state.robots["delta4"].q, before)
    assert "leaves loops" in state.notices[-1].text
    assert state.moving is None


def test_a_joint_that_its_limit_stops_is_named(raff, closing):
    """A link of 500 mm, limited to 30 degrees, and a target at 90 degrees."""
    arm = raff("""sensor 1 { port "spnav:" translation 3 rotation 3 }
      robot r { base { } link 1 { type 2 pred 0 limits { -30 30 } velocity 90 }
        frame 2 { parameters { d 500 } pred 1 name "tool" } constraint { frame 2 sensor ( 0 1 ) } }""")
    session = closing(Session(arrange({"arm": arm})))
    state = run(session, 2.0, c.StartDrag("arm", "tool", (0, 0, 0)), c.MoveDrag((0.0, 0.5, 0.0)))
    assert state.robots["arm"].status.label == "at the limit of joint1"
    assert state.robots["arm"].q == pytest.approx([np.pi / 6.0], abs=1e-6)


# --- two drags --------------------------------------------------------------------------------------------------------
# Two hands at one session: two pointers drag two parts, or two points of one part; each begins and ends by itself.


def test_two_pointers_drag_two_robots_each_ends_by_itself_and_both_are_one_undo_step(session):
    live_session = session("delta4", "rx90")
    home = {name: robot.q for name, robot in live_session.state().robots.items()}
    goals = {"delta4": np.array([0.05, 0.0, -0.1]), "rx90": np.array([-0.05, 0.04, -0.06])}
    nodes = {"delta4": "platform", "rx90": "tool"}
    for pointer, name in enumerate(goals):
        goals[name] += at(live_session, name, nodes[name])
        live_session.obey(c.StartDrag(name, nodes[name], (0, 0, 0), pointer=pointer))
        live_session.obey(c.MoveDrag(tuple(goals[name]), pointer=pointer))
    state = run(live_session, 1.0)
    for name, goal in goals.items():
        assert np.linalg.norm(at(live_session, name, nodes[name]) - goal) < 1e-6
    assert state.robots["delta4"].closure < 1e-11
    state = run(live_session, 0.01, c.EndDrag(pointer=0))
    assert [len(state.robots[name].tasks) for name in goals] == [0, 1]
    further = goals["rx90"] + [0.0, 0.0, 0.03]
    state = run(live_session, 0.5, c.MoveDrag((9.0, 9.0, 9.0), pointer=0), c.MoveDrag(tuple(further), pointer=1))
    assert np.linalg.norm(at(live_session, "delta4", "platform") - goals["delta4"]) < 1e-6  # its drag has ended
    assert np.linalg.norm(at(live_session, "rx90", "tool") - further) < 1e-6
    state = run(live_session, 0.1, c.EndDrag())
    assert state.robots["rx90"].tasks == ()  # all of them
    assert state.undo == 1
    state = run(live_session, 2.0, c.Undo())
    assert all(np.abs(state.robots[name].q - home[name]).max() < 1e-9 for name in home)


def test_two_pointers_on_one_part_rotate_it(session):
    """Targets of a rigid motion (0.3 rad about the tool's z): two points and their distance determine it but for a
    rotation about the line through both."""
    live_session = session("rx90")
    points = np.array([[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]])
    goal = live_session.robots["rx90"].placement("tool") * pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.3])), np.zeros(3))
    for pointer, point in enumerate(points):
        live_session.obey(c.StartDrag("rx90", "tool", tuple(point), pointer=pointer))
        live_session.obey(c.MoveDrag(tuple(goal.act(point)), pointer=pointer))
    state = run(live_session, 1.5)
    assert [(task.source, task.node) for task in state.robots["rx90"].tasks] == [("pointer", "tool")] * 2
    for point in points:
        assert np.linalg.norm(at(live_session, "rx90", "tool", point) - goal.act(point)) < 1e-6
    line = live_session.robots["rx90"].placement("tool").rotation[:, 0]
    assert np.linalg.norm(line - goal.rotation[:, 0]) < 1e-6


def test_home_brings_a_floating_base_back_too(closing):
    session = closing(Session(arrange({"biped": cinegen.load(bipeds.URDF)})))
    trunk = session.robots["biped"].placement("trunk")
    goal = trunk.translation + np.array([0.5, 0.2, 0.1])
    run(session, 1.0, c.StartDrag("biped", "trunk", None, rotation=True), c.MoveDrag(tuple(goal)))
    assert not session.robots["biped"].placement("trunk").isApprox(trunk, 1e-3)
    run(session, 5.0, c.EndDrag(), c.MoveHome("biped"))
    assert session.robots["biped"].motion is None
    assert session.robots["biped"].placement("trunk").isApprox(trunk, 1e-9)
