"""`cinegen export`: the joint motion of a recorded mission, for a robot's controller."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from cinegen.cli.files import check_outputs
from cinegen.cli.options import exclude, force_option, output_option
from cinegen.cli.study.payloads import GRAVITY, PAYLOADS, carried, gravity_of
from raff2urdf.command.command_line import check_ending, flag, no_effect, option, quantity_option
from raff2urdf.files import output_path, stem_of
from raff2urdf.quantities import FREQUENCY, NUMBER

if TYPE_CHECKING:
    from cinegen.model import Mechanism

FORMATS = ("csv", "npz", "ros2", "urscript")
"""Names in `cinegen.mission.FORMATS`, whose import takes longer than help may."""

RECORDING = typer.Argument(..., metavar="FILE.jsonl", help="recording, by `cinegen drive --record`")
SPEED = quantity_option("X", "playback speed, times that of the recording", NUMBER, 1.0)


def run(
    recording: Path = RECORDING,
    to: str = option("FORMAT", f"format: {', '.join(FORMATS)}", ...),
    output: str | None = output_option("FILE", "file to write (default: next to the recording)"),
    robot: str | None = option("NAME", "robot of the recording, if it has several"),
    rate: float = quantity_option("HZ", "samples per second (Hz)", FREQUENCY, 125.0),
    speed: float = SPEED,
    fastest: bool = flag("--fastest", "move as fast as limits allow, whatever the recording's times"),
    acceleration: float | None = option("A", "limit of the joints' acceleration, rad/s^2 and m/s^2 (default: 10, 2.5)"),
    jerk: float | None = option("J", "limit of their jerk, rad/s^3 and m/s^3 (default: none)"),
    torques: bool = flag("--torques", "keep the actuators' torques and forces within the limits of the description"),
    payload: list[str] = PAYLOADS,
    gravity: str = GRAVITY,
    cross_singularities: bool = flag(
        "--cross-singularities",
        "with --torques: pass type 2 singularities at a speed that keeps torques within limits",
        needs="--torques",
    ),
    all_joints: bool = flag("--all-joints", "write passive joints too"),
    unsafe: bool = flag("--unsafe", "write the motion even if its check fails"),
    force: bool = force_option(),
) -> int:
    """Export a recorded motion as CSV, NPZ, a ROS 2 goal or URScript.

    The motion is resampled at a fixed rate within limits of velocity, acceleration, jerk and, with --torques, torque,
    checked again (loops, limits, singularities between the samples too) and written.
    """
    from cinegen.mission import export, report_text
    from cinegen.mission.formats import format_of
    from cinegen.planning.torque_limits import TorqueLimits

    exclude(fastest=fastest, speed=speed != 1.0)
    if not torques:
        no_effect("without --torques", "--payload", "--gravity", remedy="add that, or leave it out")
    acceleration_of_gravity = gravity_of(gravity)

    def limits(mechanism: Mechanism) -> TorqueLimits:
        return TorqueLimits(
            mechanism, carried(mechanism, payload), gravity=acceleration_of_gravity, crosses=cross_singularities
        )

    suffix = format_of(to).suffix
    if output is not None:
        check_ending("--output", output, (suffix,))
    path = recording.parent / f"{stem_of(recording)}{suffix}"
    path = output_path(output, path.name) if output else path
    check_outputs(path, force=force or path == recording, remakeable=False)
    print(report_text(export(
        recording, to, output=path, robot=robot, rate=rate, speed=math.inf if fastest else speed, all_joints=all_joints,
        unsafe=unsafe, acceleration=acceleration, jerk=jerk, torques=limits if torques else None,
    )))  # fmt: skip
    return 0
