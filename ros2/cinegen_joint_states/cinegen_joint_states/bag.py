"""`complete_bag`: a recording with the states of all joints, from one with those of the actuated ones. Needs no ROS."""

from __future__ import annotations

import argparse
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from rosbags.interfaces import ConnectionExtRosbag2
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import cinegen
from cinegen_joint_states.joint_states import JointStateCompletion
from raff2urdf.command.output import run

_TYPE = "sensor_msgs/msg/JointState"
_SHOWN = 3  # messages that were not completed
_VERSION: Final = 8  # of the recording's metadata: ROS 2 Humble and newer read it


def complete_bag(robot: Path, recording: Path, made: Path, topic: str = "/joint_states") -> tuple[int, list[str]]:
    """Write a recording in which a topic has the states of all joints; other topics are copied.

    Args:
        robot: file of the robot, as `cinegen.load` reads.
        recording: a folder with its metadata, or a file, mcap or sqlite3.
        made: folder of the new recording, mcap; it must not exist.
        topic: topic of the joint states.

    Returns:
        how many messages were completed, and for each one that can't be and is left out, its time and the reason.

    Raises:
        CinegenError: the recording has no such topic with joint states, the robot can't be read, or `made` exists.
        ReaderError, WriterError: of rosbags: a recording can't be read or written.
    """
    completion = JointStateCompletion(cinegen.load(robot))
    if made.exists():
        raise cinegen.CinegenError(f"{made} exists: name another folder")
    with Reader(recording) as reader:
        states = [conn for conn in reader.connections if conn.msgtype == _TYPE]
        if topic not in [conn.topic for conn in states]:
            others = ", ".join(sorted({conn.topic for conn in states}))
            advice = f": name one of --topic {others}" if others else ", nor on another one"
            raise cinegen.CinegenError(f"{recording} has no joint states on topic {topic}{advice}")
        try:
            with Writer(made, version=_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
                return _completed(completion, reader, writer, topic)
        except BaseException:
            shutil.rmtree(made, ignore_errors=True)
            raise


def _completed(completion: JointStateCompletion, reader: Reader, writer: Writer, topic: str) -> tuple[int, list[str]]:
    types, connections = get_typestore(Stores.ROS2_HUMBLE), {}
    for conn in reader.connections:
        assert isinstance(conn.ext, ConnectionExtRosbag2)
        definition = {"msgdef": conn.msgdef.data, "rihs01": conn.digest} if conn.msgdef.data else {"typestore": types}
        connections[conn.id] = writer.add_connection(
            conn.topic, conn.msgtype, serialization_format=conn.ext.serialization_format,
            offered_qos_profiles=conn.ext.offered_qos_profiles, **definition,
        )  # fmt: skip
    completed, failed = 0, list[str]()
    for conn, time, raw in reader.messages():
        if conn.topic == topic and conn.msgtype == _TYPE:
            message: Any = types.deserialize_cdr(raw, _TYPE)
            try:
                state = completion.complete(message.name, message.position, message.velocity)
            except cinegen.CinegenError as error:
                failed.append(f"{time / 1e9:.9f} s: {error}")
                continue
            new = replace(
                message, name=list(state.names), position=state.positions, velocity=state.velocities, effort=np.zeros(0)
            )
            raw, completed = bytes(types.serialize_cdr(new, _TYPE)), completed + 1
        writer.write(connections[conn.id], time, raw)
    return completed, failed


def main() -> int:
    """Run the command by `raff2urdf.command.output.run`, which also keeps texts of recordings from controlling a
    terminal."""
    return run("complete_bag", _main)


def _main() -> int:
    parser = argparse.ArgumentParser(prog="complete_bag", description=str(complete_bag.__doc__).splitlines()[0])
    parser.add_argument("robot", type=Path, help="file of the robot: URDF with loops, RAFF ...")
    parser.add_argument("given", type=Path, help="recording, mcap or sqlite3")
    parser.add_argument("made", type=Path, help="folder of the new recording, mcap, which must not exist")
    parser.add_argument("--topic", default="/joint_states", help="topic of the joint states (%(default)s)")
    options = parser.parse_args()
    try:
        completed, failed = complete_bag(options.robot, options.given, options.made, options.topic)
    except Exception as error:  # rosbags' errors have no root of their own
        print(f"complete_bag: {error}", file=sys.stderr)
        return 1
    print(f"{completed} joint states completed, {len(failed)} left out")
    for reason in failed[:_SHOWN]:
        print(f"left out: {reason}", file=sys.stderr)
    if len(failed) > _SHOWN:
        print(f"... and {len(failed) - _SHOWN} more", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
