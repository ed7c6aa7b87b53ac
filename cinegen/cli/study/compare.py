"""`cinegen compare`: the differences of two maps."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import typer

from cinegen.cli.files import check_outputs, print_result, write_figure
from cinegen.cli.options import JSON, PLOT, UNITS, force_option
from raff2urdf.command.command_line import option

_MAP = typer.Argument(..., metavar="MAP", help="folder of a map, .zarr")


def run(
    first: Path = _MAP,
    second: Path = _MAP,
    plot: Path | None = PLOT,
    show: str | None = option("NAME", "quantity whose difference is drawn", needs="--plot"),
    json: bool = JSON,
    force: bool = force_option("--plot"),
    units: Literal["m", "mm"] = UNITS,
) -> int:
    """Compare two maps: cells that both or only one reaches, and differences of quantities."""
    from cinegen.workspace import open_map
    from cinegen.workspace.comparison import compare

    check_outputs(plot, force=force, json=json)
    maps = open_map(first), open_map(second)
    comparison = compare(*maps)
    print_result(comparison.as_dict(), comparison, json)
    if plot:
        from cinegen.plotting.comparison import draw_comparison

        write_figure(plot, draw_comparison(*maps, show), quiet=json)
    return 0
