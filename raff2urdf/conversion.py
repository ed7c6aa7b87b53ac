"""Convert RAFF files into URDF and other formats: everything is made before anything is written."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raff2urdf.constraints import Constraints, check_values, constraints, for_urdf
from raff2urdf.errors import NearlyRedundantError, RaffError, RaffWarning, run_all
from raff2urdf.files import GENERATED, check_new, has_digest, is_stream, read_bytes, stem_of, write_all, writing
from raff2urdf.graphics.meshes import Graphics
from raff2urdf.loops.mobility import Analysis, analyse, loop_kinds
from raff2urdf.raff.check import check
from raff2urdf.raff.compound import expanded
from raff2urdf.raff.document import Document, LoopKind, RaffRobot
from raff2urdf.raff.reader import parse, read
from raff2urdf.raff.sizes import check_sizes
from raff2urdf.readers.actuation import RAFF, advice
from raff2urdf.readers.urdf import hash_of
from raff2urdf.readers.urdf_file import parse as parse_urdf
from raff2urdf.shipped import find_robot
from raff2urdf.writers import WriteOptions, files

if TYPE_CHECKING:  # takes half a second
    from raff2urdf.writers.urdf_object import ExactUrdf


_NOT_IN_XML = re.compile("[\x00-\x1f\ud800-\udfff\ufffe\uffff]")  # characters of names of files


@dataclass(frozen=True)
class Translation:
    """A robot as the tree of a URDF, and everything for which a URDF has no element, in memory.

    Attributes:
        robot: that was translated, with one variable at most for each link (`raff2urdf.raff.compound`).
        model: its tree, a `yourdfpy.URDF`; meshes are named relative to `out`.
        constraints: the contents of its constraints file.
        analysis: mobility, actuated joints, rows and rank of the loops.
        missing: graphics that can't be shown.
        meshes: converted graphics that are not written yet, by path.
        out: the folder to which the files will be written; None if there is none.
    """

    robot: RaffRobot
    model: ExactUrdf
    constraints: Constraints
    analysis: Analysis
    missing: tuple[str, ...]
    meshes: Mapping[Path, bytes]
    out: Path | None

    @cached_property
    def urdf(self) -> str:
        """The text of the URDF."""
        return self.model.text()

    def content(self, mesh: str) -> bytes:
        """Return the content of a mesh, written or not.

        Raises:
            RaffError: it can't be read.
        """
        path = Path(os.path.normpath((self.out or Path()).resolve() / mesh))  # the folder need not exist yet
        pending = {file.resolve(): content for file, content in self.meshes.items()}.get(path)
        return read_bytes(path) if pending is None else pending

    def surface(self, mesh: str) -> Any:
        """Return a mesh as one surface in its own unit, a trimesh.Trimesh.

        Raises:
            RaffError: it can't be read.
        """
        from raff2urdf.writers.inertia import load_surface

        return load_surface(mesh, self.content(mesh))


@dataclass(frozen=True, slots=True)
class Conversion:
    """The files of one converted robot, and its properties.

    Attributes:
        robot: its name.
        file: path of the robot's own file: a URDF, or another format if that was asked for.
        constraints: path of the constraints file; None for other formats, which need none.
        links: number of links (without base and frames).
        joints: number of joints that move.
        loops: number of loops.
        analysis: mobility, actuated joints, rows and rank of the loops, their gap as written.
        files: every file that was written for it.
        model: its tree, a `yourdfpy.URDF`, without loops; meshes are named relative to the file.
    """

    robot: str
    file: Path
    constraints: Path | None
    links: int
    joints: int
    loops: int
    analysis: Analysis
    files: tuple[Path, ...]
    model: ExactUrdf = field(repr=False)

    @property
    def urdf(self) -> Path | None:
        """Path of the URDF; None if another format was asked for."""
        return None if self.constraints is None else self.file


def translate(
    document: Document,
    robot: RaffRobot,
    folder: Path,
    out: Path | None = None,
    loops: Mapping[str, str] | None = None,
    meshes: Path | None = None,
    exact: bool = False,
) -> Translation:
    """Translate one robot of a checked document, in memory.

    Args:
        document: that holds the robot.
        robot: the robot.
        folder: of the RAFF file; graphics are looked for relative to it.
        out: the folder to which its URDF will be written.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name.
        meshes: the folder to which converted graphics will be written; if None, they are written to the user's cache
            at once.
        exact: take all loops as written, see `examine`.

    Raises:
        RaffClosureError: the loops can't be closed.
        RaffError: `loops` names what does not exist.
    """
    check_values(constraints(document, robot, None, loops), f"{document.source.name}: robot '{robot.name}'")
    analysis, links = examine(document, robot, folder, loops, exact), expanded(robot)
    graphics = Graphics(links, folder, meshes)
    model, missing = _tree(document, _with_kinds(links, loop_kinds(robot, loops)), graphics, out)
    for joint in model.robot.joints:
        joint.origin = analysis.origins.get(joint.name, joint.origin)
    values = constraints(document, robot, analysis, loops)
    return Translation(links, model, values, analysis, missing, graphics.written, out)


def examine(
    document: Document, robot: RaffRobot, folder: Path, loops: Mapping[str, str] | None = None, exact: bool = False
) -> Analysis:
    """Return the analysis of one robot of a checked document.

    Pins with play are closed in the plane, and nearly redundant loops healed or relaxed, as `cinegen.load` does: by
    cinegen, which is imported for these alone.

    Args:
        document: that holds the robot.
        robot: the robot.
        folder: of the RAFF file.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name.
        exact: take all loops as written.

    Raises:
        RaffClosureError: the loops can't be closed.
        RaffError: `loops` names what does not exist.
    """
    try:
        return analyse(document, robot, loops, exact)
    except NearlyRedundantError:
        healer = import_module("cinegen.model.healing.healed")  # raff2urdf does without Pinocchio otherwise
    analysis: Analysis = healer.healed(document, robot, folder, loops)
    return analysis


def describe(
    document: Document, robot: RaffRobot, folder: Path, loops: Mapping[str, str] | None = None
) -> tuple[str, Constraints]:
    """Return one robot of a checked document as a URDF's text and its constraints; its loops are not closed.

    Values that only closing them determines are None, see `constraints`. Converted graphics are written to the user's
    cache.

    Args:
        document: that holds the robot.
        robot: the robot.
        folder: of the RAFF file; graphics are looked for relative to it.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name.

    Raises:
        RaffError: `loops` names a loop or a kind that does not exist; a length is too large.
    """
    check_sizes(document, robot)
    links = expanded(robot)
    drawn = _with_kinds(links, loop_kinds(robot, loops))
    model, _ = _tree(document, drawn, Graphics(links, folder, written_out=False))
    urdf, values = model.text(), constraints(document, robot, None, loops)
    check_values(values, f"{document.source.name}: robot '{robot.name}'")
    return urdf, for_urdf(values, hash_of(parse_urdf(urdf, robot.name), robot.name))


def _with_kinds(robot: RaffRobot, kinds: Mapping[int, LoopKind]) -> RaffRobot:
    """Return a robot with other kinds of loops, by index: bodies are drawn as these join them."""
    return replace(robot, loops=tuple(replace(loop, kind=kinds[i]) for i, loop in enumerate(robot.loops)))


def _tree(
    document: Document, robot: RaffRobot, graphics: Graphics, out: Path | None = None
) -> tuple[ExactUrdf, tuple[str, ...]]:
    """Return the tree and the graphics that can't be shown; one warning lists them."""
    from raff2urdf.writers.urdf import tree

    model, missing = tree(document, robot, graphics, out)
    if missing:
        shown = "; ".join(missing[:10]) + (f"; and {len(missing) - 10} more" if len(missing) > 10 else "")
        message = (
            f"robot '{robot.name}': graphics that can't be shown, for which a skeleton is drawn and collides: {shown}"
        )
        warnings.warn(message, RaffWarning, stacklevel=3)
    return model, tuple(missing)


