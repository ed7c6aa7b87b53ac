"""`cinegen close`: a filter between a driver and a robot."""

from __future__ import annotations

import argparse
import contextlib
import sys
from typing import Any

from cinegen.cli.files import mechanisms, of_files, read
from raff2urdf.output import write_at_once


def add(commands: Any) -> None:
    """Adds the command."""
    close = commands.add_parser(
        "close", help="a filter: values of actuated joints in, values of all joints out, loops closed",
        description="Reads lines such as {\"joint1\": 0.1} from its input (rad, m) and answers each with a line of all "
        "joints, on the same branch as the line before; the first begins at home. Joints that are not named stay. What "
        "can't be is answered by {\"error\": \"...\"}, and moves nothing.",
    )  # fmt: skip
    of_files(close, count=1)
    close.add_argument("--start", metavar="FILE", help="begin where an answer says, kept in a file, instead of at home")
    close.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Answers lines until there are no more."""
    from cinegen.errors import CinegenError

    found = mechanisms(options)
    if len(found) != 1:
        names = ", ".join(mechanism.name for mechanism in found.values())
        raise CinegenError(f"{options.files[0]} holds several robots: name one by --robot ({names})")
    (mechanism,) = found.values()
    from cinegen.devices import Lines, start_from
    from cinegen.model import ForwardKinematics

    motion = ForwardKinematics(mechanism) if options.start is None else start_from(mechanism, read(options.start))
    if sys.stdin is not None:
        with contextlib.suppress(KeyboardInterrupt):
            Lines(motion).serve(sys.stdin.buffer, write_at_once)
    return 0
