"""Commands: what makes sense is read, everything else is refused with a reason."""

from __future__ import annotations

import contextlib
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen.session import CommandError, Vocabulary, parse, read
from cinegen.session import commands as c

KNOWN = Vocabulary(
    nodes={"delta": {"base", "link5"}, "arm": {"tool"}},
    motors={"delta": {"joint1"}, "arm": set()},
    choices={("delta", "link5"): {None, "1"}},
)


def said(message):
    return parse(read(json.dumps(message)), KNOWN)


@pytest.mark.parametrize(
    ("message", "command"),
    [
        ({"take": {"robot": "arm", "node": "tool", "point": [1, 0, -2]}}, c.Take("arm", "tool", (1, 0, -2), False)),
        ({"take": {"robot": "delta", "node": "link5", "turn": True}}, c.Take("delta", "link5", None, True)),
        ({"lead": [1, 2, 3]}, c.Lead((1.0, 2.0, 3.0))),
        ({"lead": [1, 2, 3, 0, 0, 0, 1]}, c.Lead((1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0))),
        ({"let go": True}, c.LetGo(False)),
        ({"let go": "pin"}, c.LetGo(True)),
        ({"pin": {"robot": "arm", "node": "tool"}}, c.Pin("arm", "tool")),
        ({"release": 4}, c.Release(4)),
        ({"weight": [4, 2]}, c.Weigh(4, 2.0)),
        ({"holds": [4, 3, 0]}, c.Holds(4, 3, 0)),
        ({"joint": {"robot": "delta", "joint": "joint1", "value": 0.5}}, c.MoveJoint("delta", "joint1", 0.5)),
        ({"joint": None}, c.EndJoint()),
        ({"home": None}, c.Home(None)),
        ({"home": "arm"}, c.Home("arm")),
        ({"visit": {"robot": "arm", "node": "tool", "q": [1, 0.5]}}, c.Visit("arm", "tool", (1.0, 0.5))),
        ({"undo": True}, c.Undo()),
        ({"redo": True}, c.Redo()),
        ({"pause": False}, c.Pause(False)),
        ({"switch": {"robot": "delta", "node": "link5", "sensor": "1"}}, c.Choose("delta", "link5", "1")),
        ({"switch": {"robot": "delta", "node": "link5", "sensor": None}}, c.Choose("delta", "link5", None)),
        ({"frame": "tool"}, c.Frame("tool")),
        ({"view": [0, 0, 0, 1]}, c.View((0.0, 0.0, 0.0, 1.0))),
        ({"gain": 20}, c.Set("gain", 20.0)),
        ({"damping": 0.1}, c.Set("damping", 0.1)),
        ({"record": True}, c.Record(True)),
        ({"gamepad": {"twist": [2, 0, 0, 0, 0, -2], "buttons": [3]}}, c.Gamepad((1, 0, 0, 0, 0, -1), frozenset({3}))),
        ({"play": True}, c.Play(True)),
        ({"seek": 1.5}, c.Seek(1.5)),
        ({"tempo": 0.5}, c.Tempo(0.5)),
    ],
)  # fmt: skip
def test_what_may_be_said(message, command):
    assert said(message) == command


def test_every_kind_is_said_once_above():
    examples = next(mark for mark in test_what_may_be_said.pytestmark if mark.name == "parametrize").args[1]
    assert {kind for message, _ in examples for kind in message} == set(c.KINDS) - {"speed", "turning"}


@pytest.mark.parametrize(
    ("message", "says"),
    [
        (b"{}", "text"),
        ("{", "JSON"),
        ("[1]", "object"),
        ("{}", "one name"),
        ('{"lead": [0, 0, 0], "undo": true}', "one name"),
        ('{"dance": 1}', "nothing is called 'dance'"),
        ('{"take": 1}', "object of"),
        ('{"take": {"robot": "no", "node": "link5"}}', "no such robot"),
        ('{"take": {"robot": ["delta"], "node": "tool"}}', "no such robot"),
        ('{"take": {"robot": "delta", "node": "tool"}}', "no such part"),
        ('{"take": {"robot": "delta", "node": "link5"}}', "turn is true or false"),
        ('{"take": {"robot": "delta", "node": "link5", "turn": true, "speed": 1}}', "object of"),
        ('{"lead": [0, 0]}', "3 numbers"),
        ('{"lead": [0, NaN, 0]}', "JSON"),
        ('{"lead": [0, 1e400, 0]}', "3 numbers"),
        ('{"lead": [0, 1e7, 0]}', "not beyond"),
        ('{"lead": [0, true, 0]}', "3 numbers"),
        ('{"lead": "000"}', "3 numbers"),
        ('{"lead": [0, 0, 0, 0, 0, 0, 0]}', "quaternion"),
        ('{"let go": "now"}', "'let go'"),
        ('{"release": -1}', "whole number"),
        ('{"release": 1.0}', "whole number"),
        ('{"weight": [1, 0]}', "a weight is a number from 0.01"),
        ('{"holds": [1, 4, 0]}', "0 to 3"),
        ('{"joint": {"robot": "arm", "joint": "joint1", "value": 0}}', "no such motor"),
        ('{"joint": {"robot": "delta", "joint": "joint1", "value": Infinity}}', "JSON"),
        ('{"joint": {"robot": "delta", "joint": "joint1"}}', "a joint's value"),
        ('{"home": "no"}', "no such robot"),
        ('{"undo": 1}', "true"),
        ('{"switch": {"robot": "delta", "node": "link5", "sensor": "2"}}', "no such sensor"),
        ('{"switch": {"robot": "arm", "node": "tool", "sensor": null}}', "no such sensor"),
        ('{"frame": "moon"}', "one of world"),
        ('{"frame": ["world"]}', "one of world"),
        ('{"gain": 0}', "gain is a number from 1"),
        ('{"gain": 1e999}', "gain is a number"),
        ('{"gamepad": {"twist": [0, 0, 0, 0, 0]}}', "6 numbers"),
        ('{"gamepad": {"twist": [0, 0, 0, 0, 0, 0], "buttons": [99]}}', "0 to 63"),
        ("[" * 1000, "JSON"),
        ('"' + "x" * c.LONGEST + '"', "characters at most"),
    ],
)
def test_what_makes_no_sense_is_told(message, says):
    with pytest.raises(CommandError, match=says):
        parse(read(message), KNOWN)


ANYTHING = st.recursive(st.none() | st.booleans() | st.floats() | st.integers() | st.text(), st.lists, max_leaves=8)


@given(st.text() | st.binary() | ANYTHING.map(json.dumps))
def test_nothing_else_ever_happens(message):
    with contextlib.suppress(CommandError):
        parse(read(message), KNOWN)


@given(
    st.sampled_from(sorted(c.KINDS)), ANYTHING | st.dictionaries(st.sampled_from(["robot", "node", "point"]), ANYTHING)
)
def test_nor_where_the_name_is_right(kind, value):
    with contextlib.suppress(CommandError):
        assert isinstance(parse({kind: value}, KNOWN), c.Command)


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda x: 0.91 < math.hypot(*x) < 1.09))
def test_a_quaternion_is_made_one(numbers):
    assert math.hypot(*said({"view": numbers}).quaternion) == pytest.approx(1.0, abs=1e-12)
