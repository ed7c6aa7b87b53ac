"""`cinegen sensors`: the sensors of files and of this machine; the readings of one."""

from __future__ import annotations

import sys
from contextlib import nullcontext, redirect_stdout
from pathlib import Path

from cinegen.cli.options import FILES, IGNORE, IGNORE_LOOPS, JSON, STOP_AFTER
from raff2urdf.command.command_line import no_effect, option, quantity_option
from raff2urdf.command.output import unescaped, write_at_once
from raff2urdf.command.read_flags import ReadFlags
from raff2urdf.quantities import TIME


def run(
    reading: ReadFlags,
    files: list[Path] = FILES,
    sensor: list[str] = option("N=URL", "another port for sensor N of the files", (), unless="--monitor"),
    monitor: str | None = option("URL", "show the readings of this port or URL"),
    seconds: float | None = quantity_option("S", STOP_AFTER, TIME, needs="--monitor"),
    ignore_loops: bool = IGNORE_LOOPS,
    ignore: list[str] = IGNORE,
    json: bool = JSON,
) -> int:
    """List the sensors of files and of this machine; monitor one.

    Lists the sensors that the files name, the serial ports of this machine, and which URLs name a sensor. With
    --monitor, shows the readings of one sensor; with --json, as a recording.
    """
    from cinegen.devices import monitor as monitoring
    from cinegen.devices.kinds import join_token, split_token
    from cinegen.devices.reading_json import encode_token

    if monitor:
        no_effect("with --monitor, which names one sensor by its URL", "FILE", "--ignore-loops", "--ignore")
        no_effect("with --monitor, which reads no file", "--package", "--xacro-arg", "--swap-limits")
        url, token = split_token(monitor)
        if token:
            print(f"{url}: a program sends first: {encode_token(token)}", file=sys.stderr)
        rewrite = sys.stdout.isatty() and not json
        with redirect_stdout(unescaped(sys.stdout)) if rewrite else nullcontext():
            monitoring.monitor(join_token(url, token), write_at_once, seconds, json, rewrite)
    else:
        options = reading.options()
        print(monitoring.listing(map(str, files), sensor, json, ignore_loops, ignore, options))
    return 0
