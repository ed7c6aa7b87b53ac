"""The command `urdf2raff`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from raff2urdf.cli import FORCE, JSON, LOOPS, print_json, warnings_printed
from raff2urdf.command.command_line import (
    VERSION,
    Command,
    UsageError,
    expand,
    flag,
    new_app,
    option,
    print_error,
    run_app,
)
from raff2urdf.command.output import run
from raff2urdf.command.read_flags import ReadFlags, loop_kinds_of
from raff2urdf.errors import RaffError, counted
from raff2urdf.files import STANDARD, output_path, stem_of

if TYPE_CHECKING:
    from raff2urdf.urdf2raff.robot import RaffImport

app = new_app()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code: 0; 1 if the file is wrong; 2 for a wrong call; see also `output.run`."""
    return run("urdf2raff", lambda: run_app(app, "urdf2raff", arguments))


def urdf2raff(
    reading: ReadFlags,
    file: str = typer.Argument(..., metavar="FILE", help="URDF, SDF or MJCF", show_default=False),
    output: str | None = option(
        "FILE",
        "RAFF file to write; a folder if it exists or ends with /; -: stdout [FILE's name with .raff, here]",
        None, "--output", "-o", endings=(".raff",),
    ),
    force: bool = FORCE,
    robot: str | None = option("NAME", "which model of an SDF with several"),
    units: Literal["um", "mm", "cm", "m"] | None = option(None, "unit of lengths [that of most meshes, else mm]"),
    no_graphics: bool = flag("--no-graphics", "leave out meshes and shapes"),
    loop: list[str] | None = LOOPS,
    ignore_loops: bool = flag("--ignore-loops", "leave out all loops and couplings: write the tree only"),
    ignore: list[str] | None = option(
        "ELEMENT", "leave out loops and couplings of this name or element; may be repeated", unless="--ignore-loops"
    ),
    json: bool = JSON,
    version: bool = VERSION,
) -> int:  # fmt: skip
    """Describe a robot in RAFF (Kleinfinger parameters, loops) from a URDF, an SDF or an MJCF.

    Loops and couplings of a URDF are read in all dialects that cinegen reads.
    """
    path = output_path(output, f"{stem_of(Path(file))}.raff")
    if path == STANDARD and json:
        raise UsageError("only one output can go to standard output: leave out --json, or name a file instead of -")
    with warnings_printed():
        try:
            from raff2urdf.urdf2raff.conversion import to_raff

            loops, options = loop_kinds_of(loop), reading.options()
            imported = to_raff(
                file, path, units, not no_graphics, robot, loops, ignore_loops, ignore or (), force,
                options.packages, options.xacro_args, options.swap_limits,
            )  # fmt: skip
        except RaffError as error:
            print_error(str(error))
            return 1
    report = _report(file, path, imported)
    if json:
        print_json(report)
    else:
        print(_summary(report), file=sys.stderr if path == STANDARD else sys.stdout)
    return 0


app.command("urdf2raff", cls=Command)(expand(urdf2raff))


def _report(name: str, out: Path, imported: RaffImport) -> dict[str, Any]:
    robot = imported.document.robot()
    return {
        "file": name,
        "raff": str(out),
        "robot": robot.name,
        "links": len(robot.links),
        "frames": len(robot.frames),
        "loops": len(robot.loops),
        "joints": dict(imported.joints),
        "offsets": {joint: offset for joint, offset in imported.offsets.items() if offset},
        "nodes": dict(imported.nodes),
    }


def _summary(report: dict[str, Any]) -> str:
    numbers = report | {"joints": len(report["joints"])}
    counts = ", ".join(counted(numbers[f"{word}s"], word) for word in ("link", "frame", "joint", "loop"))
    moved = len(report["offsets"])
    zeros = f"; {counted(moved, 'joint')} with another zero" if moved else ""
    return f"{report['file']}: robot '{report['robot']}': {counts}{zeros}\n  -> {report['raff']}"
