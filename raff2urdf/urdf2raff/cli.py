"""The command `urdf2raff`."""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raff2urdf.cli import pair, show_warning
from raff2urdf.document import UNITS_PER_METRE
from raff2urdf.errors import RaffError, RaffWarning
from raff2urdf.output import run

if TYPE_CHECKING:
    from raff2urdf.urdf2raff.robot import Reversal


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code: 0, 1 where the file is wrong, or as `raff2urdf.output.run` says."""
    return run("urdf2raff", lambda: _main(arguments))


def _main(arguments: Sequence[str] | None) -> int:
    parser = argparse.ArgumentParser(
        prog="urdf2raff",
        description="Describe a robot in RAFF (Kleinfinger parameters, loops) from a URDF, an SDF or an MJCF. What a "
        "URDF can't say is read from NAME.constraints.json or robot.yaml beside it.",
    )
    parser.add_argument("file", metavar="FILE", help="URDF, SDF or MJCF")
    parser.add_argument("-o", "--out", metavar="FILE", help="RAFF file to write (FILE's name with .raff, here)")
    parser.add_argument("--robot", metavar="NAME", help="which model, of an SDF that holds several")
    parser.add_argument("--units", choices=list(UNITS_PER_METRE), help="of lengths (what the meshes are in, else mm)")
    parser.add_argument("--no-graphics", action="store_true", help="carry no meshes and shapes over")
    parser.add_argument(
        "--free-mimic", action="store_true", help="write joints that mimic others as joints of their own"
    )
    parser.add_argument(
        "--loop", action="append", default=[], metavar="NAME=KIND",
        help="close a loop as rigid, prismatic, revolute or ball, whatever the file says",
    )  # fmt: skip
    parser.add_argument(
        "--ignore-loops", action="store_true",
        help="leave all loops open: the tree only, without loops and couplings that can't be read",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="say what was written as JSON")
    options = parser.parse_args(arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("always", RaffWarning)
        warnings.showwarning = show_warning
        try:
            path = Path(options.file)
            out = Path(options.out or f"{path.stem}.raff")
            if not options.out and out.exists():
                raise RaffError(f"{out} is there already: say -o {out} to write over it")
            from raff2urdf.urdf2raff.file import reverse_file

            loops = dict(pair(text) for text in options.loop)
            found = reverse_file(
                path, out, options.units, options.free_mimic, not options.no_graphics, options.robot, loops,
                options.ignore_loops,
            )  # fmt: skip
        except RaffError as error:
            print(error, file=sys.stderr)
            return 1
    report = _report(options.file, out, found)
    print(json.dumps(report, indent=1, ensure_ascii=False) if options.json else _sentence(report))
    return 0


def _report(name: str, out: Path, found: Reversal) -> dict[str, Any]:
    robot = found.document.robot()
    return {
        "file": name,
        "raff": str(out),
        "robot": robot.name,
        "links": len(robot.links),
        "frames": len(robot.frames),
        "loops": len(robot.loops),
        "joints": dict(found.joints),
        "offsets": {joint: offset for joint, offset in found.offsets.items() if offset},
        "nodes": dict(found.nodes),
    }


def _sentence(report: dict[str, Any]) -> str:
    def count(what: str, number: int) -> str:
        return f"{number} {what[:-1] if number == 1 else what}"

    said = ", ".join(count(what, len(report[what]) if what == "joints" else report[what]) for what in _COUNTED)
    moved = len(report["offsets"])
    zeros = f"; {count('joints', moved)} with another zero" if moved else ""
    return f"{report['file']}: robot '{report['robot']}': {said}{zeros}\n  -> {report['raff']}"


_COUNTED = ("links", "frames", "joints", "loops")
