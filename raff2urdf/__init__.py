"""raff2urdf: RAFF, the Robot Arm File Format, into URDF plus explicit closed-loop constraints.

    import raff2urdf

    document = raff2urdf.load("robots/delta4.raff")
    raff2urdf.convert("robots/delta4.raff", "generated")

Errors are `RaffError`, with file, line, column and the likely meaning.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from raff2urdf.check import check, check_tree
from raff2urdf.document import Document
from raff2urdf.errors import ClosureError, RaffError, RaffWarning

if TYPE_CHECKING:  # what follows needs numpy and yourdfpy: imported where it is used
    from raff2urdf.conversion import Conversion

__all__ = ["ClosureError", "Document", "RaffError", "RaffWarning", "check", "convert", "dumps", "load", "loads"]


def loads(text: str, name: str = "<text>") -> Document:
    """Reads RAFF text; `name` is what errors call it.

    The text may be an excerpt: constraints may name links that it lacks. `check`, `convert` and
    `cinegen.load` refuse that.

    Raises:
        RaffError: with every problem found: place, cause, likely meaning.
    """
    from raff2urdf.reader import parse

    document = parse(text, name)
    check_tree(document)
    return document


def load(path: str | Path) -> Document:
    """Reads a RAFF file, as `loads` does.

    Raises:
        RaffError: the file can't be read, or with every problem found in it.
    """
    from raff2urdf.reader import read

    return loads(read(path), str(path))


def dumps(document: Document) -> str:
    """The document as RAFF text: `loads(dumps(document)) == document`.

    Raises:
        RaffError: a text in it holds what RAFF can't write.
    """
    from raff2urdf.writer import write

    return write(document)


def convert(path: str | Path, out: str | Path = "generated", robot: str | None = None) -> list[Conversion]:
    """Converts a RAFF file: `<stem>.urdf` and `<stem>.constraints.json` in the folder `out`.

    Several robots in the file become `<stem>.<robot>.urdf` and so on. Everything is made before anything is
    written, so a failure leaves what was there untouched.

    Args:
        path: the RAFF file.
        out: the folder to write to; made if it does not exist.
        robot: only the robot of this name.

    Raises:
        RaffError: the file is wrong, its loops can't be closed, or `out` can't be written.
    """
    from raff2urdf.conversion import convert_file

    return convert_file(Path(path), Path(out), robot)
