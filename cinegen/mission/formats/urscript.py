"""A URScript program for arms of Universal Robots: `movej` to the start, then `servoj` for each sample; rad, 6 digits.
The first of the six actuated joints is the base, the last the third wrist."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cinegen.mission.file_format import MissionError
from cinegen.mission.trajectory import Trajectory

Array = NDArray[np.float64]

SUFFIX = ".script"

_ACCELERATION, _SPEED = 1.0, 0.5  # rad/s^2 and rad/s of the motion to the start
_LOOKAHEAD = 0.1  # s
_GAIN = 300
_STOP = 2.0  # rad/s^2


def write(trajectory: Trajectory, joints: tuple[str, ...]) -> bytes:
    """Return the program.

    Raises:
        MissionError: the joints are not six actuated revolute joints.
    """
    mechanism = trajectory.mechanism
    revolute = [joint for joint in joints if joint in mechanism.actuated and not mechanism.is_prismatic(joint)]
    if len(joints) != 6 or len(revolute) != 6:
        more = f", and {len(joints) - len(revolute)} other joints" if len(joints) > len(revolute) else ""
        raise MissionError(f"URScript needs six actuated revolute joints: {trajectory.name} has {len(revolute)}{more}")
    q, period = trajectory.positions(joints), 1.0 / trajectory.rate
    lines = [
        f"# {trajectory.name}: {len(q)} positions in {trajectory.seconds:.3f} s, {trajectory.rate:g} a second",
        f"# joints, base first (rad): {', '.join(joints)}",
        "# Made by cinegen. It first moves to the start along a straight line in joint space: keep that path clear.",
        "def cinegen_motion():",
        f"  movej({_list(q[0])}, a={_ACCELERATION}, v={_SPEED})",
        *(f"  servoj({_list(one)}, 0, 0, {period:.6g}, {_LOOKAHEAD}, {_GAIN})" for one in q[1:]),
        f"  stopj({_STOP})",
        "end",
    ]
    return ("\n".join(lines) + "\n").encode()


def note(content: bytes) -> str:
    """Return no note."""
    return ""


def _list(q: Array) -> str:
    return f"[{', '.join(f'{value:.6f}' for value in q + 0.0)}]"
