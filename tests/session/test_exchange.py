"""A session goes on with robots whose file has changed: by joint and node names, within loops and limits."""

from dataclasses import replace

import bipeds
import coal
import msgspec
import numpy as np
import pinocchio as pin
import pytest
from leading import run

import cinegen
from cinegen.collision import load_scene
from cinegen.collision.body import PlacedShape
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.mission.drawn_obstacle import DrawnObstacle, DrawnShape
from cinegen.session import Reporter, Session, Setup, arrange, scene_setup
from cinegen.session import commands as c
from cinegen.session.other_robots import OtherRobots

ARM = """RAFF t
robot arm {
  link 1 { type 2 pred 0 name "turn" parameters { d 0 } limits { -170 170 } }
  link 2 { type 2 pred 1 name "lift" parameters { d 300 } limits { -120 120 } }
  link 3 { type 2 pred 2 name "bend" parameters { d 250 } limits { -150 150 } }
  frame 4 { pred 3 name "tip" parameters { d 200 } }
}
"""


@pytest.fixture
def arm():
    """A session of the arm."""
    return Session(arrange({"arm": cinegen.load(ARM)}))


def exchanged(session, *mechanisms, edition=1, **changes):
    """Let a session go on with mechanisms, which have the names that it has."""
    setup = arrange(dict(zip(session.robots, mechanisms, strict=True)))
    session.exchange(OtherRobots.of(replace(setup, **changes), edition))
    return session.state()


def move(session, **joints):
    (name,) = session.robots
    for joint, value in joints.items():
        session.obey(c.MoveJoint(name, joint, value))
    return run(session, 3.0, c.EndJointMotion())


def value(session, joint):
    ((_, robot),) = session.robots.items()
    return robot.q[robot.mechanism.q_index(joint)]


def test_joints_keep_their_values_by_name_within_the_limits_of_the_file(arm):
    moved = move(arm, joint1=0.4, joint2=-0.7, joint3=1.1).robots["arm"].q
    state = exchanged(arm, cinegen.load(ARM.replace("d 300", "d 330")))
    assert state.robots["arm"].q == pytest.approx(moved, abs=1e-12)
    assert (state.edition, state.notices) == (1, ())
    renamed = ARM.replace("link 2", "link 7").replace("pred 2", "pred 7")
    exchanged(arm, cinegen.load(renamed), edition=2)
    assert value(arm, "joint7") == pytest.approx(-0.7, abs=1e-6)
    link = "link 5 { type 2 pred 3 parameters { d 100 theta 20 } }"
    exchanged(arm, cinegen.load(ARM.replace("frame 4 { pred 3", f"{link} frame 4 {{ pred 5")), edition=3)
    assert value(arm, "joint5") == pytest.approx(np.radians(20.0))  # a new joint is at home
    exchanged(arm, cinegen.load(ARM), edition=4)
    assert value(arm, "joint3") == pytest.approx(1.1, abs=1e-6)
    exchanged(arm, cinegen.load(ARM.replace("-150 150", "-30 30")), edition=5)
    assert value(arm, "joint3") == pytest.approx(np.radians(30.0), abs=1e-9)
    exchanged(arm, cinegen.load(ARM.replace("link 1 { type 2", "link 1 { type 1")), edition=6)
    assert value(arm, "joint1") == 0.0  # an angle is no length


def test_loops_are_closed_with_the_actuated_joints_where_they_were(robot, root):
    mechanism = robot("five_bar")
    text = (root / "robots/five_bar.raff").read_text()
    session = Session(arrange({"five_bar": mechanism}))
    first, second = mechanism.actuated
    moved = move(session, **{first: mechanism.q_home[mechanism.q_index(first)] + 0.2})
    longer = text.replace("d 250", "d 260")
    assert longer != text
    other = cinegen.load(longer)
    state = exchanged(session, other).robots["five_bar"]
    assert other.closure(state.q) < 1e-10
    for joint in (first, second):
        before = moved.robots["five_bar"].q[mechanism.q_index(joint)]
        assert state.q[other.q_index(joint)] == pytest.approx(before, abs=1e-6)


