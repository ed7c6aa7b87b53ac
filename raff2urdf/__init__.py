"""raff2urdf: RAFF, the Robot Arm File Format, into URDF plus explicit closed-loop constraints.

    import raff2urdf

    document = raff2urdf.load("robots/delta4.raff")
    raff2urdf.convert("robots/delta4.raff", "generated")
    raff2urdf.reverse("panda.urdf", "panda.raff")

Errors are `RaffError`, with file, line, column and the likely meaning.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from raff2urdf.check import check, check_tree
from raff2urdf.document import Document
from raff2urdf.errors import RaffClosureError, RaffError, RaffWarning

if TYPE_CHECKING:  # what follows needs numpy and yourdfpy: imported where it is used
    from raff2urdf.conversion import Conversion
    from raff2urdf.urdf2raff.robot import Reversal

__all__ = [
    "Document",
    "RaffClosureError",
    "RaffError",
    "RaffWarning",
    "check",
    "convert",
    "dumps",
    "load",
    "loads",
    "reverse",
]


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


def convert(
    path: str | Path,
    out: str | Path = "generated",
    robot: str | None = None,
    *,
    format: str = "urdf",
    density: float | None = None,
    constraint_elements: bool = False,
) -> list[Conversion]:
    """Converts a RAFF file: `<stem>.urdf` and `<stem>.constraints.json` in the folder `out`, or another format.

    Several robots in the file become `<stem>.<robot>.urdf` and so on. Everything is made before anything is
    written, so a failure leaves what was there untouched.

    Args:
        path: the RAFF file.
        out: the folder to write to; made if it does not exist.
        robot: only the robot of this name.
        format: urdf; sdf, as `<stem>.sdf`; or mjcf, as `<stem>.xml`.
        density: of what the links are made of, kg/m3, where the format wants masses; 1000 unless said.
        constraint_elements: also writes the loops into the URDF, as a proposal to ROS has it.

    Raises:
        RaffError: the file is wrong, its loops can't be closed, there is no such format, or `out` can't be written.
    """
    from raff2urdf.conversion import convert_file

    return convert_file(
        Path(path), Path(out), robot, format=format, density=density, constraint_elements=constraint_elements
    )


def reverse(
    path: str | Path,
    out: str | Path | None = None,
    units: str | None = None,
    free_mimic: bool = False,
    graphics: bool = True,
    robot: str | None = None,
    loops: Mapping[str, str] | None = None,
    ignore_loops: bool = False,
) -> Reversal:
    """Describes a robot in RAFF that others have described in URDF, SDF or MJCF.

    What a URDF can't say is read from `<stem>.constraints.json` or `robot.yaml` beside it.

    Args:
        path: the file.
        out: the RAFF file to write; its graphics go to the folder `<stem>_graphics` beside it. Nothing is written
            unless said.
        units: of the RAFF file: um, mm, cm or m; unless said, what most meshes are in, and else mm.
        free_mimic: write joints that mimic others as joints of their own.
        graphics: whether meshes and shapes are carried over.
        robot: which model, of an SDF that holds several.
        loops: other kinds of closure (rigid, prismatic, revolute, ball) for some loops, by name.
        ignore_loops: leave all loops open, those too that a URDF declares in elements that are not read.

    Returns:
        the document, with how its joints, zeros and nodes correspond to the URDF's.

    Raises:
        RaffError: the file is wrong, holds what RAFF can't say, or declares loops that are not read; a mesh is missing;
            `out` can't be written.
    """
    from raff2urdf.urdf2raff.file import reverse_file

    return reverse_file(
        Path(path), None if out is None else Path(out), units, free_mimic, graphics, robot, loops, ignore_loops
    )
