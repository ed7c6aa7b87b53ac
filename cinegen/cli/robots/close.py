"""`cinegen close`: a filter between a driver and a robot."""

from __future__ import annotations

import sys
from pathlib import Path

from cinegen.cli.options import FILE, RobotOptions
from cinegen.errors import CinegenError
from raff2urdf.command.command_line import option
from raff2urdf.command.output import until_stopped, write_at_once
from raff2urdf.errors import raised_as
from raff2urdf.files import read_bytes


def run(
    options: RobotOptions,
    file: Path = FILE,
    start: Path | None = option("FILE", "start at a configuration in a file, an earlier answer (default: home)"),
) -> int:
    """Filter: values of actuated joints in, values of all joints out, with closed loops.

    Each line of standard input is an object of joint values such as {"joint1": 0.1} (rad, m). It is answered by a line
    with the values of all joints, on the same branch as the line before; the first starts at home. Joints that are not
    named keep their values. A line that is wrong, can't be reached or would bring a joint beyond its limits, even in
    between, is answered by {"error": "..."} and moves nothing.
    """
    _, mechanism = options.load_one(file)
    from cinegen.devices import Lines, start_from

    with raised_as(CinegenError, CinegenError, f"--start {start}: ", ": name a line that `cinegen close` wrote"):
        lines = Lines(
            mechanism, None if start is None else start_from(mechanism, read_bytes(start).decode(errors="replace"))
        )
    if sys.stdin is not None:
        with until_stopped():
            lines.serve(sys.stdin.buffer, write_at_once)
    return 0
