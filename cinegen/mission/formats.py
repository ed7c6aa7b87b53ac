"""Export formats of a joint trajectory: s, rad and m. A new format is a function and a line in `FORMATS`.

csv: a table `time,joint1,...` with a line for each sample; every number reads back to the same double. An
    apostrophe precedes a name that a spreadsheet would compute, such as `=1+1`.
npz: arrays for numpy, `times` (n,), `joints` (m,) their names, `q` and `v` (n, m), `rate`, `robot`.
ros2: a goal of the action `control_msgs/action/FollowJointTrajectory` of ROS 2 in YAML, as `ros2 action send_goal`
    takes it. The joints' names are those of the URDF; numbers are rounded to 1e-9.
urscript: a URScript program for arms of Universal Robots, `movej` to the start, then `servoj` for each sample; rad, 6
    digits. The first of the six actuated joints is the base, the last the third wrist.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import yaml

from cinegen.errors import UnknownNameError
from cinegen.mission.file_format import MissionError
from cinegen.mission.trajectory import Trajectory
from raff2urdf.errors import counted
from raff2urdf.escape import csv_cell, line_comment

_LONGEST = 128 * 1024  # bytes: Linux limits the length of an argument
_DIGITS = 9
_SECOND = 1_000_000_000  # ns

_ACCELERATION, _SPEED = 1.0, 0.5  # rad/s^2 and rad/s of the motion to the start
_LOOKAHEAD = 0.1  # s
_GAIN = 300
_STOP = 2.0  # rad/s^2


def _csv(trajectory: Trajectory, joints: tuple[str, ...]) -> bytes:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["time", *map(csv_cell, joints)])
    table.writerows(np.column_stack([trajectory.times, trajectory.positions(joints)]).tolist())
    return text.getvalue().encode()


def _npz(trajectory: Trajectory, joints: tuple[str, ...]) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(
        file,
        times=trajectory.times,
        joints=np.array(joints),
        q=trajectory.positions(joints),
        v=trajectory.velocities(joints),
        rate=np.array(trajectory.rate),
        robot=np.array(trajectory.name),
    )
    return file.getvalue()


def _ros2(trajectory: Trajectory, joints: tuple[str, ...]) -> bytes:
    positions = (trajectory.positions(joints).round(_DIGITS) + 0.0).tolist()  # no -0.0
    velocities = (trajectory.velocities(joints).round(_DIGITS) + 0.0).tolist()
    points = []
    for time, position, velocity in zip(trajectory.times.tolist(), positions, velocities, strict=True):
        seconds, nanoseconds = divmod(round(time * _SECOND), _SECOND)
        from_start = {"sec": seconds, "nanosec": nanoseconds}
        points.append({"positions": position, "velocities": velocity, "time_from_start": from_start})
    goal = {"trajectory": {"joint_names": list(joints), "points": points}}
    dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    text: str = yaml.dump(goal, Dumper=dumper, sort_keys=False, default_flow_style=None, width=10_000)
    return text.encode()


def _ros2_note(content: bytes) -> str:
    """Return a note if the content is too long for `"$(cat FILE)"`."""
    if len(content) < _LONGEST:
        return ""
    return (
        f"{len(content) / 1e6:.1f} MB are too long for an argument: ros2 action send_goal --stdin (Jazzy and newer) "
        "takes them, or use a lower rate, between whose points the controller interpolates"
    )


def _urscript(trajectory: Trajectory, joints: tuple[str, ...]) -> bytes:
    mechanism = trajectory.mechanism
    revolute = [joint for joint in joints if joint in mechanism.actuated and not mechanism.is_prismatic(joint)]
    if len(joints) != 6 or len(revolute) != 6:
        more = f", and {counted(len(joints) - len(revolute), 'other joint')}" if len(joints) > len(revolute) else ""
        raise MissionError(f"URScript needs six actuated revolute joints: {trajectory.name} has {len(revolute)}{more}")
    q, period = trajectory.positions(joints), 1.0 / trajectory.rate
    first, *others = (f"[{', '.join(f'{value:.6f}' for value in row + 0.0)}]" for row in q)
    about = f"{trajectory.name}: {len(q)} positions in {trajectory.seconds:.3f} s, {trajectory.rate:g} a second"
    lines = [
        f"# {line_comment(about)}",
        f"# joints, base first (rad): {line_comment(', '.join(joints))}",
        "# Made by cinegen. It first moves to the start along a straight line in joint space: keep that path clear.",
        "def cinegen_motion():",
        f"  movej({first}, a={_ACCELERATION}, v={_SPEED})",
        *(f"  servoj({row}, 0, 0, {period:.6g}, {_LOOKAHEAD}, {_GAIN})" for row in others),
        f"  stopj({_STOP})",
        "end",
    ]
    return ("\n".join(lines) + "\n").encode()


class Format(NamedTuple):
    """An export format.

    Attributes:
        suffix: suffix of its files.
        write: returns the content of a file with the motion of some joints; raises `MissionError` if the format can't
            express it.
        note: returns a note for users about a file with some content; empty without one.
    """

    suffix: str
    write: Callable[[Trajectory, tuple[str, ...]], bytes]
    note: Callable[[bytes], str] = lambda content: ""


FORMATS: Mapping[str, Format] = {
    "csv": Format(".csv", _csv),
    "npz": Format(".npz", _npz),
    "ros2": Format(".yaml", _ros2, _ros2_note),
    "urscript": Format(".script", _urscript),
}
"""Formats by name."""


def format_of(name: str) -> Format:
    """Return a format by its name.

    Raises:
        UnknownNameError: no such format.
    """
    if name not in FORMATS:
        raise UnknownNameError("format", name, tuple(FORMATS))
    return FORMATS[name]