def convert(
    path: str | Path,
    out: str | Path = "generated",
    robot: str | None = None,
    loops: Mapping[str, str] | None = None,
    *,
    format: str = "urdf",
    density: float | None = None,
    dialect: str = "json",
    file: str | None = None,
    overwrite: bool = True,
    exact: bool = False,
) -> list[Conversion]:
    """Convert a RAFF file to `<stem>.urdf` and `<stem>.constraints.json` in the folder `out`, or to another format.

    Several robots in the file become `<stem>.<robot>.urdf` and so on. Everything is made before anything is
    written, so that a failure leaves existing files untouched.

    Args:
        path: the RAFF file, or the name of a shipped robot.
        out: the folder to write to; made if it does not exist.
        robot: convert only the robot of this name.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name.
        format: urdf; sdf, as `<stem>.sdf`; or mjcf, as `<stem>.xml`.
        density: of the links, kg/m3, for formats that need masses; 1000 by default.
        file: name of the robot's own file in `out`, whose stem is that of its other files; `-` is standard output.
        overwrite: whether to replace files that were not generated, or were changed since; see
            `raff2urdf.files.check_new`.
        exact: take all loops as written. Otherwise pins with play (`raff2urdf.loops.play`) are closed in the plane, and
            nearly redundant loops (`raff2urdf.loops.near_redundancy`) healed or relaxed.
        dialect: in which a URDF declares loops and couplings, besides its constraints file: json (none), constraint,
            urdf+, closing-frames, mimic or robot.yaml; see `raff2urdf.writers.urdf_dialects`.

    Raises:
        RaffError: the file is wrong, its loops can't be closed, there is no such format, or `out` can't be written.
    """
    path, out = find_robot(path), Path(out)
    document = parse(read(path), str(path))
    check(document)
    robots = [document.robot(robot)] if robot is not None else list(document.robots)
    options = WriteOptions(density, dialect)
    if file is not None and len(robots) > 1:
        names = ", ".join(chosen.name for chosen in robots)
        raise RaffError(f"{path}: holds several robots ({names}): name one with --robot, or a folder to write to")
    streamed = file is not None and _is_stream(out / file)
    conversions, contents = list[Conversion](), dict[Path, bytes]()
    for chosen in robots:
        name = stem_of(path) if len(document.robots) == 1 else f"{stem_of(path)}.{chosen.name}"
        name = name if file is None else Path(file).stem
        meshes = out / "meshes" / _NOT_IN_XML.sub("_", name)
        made = translate(document, chosen, path.parent, out, loops, None if streamed else meshes, exact)
        warn_of(chosen.name, made.analysis, actuation=format != "urdf")
        main, *others = files(format, made, name, options).items()
        constrained = made.constraints["loops"] or made.constraints.get("couplings")
        if streamed and constrained and others and dialect in ("json", "robot.yaml"):
            message = f"{out / str(file)}: its loops are left out: {others[0][0]} needs a file to be next to"
            warnings.warn(f"robot '{chosen.name}': {message}", RaffWarning, stacklevel=2)
        written = {out / (file or main[0]): _marked(main[1])}
        written |= {out / key: content for key, content in (() if streamed else others)}
        conversion = _conversion(chosen, made, tuple(written), out / f"{name}.constraints.json")
        conversions.append(conversion)
        contents |= made.meshes  # first, so that a robot's own file never exists without its meshes
        contents |= dict(reversed(written.items()))
        if not overwrite:
            older = conversion.file.exists() and not has_digest(conversion.file)
            run_all(
                partial(check_new, target, is_companion=older and target != conversion.file)
                for target in conversion.files
            )
    with writing(RaffError):
        write_all(contents)
    return conversions