def test_a_motor_beyond_the_limits_of_the_file_comes_to_these_with_loops_closed(robot, root):
    session = Session(arrange({"four_bar": robot("four_bar")}))
    move(session, joint1=np.radians(120.0))
    text = (root / "robots/four_bar.raff").read_text()
    other = cinegen.load(text.replace("link 1 {", "link 1 { limits { 40 60 }"))
    state = exchanged(session, other).robots["four_bar"]
    assert state.q[other.q_index("joint1")] == pytest.approx(np.radians(60.0))
    assert other.limits.within(state.q)
    assert other.closure(state.q) < 1e-10


def test_where_loops_can_not_be_closed_the_robot_is_at_home_and_says_so(arm, monkeypatch):
    move(arm, joint1=0.4)
    monkeypatch.setattr("cinegen.session.robot.carried_over", lambda *_: None)
    state = exchanged(arm, cinegen.load(ARM))
    assert state.robots["arm"].q == pytest.approx(np.zeros(3))
    assert state.notices[-1].text == "arm is at home: its loops can't be closed within its limits where it was"


def test_pins_hold_their_place_and_those_of_lost_nodes_are_named(arm):
    move(arm, joint1=0.3, joint2=0.6, joint3=-0.8)
    for node in ("bend", "tip"):
        arm.obey(c.Pin("arm", node))
    ids = [task.id for task in arm.state().robots["arm"].tasks]
    target = arm.robots["arm"].placement("bend").translation.copy()
    without = ARM.replace('frame 4 { pred 3 name "tip" parameters { d 200 } }\n', "").replace("d 250", "d 240")
    state = exchanged(arm, cinegen.load(without)).robots["arm"]
    assert [(task.id, task.node) for task in state.tasks] == [(ids[0], "bend")]
    assert any("there is no 'tip' any more: its pin has ended" in notice.text for notice in arm.state().notices)
    run(arm, 3.0)
    assert arm.robots["arm"].placement("bend").translation[:2] == pytest.approx(target[:2], abs=2e-2)


def test_a_drag_goes_on(arm):
    move(arm, joint1=0.3, joint2=0.6, joint3=-0.8)
    run(arm, 0.005, c.StartDrag("arm", "tip"))
    exchanged(arm, cinegen.load(ARM.replace("d 250", "d 260")))
    tip = arm.robots["arm"].placement("tip").translation
    run(arm, 0.6, c.MoveDrag(tuple(0.95 * tip)))
    assert arm.robots["arm"].placement("tip").translation == pytest.approx(0.95 * tip, abs=1e-4)
    arm.obey(c.EndDrag())
    assert arm.state().robots["arm"].tasks == ()


def test_undo_goes_back_across_the_edit_by_joint_names(arm):
    move(arm, joint1=0.3)
    move(arm, joint1=0.9, joint3=0.5)
    edited = ARM.replace("d 250", "d 260").replace("link 2", "link 7").replace("pred 2", "pred 7")
    exchanged(arm, cinegen.load(edited))
    assert arm.state().undo == 2
    run(arm, 3.0, c.Undo())
    assert value(arm, "joint1") == pytest.approx(0.3, abs=1e-6)
    assert value(arm, "joint3") == pytest.approx(0.0, abs=1e-6)
    assert "joint7" in arm.robots["arm"].mechanism.joints  # the robot stays that of the file
    run(arm, 3.0, c.Redo())
    assert value(arm, "joint1") == pytest.approx(0.9, abs=1e-6)


def test_an_obstacle_stays_where_it_was_dragged_unless_its_file_moves_it():
    shape = DrawnShape.of(PlacedShape(pin.SE3.Identity(), coal.Box(np.full(3, 0.1))))
    box = DrawnObstacle((shape,), pin.SE3.Identity(), 6)
    far, near = (pin.SE3(np.eye(3), np.array(at)) for at in ([2.0, 0.0, 0.0], [1.5, 0.0, 0.0]))
    drawn = {name: msgspec.structs.replace(box, placement=far) for name in ("kept", "moved", "gone")}
    session = Session(replace(arrange({"arm": cinegen.load(ARM)}), obstacles=drawn))
    dragged = pin.SE3(np.eye(3), np.array([0.0, 3.0, 0.0]))
    for obstacle in session.obstacles.values():
        obstacle.pose = dragged
    obstacles = {"kept": drawn["kept"], "moved": msgspec.structs.replace(box, placement=near)}
    state = exchanged(session, cinegen.load(ARM), obstacles=obstacles)
    assert state.obstacles["kept"].pose.isApprox(dragged)
    assert state.obstacles["moved"].pose.isApprox(near)
    assert list(state.obstacles) == ["kept", "moved"]


