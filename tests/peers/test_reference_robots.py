"""`cinegen validate`, and URDF -> RAFF -> URDF as a fixed point, on the robots of example-robot-data."""

import json
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from ask_peers import DT, FAR, KEPT, LEVELS, PROBLEMS, PYTHON, ask, scene
from variants import slow

import cinegen
import raff2urdf
from cinegen.cli.robots import validate
from cinegen.model import validation
from raff2urdf import readers
from raff2urdf.conversion import translate
from raff2urdf.readers.urdf_file import parse
from raff2urdf.shipped import reference_robots
from raff2urdf.urdf2raff.robot import import_tree

ROBOTS = reference_robots()
RIGID = {"quadrotor_base", "iris_simple"}
UNREADABLE = {"ur3": "has no link", "alex_psyonic_hands": r"<mimic> in joint 'Left_index_q2' names joint 'index_q1'"}
OF_EACH_KIND = {
    *("TwoDofs", "double_pendulum_continuous", "kinova", "ur5_robot", "xarm7"),
    *("panda", "talos_left_arm", "allegro_left_hand"),  # mimic joints
    *("a1", "hyq_no_sensors", "anymal-kinova", "solo12"),  # a floating base
    *("human", "simple_humanoid", "borinot_flying_arm_2", "baxter", "tiago_no_hand"),
    "pr2",  # loops
}


def others_slow(names):
    return [name if name in OF_EACH_KIND else slow(name)[0] for name in names]


@pytest.fixture(autouse=True)
def _quiet(recwarn):
    """What these files leave out is told elsewhere."""


