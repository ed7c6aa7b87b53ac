"""Entry points of the commands: Ctrl-C ends them without a traceback while they are imported, and while they exit."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from typing import NoReturn


def cinegen() -> NoReturn:
    """Run the command `cinegen`, and exit."""
    _run("cinegen.cli")


def raff2urdf() -> NoReturn:
    """Run the command `raff2urdf`, and exit."""
    _run("raff2urdf.cli")


def urdf2raff() -> NoReturn:
    """Run the command `urdf2raff`, and exit."""
    _run("raff2urdf.urdf2raff.cli")


def _run(module: str) -> NoReturn:
    """Run `main` of a module.

    Before and after, nothing needs to be completed: Ctrl-C then ends the process by the signal itself, without a
    traceback; command interpreters report 130, too. In between, `main` handles it; in the moments when it begins and
    ends, the exit code is 130.
    """
    handled = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # it is ignored in background jobs of sh
    if handled:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    # More threads make decompositions of matrices as small as those of robots no faster, and wait for each other where
    # other programs run, too.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main = import_module(module).main
    try:
        if handled:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            code = main()
        finally:
            if handled:
                signal.signal(signal.SIGINT, signal.SIG_DFL)
    except KeyboardInterrupt:
        code = 128 + signal.SIGINT
    sys.exit(code)
