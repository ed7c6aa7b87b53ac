"""`cinegen replay`: a recorded mission in the page."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from cinegen.cli.drive import of_page, show


def add(commands: Any) -> None:
    """Adds the command."""
    replay = commands.add_parser("replay", help="show a recorded mission in the page")
    replay.add_argument("recording", metavar="FILE.jsonl", help="as `cinegen drive --record` writes it")
    replay.add_argument("--tempo", type=float, default=1.0, metavar="X", help="times as fast (%(default)g)")
    of_page(replay)
    replay.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Shows it."""
    from cinegen.session import replayed

    return show(replayed(options.recording, options.tempo), options, Path(options.recording).stem)
