"""Which client sees what, has control, or is dropped: the hub, without a network."""

import json
from types import SimpleNamespace

import pytest
from msgspec.structs import replace

from cinegen.cockpit import clients
from cinegen.cockpit import hub as hubs
from cinegen.cockpit.hub import Hub
from cinegen.cockpit.messages import PROTOCOL, HelloMessage, ReportMessage, StateMessage, TickRate
from cinegen.session import commands as c
from cinegen.session.state import Settings

DELTA = SimpleNamespace(nodes=("base", "link5"), actuated=("joint1",))
SETUP = SimpleNamespace(robots={"delta": DELTA}, obstacles={}, switches=())
START = {"type": "start_drag", "robot": "delta", "node": "link5", "point": [0, 0, 0]}
MOVE = {"type": "move_drag", "position": [0, 0, 0]}
HELLO = HelloMessage(PROTOCOL, 1, "", (), (), (), (), (), None, (), None)
REPORT = ReportMessage(
    robots={}, switches=(), rate=TickRate(1000.0, 0, 0, 0.1, False), clients=1, sensors=(), undo=0, redo=0,
    paused=False, settings=Settings(100.0, 0.05, 0.1, 0.5, "world"), moving=None, recording=None, playback=None,
)  # fmt: skip


def at(monkeypatch, clock):
    """Let the hub and its clients read the time of a clock."""
    for module in (hubs, clients):
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=clock))


def state(time=0.0):
    return StateMessage(time, {}, {}, (), {}, {}, {})


class Line:
    """What a browser is told."""

    def __init__(self):
        self.told, self.closed = [], None

    def send(self, text):
        self.told.append(json.loads(text))

    def close(self, code, reason):
        self.closed = code, reason

    def frames(self):
        return [said["frame"] for said in self.told if said["type"] == "state"]

    def notices(self):
        return [said["text"] for said in self.told if said["type"] == "notice"]


def hub_of(*more, obey=lambda command: None, **options):
    return Hub(SETUP, obey, lambda number: replace(HELLO, client=number), *more, **options)


@pytest.fixture
def hub():
    hub = hub_of(obey=lambda command: hub.obeyed.append(command))
    hub.obeyed = []
    return hub


def test_the_fastest_client_decides_how_often_states_are_sent(hub):
    (slow_client, _), (fast, _) = join(hub), join(hub)
    assert hub.rate == 60.0
    says(hub, fast, type="request_rate", rate=90.0)
    assert (hub.rate, hub.controller) == (90.0, None)  # it takes no control
    says(hub, slow_client, type="request_rate", rate=72.0)
    assert hub.rate == 90.0
    hub.leave(fast)
    assert hub.rate == 72.0
    says(hub, slow_client, type="request_rate")
    assert hub.rate == 60.0
    says(hub, slow_client, type="request_rate", rate=121.0)
    assert not hub.clients


def join(hub):
    line = Line()
    return hub.join(line), line


def says(hub, client, **said):
    hub.receive(client, json.dumps(said))


def test_a_browser_gets_the_newest_frame_and_the_next_only_when_it_has_taken_that(hub):
    client, line = join(hub)
    assert [(said["type"], said["client"]) for said in line.told] == [("hello", 1)]
    for time in range(5):
        hub.show(state(time))
    assert line.frames() == [1]
    says(hub, client, type="ack", frame=1)
    assert line.frames() == [1, 5]  # those in between are old
    says(hub, client, type="ack", frame=4)  # not what it was sent
    hub.show(state(6.0))
    assert line.frames() == [1, 5]
    says(hub, client, type="ack", frame=5)
    assert line.frames() == [1, 5, 6]
    assert client.frames == 2


def test_reactions_are_wanted_while_a_browser_asks_which_needs_no_control(hub):
    (first, line), (second, _) = join(hub), join(hub)
    assert not hub.wants_reactions
    says(hub, first, type="request_reactions", on=True)
    says(hub, second, type="request_reactions", on=True)
    says(hub, first, type="request_reactions", on=False)
    assert hub.wants_reactions
    assert hub.controller is None
    assert line.notices() == []
    hub.leave(second)
    assert not hub.wants_reactions


