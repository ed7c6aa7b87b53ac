"""`cinegen export`: the joint motion of a recorded mission, for a robot's controller."""

from __future__ import annotations

from pathlib import Path

import typer

from cinegen.cli.options import flag, option

FORMATS = ("csv", "npz", "ros2", "urscript")
"""Names in `cinegen.mission.FORMATS`, whose import takes longer than help may."""

RECORDING = typer.Argument(..., metavar="FILE.jsonl", help="recording, by `cinegen drive --record`")
SPEED = option("X", "playback speed, times that of the recording", 1.0)


def run(
    recording: Path = RECORDING,
    to: str = option("FORMAT", f"format: {', '.join(FORMATS)}", ...),
    output: Path | None = option("FILE", "file to write (default: next to the recording)", None, "-o", "--output"),
    robot: str | None = option("NAME", "robot of the recording, if it has several"),
    rate: float = option("HZ", "samples per second, Hz", 125.0),
    speed: float = SPEED,
    all_joints: bool = flag("--all-joints", "write passive joints too"),
    force: bool = flag("--force", "write the motion even if its check fails"),
) -> int:
    """Export a recorded motion as CSV, NPZ, a ROS 2 goal or URScript.

    The motion is resampled at a fixed rate within the velocity limits of the robot, checked again (loops, limits,
    singularities between the samples too) and written.
    """
    from cinegen.mission import export, report_text

    print(report_text(export(
        recording, to, output=output, robot=robot, rate=rate, speed=speed, all_joints=all_joints, force=force
    )))  # fmt: skip
    return 0
