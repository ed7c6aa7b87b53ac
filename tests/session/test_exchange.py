"""A session goes on with robots whose file has changed: by joint and node names, within loops and limits."""

import re
from dataclasses import replace

import coal
import msgspec
import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen.collision.body import PlacedShape
from cinegen.mission.drawn_obstacle import DrawnObstacle, DrawnShape
from cinegen.session import Session, Setup, arrange
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
def load(tmp_path):
    """Return a function that loads RAFF text."""

    def loaded(text, name="arm"):
        (tmp_path / f"{name}.raff").write_text(text)
        return cinegen.load(tmp_path / f"{name}.raff")

    return loaded


def exchanged(session, *mechanisms, edition=1, **changes):
    """Let a session go on with mechanisms, which have the names that it has."""
    setup = arrange(dict(zip(session.robots, mechanisms, strict=True)))
    session.exchange(OtherRobots.of(replace(setup, **changes), edition))
    return session.state()


def run(session, ticks=400):
    for _ in range(ticks):
        session.tick()
    return session.state()


def move(session, **joints):
    (name,) = session.robots
    for joint, value in joints.items():
        session.obey(c.MoveJoint(name, joint, value))
    session.obey(c.EndJointMotion())
    return run(session, 3000)


def value(session, joint):
    ((_, robot),) = session.robots.items()
    return robot.q[robot.mechanism.q_index(joint)]


def texts(session):
    return " | ".join(notice.text for notice in session.state().notices)


def test_joints_keep_their_values_by_name_within_the_limits_of_the_file(load):
    session = Session(arrange({"arm": load(ARM)}))
    moved = move(session, joint1=0.4, joint2=-0.7, joint3=1.1).robots["arm"].q
    state = exchanged(session, load(ARM.replace("d 300", "d 330")))
    assert state.robots["arm"].q == pytest.approx(moved, abs=1e-12)
    assert (state.edition, state.notices) == (1, ())
    renamed = ARM.replace("link 2", "link 7").replace("pred 2", "pred 7")
    exchanged(session, load(renamed), edition=2)
    assert value(session, "joint7") == pytest.approx(-0.7, abs=1e-6)
    link = "link 5 { type 2 pred 3 parameters { d 100 theta 20 } }"
    exchanged(session, load(ARM.replace("frame 4 { pred 3", f"{link} frame 4 {{ pred 5")), edition=3)
    assert value(session, "joint5") == pytest.approx(np.radians(20.0))  # a new joint is at home
    exchanged(session, load(ARM), edition=4)
    assert value(session, "joint3") == pytest.approx(1.1, abs=1e-6)
    exchanged(session, load(ARM.replace("-150 150", "-30 30")), edition=5)
    assert value(session, "joint3") == pytest.approx(np.radians(30.0), abs=1e-9)
    exchanged(session, load(ARM.replace("link 1 { type 2", "link 1 { type 1")), edition=6)
    assert value(session, "joint1") == 0.0  # an angle is no length


def test_loops_are_closed_with_the_actuated_joints_where_they_were(robot, root, load):
    mechanism = robot("five_bar")
    text = (root / "robots/five_bar.raff").read_text()
    session = Session(arrange({"five_bar": mechanism}))
    first, second = mechanism.actuated
    moved = move(session, **{first: mechanism.q_home[mechanism.q_index(first)] + 0.2})
    longer = text.replace("d 250", "d 260")
    assert longer != text
    other = load(longer, "five_bar")
    state = exchanged(session, other).robots["five_bar"]
    assert other.closure(state.q) < 1e-10
    for joint in (first, second):
        assert state.q[other.q_index(joint)] == pytest.approx(
            moved.robots["five_bar"].q[mechanism.q_index(joint)], abs=1e-6
        )


def test_where_loops_can_not_be_closed_the_robot_is_at_home_and_says_so(robot, root, load):
    """A crank that is shorter by much can't follow: with another ground link its range is another one."""
    mechanism = robot("four_bar")
    text = (root / "robots/four_bar.raff").read_text()
    (crank,) = mechanism.actuated
    session = Session(arrange({"four_bar": mechanism}))
    move(session, **{crank: mechanism.q_home[mechanism.q_index(crank)] + 1.2})
    home = float(np.degrees(mechanism.q_home[mechanism.q_index(crank)]))
    link = re.search(rf"link {crank.removeprefix('joint')} \{{", text)
    narrow = f"{text[: link.end()]} limits {{ {home - 1.0} {home + 1.0} }}{text[link.end() :]}"
    other = load(narrow, "four_bar")
    state = exchanged(session, other).robots["four_bar"]
    assert other.limits.within(state.q)
    assert other.closure(state.q) < 1e-10