def _conversion(robot: RaffRobot, made: Translation, written: tuple[Path, ...], sidecar: Path) -> Conversion:
    """Return the conversion of a robot whose files are `written`, the robot's own file first, and its meshes."""
    return Conversion(
        robot=robot.name,
        file=written[0],
        constraints=sidecar if sidecar in written else None,
        links=len(robot.links),
        joints=len(made.constraints["joints"]),
        loops=len(robot.loops),
        analysis=made.analysis,
        files=(*written, *made.meshes),
        model=made.model,
    )


def _marked(content: bytes) -> bytes:
    """Return an XML file with a comment that it may be replaced, after the declaration."""
    return content.replace(
        b"?>\n", f"?>\n<!-- {GENERATED}: raff2urdf replaces this file unless it is changed -->\n".encode(), 1
    )


def _is_stream(path: Path) -> bool:
    try:
        return is_stream(path)
    except OSError:  # reported when it is written
        return False


def warn_of(name: str, analysis: Analysis, actuation: bool = True) -> None:
    """Warn of what the analysis of the robot of that name remarks: pins with play, joints that home moves to be within
    their limits or leaves outside; and, if asked to, of actuated joints that depend on each other, and leave a DoF
    uncontrolled."""
    texts = list(analysis.remarks)
    if actuation and analysis.uncontrolled and analysis.dependent:
        texts.append(advice(analysis.uncontrolled, analysis.dependent, RAFF, len(analysis.uncontrolled)))
    for text in texts:
        warnings.warn(f"robot '{name}': {text}", RaffWarning, stacklevel=3)
