"""From a document to files: everything is made before anything is written."""

from __future__ import annotations

import os
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from raff2urdf.analysis import Analysis, analyse
from raff2urdf.check import check
from raff2urdf.constraints import Constraints, constraints, dumps
from raff2urdf.document import Document, Robot
from raff2urdf.errors import RaffError, RaffWarning
from raff2urdf.urdf import urdf


@dataclass(frozen=True, slots=True)
class Translation:
    """A robot as a URDF and what that can't say, as texts and values; `missing`: graphics that can't be shown."""

    robot: Robot
    urdf: str
    constraints: Constraints
    analysis: Analysis
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Conversion:
    """What the conversion of one robot wrote and found.

    Attributes:
        robot: its name.
        urdf: path of the URDF.
        constraints: path of the constraints.
        links: how many it has (base and frames not counted).
        joints: how many of them move.
        loops: how many are closed.
        analysis: mobility, actuated joints, rows and rank of the loops, how far they stand open as written.
    """

    robot: str
    urdf: Path
    constraints: Path
    links: int
    joints: int
    loops: int
    analysis: Analysis


def translate(
    document: Document,
    robot: Robot,
    beside: Path,
    out: Path | None = None,
    loops: Mapping[str, str] | None = None,
) -> Translation:
    """One robot of a checked document, in memory.

    Args:
        document: that holds the robot.
        robot: which one.
        beside: the folder of the RAFF file, for its graphics.
        out: the folder its URDF will stand in.
        loops: other kinds (rigid, prismatic, revolute, ball) for some loops, by name.

    Raises:
        ClosureError: the loops can't be closed.
        RaffError: `loops` names what does not exist.
    """
    analysis = analyse(document, robot, loops)
    text, missing = urdf(document, robot, beside, out)
    if missing:
        shown = "; ".join(missing[:10]) + (f"; and {len(missing) - 10} more" if len(missing) > 10 else "")
        message = (
            f"robot '{robot.name}': graphics that can't be shown (a skeleton stands in where no other is): {shown}"
        )
        warnings.warn(message, RaffWarning, stacklevel=2)
    return Translation(robot, text, constraints(document, robot, analysis), analysis, tuple(missing))


def convert_file(
    path: Path, out: Path, robot: str | None = None, loops: Mapping[str, str] | None = None
) -> list[Conversion]:
    """See `raff2urdf.convert`; `loops` as in `translate`."""
    from raff2urdf.reader import parse, read

    document = parse(read(path), str(path))
    check(document)
    robots = [document.robot(robot)] if robot is not None else list(document.robots)
    conversions, texts = [], []
    for one in robots:
        stem = path.stem if len(document.robots) == 1 else f"{path.stem}.{one.name}"
        made = translate(document, one, path.parent, out, loops)
        conversion = Conversion(
            robot=one.name,
            urdf=out / f"{stem}.urdf",
            constraints=out / f"{stem}.constraints.json",
            links=len(one.links),
            joints=len(made.constraints["joints"]),
            loops=len(one.loops),
            analysis=made.analysis,
        )
        conversions.append(conversion)
        texts += [(conversion.urdf, made.urdf), (conversion.constraints, dumps(made.constraints))]
    _write_all(out, texts)
    return conversions


def _write_all(out: Path, texts: Sequence[tuple[Path, str]]) -> None:
    """All files or none: each is written aside, then all are put in place."""
    aside: list[str] = []
    try:
        out.mkdir(parents=True, exist_ok=True)
        for path, _ in texts:
            if path.is_dir():
                raise IsADirectoryError(0, f"{path.name} is a folder")
        for path, text in texts:
            handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=out)
            aside.append(name)
            with open(handle, "w", encoding="utf-8", newline="\n") as file:
                file.write(text)
            os.chmod(name, 0o666 & ~_umask())
        for (path, _), name in zip(texts, aside, strict=True):
            os.replace(name, path)
    except OSError as error:
        for name in aside:
            Path(name).unlink(missing_ok=True)
        raise RaffError(f"{out}: can't be written: {error.strerror or error}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
