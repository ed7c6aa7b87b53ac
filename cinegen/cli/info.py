"""`cinegen info`: what a mechanism is."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from typing import Any

from cinegen.cli.files import count, mechanisms, of_files


def add(commands: Any) -> None:
    """Adds the command."""
    info = commands.add_parser("info", help="what a mechanism is: joints, loops, mobility, singular values")
    of_files(info)
    info.add_argument("--json", action="store_true", help="as JSON")
    info.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Prints it."""
    from cinegen.model.description import describe

    reports = [{"name": name, **describe(mechanism)} for name, mechanism in mechanisms(options).items()]
    if options.json:
        print(json.dumps(reports, indent=1, ensure_ascii=False))
    else:
        print("\n\n".join(_described(report) for report in reports))
    return 0


def _described(report: Mapping[str, Any]) -> str:
    actuated, joints, loops = report["actuated"], report["joints"], report["loops"]
    undriven = f" ({report['undriven']} driven by no motor)" if report["undriven"] else ""
    lines = [
        f"{report['name']}: robot '{report['robot']}', mobility {report['mobility']}{undriven}, "
        f"{count(joints, 'joint')} ({len(actuated)} actuated), {count(loops, 'loop')}",
        "",
        f"  {'joint':<12}{'type':<11}{'home':>10}{'low':>10}{'high':>10}{'velocity':>10}   (rad, m)",
    ]
    for joint in joints:
        numbers = [joint["home"], joint["low"], joint["high"], joint["velocity"]]
        cells = "".join(f"{'-' if value is None else f'{_quiet(value):.4g}':>10}" for value in numbers)
        motor = "actuated" if joint["actuated"] else ""
        lines.append(f"  {joint['name']:<12}{joint['type']:<11}{cells}   {motor}".rstrip())
    if loops:
        lines += ["", f"  loops: {report['loop_rows']} rows of rank {report['loop_rank']}"]
        lines += [f"    {loop['name']}: {loop['kind']}" for loop in loops]
        gaps = report["gap_as_written"], report["closure_at_home"]
        lines.append("    open as written by {:.2g}, at home by {:.2g}".format(*gaps))
        lines.append(f"    singular values at home: {_values(report['loop_singular_values'])}")
    lines += ["", f"  {report['end']} at home: singular values {_values(report['end_singular_values'])}"]
    length = report["characteristic_length"]
    lines.append(f"  (without unit: lengths divided by the characteristic length, {length:.4g} m)")
    return "\n".join(lines)


def _values(sigma: Sequence[float]) -> str:
    return " ".join(f"{_quiet(value):.3g}" for value in sigma)


def _quiet(value: float) -> float:
    """Rounding is not worth reading."""
    return value if abs(value) > 1e-12 else 0.0
