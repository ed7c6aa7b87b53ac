"""Locked joints in a session: nothing but an undo moves them, and a saved file or an undo does not unlock them."""

import bipeds
import numpy as np
import pytest
from leading import run

import cinegen
from cinegen.collision import load_scene
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.session import Reporter, Session, arrange, scene_setup
from cinegen.session import commands as c
from cinegen.session.other_robots import OtherRobots


def drag(session, name, by, **options):
    """Drag the end of a robot by a vector (m)."""
    robot = session.robots[name]
    goal = robot.placement(robot.mechanism.end).translation + by
    session.obey(c.StartDrag(name, robot.mechanism.end, None))
    session.obey(c.MoveDrag(tuple(goal)))
    state = run(session, 2.0)
    session.obey(c.EndDrag(**options))
    return state.robots[name]


def value(session, name, joint):
    robot = session.robots[name]
    return robot.q[robot.mechanism.q_index(joint)]


@pytest.mark.parametrize(("name", "joint"), [("arm7", "joint1"), ("gough", "joint3")])
def test_a_drag_does_not_move_a_locked_joint_until_it_is_unlocked(session, name, joint):
    one = session(name)
    before, by = value(one, name, joint), 0.05 * one.robots[name].mechanism.length * np.array([0.3, 1.0, 0.2])
    one.obey(c.LockJoint(name, joint, True))
    state = drag(one, name, by)
    assert state.locked == (joint,)
    assert value(one, name, joint) == before
    assert not np.array_equal(one.robots[name].q, one.robots[name].home)
    one.obey(c.LockJoint(name, joint, False))
    state = drag(one, name, by)
    assert state.locked == ()
    assert value(one, name, joint) != before


def test_sliders_home_and_lines_do_not_move_a_locked_joint(session):
    one = session("arm7")
    drag(one, "arm7", np.array([0.0, 0.1, 0.0]))
    one.obey(c.LockJoint("arm7", "joint1", True))
    before = value(one, "arm7", "joint1")
    assert before != one.robots["arm7"].home[0]
    one.obey(c.MoveJoint("arm7", "joint1", 0.5))
    assert "joint1 of arm7 is locked: unlock it" in one.state().notices[-1].text
    for command in (c.MoveHome("arm7"), c.MoveTo("arm7", "tool", tuple(one.robots["arm7"].home.tolist()))):
        one.obey(command)
        state = run(one, 4.0)
        assert value(one, "arm7", "joint1") == before
        assert "locked: joint1" in " ".join(notice.text for notice in state.notices)
    one.obey(c.MoveJoint("arm7", "joint2", 0.4))
    one.obey(c.EndJointMotion())
    run(one, 4.0)
    assert value(one, "arm7", "joint2") == pytest.approx(0.4)
    assert value(one, "arm7", "joint1") == before


def test_a_passive_joint_that_is_locked_stops_the_motors(session):
    one = session("four_bar")
    mechanism = one.robots["four_bar"].mechanism
    passive = next(joint for joint in mechanism.joints if joint not in mechanism.actuated)
    one.obey(c.LockJoint("four_bar", passive, True))
    before = one.robots["four_bar"].q
    one.obey(c.MoveJoint("four_bar", mechanism.actuated[0], before[0] + 0.3))
    state = run(one, 1.0).robots["four_bar"]
    assert state.status.label == f"locked: {passive}"
    assert (state.q == before).all()


def test_locks_survive_undo_and_redo(session):
    one = session("arm7")
    home = value(one, "arm7", "joint1")
    drag(one, "arm7", np.array([0.0, 0.1, 0.0]))
    moved = value(one, "arm7", "joint1")
    run(one, 0.1)
    one.obey(c.LockJoint("arm7", "joint1", True))
    one.obey(c.Undo())
    state = run(one, 3.0).robots["arm7"]
    assert state.locked == ("joint1",)
    assert value(one, "arm7", "joint1") == pytest.approx(home, abs=1e-9)  # what was done before it was locked
    drag(one, "arm7", np.array([0.0, 0.1, 0.0]))
    assert value(one, "arm7", "joint1") == pytest.approx(home, abs=1e-9)
    assert moved != home


