"""The command `cinegen`: a module for each of its commands."""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Sequence
from typing import Any

from cinegen.cli import close, drive, export, info, map, modes, plan, replay, sensors, singular
from raff2urdf.errors import RaffError


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code: 0, or 1 where something is wrong."""
    parser = argparse.ArgumentParser(prog="cinegen", description="Drive, study and show any mechanism.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in (info, modes, singular, map, plan, drive, replay, export, close, sensors):
        command.add(commands)
    map.add_compare(commands)
    options = parser.parse_args(arguments)
    from cinegen.errors import CinegenError

    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        warnings.filterwarnings("ignore", category=DeprecationWarning, module=r"(zmq|meshcat)\b")  # others' affair
        try:
            code: int = options.run(options)
            sys.stdout.flush()
        except (RaffError, CinegenError) as error:
            print(f"cinegen: {error}", file=sys.stderr)
            return 1
        except BrokenPipeError:  # whoever reads has seen enough: `cinegen info x.raff | head -1`
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 1
    return code


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    print(f"warning: {message}", file=sys.stderr)