def constraints_of(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the PR2's grippers
        return readers.read(ROBOTS[name]).constraints


@pytest.mark.parametrize("name", others_slow(sorted(set(ROBOTS) - RIGID - set(UNREADABLE))))
def test_a_robot_agrees_with_pinocchio(name):
    assert validation.validate(ROBOTS[name]).agrees


def test_the_command_has_a_line_for_each_and_names_what_can_t_be_compared(typed):
    said = typed("validate", "TwoDofs", "iris_simple", *UNREADABLE)
    heading, agrees, rigid, *unreadable, summary = said.out.splitlines()
    assert heading.split() == ["robot", "joints", "frames", "jacobians", "masses", "home"]
    assert agrees.split()[:2] == ["TwoDofs", "2"]
    assert "nothing moves" in rigid
    assert all("not compared" in line for line in unreadable)
    assert summary == "1 of 4 robots agree with Pinocchio, 3 can't be compared"


@pytest.mark.parametrize(("what", "name", "number", "other"), [
    ("frames", "double_pendulum_simple", "d 100 }", "d 100.0005 }"),
    ("masses", "double_pendulum_simple", "mass 0.3 ", "mass 0.30001 "),
    ("masses", "double_pendulum_simple", "{ 0 0 100 } moments { 1015", "{ 0 10 100 } moments { 985"),  # not at 0
    ("home", "panda", "theta -90.00021045915 d", "theta -90.001 d"),
])  # fmt: skip
def test_a_difference_is_found_and_the_exit_code_is_1(what, name, number, other, monkeypatch, typed):
    def changed(document):
        text = raff2urdf.dumps(document)
        assert text.count(number) == 1
        return text.replace(number, other)

    monkeypatch.setattr(validation, "dumps", changed)
    (report,) = json.loads(typed("validate", name, "--json", code=1).out)
    assert not report["agrees"]
    assert report[what] > 1e-7


def test_without_the_package_the_extra_is_named(monkeypatch, typed):
    monkeypatch.setattr(validate, "reference_robots", dict)
    assert 'install "cinegen[robots]"' in typed("validate", code=1).err


@pytest.mark.parametrize("name", others_slow(sorted(set(ROBOTS) - set(UNREADABLE))))
def test_written_again_it_is_the_same(name):
    """URDF -> RAFF -> URDF -> RAFF -> URDF: a fixed point."""
    first = import_tree(parse(ROBOTS[name].read_text(encoding="utf-8"), name), name, constraints_of(name))
    made = translate(first.document, first.document.robot(), Path())
    second = import_tree(parse(made.urdf, name), name, made.constraints)
    again = translate(second.document, second.document.robot(), Path())
    third = import_tree(parse(again.urdf, name), name, again.constraints)
    assert third.document == second.document
    assert not any(second.offsets.values())
    assert len(second.document.robot().links) == len(first.document.robot().links)


@pytest.mark.parametrize("name", others_slow(sorted(set(ROBOTS) - {"ur3"})))
def test_no_robot_is_suspected_of_a_loop(name, recwarn):
    """Only the PR2 has loops, in its grippers, as Gazebo before SDF read them: it loads as a tree, with a warning."""
    if name in UNREADABLE:
        with pytest.raises(raff2urdf.RaffError, match=UNREADABLE[name]):
            readers.read(ROBOTS[name])
        return
    readers.read(ROBOTS[name])
    warned = [str(warning.message) for warning in recwarn]
    if name == "pr2":
        (message,) = warned
        assert "<joint:hinge> 'r_gripper_r_parallel_tip_joint' in <gazebo>" in message
    else:
        assert not warned


# --- differential inverse kinematics ----------------------------------------------------------------------------------
# One step of our solver beside pink's and placo's, where differential inverse kinematics has one answer.
#
# Our robot is the round trip's: URDF -> RAFF -> the mechanism that `cinegen.load` makes of it.


ANSWERS = json.loads(KEPT.read_text())
CASES = [(answer, peer) for answer in ANSWERS for peer in ("pink", "placo") if peer in answer]  # pink has no levels
SAME = 1e-3  # of the step: what first and second order differ by, and what a QP's regularisation costs


def ours(answer, folder):
    """The joints' values after our step, and before it, in the order of the problem."""
    problem, urdf = scene(answer["urdf"], answer["node"], answer["rotation"], answer.get("second"))
    (folder / "robot.urdf").write_bytes(urdf)
    conversion = raff2urdf.to_raff(folder / "robot.urdf", folder / "robot.raff")
    mechanism = cinegen.load(folder / "robot.raff")
    names = [joint["name"] for joint in problem["joints"]]
    begin = np.array([joint["home"] for joint in problem["joints"]])
    offsets = np.array([conversion.offsets[conversion.joints[name]] for name in names])
    indices = [mechanism.q_index(conversion.joints[name]) for name in names]
    q = np.zeros(mechanism.model.nq)
    q[indices] = begin + offsets
    solver = cinegen.Solver(mechanism, DT, q=q)
    task = solver.add_task(conversion.nodes[answer["node"]], rotation=answer["rotation"])
    task.target = pin.SE3(np.array(problem["targets"][0]))
    if "second" in problem:
        point = pin.SE3(np.eye(3), np.array(problem["second"]["target"]))
        solver.add_task(conversion.nodes[answer["second"]], point, rotation=0, priority=1)
    solver.step()
    return solver.q[indices] - offsets, begin


def test_every_problem_is_answered():
    assert [(a["urdf"], a["node"], a["rotation"]) for a in ANSWERS if "second" not in a] == list(PROBLEMS)
    assert [(a["urdf"], a["node"], a["second"]) for a in ANSWERS if "second" in a] == list(LEVELS)
    assert all("placo" in a and ("pink" in a or "second" in a) for a in ANSWERS)


@pytest.mark.parametrize(("answer", "peer"), CASES, ids=[f"{answer['urdf']}:{answer['node']}" for answer, _ in CASES])
def test_our_step_is_theirs(answer, peer, tmp_path, recwarn):
    """Of two levels the pose of a hand is exact, and its elbow comes as near to a point as that allows."""
    after, before = ours(answer, tmp_path)
    step, theirs = after - before, np.array(answer[peer]) - before
    assert 0.1 * FAR < np.linalg.norm(theirs) < 1000.0 * FAR
    assert np.linalg.norm(step - theirs) < SAME * np.linalg.norm(theirs)


@pytest.mark.skipif(not PYTHON.exists(), reason="pink and placo live in .venv-bench, which `make bench` makes")
def test_what_is_kept_is_what_they_say():
    answer = ANSWERS[0]
    problem, urdf = scene(answer["urdf"], answer["node"], answer["rotation"])
    for peer in ("pink", "placo"):
        assert np.allclose(ask(peer, problem, urdf), answer[peer], atol=1e-9)
