"""The session of a page without a server does what Python's does, and its solver: commands lead to the same states.

Commands are carried out by both, at the same rate. After each, everything that a user sees of the session is equal, and
configurations are equal where motions have ended; during motions that no task causes, at each moment.
"""

import json

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
from cinegen.mission import BasePose
from cinegen.page.build import RATE, content_of
from cinegen.page.tables import robot_tables
from cinegen.session import Session, Setup
from cinegen.session.decoding import decode_command
from cinegen.singularities.ball_joints import CountedLoops, balls

MOVED = 1e-9  # rad and m: motions of joints, home, and of undo along them
LOOPS = 1e-7  # rad and m: loops are closed to 1e-12 there and 1e-10 here
OUTSIDE = np.array([4.0, 0.0, 4.0])  # m
REACHED = 1e-5  # rad and m: targets that tasks have reached

pytestmark = needs_three


def in_python(setup, script):
    session, states = Session(setup), []
    for ticks, command in script:
        if command is not None:
            session.obey(decode_command(json.dumps(command), setup))
        for _ in range(ticks):
            session.tick()
        state = session.state()
        robots = {
            name: {
                "q": robot_state.q.tolist(),
                "status": robot_state.status.name,
                "closure": robot_state.closure,
                "tasks": [[t.id, t.node, t.source, t.translation, t.rotation, t.weight] for t in robot_state.tasks],
                "base": pin.SE3ToXYZQUAT(robot_state.base).tolist(),
            }
            for name, robot_state in state.robots.items()
        }
        shown = {name: getattr(state, name) for name in ("undo", "redo", "paused", "moving")}
        waypoints = [{"id": waypoint.id, "name": waypoint.name} for waypoint in state.waypoints]
        shown |= {"waypoints": waypoints, "waypoint": state.waypoint}
        states.append({"robots": robots, **shown, "notices": len(state.notices)})
    session.close()
    return states


@pytest.fixture
def same(tmp_path):
    """`same(setup, script)`: the states of Python, once those of JavaScript are equal to them."""

    def compare(setup, script, tolerance=MOVED):
        expected = in_python(setup, script)
        actual = run("run_session.js", tmp_path, content=content_of(setup, ""), script=script)
        for (_, command), wanted, other in zip(script, expected, actual, strict=True):
            for name, robot in wanted["robots"].items():
                mine = other["robots"][name]
                where = f"{name} after {command}"
                assert mine["q"] == pytest.approx(robot["q"], abs=tolerance), where
                assert mine["tasks"] == robot["tasks"], where
                assert mine["status"] == robot["status"], where
                turned = np.sign(np.dot(mine["base"][3:], robot["base"][3:]))
                base = np.array(mine["base"]) * np.array([1.0, 1.0, 1.0, *[turned] * 4])
                assert base == pytest.approx(robot["base"], abs=tolerance), where
            for name in ("undo", "redo", "paused", "moving", "waypoints", "waypoint", "notices"):
                assert other[name] == wanted[name], f"{name} after {command}"
        return expected

    return compare


def test_joints_home_undo_and_pauses(same, robot):
    setup = Setup({"rx90": robot("rx90")}, rate=RATE)
    move = {"type": "move_joint", "robot": "rx90", "joint": "joint2"}
    script = [
        (10, None),
        (40, move | {"value": 0.6}),
        (3, move | {"value": 9.0}),  # beyond its limit
        (30, {"type": "move_joint", "robot": "rx90", "joint": "joint5", "value": -0.3}),
        (20, {"type": "pause", "on": True}),
        (400, {"type": "pause", "on": False}),
        (60, {"type": "end_joint_motion"}),
        (200, {"type": "move_home"}),
        (400, None),
        (50, {"type": "undo"}),
        (500, None),
        (500, {"type": "undo"}),
        (100, {"type": "redo"}),
        (20, {"type": "undo"}),  # while it moves
        (700, None),
        (700, {"type": "redo"}),
        (100, move | {"value": 1.0}),  # and what was undone can't be redone any more
        (500, {"type": "end_joint_motion"}),
    ]
    states = same(setup, script)
    assert max(state["redo"] for state in states) > 0 == states[-1]["redo"]
    assert states[8]["robots"]["rx90"]["q"] == pytest.approx(setup.robots["rx90"].q_home)


