"""Who looks, who holds the hand, who is dropped: the hub, without a network."""

from __future__ import annotations

import json

import pytest

from cinegen.cockpit import hub as hubs
from cinegen.cockpit.hub import Hub
from cinegen.session import Vocabulary
from cinegen.session import commands as c

KNOWN = Vocabulary({"delta": {"base", "link5"}}, {"delta": {"joint1"}})
TAKE = {"take": {"robot": "delta", "node": "link5", "point": [0, 0, 0]}}


class Line:
    """What a browser is told."""

    def __init__(self):
        self.told, self.closed = [], None

    def send(self, text):
        self.told.append(json.loads(text))

    def close(self, code, reason):
        self.closed = code, reason

    def frames(self):
        return [said["frame"] for said in self.told if said["kind"] == "state"]

    def notices(self):
        return [said["words"] for said in self.told if said["kind"] == "notice"]


@pytest.fixture
def hub():
    obeyed = []
    hub = Hub(KNOWN, obeyed.append, lambda number: {"kind": "hello", "client": number})
    hub.obeyed = obeyed
    return hub


def join(hub):
    line = Line()
    return hub.join(line), line


def says(hub, client, **said):
    hub.heard(client, json.dumps(said))


def test_a_browser_gets_the_newest_frame_and_the_next_only_when_it_has_taken_that(hub):
    client, line = join(hub)
    assert line.told == [{"kind": "hello", "client": 1}]
    for time in range(5):
        hub.show({"kind": "state", "time": time})
    assert line.frames() == [1]
    says(hub, client, ack=1)
    assert line.frames() == [1, 5]  # those in between are old
    says(hub, client, ack=4)  # not what it was sent
    hub.show({"kind": "state", "time": 6})
    assert line.frames() == [1, 5]
    says(hub, client, ack=5)
    assert line.frames() == [1, 5, 6]
    assert client.frames == 2


def test_a_slow_one_holds_up_nobody(hub):
    slow, slow_line = join(hub)
    quick, quick_line = join(hub)
    for time in range(1, 11):
        hub.show({"kind": "state", "time": time})
        says(hub, quick, ack=time)
    assert slow_line.frames() == [1]
    assert quick_line.frames() == list(range(1, 11))
    assert slow.frames == 0


def test_who_comes_late_sees_the_newest_at_once_with_its_report(hub):
    hub.show({"kind": "state"}, {"rate": 1})
    hub.show({"kind": "state"})
    _, line = join(hub)
    assert line.told[1]["frame"] == 2
    assert line.told[1]["report"] == {"rate": 1}


def test_a_report_is_told_once_however_many_frames_are_left_out(hub):
    client, line = join(hub)
    hub.show({"kind": "state"})
    hub.show({"kind": "state"}, {"rate": 1})
    hub.show({"kind": "state"})
    says(hub, client, ack=1)
    hub.show({"kind": "state"})
    says(hub, client, ack=3)
    assert ["report" in said for said in line.told[1:]] == [False, True, False]


def test_the_first_who_does_something_holds_the_hand_until_it_is_taken_or_gone(hub):
    one, first = join(hub)
    two, second = join(hub)
    says(hub, one, **TAKE)
    assert hub.hand == one.number
    says(hub, two, lead=[0, 0, 0])
    assert second.notices() == ["another browser holds the hand: take it first"]
    assert hub.obeyed == [c.Take("delta", "link5", (0, 0, 0), False)]
    says(hub, two, hand=True)
    assert hub.hand == two.number
    assert hub.obeyed[1:] == [c.LetGo(False), c.EndJoint()]  # what the first one held
    assert first.notices() == ["another browser has taken the hand"]
    says(hub, two, lead=[0, 0, 0])
    assert hub.obeyed[-1] == c.Lead((0, 0, 0))
    hub.leave(two)
    assert hub.hand is None
    assert hub.obeyed[-2:] == [c.LetGo(False), c.EndJoint()]
    says(hub, one, undo=True)
    assert hub.hand == one.number
    says(hub, one, hand=False)
    assert hub.hand is None


def test_frames_say_who_holds_it(hub):
    client, line = join(hub)
    hub.show({"kind": "state"})
    says(hub, client, ack=1)
    says(hub, client, **TAKE)
    hub.show({"kind": "state"})
    assert [said["hand"] for said in line.told[1:]] == [None, client.number]


@pytest.mark.parametrize(
    "message", [b"\x00\x01", "", "null", "[]", '{"ack": "1"}', '{"hand": 1}', '{"lead": [1]}', "x" * 5000, '{"": 1}']
)
def test_who_talks_nonsense_is_dropped_and_told_why(hub, message):
    client, line = join(hub)
    other, _ = join(hub)
    hub.heard(client, message)
    code, reason = line.closed
    assert code == 1008
    assert 3 < len(reason) <= 120
    assert list(hub.clients) == [other.number]
    hub.heard(client, '{"undo": true}')  # on its way still
    assert hub.obeyed == []


def test_who_floods_is_dropped(hub):
    client, line = join(hub)
    for _ in range(2 * hubs.FASTEST):
        says(hub, client, lead=[0, 0, 0])
    assert line.closed == (1008, f"more than {hubs.FASTEST} messages a second")
    assert len(hub.obeyed) < 1.5 * hubs.FASTEST


def test_there_is_room_for_so_many(hub):
    lines = [join(hub) for _ in range(hubs.MOST + 20)]
    assert len(hub.clients) == hubs.MOST
    assert all(line.closed[0] == 1013 for client, line in lines if client is None)
    hub.leave(lines[0][0])
    assert join(hub)[0] is not None


def test_who_takes_no_frame_for_long_is_given_up(hub, monkeypatch):
    _, line = join(hub)
    hub.show({"kind": "state"})
    now = hubs.time.monotonic()
    monkeypatch.setattr(hubs.time, "monotonic", lambda: now + hubs.PATIENCE + 1)
    hub.show({"kind": "state"})
    assert line.closed[0] == 1001
    assert not hub.clients
