"""`cinegen singular`: singularities at a pose, over a slice of the workspace, or along a recorded motion."""

from __future__ import annotations

import json as json_text
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from cinegen.cli.files import check_outputs, print_result, write, write_figure
from cinegen.cli.numbers import AT, POSE_EXAMPLE, UNITS, configuration_at, interval_of, parts, values
from cinegen.cli.options import FILE, JSON, PICTURES, ShownRobotOptions, force_option, output_option
from cinegen.cli.progress import Progress
from cinegen.errors import CinegenError
from raff2urdf.command.command_line import UsageError, no_effect, option
from raff2urdf.errors import counted
from raff2urdf.files import GENERATED, output_path

if TYPE_CHECKING:
    from cinegen.model import Mechanism
    from cinegen.singularities.slice import Axis


def run(
    robots: ShownRobotOptions,
    files: list[Path] = FILE,
    node: str | None = option("NAME", "node whose motion is analysed (default: the last of the file)"),
    at: str = AT,
    over: str | None = option(
        "AXES", f"two coordinates, such as x,y or x=-0.3..0.3,rz=-90..90, or two actuated joints ({UNITS})"
    ),
    grid: int = option("N", "points along each axis", 61, needs="--over", min=2),
    plot: Path | None = option(
        "FILE", "picture of the scan: .png, .svg or .pdf (ROBOT-singular.png)", needs="--over", endings=PICTURES
    ),
    output: str | None = output_option(
        "FILE", "the scan as JSON, m and rad (ROBOT-singular.json)", ".json", needs="--over"
    ),
    json: bool = JSON,
    force: bool = force_option("--over"),
) -> int:
    """Find singularities: at a pose, over a slice of the workspace, or along a recorded motion.

    Reports whether a mechanism is singular at a pose, of which type, which degrees of freedom are lost or uncontrolled
    there and, for legs that are lines, the geometric reason. With --over, finds, draws and writes all singularities on
    a slice. For a recording (FILE.jsonl), finds where the motion passes through one, between the samples too.
    """
    recordings = [file for file in files if file.suffix == ".jsonl"]
    if recordings:
        no_effect(
            f"on a recording ({recordings[0]})", "--node", "--at", "--over", "--loop", "--ignore-loops", "--ignore",
            "--relax", "--srdf", "--actuated", "--fixed-base", "--units", "--package", "--xacro-arg", "--swap-limits",
        )  # fmt: skip
        if len(recordings) < len(files):
            raise UsageError("recordings (.jsonl) and robots are analysed apart: name only one kind of file")
        _check_recordings(recordings, robots.robot, json)
        return 0
    mechanisms = {name: mechanism for name, (mechanism, _) in robots.load(files).items()}
    if over is not None:
        no_effect("with --over", "--json", remedy="the scan is JSON, in a file, or with -o - on standard output")
        if len(mechanisms) > 1 and (plot or output):
            raise CinegenError(f"{files[0]}: --plot and --output need one robot: name one with --robot")
        for name, mechanism in mechanisms.items():
            picture = plot or Path(f"{name}-singular.png")
            numbers = output_path(output, f"{name}-singular.json")
            check_outputs(picture, numbers, force=force)
            _scan(mechanism, name, over, at, node, grid, picture, numbers)
        return 0
    from cinegen.singularities import singularity

    reports, texts = [], []
    for name, mechanism in mechanisms.items():
        report = singularity(mechanism, configuration_at(mechanism, at, node), node)
        reports.append({"name": name, **report.as_dict()})
        first, *others = report.message.split("; ")
        wrapped = [textwrap.fill(part, 100, initial_indent="  ", subsequent_indent="    ") for part in others]
        texts += [f"{name}: {first}", *wrapped]
    print_result(reports, "\n".join(texts), json)
    return 0


def _scan(
    mechanism: Mechanism, name: str, axes: str, at: str, node: str | None, grid: int, picture: Path, numbers: Path
) -> None:
    from cinegen.plotting.loci import draw_loci
    from cinegen.singularities import SingularityType
    from cinegen.singularities.loci import singular_loci
    from cinegen.singularities.slice import Slice

    names = parts(axes)
    if len(names) != 2:
        raise CinegenError(f"--over {axes}: name two coordinates, such as x,y or x=-0.3..0.3,rz=-90..90")
    first, second = (_axis(mechanism, text, node) for text in names)
    of = Slice(mechanism, (first, second), values(at, "--at", POSE_EXAMPLE, mechanism), node)
    with Progress() as progress:
        loci = singular_loci(of, grid, progress.fraction)
    figure = draw_loci(loci, name=name)
    write(numbers, json_text.dumps({"origin": GENERATED, **loci.as_dict()}, ensure_ascii=False) + "\n")
    write_figure(picture, figure, quiet=True)
    share = f"{100.0 * loci.reached.mean():.0f} % of the slice over {first.name} and {second.name}"
    print(f"{name}: {share} is reached from home on its branch")
    for curve in loci.curves:
        kind = "no singularity" if curve.kind is SingularityType.NONE else curve.kind.value
        print(
            f"  {kind}, {'where the branch ends' if curve.border else 'inside'}: {counted(len(curve.points), 'point')}"
        )
    if not loci.curves:
        print("  no singularity")
    print(f"{picture} and {numbers} are written")


def _axis(mechanism: Mechanism, text: str, node: str | None) -> Axis:
    """Return a coordinate with its range; without one, a range around home."""
    from cinegen.singularities.slice import Axis, about_home

    name, equals, ends = text.partition("=")
    if not equals:
        return about_home(mechanism, name, node)
    return Axis(name, *interval_of(mechanism, name, ends, "--over"))


def _check_recordings(files: list[Path], robot: str | None, json: bool) -> None:
    from cinegen.mission import Recording, check, resampled
    from cinegen.typed_json import as_json

    reports, texts = [], []
    for file in files:
        events = [event for event in check(resampled(Recording.load(file), robot)) if event.sigma is not None]
        texts.append(f"{file}: {len(events) or 'no'} singularit{'y' if len(events) == 1 else 'ies'} along the motion")
        texts += [f"  at {event.recorded:.3f} s {event.message} (singular value {event.sigma:.2g})" for event in events]
        numbers = [as_json(event, "kind", "sigma", "message", "q", time=event.recorded) for event in events]
        reports.append({"recording": str(file), "found": numbers})
    print_result(reports, "\n".join(texts), json)
