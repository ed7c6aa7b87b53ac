"""Convert a URDF, SDF or MJCF to a RAFF file: everything is made before anything is written."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from raff2urdf import readers
from raff2urdf.errors import RaffError, RaffWarning, did_you_mean, first_of, raised_as, run_all
from raff2urdf.files import check_new, is_stream, write_all, writing
from raff2urdf.loops.mobility import loop_kind
from raff2urdf.raff.check import check
from raff2urdf.raff.writer import dumps
from raff2urdf.readers.options import ReadOptions
from raff2urdf.readers.urdf import joints, lacks_limits, listed
from raff2urdf.readers.urdf_file import parse
from raff2urdf.urdf2raff.graphics import GraphicsExport, units_of
from raff2urdf.urdf2raff.robot import RaffImport, import_tree


def to_raff(
    path: str | Path,
    out: str | Path | None = None,
    units: str | None = None,
    graphics: bool = True,
    robot: str | None = None,
    loops: Mapping[str, str] | None = None,
    ignore_loops: bool = False,
    ignore: Sequence[str] = (),
    overwrite: bool = True,
    packages: Mapping[str, str | Path] | None = None,
    xacro_args: Mapping[str, str] | None = None,
    swap_limits: bool = False,
) -> RaffImport:
    """Describe a robot in RAFF, from a URDF, SDF or MJCF.

    Loops and couplings of a URDF are read in all dialects that `cinegen.load` reads.

    Args:
        path: the file.
        out: the RAFF file to write; its graphics are written to the folder `<stem>_graphics` next to it. Nothing is
            written if None.
        units: of the RAFF file: um, mm, cm or m; by default the unit of most meshes, or else mm.
        graphics: whether meshes and shapes are converted too.
        robot: which model of an SDF with several; the first by default.
        loops: kinds (rigid, prismatic, revolute, ball) that replace the file's, by the loop's name.
        ignore_loops: leave out all loops and couplings.
        ignore: loops and couplings to be left out, by name or by element.
        overwrite: whether to replace a RAFF file.
        packages: folders of ROS packages by name, where `package://NAME` and `$(find NAME)` are searched first.
        xacro_args: arguments of a file in xacro, by name.
        swap_limits: exchange lower and upper limits of a URDF where the lower one is above the upper one.

    Returns:
        the document, and how its joints, zeros and nodes correspond to the URDF's.

    Raises:
        RaffError: the file is wrong, holds something for which RAFF has no notation, or declares loops that are not
            read; an option has no effect; `out` can't be written.
    """
    path, out = Path(path), None if out is None else Path(out)
    options = ReadOptions(packages or {}, xacro_args or {}, swap_limits)
    text, constraints, *_ = readers.read(path, robot, ignore_loops, ignore, options)
    options.check(path)
    entries = {entry["name"]: entry for entry in (constraints or {}).get("loops", [])}
    for name, kind in (loops or {}).items():
        if name not in entries:
            raise RaffError(f"{path}: there is no loop '{name}'{did_you_mean(name, list(entries))}")
        entries[name]["kind"] = loop_kind(kind).name.lower()
    tree = parse(text, str(path))
    unlimited = [joint for joint in joints(tree) if lacks_limits(joint)]
    if unlimited:
        message = f"{listed(unlimited, str(path))}: neither lower nor upper limit is given; written without limits"
        warnings.warn(message, RaffWarning, stacklevel=2)
    imported = import_tree(tree, str(path), constraints, units or units_of(tree))
    try:
        check(imported.document)
    except RaffError as error:
        problems = "; ".join(problem.message for problem in error.problems)
        raise RaffError(f"{path}: RAFF has no notation for it: {problems}") from None
    if out is None:
        return imported
    if not overwrite:
        check_new(out, remakeable=False)  # before meshes are read
    with writing(RaffError):
        folder = None if is_stream(out) else out.parent
    contents: dict[Path, bytes] = {}
    if graphics:
        export = GraphicsExport(tree, str(path), path.parent, folder or Path(), out.stem, options.search)
        imported, contents = _with_graphics(imported, export)
        if contents and folder is None:
            raise RaffError(
                f"{path}: graphics can't be written next to {out}: name a regular file, or give --no-graphics"
            )
    _write(path, out, imported, contents, overwrite)
    return imported


def _with_graphics(imported: RaffImport, export: GraphicsExport) -> tuple[RaffImport, dict[Path, bytes]]:
    """Return a robot with graphics, and the contents of these; one warning reports what is left out."""
    document = replace(imported.document, robots=(export.robot(imported.document, imported.nodes),))
    if lost := list(export.lost.values()):
        more = f"; and {len(lost) - 1} more mesh{'es' * (len(lost) > 2)}" if len(lost) > 1 else ""
        message = f"{lost[0]}{more}; left out; links without another shape are drawn as a skeleton"
        warnings.warn(message, RaffWarning, stacklevel=3)
    return replace(imported, document=document), dict(export.files)


def _write(path: Path, out: Path, imported: RaffImport, graphics: Mapping[Path, bytes], overwrite: bool) -> None:
    """Write the RAFF file `out` of a robot from `path`, and its graphics.

    Raises:
        RaffError: RAFF has no notation for the robot, or a file exists or can't be written.
    """
    with raised_as(RaffError, RaffError, f"{path}: "):
        text = dumps(imported.document, _head(path, imported), imported.notes)
    contents = {**graphics, out: text.encode()}
    run_all(partial(check_new, to, False, content) for to, content in contents.items() if not overwrite)
    with writing(RaffError):
        write_all(contents)


def _head(path: Path, imported: RaffImport) -> Sequence[str]:
    """Return the comment at the head of the file."""
    lines = [f"From {path.name}. The comment on a link is the name of its joint there."]
    moved = sum(offset != 0.0 for offset in imported.offsets.values())
    if moved:
        lines.append(f"Joint variables are those of {path.name}, except {moved}, which have another zero there.")
    renamed = {link: node for link, node in imported.nodes.items() if link != node}
    if renamed:
        lines.append(f"Names that differ: {first_of([f'{link} is {node}' for link, node in renamed.items()], 8)}.")
    return lines