def test_two_pointers_drag_two_nodes_and_two_points_of_one(same, robot):
    mechanism = robot("rx90")
    setup = Setup({"rx90": mechanism}, rate=RATE)
    elbow, tool = (mechanism.placement(mechanism.q_home, node).translation for node in ("link4", "tool"))

    def move(pointer, position, **more):
        return {"type": "move_drag", "pointer": pointer, "position": position.tolist()} | more

    drag = {"type": "start_drag", "robot": "rx90", "node": "tool"}
    script = [
        (5, {"type": "pin", "robot": "rx90", "node": "tool"}),
        (5, drag | {"pointer": 0}),
        (5, {"type": "start_drag", "robot": "rx90", "node": "link4", "pointer": 1, "point": [0.0, 0.0, 0.0]}),
        (400, move(0, np.add(tool, [0.03, 0.0, 0.02]), weight=2.0)),
        (5, {"type": "end_drag", "pointer": 1}),
        (5, move(1, elbow)),  # which drags nothing any more
        (5, drag | {"pointer": 1, "point": [0.05, 0.0, 0.0]}),
        (5, {"type": "end_drag", "pointer": 0}),  # the other pointer drags the node still: its pin waits
        (400, {"type": "end_drag"}),
        (5, drag | {"pointer": 3}),
        (400, {"type": "remove_task", "task": 6}),
        (800, {"type": "undo"}),
    ]
    states = same(setup, script, REACHED)
    sources = [[task[2] for task in state["robots"]["rx90"]["tasks"]] for state in states]
    assert sources[3] == ["pointer", "pointer"]
    assert sources[6:9] == [["pointer", "pointer"], ["pointer"], ["pin"]]


def test_drags_pins_and_their_removal(same, robot):
    mechanism = robot("rx90")
    setup = Setup({"rx90": mechanism}, rate=RATE)
    at = mechanism.placement(mechanism.q_home, "tool")
    target = at * pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.1, 0.2), np.array([0.02, -0.03, 0.01]))
    numbers = pin.SE3ToXYZQUAT(target).tolist()
    drag = {"type": "start_drag", "robot": "rx90", "node": "tool", "rotation": True}
    script = [
        (5, drag),
        (400, {"type": "move_drag", "position": numbers[:3], "quaternion": numbers[3:]}),
        (5, {"type": "end_drag", "pin": True}),
        (5, {"type": "pin", "robot": "rx90", "node": "tool"}),  # it is pinned already
        (5, {"type": "change_task", "task": 1, "weight": 2.0}),
        (5, drag),  # moves the pin
        (400, {"type": "move_drag", "position": at.translation.tolist()}),
        (400, {"type": "end_drag"}),
        (5, {"type": "remove_task", "task": 3}),
        (800, {"type": "undo"}),
        (800, {"type": "redo"}),
        (5, {"type": "change_settings", "gain": 30.0, "damping": 0.1}),
        (5, {"type": "move_drag", "position": [0.0, 0.0, 0.0]}),  # nothing is dragged
        (5, {"type": "end_drag"}),
        (5, {"type": "move_home", "robot": "rx90"}),  # removes pins
        (800, None),
    ]
    states = same(setup, script, REACHED)
    assert states[1]["robots"]["rx90"]["tasks"][0][2] == "pointer"
    assert states[7]["robots"]["rx90"]["tasks"][0][2] == "pin"
    assert states[-1]["robots"]["rx90"]["tasks"] == []


def test_a_robot_carries_another_whose_pin_stays(same, robot):
    bases = {"arm": BasePose("rx90", "tool", pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.05])))}
    setup = Setup({"arm": robot("planar_3r"), "rx90": robot("rx90")}, bases, rate=RATE)
    script = [
        (20, None),
        (300, {"type": "move_joint", "robot": "rx90", "joint": "joint1", "value": 0.5}),
        (20, {"type": "end_joint_motion"}),
        (300, {"type": "move_joint", "robot": "arm", "joint": "joint2", "value": 0.4}),
        (500, {"type": "undo"}),
        (500, {"type": "undo"}),
    ]
    states = same(setup, script)
    assert states[1]["robots"]["arm"]["base"] != states[0]["robots"]["arm"]["base"]


