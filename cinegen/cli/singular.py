"""`cinegen singular`: whether a mechanism is singular somewhere, why, and where else it is."""

from __future__ import annotations

import argparse
import json
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.cli.files import mechanisms, of_files, progress, write, write_figure
from cinegen.cli.values import meant, named, number, parts

if TYPE_CHECKING:
    from cinegen.model import Mechanism
    from cinegen.singularities.slice import Axis, Slice


def add(commands: Any) -> None:
    """Adds the command."""
    singular = commands.add_parser(
        "singular", help="singularities: at a pose, over a slice of the workspace, or on a recorded way",
        description="Says whether a mechanism is singular at a pose (home unless --at says where), of which type, what "
        "moves or is lost there, and, for legs that are lines, the geometric reason. With --scan it looks for all "
        "singularities on a slice, draws them and writes them. Given a recording (FILE.jsonl) it says where, between "
        "its samples too, the motion passes through one. Lengths in mm, angles in degrees.",
    )  # fmt: skip
    of_files(singular)
    singular.add_argument("--node", metavar="NAME", help="whose motion is meant (the robot's end)")
    singular.add_argument(
        "--at", metavar="POSE", default="",
        help="where, such as x=0,y=100,rz=15 of the node, or joint3=700 of motors; the others as at home",
    )  # fmt: skip
    singular.add_argument(
        "--scan", metavar="AXES", help="two coordinates, such as x,y or x=-300..300,rz=-90..90, or two motors"
    )
    singular.add_argument("--grid", type=int, default=61, metavar="N", help="points along each axis (%(default)d)")
    singular.add_argument("--plot", metavar="FILE", help="the scan's picture, .png, .svg or .pdf (ROBOT-singular.png)")
    singular.add_argument("-o", "--output", metavar="FILE", help="the scan as JSON, m and rad (ROBOT-singular.json)")
    singular.add_argument("--json", action="store_true", help="as JSON")
    singular.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Prints it, or writes it."""
    recordings = [file for file in options.files if file.endswith(".jsonl")]
    if recordings:
        return _ways(recordings, options)
    found = mechanisms(options)
    if options.scan is not None:
        for name, mechanism in found.items():
            _scan(name, mechanism, options, alone=len(found) == 1)
        return 0
    from cinegen.singularities import singularity

    reports = []
    for name, mechanism in found.items():
        here = singularity(mechanism, _there(mechanism, options), options.node)
        reports.append({"name": name, **here.as_dict()})
        if not options.json:
            print(f"{name}: " + "\n".join(_wrapped(here.words)))
    if options.json:
        print(json.dumps(reports, indent=1, ensure_ascii=False))
    return 0


def _wrapped(words: str) -> list[str]:
    """A line or two for each part of a sentence."""
    parts = words.split("; ")
    return [parts[0], *(textwrap.fill(part, 100, initial_indent="  ", subsequent_indent="    ") for part in parts[1:])]


# --- a pose ------------------------------------------------------------------------------------------------------


def _there(mechanism: Mechanism, options: argparse.Namespace) -> Any:
    """The configuration that --at names; home without it."""
    values = _values(mechanism, options.at)
    if not values:
        return mechanism.q_home
    from cinegen.errors import CinegenError
    from cinegen.singularities.slice import POSE, Coordinates

    of_motors = all(name in mechanism.actuated for name in values)
    names = mechanism.actuated if of_motors else POSE
    coordinates = Coordinates(mechanism, [name for name in names if name in values], options.node)
    q = coordinates.led(values)
    if q is None:
        raise CinegenError(f"{mechanism.name}: --at {options.at} can't be reached straight from home on its branch")
    return q


def _values(mechanism: Mechanism, text: str) -> dict[str, float]:
    """Coordinates by name, m and rad, from --at; none without it."""
    from cinegen.errors import CinegenError

    given = parts([text])
    for part in given:
        if "=" not in part:
            raise CinegenError(f"--at: '{part}': write NAME=VALUE, mm or degrees, such as x=100 or rz=15")
    values = named(given, "--at", "x=100,rz=15") or {}
    return {name: meant(mechanism, name, value) for name, value in values.items()}


# --- a slice -----------------------------------------------------------------------------------------------------


def _scan(name: str, mechanism: Mechanism, options: argparse.Namespace, alone: bool) -> None:
    from cinegen.plotting.loci import draw_loci
    from cinegen.singularities import Kind
    from cinegen.singularities.scan import scan

    of = _slice(mechanism, options)
    with progress() as say:
        loci = scan(of, options.grid, lambda part: say(f"{100.0 * part:3.0f} %"))
    picture = Path(options.plot if options.plot and alone else f"{name}-singular{_ending(options.plot)}")
    numbers = Path(options.output if options.output and alone else f"{name}-singular.json")
    figure = draw_loci(loci)
    write(numbers, json.dumps(loci.as_dict(), ensure_ascii=False) + "\n")
    write_figure(picture, figure)
    axes = " and ".join(axis.name for axis in of.axes)
    print(f"{name}: {100.0 * loci.reached.mean():.0f} % of the slice over {axes} is reached from home on its branch")
    for curve in loci.curves:
        kind = "no singularity" if curve.kind is Kind.NONE else curve.kind.value
        print(f"  {kind}, {'where the branch ends' if curve.border else 'inside'}: {len(curve.points)} points")
    if not loci.curves:
        print("  no singularity")
    print(f"{picture} and {numbers} are written")


def _slice(mechanism: Mechanism, options: argparse.Namespace) -> Slice:
    from cinegen.errors import CinegenError
    from cinegen.singularities.slice import Slice

    parts = [part.strip() for part in options.scan.split(",") if part.strip()]
    if len(parts) != 2:
        raise CinegenError(f"--scan {options.scan}: name two coordinates, such as x,y or x=-300..300,rz=-90..90")
    first, second = (_axis(mechanism, part, options.node) for part in parts)
    return Slice(mechanism, (first, second), _values(mechanism, options.at), options.node)


def _axis(mechanism: Mechanism, text: str, node: str | None) -> Axis:
    """A coordinate with its range; where none is given, about home."""
    from cinegen.errors import CinegenError
    from cinegen.singularities.slice import Axis, about_home

    name, equals, span = (word.strip() for word in text.partition("="))
    if not equals:
        return about_home(mechanism, name, node)
    low, dots, high = span.partition("..")
    if not dots:
        raise CinegenError(f"--scan: '{text}': write NAME=LOW..HIGH, mm or degrees, such as x=-300..300")
    return Axis(name, *(meant(mechanism, name, number(end, "--scan")) for end in (low, high)))


def _ending(plot: str | None) -> str:
    return Path(plot).suffix if plot and Path(plot).suffix else ".png"


# --- a recorded way ----------------------------------------------------------------------------------------------


def _ways(files: list[str], options: argparse.Namespace) -> int:
    from cinegen.mission import Recording, check, resampled

    reports = []
    for file in files:
        trajectory = resampled(Recording.load(file), options.robot)
        findings = [finding for finding in check(trajectory) if finding.sigma is not None]
        reports.append({"recording": file, "found": [
            {"kind": one.kind.value, "time": one.recorded, "sigma": one.sigma, "message": one.message,
             "q": one.q.tolist()}
            for one in findings
        ]})  # fmt: skip
        if not options.json:
            print(f"{file}: {len(findings) or 'no'} singularit{'y' if len(findings) == 1 else 'ies'} on its way")
            for one in findings:
                print(f"  at {one.recorded:.3f} s {one.message} (singular value {one.sigma:.2g})")
    if options.json:
        print(json.dumps(reports, indent=1, ensure_ascii=False))
    return 0
