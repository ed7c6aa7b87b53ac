"""`cinegen validate`: reference robots as Pinocchio reads them, and as they come back through RAFF."""

from __future__ import annotations

from typing import Any

import typer

from cinegen.cli.files import print_result
from cinegen.cli.options import JSON
from cinegen.errors import CinegenError
from raff2urdf.command.extras import MissingExtraError, install
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.shipped import reference_robots

_COLUMNS = ("frames", "jacobians", "masses", "home")


def run(
    robots: list[str] = typer.Argument(None, metavar="[ROBOT]...", help="reference robots; all unless given"),
    json: bool = JSON,
) -> int:
    """Compare reference robots with Pinocchio: frames, Jacobians, mass matrices and home.

    The robots are those of the package example-robot-data. Each goes URDF -> RAFF -> URDF, and is compared with the
    model that Pinocchio's own reader makes of its URDF, at 0 and at 20 random configurations. Differences are in m and
    rad, of mass matrices relative to their largest entry. The exit code is 1 if one is larger than 1e-9.
    """
    import warnings

    from cinegen.model.validation import validate

    known = reference_robots()
    if not known:
        raise MissingExtraError(f"reference robots need the package example-robot-data: {install('robots')}")
    for name in robots or ():
        if name not in known:
            raise CinegenError(f"there is no reference robot '{name}'{did_you_mean(name, tuple(known))}")
    reports: list[dict[str, Any]] = []
    if not json:
        print(f"{'robot':<28}{'joints':>7}" + "".join(f"{column:>11}" for column in _COLUMNS))
    for name in robots or known:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of what the files leave out: `cinegen info` reports it
                comparison = validate(known[name])
            reports.append({"robot": name, **comparison._asdict(), "agrees": comparison.agrees})
        except (CinegenError, RaffError) as error:
            reports.append({"robot": name, "error": str(error)})
        if not json:
            print(_line(reports[-1]), flush=True)
    wrong = sum(report.get("agrees") is False for report in reports)
    compared = sum("agrees" in report for report in reports)
    summary = f"{compared - wrong} of {len(reports)} robots agree with Pinocchio"
    summary += f", {wrong} differ" * bool(wrong) + f", {len(reports) - compared} can't be compared" * (
        compared < len(reports)
    )
    print_result(reports, summary, json)
    return 1 if wrong else 0


def _line(report: dict[str, Any]) -> str:
    if "error" in report:
        return f"{report['robot']:<28}not compared: {report['error']}"
    cells = "".join(f"{report[column]:>11.1e}" for column in _COLUMNS)
    return f"{report['robot']:<28}{report['joints']:>7}{cells}" + ("" if report["agrees"] else "   DIFFERS")