def test_locks_survive_the_reload_of_a_file(session, robot):
    one = session("arm7")
    for joint in ("joint2", "joint5"):
        one.obey(c.LockJoint("arm7", joint, True))
    one.exchange(OtherRobots.of(arrange({"arm7": robot("arm7")}), 1))
    before = value(one, "arm7", "joint2")
    state = drag(one, "arm7", np.array([0.0, 0.1, -0.1]))
    assert state.locked == ("joint2", "joint5")
    assert value(one, "arm7", "joint2") == before
    one.exchange(OtherRobots.of(arrange({"arm7": robot("planar_3r")}), 2))
    assert one.state().robots["arm7"].locked == ("joint2",)


def test_a_setup_locks_joints_from_the_start(robot):
    setup = arrange({"arm": robot("arm7"), "other": robot("planar_3r")})
    one = Session(setup.with_locked(["joint7", "arm.joint1"]))
    assert one.state().robots["arm"].locked == ("joint7", "joint1")
    assert one.state().robots["other"].locked == ()
    one.close()
    with pytest.raises(CinegenError, match=r"several robots have a joint 'joint1': name one, such as arm\.joint1"):
        setup.with_locked(["joint1"])
    with pytest.raises(UnknownNameError, match="did you mean 'joint7'"):
        setup.with_locked(["joint77"])
    with pytest.raises(CinegenError, match="does not float"):
        setup.with_locked(["arm.base"])


def test_the_report_is_that_of_the_robot_with_locked_joints(session):
    one = session("gough")
    reporter = Reporter(one.robots["gough"].mechanism)
    free = reporter.report(one.state().robots["gough"], 0.0)
    one.obey(c.LockJoint("gough", "joint3", True))
    run(one, 0.1)
    report = reporter.report(one.state().robots["gough"], 0.1)
    assert (free.locked, report.locked) == ((), ("joint3",))
    assert report.type1.sigma != free.type1.sigma
    one.obey(c.LockJoint("gough", "joint3", False))
    again = reporter.report(one.state().robots["gough"], 0.2)
    assert again.type1.sigma == pytest.approx(free.type1.sigma, abs=1e-12)


def test_a_robot_that_avoids_obstacles_keeps_its_locks(root):
    one = Session(scene_setup(load_scene(root / "robots/scenes/rod.toml")))
    (name,) = one.robots
    one.obey(c.LockJoint(name, "joint1", True))
    before = one.robots[name].q
    drag(one, name, np.array([0.0, 0.05, 0.0]))
    after = one.robots[name].q
    assert after[0] == before[0]
    assert np.abs(after - before).max() > 1e-3
    one.obey(c.MoveJoint(name, "joint2", float(after[1] + 0.1)))
    one.obey(c.EndJointMotion())
    run(one, 2.0)
    assert one.robots[name].q[0] == before[0]
    assert one.robots[name].q[1] == pytest.approx(after[1] + 0.1, abs=1e-3)
    one.close()


def test_a_locked_base_holds_the_trunk_of_a_humanoid(tmp_path):
    (tmp_path / "biped.urdf").write_text(bipeds.URDF)
    one = Session(arrange({"biped": cinegen.load(tmp_path / "biped.urdf")}))
    one.obey(c.LockJoint("biped", "base", True))
    before = one.robots["biped"].q[:7]
    drag(one, "biped", np.array([0.1, 0.0, 0.1]))
    assert (one.robots["biped"].q[:7] == before).all()
    one.obey(c.LockJoint("biped", one.robots["biped"].mechanism.base, False))
    drag(one, "biped", np.array([0.1, 0.0, 0.1]))
    assert not (one.robots["biped"].q[:7] == before).all()
    one.close()
