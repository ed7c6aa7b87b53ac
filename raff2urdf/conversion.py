"""From a document to files: everything is made before anything is written."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yourdfpy

from raff2urdf.analysis import Analysis, analyse
from raff2urdf.check import check, check_sizes
from raff2urdf.constraints import Constraints, constraints
from raff2urdf.document import Document, RaffRobot
from raff2urdf.errors import RaffError, RaffWarning
from raff2urdf.files import write_all
from raff2urdf.formats import Described, files
from raff2urdf.graphics.meshes import Graphics
from raff2urdf.tree import limits
from raff2urdf.writers.urdf import dumps, tree


@dataclass(frozen=True, slots=True)
class Translation:
    """A robot as a URDF and what that can't say, as texts and values.

    Attributes:
        robot: that was translated.
        urdf: its tree.
        constraints: what that can't say.
        analysis: mobility, actuated joints, rows and rank of the loops.
        missing: graphics that can't be shown.
        meshes: converted graphics that the URDF names and that are still to be written, by their path.
        model: the tree as yourdfpy's classes.
    """

    robot: RaffRobot
    urdf: str
    constraints: Constraints
    analysis: Analysis
    missing: tuple[str, ...]
    meshes: Mapping[Path, bytes]
    model: yourdfpy.Robot


@dataclass(frozen=True, slots=True)
class Conversion:
    """What the conversion of one robot wrote and found.

    Attributes:
        robot: its name.
        file: path of the robot's own file: a URDF, unless another format was asked for.
        constraints: path of the constraints; None for other formats, which need no file beside them.
        links: how many it has (base and frames not counted).
        joints: how many of them move.
        loops: how many are closed.
        analysis: mobility, actuated joints, rows and rank of the loops, how far they stand open as written.
        files: every file that was written for it.
    """

    robot: str
    file: Path
    constraints: Path | None
    links: int
    joints: int
    loops: int
    analysis: Analysis
    files: tuple[Path, ...]

    @property
    def urdf(self) -> Path | None:
        """Path of the URDF; None if another format was asked for."""
        return None if self.constraints is None else self.file


def translate(
    document: Document,
    robot: RaffRobot,
    beside: Path,
    out: Path | None = None,
    loops: Mapping[str, str] | None = None,
    meshes: Path | None = None,
) -> Translation:
    """One robot of a checked document, in memory.

    Args:
        document: that holds the robot.
        robot: which one.
        beside: the folder of the RAFF file, for its graphics.
        out: the folder its URDF will stand in.
        loops: other kinds (rigid, prismatic, revolute, ball) for some loops, by name.
        meshes: the folder where converted graphics are to be written; unless said, they are written to the user's
            cache at once.

    Raises:
        RaffClosureError: the loops can't be closed.
        RaffError: `loops` names what does not exist.
    """
    analysis = analyse(document, robot, loops)
    graphics = Graphics(robot, beside, meshes)
    model, missing = _tree(document, robot, beside, out, graphics)
    values = constraints(document, robot, analysis, loops)
    return Translation(robot, dumps(model), values, analysis, missing, graphics.written, model)


def describe(
    document: Document, robot: RaffRobot, beside: Path, loops: Mapping[str, str] | None = None
) -> tuple[str, Constraints]:
    """Return one robot of a checked document as a URDF's text and its constraints; its loops are not closed.

    What only closing them would tell is None, see `constraints`. Converted graphics are written to the user's cache.

    Args:
        document: that holds the robot.
        robot: the robot.
        beside: the folder of the RAFF file, for its graphics.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name.

    Raises:
        RaffError: `loops` names a loop or a kind that does not exist; a length is too large.
    """
    check_sizes(document, robot)
    model, _ = _tree(document, robot, beside, None, Graphics(robot, beside, None))
    return dumps(model), constraints(document, robot, None, loops)


def _tree(
    document: Document, robot: RaffRobot, beside: Path, out: Path | None, graphics: Graphics
) -> tuple[yourdfpy.Robot, tuple[str, ...]]:
    """Return the tree and the graphics that can't be shown; one warning lists them."""
    model, missing = tree(document, robot, beside, out, graphics)
    if missing:
        shown = "; ".join(missing[:10]) + (f"; and {len(missing) - 10} more" if len(missing) > 10 else "")
        message = (
            f"robot '{robot.name}': graphics that can't be shown (a skeleton stands in where no other is): {shown}"
        )
        warnings.warn(message, RaffWarning, stacklevel=3)
    return model, tuple(missing)


def convert_file(
    path: Path,
    out: Path,
    robot: str | None = None,
    loops: Mapping[str, str] | None = None,
    *,
    format: str = "urdf",
    density: float | None = None,
    constraint_elements: bool = False,
) -> list[Conversion]:
    """See `raff2urdf.convert`; `loops` as in `translate`."""
    from raff2urdf.reader import parse, read

    document = parse(read(path), str(path))
    check(document)
    robots = [document.robot(robot)] if robot is not None else list(document.robots)
    conversions = []
    contents: dict[Path, bytes] = {}
    for one in robots:
        stem = path.stem if len(document.robots) == 1 else f"{path.stem}.{one.name}"
        made = translate(document, one, path.parent, out, loops, out / "meshes" / stem)
        if format != "urdf":
            _warn_outside(document, made)
        described = Described(
            stem=stem,
            model=made.model,
            urdf=made.urdf,
            constraints=made.constraints,
            home=made.analysis.home,
            folder=out,
            meshes=made.meshes,
            density=density,
            constraint_elements=constraint_elements,
        )
        written = {out / name: content for name, content in files(format, described).items()}
        beside = out / f"{stem}.constraints.json"
        conversion = Conversion(
            robot=one.name,
            file=next(iter(written)),
            constraints=beside if beside in written else None,
            links=len(one.links),
            joints=len(made.constraints["joints"]),
            loops=len(one.loops),
            analysis=made.analysis,
            files=(*written, *made.meshes),
        )
        conversions.append(conversion)
        contents |= made.meshes  # first, so that a robot's own file never stands without its meshes
        contents |= dict(reversed(written.items()))
    try:
        write_all(contents)
    except OSError as error:
        raise RaffError(f"{out}: can't be written: {error.filename}: {error.strerror}") from None
    return conversions


def _warn_outside(document: Document, made: Translation) -> None:
    """Says where a simulation would begin beyond a limit."""
    beyond = []
    for link in made.robot.links:
        low, high = limits(document, link)
        if not low <= made.analysis.home.get(link.joint, low) <= high:
            beyond.append(link.joint)
    if beyond:
        message = f"robot '{made.robot.name}': with loops closed, home is outside the limits of {', '.join(beyond)}"
        warnings.warn(message, RaffWarning, stacklevel=3)
