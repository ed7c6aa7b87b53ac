"""The command `raff2urdf`."""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TextIO

import typer

from raff2urdf.command.command_line import (
    VERSION,
    Command,
    UsageError,
    expand,
    flag,
    new_app,
    option,
    print_error,
    quantity_option,
    run_app,
)
from raff2urdf.command.output import run
from raff2urdf.command.read_flags import loop_kinds_of
from raff2urdf.errors import RaffError, RaffWarning, counted
from raff2urdf.files import is_stream, output_path
from raff2urdf.quantities import DENSITY as DENSITY_DIMENSION
from raff2urdf.writers import DENSITY, FORMATS

if TYPE_CHECKING:
    from raff2urdf.conversion import Conversion
    from raff2urdf.loops.mobility import Analysis

app = new_app()

LOOPS = option(
    "NAME=KIND",
    "close a loop as rigid, prismatic, revolute or ball, instead of what the file declares; may be repeated",
    None, "--loop",
)  # fmt: skip
FORCE = flag("--force", "replace an existing file that was not generated, or was changed since", unless="--check")
JSON = flag("--json", "print the result as JSON; SI units and radians")


def _print_grammar(wanted: bool) -> None:
    if wanted:
        from raff2urdf.raff.textmate import grammar

        print(json.dumps(grammar(), indent=2))
        raise typer.Exit


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code: 0; 1 if a file is wrong; 2 for a wrong call; see also `output.run`."""
    return run("raff2urdf", lambda: run_app(app, "raff2urdf", arguments))


def raff2urdf(
    files: list[str] = typer.Argument(
        ..., metavar="FILE...", help="RAFF files, or names of shipped robots", show_default=False
    ),
    output: str = option(
        "FILE", "file to write; a folder if it exists or ends with /; -: stdout", "generated/", "--output", "-o",
        unless="--check",
    ),
    force: bool = FORCE,
    format: Literal["urdf", "sdf", "mjcf"] = option(
        None, "urdf: URDF and a constraints file; sdf: for Gazebo; mjcf: for MuJoCo, as NAME.xml", "urdf",
        unless="--check",
    ),
    density: float | None = quantity_option(
        "KG_PER_M3",
        f"density of the links, for sdf and mjcf, whose masses are estimated from the graphics [{DENSITY:g}]",
        DENSITY_DIMENSION, least=-1e12, most=1e12, needs="--format sdf, --format mjcf",
    ),
    dialect: Literal["json", "constraint", "urdf+", "closing-frames", "mimic", "robot.yaml"] = option(
        None,
        "urdf: dialect in which it declares loops and couplings to other programs; json: none but the constraints "
        "file, which is always written",
        "json", "--loops", unless="--check", needs="--format urdf",
    ),
    robot: str | None = option("NAME", "convert only the robot of this name"),
    loop: list[str] | None = LOOPS,
    exact: bool = flag(
        "--exact",
        "keep all loops as written: neither close pins with play in the plane nor heal nearly redundant loops",
    ),
    check: bool = flag("--check", "only check the files and whether the loops can be closed: write nothing"),
    json: bool = JSON,
    grammar: bool = flag(
        "--grammar", "print the TextMate grammar of RAFF, with which editors highlight it, and exit",
        is_eager=True, callback=_print_grammar,
    ),
    version: bool = VERSION,
) -> int:  # fmt: skip
    """Convert RAFF files (Kleinfinger parameters, loops, sensors) to URDF with a constraints file, SDF or MJCF."""
    out, target = _target(output, files, format, json)
    from raff2urdf.conversion import convert

    def process(name: str) -> list[dict[str, Any]]:
        loops = loop_kinds_of(loop)
        if check:
            return _check(name, robot, loops, exact)
        conversions = convert(
            name, out, robot, loops, format=format, density=density, dialect=dialect,
            file=target, overwrite=force, exact=exact,
        )  # fmt: skip
        return [_report(name, format, conversion) for conversion in conversions]

    with warnings_printed():
        stream = sys.stderr if output == "-" else sys.stdout
        reports = _reports(files, process, are_written=not check, stream=None if json else stream)
    if json:
        print_json(reports)
    return 1 if any("errors" in report for report in reports) else 0


def _reports(
    files: list[str], process: Callable[[str], list[dict[str, Any]]], are_written: bool, stream: TextIO | None
) -> list[dict[str, Any]]:
    """Return the reports on files, each as soon as it is processed also on a stream; print errors."""
    reports: list[dict[str, Any]] = []
    stems: dict[str, str] = {}
    for name in files:
        try:
            other = stems.get(Path(name).stem, name)
            if other != name and are_written:
                raise RaffError(f"{name}: would overwrite the files of {other}: give them different names")
            of_file = process(name)
            reports += of_file
            stems[Path(name).stem] = name
            if stream is not None:
                print(*map(_summary, of_file), sep="\n", file=stream)
        except RaffError as error:
            reports.append({"file": name, "errors": [str(problem) for problem in error.problems]})
            print_error(str(error))
    return reports


app.command("raff2urdf", cls=Command)(expand(raff2urdf))


def _target(output: str, files: list[str], format: str, json: bool) -> tuple[str, str | None]:
    """Return the folder of --output, and the name of its file; None for a folder.

    Raises:
        UsageError: the name fits neither the files nor the format.
    """
    path = output_path(output, "")
    if output == "-" and json:
        raise UsageError("only one output can go to standard output: leave out --json, or name a file instead of -")
    if output != "-" and (output.endswith("/") or path.is_dir()):
        return output, None
    if len(files) > 1:
        raise UsageError(f"--output: {len(files)} files need a folder: write '{output}/'")
    suffix = {"urdf": ".urdf", "sdf": ".sdf", "mjcf": ".xml"}[format]
    if output == "-" or is_stream(path) or path.suffix == suffix:
        return str(path.parent), path.name
    raise UsageError(f"--output: '{output}' is neither a {suffix} file nor a folder: write '{output}/' for a folder")


@contextmanager
def warnings_printed() -> Iterator[None]:
    """Print warnings as commands do, one line each, on standard error."""

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        print(f"warning: {message}", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.simplefilter("always", RaffWarning)
        warnings.showwarning = show
        yield


def print_json(report: Any) -> None:
    """Print a report as JSON."""
    print(json.dumps(report, indent=1, ensure_ascii=False))


def _check(name: str, robot: str | None, loops: dict[str, str], exact: bool) -> list[dict[str, Any]]:
    from raff2urdf.conversion import examine, warn_of
    from raff2urdf.raff.check import check
    from raff2urdf.raff.compound import expanded
    from raff2urdf.raff.reader import parse, read
    from raff2urdf.shipped import find_robot

    path = find_robot(name)
    document = parse(read(path), name)
    check(document)
    reports = []
    for chosen in [document.robot(robot)] if robot is not None else document.robots:
        analysis, links = examine(document, chosen, path.parent, loops, exact), expanded(chosen).links
        warn_of(chosen.name, analysis)
        joints = sum(link.type != 0 for link in links)
        counts = {"links": len(chosen.links), "joints": joints, "loops": len(chosen.loops)}
        reports.append({"file": name, "robot": chosen.name, **counts, **_of_loops(analysis)})
    return reports


def _of_loops(analysis: Analysis) -> dict[str, Any]:
    return {
        "loop_rows": analysis.rows,
        "loop_rank": analysis.rank,
        "mobility": analysis.mobility,
        "actuated": list(analysis.actuated),
        "uncontrolled": list(analysis.uncontrolled),
        "gap_as_written": analysis.gap,
        "closure_at_home": analysis.closure,
    }


def _report(name: str, format: str, conversion: Conversion) -> dict[str, Any]:
    return {
        "file": name,
        "robot": conversion.robot,
        "links": conversion.links,
        "joints": conversion.joints,
        "loops": conversion.loops,
        **_of_loops(conversion.analysis),
        format: str(conversion.file),
        **({} if conversion.constraints is None else {"constraints": str(conversion.constraints)}),
        "files": [str(file) for file in conversion.files],
    }


def _summary(report: dict[str, Any]) -> str:
    counts = ", ".join(counted(report[f"{word}s"], word) for word in ("link", "joint", "loop"))
    text = f"{report['file']}: robot '{report['robot']}': {counts}"
    if report["loop_rows"]:
        text += f" ({report['loop_rows']} rows of rank {report['loop_rank']}, open by {report['gap_as_written']:.2g}"
        text += " as written)"
    text += f", mobility {report['mobility']}"
    if report["uncontrolled"]:
        text += f" ({len(report['uncontrolled'])} of them uncontrolled: {', '.join(report['uncontrolled'])})"
    if "files" not in report:
        closed = f", loops close to {report['closure_at_home']:.0e} at home" if report["loop_rows"] else ""
        return f"{text}: syntax and structure are valid{closed}"
    main = [report[word] for word in (*FORMATS, "constraints") if word in report]
    return f"{text}\n  -> {', '.join(main)}"
