"""Waypoints: they are saved, renamed, reordered, removed, moved to and played, and what was played is a mission."""

import json

import numpy as np
import pytest

import cinegen
from cinegen.mission import Recording, export
from cinegen.session import Session, Setup
from cinegen.session import commands as c
from cinegen.session.waypoints import MOST_WAYPOINTS

RATE = 250.0


@pytest.fixture
def session(robot, tmp_path, monkeypatch, closing):
    """Of a five-bar and a planar arm; what it records is in `tmp_path`."""
    monkeypatch.chdir(tmp_path)
    return closing(Session(Setup({"five_bar": robot("five_bar"), "arm": robot("planar_3r")}, rate=RATE)))


def run(session, *commands, most=20_000):
    """Obey, and tick until nothing moves."""
    for command in commands:
        session.obey(command)
    for _ in range(most):
        session.tick()
        if session.state().moving is None:
            return session.state()
    raise AssertionError("it moves for ever")


def configurations(session):
    return {name: robot.q.copy() for name, robot in session.robots.items()}


def place(session, value, name):
    """Move a joint of each robot away from home by a value (rad), and save that as a waypoint."""
    five_bar = session.robots["five_bar"]
    joint = five_bar.mechanism.actuated[0]
    at = five_bar.home[five_bar.mechanism.q_index(joint)]
    moves = c.MoveJoint("five_bar", joint, at + value), c.MoveJoint("arm", "joint2", 3.0 * value)
    run(session, *moves, c.EndJointMotion())
    session.obey(c.SaveWaypoint(name))
    return configurations(session)


def names(session):
    return [waypoint.name for waypoint in session.state().waypoints]


def differs(first, other):
    return max(np.abs(first[name] - other[name]).max() for name in first)


def test_the_list_is_renamed_reordered_and_shortened(session):
    for name in ("a", "b", "c", "d"):
        session.obey(c.SaveWaypoint(name))
    a, b, _, d = (waypoint.id for waypoint in session.state().waypoints)
    session.obey(c.ChangeWaypoint(a, index=2))
    assert names(session) == ["b", "c", "a", "d"]
    session.obey(c.ChangeWaypoint(d, name="z", index=0))
    session.obey(c.ChangeWaypoint(b, index=1000))
    assert names(session) == ["z", "c", "a", "b"]
    session.obey(c.RemoveWaypoint(a))
    assert names(session) == ["z", "c", "b"]
    assert session.state().notices == ()
    for command in (c.RemoveWaypoint(a), c.MoveToWaypoint(a), c.ChangeWaypoint(a, name="x")):  # others were faster
        session.obey(command)
    assert [notice.text for notice in session.state().notices] == ["this waypoint was removed"] * 3
    for _ in range(MOST_WAYPOINTS):
        session.obey(c.SaveWaypoint("more"))
    assert len(names(session)) == MOST_WAYPOINTS
    assert "remove some first" in session.state().notices[-1].text


def test_all_robots_move_to_a_waypoint_and_back_by_undo(session):
    home = configurations(session)
    goal = place(session, 0.2, "goal")
    (waypoint,) = session.state().waypoints
    run(session, c.MoveHome())
    session.obey(c.Pin("arm", "tool"))
    session.obey(c.MoveToWaypoint(waypoint.id))
    session.tick()
    state = session.state()
    assert (state.moving, state.waypoint) == ("waypoint", waypoint.id)
    assert state.robots["arm"].tasks == ()  # as for a motion home, pins are removed
    largest, before = 0.0, configurations(session)
    for _ in range(2000):
        session.tick()
        largest = max(largest, differs(configurations(session), before))
        before = configurations(session)
        assert session.state().robots["five_bar"].closure < 1e-10
        if session.state().moving is None:
            break
    assert differs(before, goal) == 0.0
    assert largest < 0.02  # rad a tick: it moves there on a path
    assert session.state().waypoint is None
    run(session, c.Undo())
    assert differs(configurations(session), home) < 1e-9
    assert session.state().notices == ()


