"""`cinegen info`: the properties of a mechanism."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.cli.files import print_result
from cinegen.cli.options import FILE, JSON, ShownRobotOptions
from cinegen.errors import warn
from raff2urdf.command.command_line import flag
from raff2urdf.errors import counted, first_of
from raff2urdf.quantities import ANGLE, LENGTH, shown, shown_scale

if TYPE_CHECKING:
    from raff2urdf.readers.options import ReadOptions


def run(
    options: ShownRobotOptions,
    files: list[Path] = FILE,
    ignored: bool = flag("--ignored", "also list the elements of a URDF, SDF or MJCF that are not read"),
    collision: bool = flag("--collision", "also list the shapes of links, and why each pair is checked, or not"),
    json: bool = JSON,
) -> int:
    """Print joints, limits, loops, couplings, mobility, singular values and masses."""
    from cinegen.model.description import describe

    reports = []
    for name, (mechanism, file) in options.load(files).items():
        more: dict[str, Any] = {"ignored": _ignored(file, options.options())} if ignored else {}
        if mechanism.lost_meshes:
            warn(mechanism.lost_meshes)
        if collision:
            from cinegen.collision.report import collision_report

            more["collision"] = collision_report(mechanism)
        reports.append({"name": name, **describe(mechanism), **more})
    print_result(reports, "\n\n".join(map(_text, reports)), json)
    return 0


def _ignored(file: Path, options: ReadOptions) -> list[dict[str, Any]]:
    """Return the elements of a file that are not read."""
    from raff2urdf import readers
    from raff2urdf.readers.ignored import ignored
    from raff2urdf.shipped import find_robot

    path = find_robot(file)
    return [element._asdict() for element in ignored(path, options)] if readers.holds_xml(path) else []


def _text(report: Mapping[str, Any]) -> str:
    actuated, joints, balls, loops, couplings = (
        report[key] for key in ("actuated", "joints", "balls", "loops", "couplings")
    )
    parts = {"uncontrolled": report["uncontrolled_dof"], "idle": len(report["idle"])}
    listed = " and ".join(f"{number} {what}" for what, number in parts.items() if number)
    uncontrolled = f" ({listed})" if listed else ""
    wide = max([12, *(len(joint["name"]) + 2 for joint in joints), *(len(ball) + 2 for ball in balls)])
    lines = [
        f"{report['name']}: robot '{report['robot']}', mobility {report['mobility']}{uncontrolled}, "
        f"{counted(len(joints), 'joint')} ({len(actuated)} actuated), "
        + (f"{counted(len(balls), 'ball joint')}, " if balls else "")
        + counted(len(loops), "loop")
        + (f", {counted(len(couplings), 'coupling')}" if couplings else ""),
        "",
        f"  {'joint':<{wide}}{'type':<11}{'home':>10}{'lower':>10}{'upper':>10}{'velocity':>10}",
    ]
    for joint in joints:
        numbers = [joint["home"], joint["lower"], joint["upper"], joint["velocity"]]
        scale, unit = shown_scale(LENGTH if joint["type"] == "prismatic" else ANGLE)
        cells = "".join(f"{'-' if value is None else f'{_rounded(scale * value):.4g}':>10}" for value in numbers)
        actuation = "   actuated" if joint["actuated"] else ""
        lines.append(f"  {joint['name']:<{wide}}{joint['type']:<11}{cells}   {unit}, {unit}/s{actuation}")
    lines += [f"  {ball:<{wide}}ball" for ball in balls]
    if loops or couplings:
        what = " and ".join(["loops"] * bool(loops) + ["couplings (rad, m)"] * bool(couplings))
        lines += ["", f"  {what}: {report['loop_rows']} rows of rank {report['loop_rank']}"]
        lines += [f"    {loop['name']}: {loop['kind']}" for loop in loops]
        lines += [f"    {coupling['name']}: {coupling['equation']}" for coupling in couplings]
        gaps = report["gap_as_written"], report["closure_at_home"]
        lines.append("    open by {:.2g} as written, by {:.2g} at home".format(*gaps))
        lines.append(f"    singular values at home, cut joints included: {_values(report['loop_singular_values'])}")
        lines += [f"    declared by: {', '.join(report['dialects'])}"] * bool(report["dialects"])
    if rods := [" and ".join(nodes) for nodes in report["idle"]]:
        more = f"; and {len(rods) - _MOST_NAMES} more" if len(rods) > _MOST_NAMES else ""
        lines.append(f"  idle, turning about themselves and moving nothing else: {'; '.join(rods[:_MOST_NAMES])}{more}")
    lines += [f"  note: {note}" for note in report["notes"]]
    lines += ["", f"  {report['end']} at home: singular values {_values(report['end_singular_values'])}"]
    length = report["characteristic_length"]
    lines.append(f"  (dimensionless: lengths divided by the characteristic length, {shown(length, LENGTH)})")
    lines += ["", *_masses(report)]
    if "ignored" in report:
        lines += ["", "  not read:" if report["ignored"] else "  everything is read"]
    for unread in report.get("ignored", []):
        around, _, element = unread["element"].rpartition("/")
        more = ", ..." if unread["number"] > len(unread["lines"]) else ""
        where = f"line{'s' * (unread['number'] > 1)} {', '.join(map(str, unread['lines']))}{more}"
        lines.append(f"    {unread['number']} <{element}> in <{around}>, {where}")
    if "collision" in report:
        lines += _collision(report["collision"])
    return "\n".join(lines)


def _masses(report: Mapping[str, Any]) -> list[str]:
    """Return the lines about masses."""
    massless, bodies = report["massless"], report["unphysical"].items()
    shown = first_of(massless, _MOST_NAMES)
    if massless and not report["mass"]:
        return ["  mass: unknown"]
    unknown = f"; unknown: {shown}" if massless else ""
    lines = [f"  mass: {report['mass']:.4g} kg{unknown}"]
    return lines + [f"  no body can have the inertia of link '{link}': {why}" for link, why in bodies]


_MOST_NAMES = 12  # in a line


def _collision(report: Mapping[str, Any]) -> list[str]:
    """Return the lines about shapes and pairs."""
    within = shown(report["exact_within"], LENGTH, 3)
    lines = ["", f"  shapes; those in convex ones are measured where these are nearer than {within}:"]
    for row in report["shapes"]:
        exceeds = f", exceeds it by up to {shown(row['excess'], LENGTH, 3)}"
        lines.append(f"    {row['link']}: {row['shape']}" + (f"; {row['around']}{exceeds}" if row["around"] else ""))
    lines += [f"    not checked: {why}" for why in dict.fromkeys(report["not_checked"].values())]
    lines += ["", "  pairs:"]
    touching = []
    for pair in report["pairs"]:
        contact = ""
        if "depth_at_home" in pair:
            touching.append("[{}]".format(", ".join(f'"{name}"' for name in pair["links"])))
            bounds = (shown(pair[key], LENGTH, 3) for key in ("depth_at_home_at_least", "depth_at_home"))
            contact = "; in contact at home, {} to {} deep".format(*bounds)
        lines.append(f"    {' - '.join(pair['links'])}: {pair['reason']}{contact}")
    if touching:
        lines += ["", "  no motion starts at home while these are checked; if they may touch, write in the scene:"]
        lines.append(f"    allowed_collisions = [{', '.join(dict.fromkeys(touching))}]")
    return lines


def _values(sigma: Sequence[float]) -> str:
    return " ".join(f"{_rounded(value):.3g}" for value in sigma)


def _rounded(value: float) -> float:
    """Return 0 for a rounding error."""
    return value if abs(value) > 1e-12 else 0.0
