"""`cinegen synthesize`: the dimensions with which a robot does a task best."""

from __future__ import annotations

from pathlib import Path

import typer

from cinegen.cli.files import check_outputs, print_result, write
from cinegen.cli.options import FILE, JSON, ROBOT, SCHEDULER, WORKERS, force_option, output_option
from cinegen.cli.progress import Progress
from raff2urdf.command.command_line import option
from raff2urdf.files import output_path, stem_of


def run(
    file: Path = FILE,
    task: Path = typer.Option(..., "--task", metavar="TASK.toml", help="parameters, points to reach, objectives"),
    output: str | None = output_option("FILE", "the robot with its new dimensions (ROBOT-synthesized.raff)", ".raff"),
    state: Path | None = option(
        "FILE", "finished starts, to continue from (ROBOT-synthesis.json, removed at the end)", endings=(".json",)
    ),
    report: Path | None = option(
        "FILE.html",
        "report with pictures, tables and maps of before and after; needs the plot extra",
        endings=(".html", ".htm"),
    ),
    workers: int | None = WORKERS,
    scheduler: str | None = SCHEDULER,
    robot: str | None = ROBOT,
    force: bool = force_option(),
    json: bool = JSON,
) -> int:
    """Find the dimensions with which a robot does a task best.

    Optimises parameters of the description by exact derivatives, from several starts, and writes the best robot as
    RAFF; several objectives give a Pareto front. The result is checked at points that the optimiser did not see. After
    an interruption the same command continues.
    """
    name = stem_of(file)
    raff = output_path(output, f"{name}-synthesized.raff")
    check_outputs(raff, report, force=force, json=json, remakeable=False)
    from cinegen.design.synthesis import synthesize

    kept = state or raff.with_name(f"{name}-synthesis.json")
    with Progress() as progress:
        result = synthesize(file, task, robot, kept, progress.steps, workers, scheduler)
    if report is not None:
        from cinegen.plotting import synthesis_report

        page = synthesis_report(result)
    write(raff, result.raff)
    if report is not None:
        write(report, page)
    kept.unlink(missing_ok=True)
    print_result({**result.as_dict(), "file": str(raff)}, f"{result.text}\nrobot: {raff}", json)
    return 0 if result.holds else 1
