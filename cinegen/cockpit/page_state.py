"""States as pages get them: a quarter of the bytes of JSON.

A byte 0, three unused ones, the length of the JSON (uint32), the JSON without poses and some empty fields, spaces to a
multiple of four bytes, then the poses of all robots in the order of `hello`: of each its base pose, and those of its
nodes that joints move. The page has the placements of the other nodes. A pose is its position as float32 and its
quaternion as int16, in parts of 32767: together 20 bytes, whose rounding is far below a pixel. Integers and floats
begin with their lowest byte. Drawing commands of meshcat come over the same connection; none begins with a byte 0.
"""

from __future__ import annotations

import struct

import numpy as np
from msgspec import UNSET
from msgspec.structs import asdict

from cinegen.arrays import Integers
from cinegen.cockpit.messages import HelloMessage, StateMessage
from cinegen.typed_json import encode

_HEAD = struct.Struct("<II")
_HEADER = ("time", "frame", "controller", "report", "users")
_OPTIONAL = ("obstacles", "obstructions", "torques", "described")  # left out where they are empty
_ONE = 32767  # stands for 1 in a quaternion
_PACKED = np.dtype([("position", "<f4", 3), ("quaternion", "<i2", 4)])


def moving_rows(hello: HelloMessage) -> dict[str, Integers]:
    """Return the rows of each robot's poses that a state has to send: of its base and of the nodes that joints move."""
    return {
        robot.name: np.array([0, *(i for i, node in enumerate(robot.nodes, 1) if node.placement is None)])
        for robot in hello.robots
    }


def shown_of(state: StateMessage, rows: dict[str, Integers]) -> tuple[bytes, bytes]:
    """Encode what a page shows of a state: JSON without what tells states apart that look alike, and poses.

    Args:
        state: the state.
        rows: what `moving_rows` returned of the same robots.
    """
    fields = {name: value for name, value in asdict(state).items() if name not in (*_HEADER, "poses")}
    text = encode({name: value for name, value in fields.items() if value or name not in _OPTIONAL})
    numbers = [np.reshape(state.poses[robot], (-1, 7))[which] for robot, which in rows.items()]
    poses = np.vstack([*numbers, np.empty((0, 7))])
    packed = np.empty(len(poses), _PACKED)
    packed["position"], packed["quaternion"] = poses[:, :3], np.round(_ONE * poses[:, 3:])
    return text, packed.tobytes()


def page_state(state: StateMessage, shown: tuple[bytes, bytes]) -> bytes:
    """Encode a state for pages.

    Args:
        state: the state.
        shown: what `shown_of` returned of it.
    """
    header = {name: value for name in _HEADER if (value := getattr(state, name)) is not UNSET}
    text, poses = encode({"type": "state"} | header)[:-1] + b"," + shown[0][1:], shown[1]
    text += b" " * (-len(text) % 4)
    return b"".join((_HEAD.pack(0, len(text)), text, poses))
