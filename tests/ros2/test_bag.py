"""`complete_bag`, on recordings that rosbags writes and reads."""

import sys

import numpy as np
import pytest
from cinegen_joint_states.bag import complete_bag, main
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPES = get_typestore(Stores.ROS2_HUMBLE)
JOINT_STATE, STRING = "sensor_msgs/msg/JointState", "std_msgs/msg/String"


def state(seconds, names, positions, velocities=()):
    stamp = TYPES.types["builtin_interfaces/msg/Time"](int(seconds), round(seconds % 1 * 1e9))
    header = TYPES.types["std_msgs/msg/Header"](stamp, "base")
    values = [np.array(numbers, dtype=float) for numbers in (positions, velocities, ())]
    return TYPES.types[JOINT_STATE](header, list(names), *values)


def record(folder, storage, states, topic="/joint_states"):
    with Writer(folder, version=8, storage_plugin=storage) as writer:
        chatter = writer.add_connection("/chatter", STRING, typestore=TYPES)
        moved = writer.add_connection(topic, JOINT_STATE, typestore=TYPES)
        writer.write(chatter, 1, TYPES.serialize_cdr(TYPES.types[STRING]("hello"), STRING))
        for number, sample in enumerate(states):
            writer.write(moved, (number + 2) * 10_000_000, TYPES.serialize_cdr(sample, JOINT_STATE))
    return folder


def read(folder):
    with AnyReader([folder], default_typestore=TYPES) as reader:
        return [(conn.topic, time, reader.deserialize(raw, conn.msgtype)) for conn, time, raw in reader.messages()]


@pytest.fixture
def states():
    angles = np.linspace(0.0, 0.3, 20)
    names = ["joint1", "joint6", "joint12"]
    return [state(0.01 * i, names, [a, 0.5 * a, -a], [1, 0.5, -1]) for i, a in enumerate(angles)]


@pytest.mark.parametrize("storage", StoragePlugin)
def test_a_recording_of_the_actuated_joints_becomes_one_of_all(robot, root, tmp_path, storage, states):
    bag, made = record(tmp_path / "given", storage, states), tmp_path / "made"
    assert complete_bag(root / "generated/delta4.urdf", bag, made) == (20, [])
    delta, (greeting, *messages) = robot("delta4"), read(made)
    assert (greeting[0], greeting[1], greeting[2].data) == ("/chatter", 1, "hello")
    for (topic, time, message), before, number in zip(messages, states, range(20), strict=True):
        assert (topic, time) == ("/joint_states", (number + 2) * 10_000_000)
        assert repr(message.header) == repr(before.header)
        q = delta.configuration(dict(zip(message.name, message.position, strict=True)))
        assert delta.closure(q) < 1e-12
        assert [q[delta.q_index(name)] for name in before.name] == pytest.approx(before.position, abs=1e-15)
        assert len(message.velocity) == len(message.name) == len(delta.joints)
        assert not len(message.effort)


def test_what_cannot_be_completed_is_left_out_and_told(root, tmp_path, states, capsys, monkeypatch):
    states[3] = state(0.03, ["joint1"], [np.nan])
    bag = record(tmp_path / "given", StoragePlugin.MCAP, states)
    command = ["complete_bag", root / "generated/delta4.urdf", bag, tmp_path / "made"]
    monkeypatch.setattr(sys, "argv", [*map(str, command)])
    assert main() == 1
    out, err = capsys.readouterr()
    assert out == "19 joint states completed, 1 left out\n"
    assert "left out: 0.050000000 s: the value of joint 'joint1' is not a finite number" in err
    assert len(read(tmp_path / "made")) == 20


@pytest.mark.parametrize(
    ("robot", "topic", "made", "message"),
    [
        ("delta4", "/states", "made", r"no joint states on topic /states: name one of --topic /joint_states"),
        ("delta4", "/joint_states", "given", "exists: name another folder"),
        ("delta99", "/joint_states", "made", "delta99"),
    ],
)
def test_nothing_is_written_where_something_is_wrong(root, tmp_path, states, robot, topic, made, message):
    bag = record(tmp_path / "given", StoragePlugin.MCAP, states)
    before = read(bag)
    with pytest.raises(Exception, match=message):
        complete_bag(root / f"generated/{robot}.urdf", bag, tmp_path / made, topic)
    assert [path.name for path in tmp_path.iterdir()] == ["given"]
    assert len(read(bag)) == len(before)


def test_names_of_topics_control_no_terminal(root, tmp_path, states, capsys, monkeypatch):
    bag = record(tmp_path / "given", StoragePlugin.MCAP, states)
    command = ["complete_bag", root / "generated/delta4.urdf", bag, tmp_path / "made", "--topic", "/joints\x1b[2J"]
    monkeypatch.setattr(sys, "argv", [*map(str, command)])
    assert main() == 1
    assert r"/joints\u001b[2J" in capsys.readouterr().err