def test_an_earlier_edition_that_comes_late_is_not_taken(arm):
    exchanged(arm, cinegen.load(ARM.replace("d 250", "d 260")), edition=2)
    newest = arm.robots["arm"].mechanism
    assert exchanged(arm, cinegen.load(ARM), edition=1).edition == 2
    assert arm.robots["arm"].mechanism is newest
    arm.refuse(1, "too late")
    assert arm.state().refused is None


def test_settings_time_and_pause_stay():
    session = Session(Setup({"arm": cinegen.load(ARM)}))
    time = run(session, 0.01, c.ChangeSettings(gain=30.0, damping=0.1), c.Pause(True)).time
    state = exchanged(session, cinegen.load(ARM))
    assert (state.settings.gain, state.settings.damping, state.paused) == (30.0, 0.1, True)
    assert state.time == time
    assert session.robots["arm"].solver.gain == 30.0


# --- locked joints ----------------------------------------------------------------------------------------------------
# Locked joints in a session: nothing but an undo moves them, and a saved file or an undo does not unlock them.


def drag(session, name, by, **options):
    """Drag the end of a robot by a vector (m)."""
    robot = session.robots[name]
    goal = robot.placement(robot.mechanism.end).translation + by
    state = run(session, 2.0, c.StartDrag(name, robot.mechanism.end, None), c.MoveDrag(tuple(goal)))
    session.obey(c.EndDrag(**options))
    return state.robots[name]


@pytest.mark.parametrize(("name", "joint"), [("arm7", "joint1"), ("gough", "joint3")])
def test_a_drag_does_not_move_a_locked_joint_until_it_is_unlocked(session, name, joint):
    live = session(name)
    before, by = value(live, joint), 0.05 * live.robots[name].mechanism.length * np.array([0.3, 1.0, 0.2])
    live.obey(c.LockJoint(name, joint, True))
    state = drag(live, name, by)
    assert state.locked == (joint,)
    assert value(live, joint) == before
    assert not np.array_equal(live.robots[name].q, live.robots[name].home)
    live.obey(c.LockJoint(name, joint, False))
    state = drag(live, name, by)
    assert state.locked == ()
    assert value(live, joint) != before


def test_sliders_home_and_lines_do_not_move_a_locked_joint(session):
    live_session = session("arm7")
    drag(live_session, "arm7", np.array([0.0, 0.1, 0.0]))
    live_session.obey(c.LockJoint("arm7", "joint1", True))
    before = value(live_session, "joint1")
    assert before != live_session.robots["arm7"].home[0]
    live_session.obey(c.MoveJoint("arm7", "joint1", 0.5))
    assert "joint1 of arm7 is locked: unlock it" in live_session.state().notices[-1].text
    for command in (c.MoveHome("arm7"), c.MoveTo("arm7", "tool", tuple(live_session.robots["arm7"].home.tolist()))):
        state = run(live_session, 4.0, command)
        assert value(live_session, "joint1") == before
        assert "locked: joint1" in " ".join(notice.text for notice in state.notices)
    run(live_session, 4.0, c.MoveJoint("arm7", "joint2", 0.4), c.EndJointMotion())
    assert value(live_session, "joint2") == pytest.approx(0.4)
    assert value(live_session, "joint1") == before


def test_a_passive_joint_that_is_locked_stops_the_motors(session):
    live_session = session("four_bar")
    mechanism = live_session.robots["four_bar"].mechanism
    passive = next(joint for joint in mechanism.joints if joint not in mechanism.actuated)
    live_session.obey(c.LockJoint("four_bar", passive, True))
    before = live_session.robots["four_bar"].q
    state = run(live_session, 1.0, c.MoveJoint("four_bar", mechanism.actuated[0], before[0] + 0.3)).robots["four_bar"]
    assert state.status.label == f"locked: {passive}"
    assert (state.q == before).all()


