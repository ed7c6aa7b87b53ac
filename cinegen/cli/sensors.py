"""`cinegen sensors`: which sensors there are; what one says."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from cinegen.cli.files import ignoring_loops, seconds
from raff2urdf.output import write_at_once


def add(commands: Any) -> None:
    """Adds the command."""
    sensors = commands.add_parser(
        "sensors", help="which sensors a file names and what could be one here; watch one",
        description="Lists the sensors that files name, the serial ports of this machine, and what else may be a "
        "sensor. With --monitor, shows what one says until Ctrl-C.",
    )  # fmt: skip
    sensors.add_argument("files", nargs="*", metavar="FILE", help="RAFF file, URDF, SDF or MJCF")
    ignoring_loops(sensors)
    sensors.add_argument(
        "--sensor", action="append", default=[], metavar="N=URL", help="another port for the files' sensor N"
    )
    sensors.add_argument("--monitor", metavar="URL", help="show what this one says: a port or a URL")
    sensors.add_argument("--seconds", type=seconds, metavar="S", help="stop after so long (at Ctrl-C)")
    sensors.add_argument("--json", action="store_true", help="as JSON; with --monitor, a recording")
    sensors.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """List the sensors, or monitor one."""
    from cinegen.devices import monitor

    if options.monitor:
        rewrite = sys.stdout.isatty() and not options.json
        monitor.monitor(options.monitor, write_at_once, options.seconds, options.json, rewrite)
        return 0
    print(monitor.listing(options.files, options.sensor, options.json, options.ignore_loops))
    return 0
