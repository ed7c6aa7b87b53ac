"""The command `cinegen`: a module for each of its commands."""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from collections.abc import Sequence
from typing import Any

from cinegen.cli import close, drive, export, info, map, modes, plan, replay, sensors, singular
from raff2urdf import output
from raff2urdf.errors import RaffError


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code: 0, 1 where something is wrong, or as `raff2urdf.output.run` says."""
    return output.run("cinegen", lambda: _main(arguments))


def _main(arguments: Sequence[str] | None) -> int:
    options = parser().parse_args(arguments)
    from cinegen.errors import CinegenError

    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        warnings.filterwarnings("ignore", category=DeprecationWarning, module=r"(zmq|meshcat)\b")  # others' affair
        try:
            code: int = options.run(options)
        except (RaffError, CinegenError) as error:
            print(f"cinegen: {error}", file=sys.stderr)
            return 1
    return code


def parser() -> argparse.ArgumentParser:
    """All commands, with their options."""
    found = _Parser(prog="cinegen", description="Drive, study and show any mechanism.")
    commands = found.add_subparsers(required=True, metavar="COMMAND")
    for command in (info, modes, singular, map, plan, drive, replay, export, close, sensors):
        command.add(commands)
    map.add_compare(commands)
    return found


class _Parser(argparse.ArgumentParser):
    """What begins with a negative number is a value, not an option: -0.5,0,-1.8 or -900mm, not only -0.5."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._negative_number_matcher = re.compile(r"-\.?\d")


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    print(f"warning: {message}", file=sys.stderr)
