"""Runs the command `raff2urdf`: in this process, which is quick, or in one of its own, as a person does."""

import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

import raff2urdf
from raff2urdf.cli import main


@dataclass(frozen=True)
class Done:
    """What came of a command."""

    code: int
    out: str
    err: str


Run = Callable[..., Done]


def run_here(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> Done:
    """In this process and folder."""
    capsys.readouterr()
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        try:
            code = main(arguments)
        except SystemExit as end:  # argparse's, for --help and wrong calls
            code = int(end.code or 0)
    return Done(code, *capsys.readouterr())


def run_apart(arguments: tuple[str, ...], folder: Path, environment: dict[str, str]) -> Done:
    """`python -m raff2urdf ARGUMENTS` in a folder."""
    package = Path(raff2urdf.__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-m", "raff2urdf", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(package), "PYTHONUTF8": "1"} | environment,
        capture_output=True,
        encoding="utf-8",
        timeout=120,
    )
    return Done(done.returncode, done.stdout, done.stderr)