def test_who_comes_late_sees_the_newest_at_once_with_its_report(hub):
    hub.show(state(), REPORT)
    hub.show(state())
    _, line = join(hub)
    assert line.told[1]["frame"] == 2
    assert line.told[1]["report"]["rate"] == {
        "ticks": 1000.0, "missed": 0, "missed_in_all": 0, "late": 0.1, "at_rest": False,
    }  # fmt: skip


def test_a_report_is_told_once_however_many_frames_are_left_out(hub):
    client, line = join(hub)
    hub.show(state())
    hub.show(state(), REPORT)
    hub.show(state())
    says(hub, client, type="ack", frame=1)
    hub.show(state())
    says(hub, client, type="ack", frame=3)
    assert ["report" in said for said in line.told[1:]] == [False, True, False]


def test_the_first_who_does_something_holds_the_hand_until_it_is_taken_or_gone(hub):
    first_client, first = join(hub)
    two, second = join(hub)
    says(hub, first_client, **START)
    assert hub.controller == first_client.number
    says(hub, two, **MOVE)
    assert second.notices() == ["another browser has control: take it first"]
    assert hub.obeyed == [c.StartDrag("delta", "link5", (0, 0, 0))]
    says(hub, two, type="request_control", on=True)
    assert hub.controller == two.number
    assert hub.obeyed[1:] == [c.EndDrag(), c.EndJointMotion()]  # what the first one held
    assert first.notices() == ["another browser has taken control"]
    says(hub, two, **MOVE)
    assert hub.obeyed[-1] == c.MoveDrag((0, 0, 0))
    hub.leave(two)
    assert hub.controller is None
    assert hub.obeyed[-2:] == [c.EndDrag(), c.EndJointMotion()]
    says(hub, first_client, type="undo")
    assert hub.controller == first_client.number
    says(hub, first_client, type="request_control", on=False)
    assert hub.controller is None


@pytest.mark.parametrize("message", [b"\x00\x01", '{"type": "ack"}', json.dumps({**START, "node": "nose"}), "x" * 5000])
def test_who_talks_nonsense_is_dropped_and_told_why(hub, message):
    client, line = join(hub)
    other, _ = join(hub)
    hub.receive(client, message)
    code, reason = line.closed
    assert code == 1008
    assert 3 < len(reason) <= 120
    assert list(hub.clients) == [other.number]
    hub.receive(client, '{"type": "undo"}')  # on its way still
    assert hub.obeyed == []


def test_who_floods_is_dropped(hub):
    client, line = join(hub)
    for _ in range(2 * clients.FASTEST):
        says(hub, client, **MOVE)
    assert line.closed == (1008, f"more than {clients.FASTEST} messages per second")
    assert len(hub.obeyed) < 1.5 * clients.FASTEST


def test_who_takes_no_frame_for_long_is_given_up(hub, monkeypatch):
    _, line = join(hub)
    hub.show(state())
    now = hubs.time.monotonic()
    at(monkeypatch, lambda: now + hubs.PATIENCE + 1)
    hub.show(state())
    assert line.closed[0] == 1001
    assert not hub.clients


def test_messages_beyond_the_budget_of_all_wait_but_not_those_of_who_has_control_or_sends_little(hub, monkeypatch):
    at(monkeypatch, lambda: now)
    now = 100.0
    hub = hub_of()
    greedy = [join(hub)[0] for _ in range(20)]
    modest, driver = join(hub)[0], join(hub)[0]
    says(hub, driver, type="request_control", on=True)
    read = dict.fromkeys(greedy, 0)
    free = dict.fromkeys(greedy, now)
    waited = 0.0
    for step in range(5000):
        now = 100.0 + 1e-3 * step
        for client in greedy:
            if now >= free[client]:
                free[client] = now + max(0.0025, hub.pause(client))
                read[client] += 1
        if step % 17 == 0:
            waited = max(waited, hub.pause(modest))
        if step % 3 == 0:  # a client sends at most 400 per second
            assert hub.pause(driver) == 0.0
    assert waited == 0.0
    assert sum(read.values()) < 1.2 * 5.0 * clients.BUDGET
    assert max(read.values()) < 1.1 * min(read.values())
    calm = hub_of()
    client, _ = join(calm)
    assert not any(calm.pause(client) for _ in range(clients.FASTEST))