def test_waypoints_are_saved_changed_and_played(same, robot):
    setup = Setup({"five_bar": robot("five_bar"), "arm": robot("planar_3r")}, rate=RATE)
    home = setup.robots["five_bar"].q_home[setup.robots["five_bar"].q_index("joint1")]
    move = {"type": "move_joint", "robot": "five_bar", "joint": "joint1"}
    script = [
        (300, move | {"value": home + 0.2}),
        (10, {"type": "end_joint_motion"}),
        (5, {"type": "save_waypoint", "name": "one"}),
        (300, {"type": "move_joint", "robot": "arm", "joint": "joint2", "value": 0.5}),
        (10, {"type": "end_joint_motion"}),
        (5, {"type": "pin", "robot": "arm", "node": "tool"}),
        (5, {"type": "save_waypoint", "name": "two"}),
        (400, {"type": "move_home"}),
        (5, {"type": "save_waypoint", "name": "three"}),
        (5, {"type": "change_waypoint", "waypoint": 1, "name": "last", "index": 9}),
        (30, {"type": "move_to_waypoint", "waypoint": 3}),
        (400, None),
        (100, {"type": "play_waypoints", "on": True}),
        (1500, None),
        (30, {"type": "play_waypoints", "on": True}),
        (400, {"type": "move_home"}),  # which ends that
        (60, {"type": "play_waypoints", "on": True}),
        (5, {"type": "remove_waypoint", "waypoint": 3}),  # while the robots move there
        (1500, None),
        (700, {"type": "undo"}),
        (5, {"type": "play_waypoints", "on": True}),
        (5, {"type": "play_waypoints", "on": False}),
    ]
    states = same(setup, script)
    assert [waypoint["name"] for waypoint in states[9]["waypoints"]] == ["two", "three", "last"]
    assert states[12]["waypoint"] is not None
    assert states[13]["robots"]["five_bar"]["q"] == pytest.approx(states[2]["robots"]["five_bar"]["q"], abs=1e-9)
    assert states[-1]["waypoint"] is None


def on_loops(mechanism, name, node, joint):
    """A script for a robot with loops."""
    at = mechanism.placement(mechanism.q_home, node).translation
    home = mechanism.q_home[mechanism.q_index(joint)]
    move = {"type": "move_joint", "robot": name, "joint": joint}
    drag = {"type": "start_drag", "robot": name, "node": node, "point": [0.0, 0.0, 0.0]}
    reach = 0.05 * mechanism.length
    return [
        (5, None),
        (40, move | {"value": home + 0.1}),
        (100, {"type": "end_joint_motion"}),
        (5, drag),
        (80, {"type": "move_drag", "position": (at + reach).tolist()}),
        (400, {"type": "move_drag", "position": (at + OUTSIDE).tolist()}),
        (80, {"type": "move_drag", "position": (at - reach).tolist()}),
        (5, {"type": "end_drag"}),
        (150, {"type": "undo"}),
        (150, {"type": "redo"}),
        (30, move | {"value": home + 50.0}),  # beyond what its loops or limits allow
        (5, {"type": "end_joint_motion"}),
        (1500, {"type": "move_home"}),
    ]


@pytest.mark.parametrize(
    ("name", "node", "joint"), [("delta4", "platform", "joint1"), *slow(("five_bar", "tool", "joint1"))]
)
def test_robots_with_loops(same, robot, name, node, joint):
    mechanism = robot(name)
    states = same(Setup({name: mechanism}, rate=RATE), on_loops(mechanism, name, node, joint), LOOPS)
    assert max(state["robots"][name]["closure"] for state in states) <= 1e-10
    assert states[5]["robots"][name]["status"] in ("AT_LIMIT", "OUT_OF_REACH", "SINGULAR")
    assert states[-1]["robots"][name]["q"] == pytest.approx(mechanism.q_home, abs=1e-9)


# --- the solver -------------------------------------------------------------------------------------------------------
# The solver of the page does what Python's does, for tasks that change while it runs.


TICKS = 12
GAIN, DAMPING = 100.0, 0.05
ROBOTS = ["delta4", "rx90", *slow("sr400", "scara", "planetary_gear")]


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
