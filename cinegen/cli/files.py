"""What several commands have in common: files of robots, times, texts."""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raff2urdf.files import write_all

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cinegen.model import Mechanism

_PATIENCE = 1.0  # s until progress is told


def of_files(parser: argparse.ArgumentParser, count: str | int = "+") -> None:
    """A command about robots: so many files of them, as argparse counts."""
    parser.add_argument("files", nargs=count, metavar="FILE", help="RAFF file, URDF, SDF or MJCF")
    parser.add_argument("--robot", metavar="NAME", help="only the robot of this name")
    parser.add_argument(
        "--loop", action="append", default=[], metavar="NAME=KIND",
        help="close a loop as rigid, prismatic, revolute or ball, whatever the file says",
    )  # fmt: skip
    ignoring_loops(parser)


def ignoring_loops(parser: argparse.ArgumentParser) -> None:
    """Add the option that leaves loops open to a command that loads robots."""
    parser.add_argument(
        "--ignore-loops", action="store_true",
        help="leave all loops open: the tree only, without loops and couplings that can't be read",
    )  # fmt: skip


def seconds(text: str) -> float:
    """A time that an option says."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < 1e9:
        raise argparse.ArgumentTypeError(f"'{text}' is no time in seconds")
    return value


def mechanisms(options: argparse.Namespace) -> dict[str, Mechanism]:
    """All robots of all files, by a name that is theirs alone."""
    return {name: mechanism for name, (mechanism, _) in mechanisms_and_files(options).items()}


def mechanisms_and_files(options: argparse.Namespace) -> dict[str, tuple[Mechanism, str]]:
    """The same, each with its file."""
    from cinegen.errors import CinegenError
    from cinegen.model.load import load, robots

    loops = {}
    for text in options.loop:
        name, equals, kind = text.rpartition("=")
        if not equals:
            raise CinegenError(f"--loop {text}: write NAME=KIND, for example --loop link5-link11=ball")
        loops[name] = kind
    found: dict[str, tuple[Mechanism, str]] = {}
    for file in options.files:
        path = Path(file)
        wanted = robots(path) if options.robot is None else [options.robot]
        for robot in wanted:
            mechanism = load(path, robot, loops, options.ignore_loops)
            name = path.stem if len(wanted) == 1 else f"{path.stem}.{mechanism.name}"
            while name in found:
                name += "'"
            found[name] = mechanism, str(file)
    return found


def read(file: str) -> str:
    """A file's text.

    Raises:
        CinegenError: it can't be read.
    """
    from cinegen.errors import CinegenError

    try:
        return Path(file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CinegenError(f"{file}: can't be read: {error}") from None


def write(path: Path, content: str | bytes) -> None:
    """Write a file as a whole, with the folder that it is in.

    Raises:
        CinegenError: it can't be written.
    """
    from cinegen.errors import CinegenError

    try:
        write_all({path: content.encode(errors="backslashreplace") if isinstance(content, str) else content})
    except OSError as error:
        raise CinegenError(f"{path}: can't be written: {error.strerror}") from None


def write_figure(path: Path, figure: Figure) -> None:
    """Write a picture, in the format that the path's suffix says (PNG without one), with the folder that it is in.

    Raises:
        CinegenError: it can't be written, or there is no such format.
    """
    from cinegen.errors import CinegenError

    picture = io.BytesIO()
    try:
        figure.savefig(picture, format=path.suffix[1:] or "png", dpi=150)
    except ValueError as error:  # matplotlib says which formats there are
        raise CinegenError(f"{path}: can't be written: {error}") from None
    write(path, picture.getvalue())


@contextlib.contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """What tells a person at a terminal how far it is, where that takes long; it is taken away in the end."""
    begun, told = time.monotonic(), 0

    def say(words: str) -> None:
        nonlocal told
        if sys.stderr.isatty() and time.monotonic() - begun > _PATIENCE:
            told = max(told, len(words))
            print(f"\r{words:<{told}}", end="", file=sys.stderr, flush=True)

    try:
        yield say
    finally:
        if told:
            print(f"\r{'':<{told}}\r", end="", file=sys.stderr, flush=True)


def count(things: Sequence[Any], name: str) -> str:
    """So many of them, in words."""
    return f"{len(things)} {name}{'s' * (len(things) != 1)}"