def test_locks_survive_undo_and_redo(session):
    live_session = session("arm7")
    home = value(live_session, "joint1")
    drag(live_session, "arm7", np.array([0.0, 0.1, 0.0]))
    moved = value(live_session, "joint1")
    run(live_session, 0.1)
    state = run(live_session, 3.0, c.LockJoint("arm7", "joint1", True), c.Undo()).robots["arm7"]
    assert state.locked == ("joint1",)
    assert value(live_session, "joint1") == pytest.approx(home, abs=1e-9)  # what was done before it was locked
    drag(live_session, "arm7", np.array([0.0, 0.1, 0.0]))
    assert value(live_session, "joint1") == pytest.approx(home, abs=1e-9)
    assert moved != home


def test_locks_survive_the_reload_of_a_file(session, robot):
    live_session = session("arm7")
    for joint in ("joint2", "joint5"):
        live_session.obey(c.LockJoint("arm7", joint, True))
    live_session.exchange(OtherRobots.of(arrange({"arm7": robot("arm7")}), 1))
    before = value(live_session, "joint2")
    state = drag(live_session, "arm7", np.array([0.0, 0.1, -0.1]))
    assert state.locked == ("joint2", "joint5")
    assert value(live_session, "joint2") == before
    live_session.exchange(OtherRobots.of(arrange({"arm7": robot("planar_3r")}), 2))
    assert live_session.state().robots["arm7"].locked == ("joint2",)


def test_a_setup_locks_joints_from_the_start(robot):
    setup = arrange({"arm": robot("arm7"), "other": robot("planar_3r")})
    session = Session(setup.with_locked(["joint7", "arm.joint1"]))
    assert session.state().robots["arm"].locked == ("joint7", "joint1")
    assert session.state().robots["other"].locked == ()
    session.close()
    with pytest.raises(CinegenError, match=r"several robots have a joint 'joint1': name one, such as arm\.joint1"):
        setup.with_locked(["joint1"])
    with pytest.raises(UnknownNameError, match="did you mean 'joint7'"):
        setup.with_locked(["joint77"])
    with pytest.raises(CinegenError, match="does not float"):
        setup.with_locked(["arm.base"])


def test_the_report_is_that_of_the_robot_with_locked_joints(session):
    live_session = session("gough")
    reporter = Reporter(live_session.robots["gough"].mechanism)
    free = reporter.report(live_session.state().robots["gough"], 0.0)
    run(live_session, 0.1, c.LockJoint("gough", "joint3", True))
    report = reporter.report(live_session.state().robots["gough"], 0.1)
    assert (free.locked, report.locked) == ((), ("joint3",))
    assert report.type1.sigma != free.type1.sigma
    live_session.obey(c.LockJoint("gough", "joint3", False))
    again = reporter.report(live_session.state().robots["gough"], 0.2)
    assert again.type1.sigma == pytest.approx(free.type1.sigma, abs=1e-12)


def test_a_robot_that_avoids_obstacles_keeps_its_locks(root, closing):
    session = closing(Session(scene_setup(load_scene(root / "robots/scenes/rod.toml"))))
    (name,) = session.robots
    session.obey(c.LockJoint(name, "joint1", True))
    before = session.robots[name].q
    drag(session, name, np.array([0.0, 0.05, 0.0]))
    after = session.robots[name].q
    assert after[0] == before[0]
    assert np.abs(after - before).max() > 1e-3
    run(session, 2.0, c.MoveJoint(name, "joint2", float(after[1] + 0.1)), c.EndJointMotion())
    assert session.robots[name].q[0] == before[0]
    assert session.robots[name].q[1] == pytest.approx(after[1] + 0.1, abs=1e-3)


def test_a_locked_base_holds_the_trunk_of_a_humanoid(closing):
    session = closing(Session(arrange({"biped": cinegen.load(bipeds.URDF)})))
    session.obey(c.LockJoint("biped", "base", True))
    before = session.robots["biped"].q[:7]
    drag(session, "biped", np.array([0.1, 0.0, 0.1]))
    assert (session.robots["biped"].q[:7] == before).all()
    session.obey(c.LockJoint("biped", session.robots["biped"].mechanism.base, False))
    drag(session, "biped", np.array([0.1, 0.0, 0.1]))
    assert not (session.robots["biped"].q[:7] == before).all()