def test_waypoints_of_two_assembly_modes_are_mended_as_the_message_says(session):
    place(session, 0.1, "a")
    bars = session.robots["five_bar"]
    actuated = [bars.q[bars.mechanism.q_index(joint)] for joint in bars.mechanism.actuated]
    other = max(cinegen.assembly_modes(bars.mechanism, actuated), key=lambda q: np.abs(q - bars.q).max())
    run(session, c.MoveTo("five_bar", "tool", tuple(other)))
    session.obey(c.SaveWaypoint("b"))

    def played():
        before = len(session.state().notices)
        return "".join(notice.text for notice in run(session, c.PlayWaypoints(on=True)).notices[before:])

    failed = "waypoints are no longer played: five_bar can't reach '{}' on a path: {}"
    assert failed.format("a", "play again") in played()
    assert failed.format("b", "drag it there from 'a' and save it again, or remove it") in played()
    first, second = session.state().waypoints
    run(session, c.MoveToWaypoint(first.id))
    session.obey(c.RemoveWaypoint(second.id))
    point = bars.mechanism.placement(bars.q, bars.mechanism.end).translation
    session.obey(c.StartDrag("five_bar", bars.mechanism.end, (0, 0, 0)))
    session.obey(c.MoveDrag(tuple(point + np.array([0.02, 0.01, 0.0]))))
    for _ in range(500):
        session.tick()
    session.obey(c.EndDrag())
    session.obey(c.SaveWaypoint("b"))
    assert "played" not in played()


def test_waypoints_that_are_played_with_a_recording_are_a_mission(session, tmp_path):
    poses = [place(session, value, f"p{value}") for value in (0.1, 0.25, -0.1)]
    first = session.state().waypoints[0]
    session.obey(c.ChangeWaypoint(first.id, index=2))  # the order of the list counts, not that of saving
    steps = session.state().undo
    state = run(session, c.PlayWaypoints(on=True, record=True))
    assert state.undo == steps + 1
    assert differs(configurations(session), poses[0]) == 0.0
    assert state.recording is None
    assert state.notices[-1].text.startswith("recorded ")
    session.close()
    (path,) = tmp_path.glob("mission-*.jsonl")
    recording = Recording.load(path)
    for name, q in recording.q.items():
        assert np.array_equal(q[0], poses[1][name])
        assert np.array_equal(q[-1], poses[0][name])
        nearest = np.abs(q - poses[2][name]).max(axis=1).min()
        assert nearest < 1e-6
        assert np.abs(np.diff(q, axis=0)).max() < 0.05
    report = export(path, "csv", tmp_path / "motion.csv", robot="five_bar")
    assert not report.findings
    assert json.loads(path.read_text().splitlines()[0])["cinegen"] == "mission"


@pytest.mark.parametrize(
    "interruption", [c.StartDrag("arm", "tool"), c.MoveHome("arm"), c.Undo(), c.PlayWaypoints(False)]
)
def test_whatever_else_moves_a_robot_ends_the_motion_and_its_recording(session, interruption):
    place(session, 0.1, "a")
    place(session, 0.3, "b")
    session.obey(c.PlayWaypoints(on=True, record=True))
    while session.state().recording is None:
        session.tick()
    session.obey(interruption)
    assert session.state().waypoint is None
    assert session.state().recording is None
    if isinstance(interruption, c.StartDrag):
        before = configurations(session)
        for _ in range(500):
            session.tick()
        assert differs(configurations(session), before) < 1e-6
    else:
        run(session)
    assert len(session.state().waypoints) == 2


def test_playing_needs_two_waypoints_and_no_other_recording(session):
    session.obey(c.PlayWaypoints(on=True))
    assert session.state().notices[-1].text == "save two waypoints or more to play them"
    place(session, 0.1, "a")
    place(session, 0.2, "b")
    session.obey(c.SetRecording(True))
    session.obey(c.PlayWaypoints(on=True, record=True))
    assert "a recording is in progress" in session.state().notices[-1].text
    assert session.state().waypoint is None
    run(session, c.PlayWaypoints(on=True))
    assert session.state().recording is not None  # the user's own goes on