def test_messages_wait_while_the_session_has_many_commands(hub):
    hub = hub_of(waiting=lambda: waiting)
    waiting = clients.QUEUE
    assert not hub.queue_is_full()
    waiting += 1
    assert hub.queue_is_full()


def test_it_receives_whether_anybody_watches(hub):
    watched = []
    hub = hub_of(lambda: watched.append(bool(hub.clients)))
    first, second = join(hub)[0], join(hub)[0]
    hub.show(state(1.0), REPORT)
    hub.leave(first)
    assert watched == [True]
    hub.leave(second)
    hub.leave(second)
    assert watched == [True, False]
    _, late = join(hub)
    assert watched == [True, False, True]
    assert late.frames() == []  # none that has grown old
    hub.show(state(2.0))
    assert late.frames() == [2]
    assert "report" not in late.told[-1]


def show(hub, *clients):
    """A new state, which the clients acknowledge."""
    hub.show(state())
    for client in clients:
        says(hub, client, type="ack", frame=client.sent)


def users_of(line):
    return [[(user["client"], user["name"]) for user in said["users"]] for said in line.told if "users" in said]


def test_users_and_their_pointers_are_seen_by_all_as_often_as_is_useful(hub, monkeypatch):
    now = 100.0
    at(monkeypatch, lambda: now)
    monkeypatch.setattr(hubs, "USERS", 0.05)
    first, first_line = join(hub)
    second, other = join(hub)
    cursor = {"type": "set_cursor", "robot": "delta", "node": "link5", "point": [0, 0, 0.1]}
    says(hub, first, **cursor)  # who has no name is not shown
    show(hub, first, second)
    assert users_of(first_line) == users_of(other) == []
    says(hub, first, **{"type": "set_user", "name": "<b>Ada</b>", "colour": 3})
    now += 0.06
    says(hub, first, **(cursor | {"dragging": True}))
    for _ in range(40):  # many messages, few lists
        says(hub, first, **cursor)
        says(hub, first, **(cursor | {"dragging": True}))
        show(hub, first, second)
    assert users_of(other)[0] == [(first.number, "<b>Ada</b>")]
    *_, (seen,) = (said["users"] for said in other.told if "users" in said)
    expected = {"robot": "delta", "node": "link5", "point": [0.0, 0.0, 0.1], "dragging": True, "colour": 3}
    assert {name: seen[name] for name in expected} == expected
    assert len(users_of(other)) <= 3
    late, line = join(hub)
    show(hub, late)
    assert users_of(line)[0] == [(first.number, "<b>Ada</b>")]
    hub.leave(first)
    now += 0.06
    show(hub, second, late)
    assert users_of(line)[-1] == users_of(other)[-1] == []
    assert hub.obeyed == []  # none of that needs control, or reaches the session


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ({"type": "set_user", "name": "", "colour": 0}, "length >= 1"),
        ({"type": "set_user", "name": "a\u202eb", "colour": 0}, "matching regex"),
        ({"type": "set_user", "name": "a", "colour": 8}, "<= 7"),
        ({"type": "set_cursor", "robot": "delta", "node": "nose"}, "Unknown node 'nose'"),
        ({"type": "set_cursor", "robot": "delta", "node": "link5", "point": [0, 0, 1e9]}, "1000000.0"),
    ],
)
def test_users_and_pointers_that_are_not_valid_are_refused(hub, message, reason):
    client, line = join(hub)
    says(hub, client, **message)
    assert line.closed[0] == 1008
    assert reason in line.closed[1]


def test_clients_that_take_control_in_turns_gain_nothing(hub, monkeypatch):
    at(monkeypatch, lambda: now)
    now = 100.0
    hub = hub_of()
    read = 0
    while now < 105.0:
        client, _ = join(hub)
        says(hub, client, type="request_control", on=True)
        for _ in range(clients.FASTEST):
            now += 1e-4 + hub.pause(client)
            read += 1
        hub.leave(client)
    assert read < 1.2 * 5.0 * (clients.BUDGET + clients.FASTEST)
