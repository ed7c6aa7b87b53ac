"""Commands: valid ones are decoded, everything else is refused with a message that names the field."""

import contextlib
import json
import math
import re
from types import SimpleNamespace
from typing import get_args

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen.ik.tasks.described import AxisAlong
from cinegen.session import Command, CommandError, decode_command
from cinegen.session import commands as c
from cinegen.session.message_types import LONGEST
from cinegen.session.setup import Device, SensorSwitch

SETUP = SimpleNamespace(
    robots={
        "delta": SimpleNamespace(
            nodes=("base", "link5"), actuated=("joint1",), joints=("joint1",), balls=(), base=None
        ),
        "arm": SimpleNamespace(nodes=("tool",), actuated=()),
    },
    obstacles={},
    switches=(SensorSwitch("delta", "link5", (None, "1")),),
    devices=(Device("1", "spnav:"),),
)
TYPES = {command.__struct_config__.tag for command in get_args(Command)}


COMMANDS = [
    c.StartDrag("arm", "tool", (1, 0, -2), False), c.StartDrag("delta", "link5", None, True),
    c.MoveDrag((1.0, 2.0, 3.0)), c.MoveDrag((1, 2, 3), (0, 0, 0, 1)), c.EndDrag(True), c.Pin("arm", "tool"),
    c.AddTask("delta", AxisAlong(node="link5")), c.RemoveTask(4), c.ChangeTask(4, weight=2.0),
    c.MoveJoint("delta", "joint1", 0.5), c.LockJoint("delta", "joint1", True), c.EndJointMotion(), c.MoveHome(None),
    c.MoveTo("arm", "tool", (1.0, 0.5)), c.SaveWaypoint("über <b>"), c.ChangeWaypoint(3, "b", 0), c.RemoveWaypoint(3),
    c.MoveToWaypoint(3), c.PlayWaypoints(True, True), c.Undo(), c.Redo(), c.Pause(False),
    c.SelectSensor("delta", "link5", "1"), c.SelectSensor("delta", "link5", None), c.ChangeSensor("1", "x, -z, y"),
    c.SetPayload("arm", "tool", 2.0), c.SetView((0.0, 0.0, 0.0, 1.0)), c.ChangeSettings(damping=0.1, frame="tool"),
    c.SetRecording(True), c.GamepadInput((1, 0, 0, 0, 0, -1), frozenset({3})), c.ControlPlayback(speed=0.5),
]  # fmt: skip
"""Of every type; the reference of the messages, which is generated, pins how they are written."""


def test_valid_commands():
    assert {command.__struct_config__.tag for command in COMMANDS} == TYPES
    for command in COMMANDS:
        assert decode_command(msgspec.json.encode(command).decode(), SETUP) == command
    assert decode_command(of("gamepad_input", twist=[2, 0, 0, 0, 0, -2]), SETUP).twist == (1, 0, 0, 0, 0, -1)


def of(kind, **fields):
    return json.dumps({"type": kind, **fields})


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (b"{}", "must be text"),
        ("{", "truncated"),
        (of("dance"), "Invalid value 'dance' - at `$.type`"),
        (of("undo", now=True), "unknown field `now`"),
        ('{"type": "undo"} {"type": "undo"}', "trailing characters"),
        (of("start_drag", robot="no", node="link5"), "Unknown robot 'no' - at `$.robot`"),
        (of("start_drag", robot="delta", node="tool"), "Unknown node 'tool' - at `$.node`"),
        (of("start_drag", robot="delta", node="link5", rotation=1), "Expected `bool`, got `int` - at `$.rotation`"),
        ('{"type": "move_drag", "position": [0, 1e400, 0]}', "out of range - at `$.position[1]`"),
        (of("move_drag", position=[0, 1e7, 0]), "<= 1000000.0 - at `$.position[1]`"),
        (of("move_drag", position=[0, 0, 0], quaternion=[0, 0, 0, 0]), "length 1, not 0 - at `$.quaternion`"),
        (of("change_task", task=1, weight=0), ">= 0.01 - at `$.weight`"),
        (of("select_sensor", robot="delta", node="link5", sensor="2"), "Unknown sensor '2' - at `$.sensor`"),
        (of("change_sensor", sensor="2", axes="x"), "Unknown sensor '2' - at `$.sensor`"),
        (of("change_sensor", sensor="1", axes="x, q"), "'q' is no axis of a sensor"),
        (of("save_waypoint", name="a\nb"), "matching regex"),
        (of("save_waypoint", name="a\u202eb"), "matching regex"),
        ('{"type": "move_to", "robot": "arm", "node": "tool", "q": ' + "[" * 1000, "at `$.q[0]`"),
        ('{"robot": ' + "[" * 1900, "recursion"),
        ('"' + "x" * LONGEST + '"', f"longer than {LONGEST}"),
    ],
)
def test_other_commands_are_refused_with_a_reason(message, reason):
    with pytest.raises(CommandError, match=re.escape(reason)):
        decode_command(message, SETUP)


ANYTHING = st.recursive(st.none() | st.booleans() | st.floats() | st.integers() | st.text(), st.lists, max_leaves=8)


@given(st.text() | st.binary() | ANYTHING.map(json.dumps))
def test_nothing_else_is_raised(message):
    with contextlib.suppress(CommandError):
        decode_command(message, SETUP)


FIELDS = sorted({field for command in get_args(Command) for field in command.__struct_fields__})


@given(st.sampled_from(sorted(TYPES)), st.dictionaries(st.sampled_from(FIELDS), ANYTHING))
def test_nor_for_a_known_type(kind, fields):
    with contextlib.suppress(CommandError):
        assert isinstance(decode_command(of(kind, **fields), SETUP), Command)


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda x: 0.91 < math.hypot(*x) < 1.09))
def test_a_quaternion_is_normalized(numbers):
    quaternion = decode_command(of("set_view", quaternion=numbers), SETUP).quaternion
    assert math.hypot(*quaternion) == pytest.approx(1.0, abs=1e-12)
