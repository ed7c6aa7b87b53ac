"""The command `raff2urdf`."""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raff2urdf.check import check
from raff2urdf.errors import RaffError, RaffWarning
from raff2urdf.formats import FORMATS
from raff2urdf.output import run

if TYPE_CHECKING:
    from raff2urdf.conversion import Conversion


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code: 0, 1 where a file is wrong, or as `raff2urdf.output.run` says."""
    return run("raff2urdf", lambda: _main(arguments))


def _main(arguments: Sequence[str] | None) -> int:
    parser = argparse.ArgumentParser(
        prog="raff2urdf",
        description="Translate RAFF files (Kleinfinger parameters, loops, sensors) into URDF plus constraints, "
        "or into what simulators read.",
    )
    parser.add_argument("files", nargs="+", metavar="FILE", help="RAFF file")
    parser.add_argument("-o", "--out", default="generated", metavar="DIR", help="folder to write to (%(default)s)")
    parser.add_argument(
        "--format", choices=list(FORMATS), default="urdf",
        help="urdf: URDF and constraints (unless said); sdf: for Gazebo; mjcf: for MuJoCo, as FILE.xml",
    )  # fmt: skip
    parser.add_argument(
        "--density", type=float, metavar="KG_PER_M3",
        help="of what the links are made of, for sdf and mjcf: masses are estimated from the graphics (1000)",
    )  # fmt: skip
    parser.add_argument(
        "--constraint-elements", action="store_true",
        help="urdf: write the loops into the URDF as well, as <constraint> elements (a proposal to ROS)",
    )  # fmt: skip
    parser.add_argument("--robot", metavar="NAME", help="only the robot of this name")
    parser.add_argument(
        "--loop", action="append", default=[], metavar="NAME=KIND",
        help="close a loop as rigid, prismatic, revolute or ball, whatever the file says",
    )  # fmt: skip
    parser.add_argument("--check", action="store_true", help="read and check only: write nothing, close no loops")
    parser.add_argument("--json", action="store_true", help="say what was found as JSON")
    options = parser.parse_args(arguments)
    if options.density is not None and options.format == "urdf":
        parser.error("--density: a URDF of RAFF has no masses; it is for --format sdf or mjcf")
    if options.constraint_elements and options.format != "urdf":
        parser.error(f"--constraint-elements is for --format urdf; {options.format} has words of its own for loops")
    with warnings.catch_warnings():
        warnings.simplefilter("always", RaffWarning)
        warnings.showwarning = show_warning
        return _run(options)


def _run(options: argparse.Namespace) -> int:
    reports: list[dict[str, Any]] = []
    failed = False
    stems: dict[str, str] = {}
    for name in options.files:
        try:
            twin = stems.get(Path(name).stem, name)
            if twin != name and not options.check:
                raise RaffError(f"{name}: would overwrite what {twin} became: give them different names")
            found = _check(name, options.robot) if options.check else _convert(name, options)
            reports += found
            stems[Path(name).stem] = name
            if not options.json:
                for report in found:
                    print(_sentence(report))
        except RaffError as error:
            failed = True
            reports.append({"file": name, "errors": [str(problem) for problem in error.problems]})
            print(error, file=sys.stderr)
    if options.json:
        print(json.dumps(reports, indent=1, ensure_ascii=False))
    return 1 if failed else 0


def _check(name: str, robot: str | None) -> list[dict[str, Any]]:
    from raff2urdf.reader import parse, read

    document = parse(read(name), name)
    check(document)
    robots = [document.robot(robot)] if robot is not None else document.robots
    return [
        {
            "file": name,
            "robot": one.name,
            "links": len(one.links),
            "joints": sum(link.type != 0 for link in one.links),
            "loops": len(one.loops),
        }
        for one in robots
    ]


def _convert(name: str, options: argparse.Namespace) -> list[dict[str, Any]]:
    from raff2urdf.conversion import convert_file

    loops = dict(pair(text) for text in options.loop)
    found = convert_file(
        Path(name), Path(options.out), options.robot, loops,
        format=options.format, density=options.density, constraint_elements=options.constraint_elements,
    )  # fmt: skip
    return [_report(name, options.format, one) for one in found]


def pair(text: str) -> tuple[str, str]:
    """The name and the kind of an option --loop NAME=KIND."""
    name, equals, kind = text.rpartition("=")
    if not equals:
        raise RaffError(f"--loop {text}: write NAME=KIND, for example --loop link5-link11=ball")
    return name, kind


def _report(name: str, format: str, conversion: Conversion) -> dict[str, Any]:
    analysis = conversion.analysis
    return {
        "file": name,
        "robot": conversion.robot,
        "links": conversion.links,
        "joints": conversion.joints,
        "loops": conversion.loops,
        "loop_rows": analysis.rows,
        "loop_rank": analysis.rank,
        "mobility": analysis.mobility,
        "actuated": list(analysis.actuated),
        "gap_as_written": analysis.gap,
        format: str(conversion.file),
        **({} if conversion.constraints is None else {"constraints": str(conversion.constraints)}),
        "files": [str(file) for file in conversion.files],
    }


def _sentence(report: dict[str, Any]) -> str:
    def count(what: str) -> str:
        return f"{report[what]} {what[:-1] if report[what] == 1 else what}"

    said = f"{report['file']}: robot '{report['robot']}': {count('links')}, {count('joints')}, {count('loops')}"
    if "mobility" not in report:
        return f"{said}: correct"
    if report["loops"]:
        said += f" ({report['loop_rows']} rows of rank {report['loop_rank']}, open by {report['gap_as_written']:.2g}"
        said += " as written)"
    main = [report[word] for word in (*FORMATS, "constraints") if word in report]
    return f"{said}, mobility {report['mobility']}\n  -> {', '.join(main)}"


def show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Prints a warning as the commands do."""
    print(f"warning: {message}", file=sys.stderr)
