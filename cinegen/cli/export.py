"""`cinegen export`: the joint motion of a recorded mission, for a robot's controller."""

from __future__ import annotations

import argparse
from typing import Any


def add(commands: Any) -> None:
    """Adds the command."""
    export = commands.add_parser(
        "export", help="a recorded motion as CSV, NPZ, a ROS 2 goal or URScript",
        description="Samples a recorded motion anew at a fixed rate, within the robot's velocity limits, checks it "
        "again (loops, limits, singularities between samples too), and writes it.",
    )  # fmt: skip
    export.add_argument("recording", metavar="FILE.jsonl", help="as `cinegen drive --record` writes it")
    export.add_argument("--to", required=True, metavar="FORMAT", help="csv, npz, ros2 or urscript")
    export.add_argument("-o", "--output", metavar="FILE", help="(the recording's name with another ending)")
    export.add_argument("--robot", metavar="NAME", help="which robot of the recording")
    export.add_argument("--rate", type=float, default=125.0, metavar="HZ", help="samples a second (%(default)g)")
    export.add_argument("--speed", type=float, default=1.0, metavar="X", help="times as fast (%(default)g)")
    export.add_argument("--all-joints", action="store_true", help="joints without motors too")
    export.add_argument("--force", action="store_true", help="write it though the check refuses it")
    export.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Writes it."""
    from cinegen.mission import export, report_text

    report = export(
        options.recording,
        options.to,
        output=options.output,
        robot=options.robot,
        rate=options.rate,
        speed=options.speed,
        all_joints=options.all_joints,
        force=options.force,
    )
    print(report_text(report))
    return 0
