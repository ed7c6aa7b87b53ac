"""A goal of the action `control_msgs/action/FollowJointTrajectory` of ROS 2, in YAML, as `ros2 action send_goal` takes
it. The joints' names are those of the URDF; positions and velocities are in rad and m, rounded to 1e-9."""

from __future__ import annotations

from typing import Any

import yaml

from cinegen.mission.trajectory import Trajectory

SUFFIX = ".yaml"

_LONGEST = 128 * 1024  # bytes: Linux limits the length of an argument
_DIGITS = 9
_SECOND = 1_000_000_000  # ns

_DUMPER: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def write(trajectory: Trajectory, joints: tuple[str, ...]) -> bytes:
    """Return the goal of these joints."""
    positions = (trajectory.positions(joints).round(_DIGITS) + 0.0).tolist()  # no -0.0
    velocities = (trajectory.velocities(joints).round(_DIGITS) + 0.0).tolist()
    points = []
    for time, position, velocity in zip(trajectory.times.tolist(), positions, velocities, strict=True):
        seconds, nanoseconds = divmod(round(time * _SECOND), _SECOND)
        from_start = {"sec": seconds, "nanosec": nanoseconds}
        points.append({"positions": position, "velocities": velocity, "time_from_start": from_start})
    goal = {"trajectory": {"joint_names": list(joints), "points": points}}
    text: str = yaml.dump(goal, Dumper=_DUMPER, sort_keys=False, default_flow_style=None, width=10_000)
    return text.encode()


def note(content: bytes) -> str:
    """Return a note if the content is too long for `"$(cat FILE)"`."""
    if len(content) < _LONGEST:
        return ""
    return (
        f"{len(content) / 1e6:.1f} MB are too long for an argument: ros2 action send_goal --stdin (Jazzy and newer) "
        "takes them, or use a lower rate, between whose points the controller goes smoothly"
    )