def test_pins_hold_their_place_and_those_of_lost_nodes_are_named(load):
    session = Session(arrange({"arm": load(ARM)}))
    move(session, joint1=0.3, joint2=0.6, joint3=-0.8)
    for node in ("bend", "tip"):
        session.obey(c.Pin("arm", node))
    ids = [task.id for task in session.state().robots["arm"].tasks]
    target = session.robots["arm"].placement("bend").translation.copy()
    without = ARM.replace('frame 4 { pred 3 name "tip" parameters { d 200 } }\n', "").replace("d 250", "d 240")
    state = exchanged(session, load(without)).robots["arm"]
    assert [(task.id, task.node) for task in state.tasks] == [(ids[0], "bend")]
    assert "there is no 'tip' any more: its pin has ended" in texts(session)
    run(session, 3000)
    assert session.robots["arm"].placement("bend").translation[:2] == pytest.approx(target[:2], abs=2e-2)


def test_a_drag_goes_on(load):
    session = Session(arrange({"arm": load(ARM)}))
    move(session, joint1=0.3, joint2=0.6, joint3=-0.8)
    session.obey(c.StartDrag("arm", "tip"))
    run(session, 5)
    exchanged(session, load(ARM.replace("d 250", "d 260")))
    here = session.robots["arm"].placement("tip").translation
    session.obey(c.MoveDrag(tuple(0.95 * here)))
    run(session, 600)
    assert session.robots["arm"].placement("tip").translation == pytest.approx(0.95 * here, abs=1e-4)
    session.obey(c.EndDrag())
    assert session.state().robots["arm"].tasks == ()


def test_undo_goes_back_across_the_edit_by_joint_names(load):
    session = Session(arrange({"arm": load(ARM)}))
    move(session, joint1=0.3)
    move(session, joint1=0.9, joint3=0.5)
    exchanged(session, load(ARM.replace("d 250", "d 260").replace("link 2", "link 7").replace("pred 2", "pred 7")))
    assert session.state().undo == 2
    session.obey(c.Undo())
    run(session, 3000)
    assert value(session, "joint1") == pytest.approx(0.3, abs=1e-6)
    assert value(session, "joint3") == pytest.approx(0.0, abs=1e-6)
    assert "joint7" in session.robots["arm"].mechanism.joints  # the robot stays that of the file
    session.obey(c.Redo())
    run(session, 3000)
    assert value(session, "joint1") == pytest.approx(0.9, abs=1e-6)


def test_an_obstacle_stays_where_it_was_dragged_unless_its_file_moves_it(load, box):
    far, near = (pin.SE3(np.eye(3), np.array(at)) for at in ([2.0, 0.0, 0.0], [1.5, 0.0, 0.0]))
    drawn = {name: msgspec.structs.replace(box, placement=far) for name in ("kept", "moved", "gone")}
    session = Session(replace(arrange({"arm": load(ARM)}), obstacles=drawn))
    there = pin.SE3(np.eye(3), np.array([0.0, 3.0, 0.0]))
    for one in session.obstacles.values():
        one.pose = there
    obstacles = {"kept": drawn["kept"], "moved": msgspec.structs.replace(box, placement=near)}
    state = exchanged(session, load(ARM), obstacles=obstacles)
    assert state.obstacles["kept"].pose.isApprox(there)
    assert state.obstacles["moved"].pose.isApprox(near)
    assert list(state.obstacles) == ["kept", "moved"]


@pytest.fixture
def box():
    shape = DrawnShape.of(PlacedShape(pin.SE3.Identity(), coal.Box(np.full(3, 0.1))))
    return DrawnObstacle((shape,), pin.SE3.Identity(), 6)


def test_an_earlier_edition_that_comes_late_is_not_taken(load):
    session = Session(arrange({"arm": load(ARM)}))
    exchanged(session, load(ARM.replace("d 250", "d 260")), edition=2)
    newest = session.robots["arm"].mechanism
    assert exchanged(session, load(ARM), edition=1).edition == 2
    assert session.robots["arm"].mechanism is newest
    session.refuse(1, "too late")
    assert session.state().refused is None


def test_settings_time_and_pause_stay(load):
    session = Session(Setup({"arm": load(ARM)}))
    session.obey(c.ChangeSettings(gain=30.0, damping=0.1))
    session.obey(c.Pause(True))
    time = run(session, 10).time
    state = exchanged(session, load(ARM))
    assert (state.settings.gain, state.settings.damping, state.paused) == (30.0, 0.1, True)
    assert state.time == time
    assert session.robots["arm"].solver.gain == 30.0
