"""`cinegen tolerance`: how accurate a robot is whose dimensions, joints and encoders have errors."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cinegen.cli.files import check_outputs, print_result, write_figure
from cinegen.cli.numbers import AT, configuration_at, named, parts
from cinegen.cli.options import FILE, JSON, NODE, PLOT, ROBOT, force_option, shown_name
from cinegen.errors import CinegenError
from raff2urdf.command.command_line import UsageError, option
from raff2urdf.errors import first_of

if TYPE_CHECKING:
    from cinegen.design.tolerance_report import Forced, ToleranceReport

SIGMA = option(
    "NAME=S", "standard deviations of parameters: 'link*.d=0.05mm, *.alpha=0.02deg'; later ones replace earlier", (),
    "--sigma",
)  # fmt: skip
PLAY = option("JOINT=P", "play of joints and loops: joint3=0.01mm, or joint3=0.01deg of tilt", (), "--play")
ENCODER = option("JOINT=S", "standard deviations of joints' readings: joint1=0.01deg", (), "--encoder")
TIE = option("TIE", "dimensions that have one error, as of one set-up: 'link2.d = link7.d'", (), "--tie")

_SHOWN = 8  # contributors
_OVER_CONSTRAINED = ": the mechanism is over-constrained and can't be assembled with them unless it is forced"
_REDUNDANT = (
    " while all actuated joints keep their readings: actuation is redundant, and these joints work against each other "
    "then"
)
_LABEL = 16  # width of the labels of rows


def run(
    file: Path = FILE,
    sigma: list[str] = SIGMA,
    play: list[str] = PLAY,
    encoder: list[str] = ENCODER,
    tie: list[str] = TIE,
    interval: float = option("K", "half-width of the intervals of the worst case, in standard deviations", 3.0),
    at: str = AT,
    node: str | None = NODE,
    samples: int = option("N", "of Monte Carlo, with loops closed; 0 for none", 10_000, min=0, max=10_000_000),
    seed: int = option("N", "of the random numbers", 0, min=0, needs="--samples"),
    robot: str | None = ROBOT,
    plot: Path | None = PLOT,
    force: bool = force_option("--plot"),
    json: bool = JSON,
) -> int:
    """Compute how accurate a robot is: covariance, worst case, largest contributors.

    Errors of dimensions, play of joints and errors of encoders move a node; Monte Carlo with loops closed confirms how
    far. Tolerances that an over-constrained robot can't be assembled with are listed, with the gaps to be forced.
    """
    check_outputs(plot, force=force, json=json)
    from cinegen.design.tolerance import Tolerances
    from cinegen.model.load import robots

    errors, plays, readings = amounts(sigma, "--sigma"), amounts(play, "--play"), amounts(encoder, "--encoder")
    if not (errors or plays or readings):
        raise UsageError("no tolerances: give --sigma, --play or --encoder, such as --sigma 'link*.d=0.05mm'")
    names = robots(file) if robot is None else [robot]
    if len(names) > 1:
        raise CinegenError(f"{file} holds several robots: name one by --robot ({', '.join(map(str, names))})")
    tolerances = Tolerances(file, errors, plays, readings, interval, robot, tie)
    mechanism = tolerances.design.mechanism
    report = tolerances.at(configuration_at(mechanism, at, node), node, samples, seed)
    name, where = shown_name(file, robot), f" at {at}" if at else " at home"
    print_result({"name": name, **report.as_dict()}, _text(report, name, where), json)
    if plot is not None:
        from cinegen.plotting.accuracy import draw_tolerance

        write_figure(plot, draw_tolerance(report, name=name), quiet=json)
    return 0


def amounts(texts: Sequence[str], option: str) -> list[tuple[str, str]]:
    """Return the amounts of an option as texts, each behind its name or pattern.

    Raises:
        UsageError: a part has no name.
    """
    dimensions = "link*.d=0.05mm"
    example = {"--sigma": dimensions, "--tolerance": dimensions, "--play": "joint3=0.01mm"}.get(
        option, "joint1=0.01deg"
    )
    return [pair for text in texts for part in parts(text) for pair in named(part, option, example).items()]


def _text(report: ToleranceReport, name: str, where: str) -> str:
    """Return the report, in mm and degrees."""
    lines = [
        f"{name}: accuracy of {report.node}{where}: position {_number(1e3 * report.position)} mm, orientation "
        f"{_number(math.degrees(report.orientation))} degrees (1 sigma, root of the summed variances)",
        "",
        f"  {'':<{_LABEL}}" + "".join(f"{name:>11}" for name in ("x mm", "y mm", "z mm", "rx deg", "ry deg", "rz deg")),
    ]
    scales = (1e3,) * 3 + (math.degrees(1.0),) * 3
    rows = (
        ("sigma", report.sigma),
        (f"within ±{report.interval:g} sigma", report.worst),
        ("  2nd order", report.second_order),
    )
    for row, values in rows:
        lines.append(
            f"  {row:<{_LABEL}}" + "".join(f"{_number(s * x):>11}" for s, x in zip(scales, values, strict=True))
        )
    for orientation in (False, True):
        largest = report.contributors(orientation)
        if largest:
            of = "orientation" if orientation else "position"
            lines += ["", f"  {of}, fraction of the variance"]
            listed = [(source.name, share) for source, share in largest[:_SHOWN]]
            if len(largest) > _SHOWN:
                listed.append((f"{len(largest) - _SHOWN} more", sum(share for _, share in largest[_SHOWN:])))
            width = max(24, *(len(name) + 1 for name, _ in listed))
            lines += [f"    {name:<{width}}{100.0 * share:5.1f} %" for name, share in listed]
    forced = [_forced(report.forced, report.interval, _OVER_CONSTRAINED)]
    forced.append(_forced(report.contradicting, report.interval, _REDUNDANT))
    for paragraph in (_worst(report), _idle(report), *forced, report.agreement):
        if paragraph:
            lines += ["", *textwrap.wrap(paragraph, 110, initial_indent="  ", subsequent_indent="  ")]
    return "\n".join(lines)


def _worst(report: ToleranceReport) -> str:
    has_play = any(source.half_width != report.interval * source.sigma for source in report.sources)
    return (
        f"Worst case within ±{report.interval:g} sigma: each error anywhere within {report.interval:g} of its standard "
        f"deviations to either side{', play within its radius' if has_play else ''}, all at once; in it, 2nd order "
        "bounds what is not linear"
    )


def _idle(report: ToleranceReport) -> str:
    if not report.idle:
        return ""
    return f"{len(report.idle)} tolerances do not move {report.node}: {first_of(report.idle, 6)}"


def _forced(forced: Forced, interval: float, why: str) -> str:
    if not forced.names:
        return ""
    each = [
        f"{name} ({_number(1e3 * x)} mm, {_number(math.degrees(a))} degrees)"
        for name, x, a in zip(forced.names, forced.position, forced.angle, strict=True)
    ]
    gaps = f"{_number(1e3 * forced.worst_position)} mm, {_number(math.degrees(forced.worst_angle))} degrees"
    return (
        f"{len(forced.names)} tolerances open loops{why}. Largest gap of each within ±{interval:g} sigma: "
        f"{first_of(each, 6)}. All together: {gaps}. They are not in the numbers above: how the node moves then "
        "depends on the elasticity of the parts"
    )


def _number(value: float) -> str:
    return f"{0.0 if abs(value) < 1e-9 else value:.4g}"
