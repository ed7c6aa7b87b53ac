"""`cinegen validate`, and URDF -> RAFF -> URDF as a fixed point, on the robots of example-robot-data."""

import json
import warnings
from pathlib import Path

import pytest
from variants import slow

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
