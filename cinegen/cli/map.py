"""`cinegen map`: where a robot reaches, how well, and where it fails; and `cinegen compare`, of two such maps."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.cli.drive import of_page, show
from cinegen.cli.files import mechanisms_and_files, of_files, write_figure

if TYPE_CHECKING:
    import xarray

    from cinegen.model import Mechanism
    from cinegen.workspace import MapSpecification
    from cinegen.workspace.make import Say

_LONG = 600.0  # s, or
_LARGE = 2e9  # bytes, that a map may take without being asked for twice
_SURELY = 200_000  # cells that take neither
_BROAD = 100  # columns of the terminal
_ROUNDING = 1e-9  # of a sum of cells


def add(commands: Any) -> None:
    """Adds the command."""
    command = commands.add_parser(
        "map", help="where a robot reaches, how well, and where it is singular: a file, a picture, in the page",
        description="Cuts a region into cells and finds for each whether the robot reaches it, and how well; writes an "
        "xarray Dataset as zarr. Killed at any moment, the same command goes on where it stopped. Numbers are m and "
        "rad, as the file has them, unless a unit stands behind: -900mm, 15deg.",
    )  # fmt: skip
    of_files(command, 1)
    command.add_argument(
        "--over", metavar="AXES", default="",
        help="what the map is over, each NAME, NAME=LOW..HIGH or NAME=LOW..HIGH:CELLS: x, y, z, rx, ry, rz of a node "
        "('xy' is x,y), azimuth, elevation, radius about --centre, or motors (all directions that the node can go)",
    )  # fmt: skip
    command.add_argument(
        "--line", metavar="A..B", help="the line from one point to another instead, such as 0,0,-1..0.5,0,-1:200"
    )
    command.add_argument("--at", metavar="VALUES", default="", help="other coordinates, such as z=-0.9,rx=0 (home's)")
    command.add_argument(
        "--orientation", choices=("free", "axis", "fixed", "home"), default="free",
        help="what counts of it: nothing, the direction of the node's z, or all; 'home' is all, as at home (free, "
        "unless rx, ry or rz are given)",
    )  # fmt: skip
    command.add_argument("--centre", metavar="X,Y,Z", help="what azimuth, elevation and radius are seen from (0,0,0)")
    command.add_argument("--node", metavar="NAME", help="whose place is meant (the robot's end)")
    command.add_argument("--grid", type=int, metavar="N", help="cells along each axis that does not say it (80 of two)")
    command.add_argument(
        "-q", "--quantity", action="append", default=[], metavar="NAMES",
        help="what is told of each cell: solutions, sigma_1, sigma_2, condition, manipulability, margin, velocity, "
        "force, solid_angle, clearance; or all, but for solutions and solid_angle (sigma_1,sigma_2)",
    )  # fmt: skip
    command.add_argument("--along", metavar="X,Y,Z", help="direction of velocity and force, in the world (z, or x, y)")
    command.add_argument("--scene", metavar="FILE", help="obstacles for the clearance, as cinegen plan reads them")
    command.add_argument("--no-limits", action="store_true", help="let joints go beyond their limits")
    command.add_argument("--starts", type=int, metavar="N", help="starts of a search where no neighbour leads (6)")
    command.add_argument(
        "--vary", action="append", default=[], metavar="PARAMETER",
        help="a map for each variant of a RAFF file, such as link2.d=1500..2500:11, in its own units; several vary "
        "together (link2.d+link5.d=...), or each for itself (--vary twice)",
    )  # fmt: skip
    command.add_argument(
        "--box", metavar="RANGES", default="", help="what is wanted of the region, such as x=-0.3..0.3,y=-0.3..0.3"
    )
    command.add_argument("-o", "--output", metavar="FOLDER", help="the map (ROBOT-map.zarr), or all (ROBOT-sweep)")
    command.add_argument("--plot", metavar="FILE", help="draws it, .png, .svg or .pdf")
    command.add_argument("--show", metavar="NAME", help="which quantity is drawn and shown in the page (sigma_1)")
    command.add_argument("--view", action="store_true", help="shows it in the page: a click brings the robot there")
    of_page(command.add_argument_group("with --view"))
    command.add_argument("--json", action="store_true", help="what is found, as JSON")
    command.add_argument("--workers", type=int, metavar="N", help="processes on this machine (its cores)")
    command.add_argument("--scheduler", metavar="URL", help="a Dask cluster's, such as tcp://node1:8786")
    command.add_argument("--yes", action="store_true", help="begin, however long it takes")
    command.set_defaults(run=run)


def add_compare(commands: Any) -> None:
    """Adds the other command."""
    command = commands.add_parser(
        "compare", help="what differs between two maps",
        description="Says what two maps over the same coordinates have in common: what both reach, what one reaches "
        "alone, and how their quantities differ.",
    )  # fmt: skip
    command.add_argument("maps", nargs=2, metavar="MAP", help="folder of a map, .zarr")
    command.add_argument("--plot", metavar="FILE", help="draws it, .png, .svg or .pdf")
    command.add_argument("--show", metavar="NAME", help="the quantity whose difference is drawn")
    command.add_argument("--json", action="store_true", help="as JSON")
    command.set_defaults(run=run_compare)


def run(options: argparse.Namespace) -> int:
    """Makes it, and says what is found."""
    from cinegen.workspace import make_map

    if options.json and options.view:
        _refuse("--json is for programs and --view for people: leave one out")
    (name, (mechanism, _)), *others = mechanisms_and_files(options).items()
    if others:
        _refuse(f"{options.files[0]} holds {1 + len(others)} robots: say which (--robot NAME)")
    spec = asked(mechanism, options)
    if options.vary:
        return _vary(name, spec, options)
    if options.box:
        _refuse("--box says what is wanted of the variants of a robot: vary something (--vary), or leave it out")
    path = Path(options.output or f"{name}-map.zarr")
    if not options.yes and not path.exists():
        _ask(spec, options)
    try:
        with bar() as say:
            found = make_map(spec, path, workers=options.workers, scheduler=options.scheduler, say=say)
    except KeyboardInterrupt:
        print(f"{path}: what was finished stays, and the same command goes on", file=sys.stderr)
        raise
    told = summary(found, spec)
    if not told["reachable"]:
        _refuse(f"{name}: no cell of this region is reached ({_settled(told)}). {_where(spec)}")
    if options.json:
        print(json.dumps({"map": str(path), **told}, indent=1, ensure_ascii=False))
    else:
        print("\n".join([*_lines(name, spec, told), f"map: {path}"]), flush=True)
    if options.plot:
        from cinegen.plotting.map import draw_map

        write_figure(Path(options.plot), draw_map(found, options.show, name=name))
        if not options.json:
            print(f"picture: {options.plot}", flush=True)
    if options.view:
        from cinegen.session import on_map

        return show(on_map(path, options.show, mechanism), options, name)
    return 0


def asked(mechanism: Mechanism, options: argparse.Namespace) -> MapSpecification:
    """What options ask for.

    Raises:
        CinegenError: something there makes no sense.
    """
    from cinegen.cli.grid import point, region
    from cinegen.workspace import MapSpecification
    from cinegen.workspace.quantities import QUANTITIES
    from cinegen.workspace.specification import STARTS

    where = region(
        mechanism, options.over, options.at, options.node, options.orientation, options.grid, options.centre,
        options.line,
    )  # fmt: skip
    quantities = [name for given in options.quantity or ["sigma_1,sigma_2"] for name in given.split(",") if name]
    scene, folder = _obstacles(mechanism, options.scene, options.ignore_loops)
    if "all" in quantities:
        slow = {"solutions", "solid_angle"} | ({"clearance"} if scene is None else set())
        quantities = [name for name in quantities if name != "all"]
        quantities += [name for name in QUANTITIES if name not in (slow | set(quantities))]
    elif scene is not None and "clearance" not in quantities:
        quantities.append("clearance")
    return MapSpecification(
        mechanism, where, tuple(name.strip() for name in quantities), options.node or "", not options.no_limits,
        STARTS if options.starts is None else options.starts,
        along=() if options.along is None else point(options.along, "--along"),
        scene=scene, folder=folder,
    )  # fmt: skip


def _obstacles(mechanism: Mechanism, file: str | None, ignore_loops: bool) -> tuple[dict[str, Any] | None, str]:
    """A scene's obstacles, around this robot."""
    if file is None:
        return None, "."
    from cinegen.collision import load_scene

    scene = load_scene(file, ignore_loops)
    home = mechanism.placement(mechanism.q_home, mechanism.end).translation.tolist()
    values: dict[str, Any] = {"name": scene.name, "goal": {"point": home}}
    if scene.allowed_collisions:
        values["allowed_collisions"] = [list(pair) for pair in scene.allowed_collisions]
    values["obstacle"] = [obstacle.document() for obstacle in scene.obstacles]
    return values, str(Path(file).absolute().parent)


def _vary(name: str, spec: MapSpecification, options: argparse.Namespace) -> int:
    """Maps of all variants, and their table."""
    from cinegen.cli.grid import ranges
    from cinegen.plotting.sweep import check_drawable, draw_table
    from cinegen.workspace.sweep import Box, Variation, sweep

    apart = {"--loop": options.loop, "--ignore-loops": options.ignore_loops, "--view": options.view}
    for option in (option for option, given in apart.items() if given):
        _refuse(f"{option} and --vary don't go together: leave one out")
    variations = [Variation.parse(text) for text in options.vary]
    if options.plot:
        check_drawable(variations)
    folder = Path(options.output or f"{name}-sweep")
    if not options.yes and not folder.exists():
        _ask(spec, options, math.prod(len(variation.values) for variation in variations))
    with bar() as say:
        table = sweep(
            options.files[0], variations, spec.region, folder, box=Box(ranges(options.box, "--box")),
            robot=options.robot, workers=options.workers, scheduler=options.scheduler, say=say,
            node=spec.node, limits=spec.limits, quantities=spec.quantities, starts=spec.starts,
            along=spec.along, scene=spec.scene, folder=spec.folder,
        )  # fmt: skip
    print(json.dumps(table.as_dict(), indent=1, ensure_ascii=False) if options.json else table.text())
    if options.plot:
        write_figure(Path(options.plot), draw_table(table))
    if not options.json:
        print(f"variants, maps and table.csv: {folder}")
        if options.plot:
            print(f"picture: {options.plot}")
    return 0


def _ask(spec: MapSpecification, options: argparse.Namespace, maps: int = 1) -> None:
    """Whether maps that take long, or much of the disk, are meant."""
    if maps * spec.region.size <= _SURELY:
        return
    from cinegen.workspace.estimate import estimate

    found, cores = estimate(spec, maps), options.workers or os.cpu_count() or 1
    if found.seconds / cores <= _LONG and found.size <= _LARGE:
        return
    words = found.words(cores)
    if not sys.stdin.isatty():
        _refuse(f"{words}. Give --yes to begin all the same, or a coarser --grid")
    print(words, file=sys.stderr)
    try:
        said = input("Begin? [y/N] ")
    except EOFError:
        said = ""
    if said.strip().lower() not in ("y", "yes"):
        _refuse("not begun; nothing is written")


@contextlib.contextmanager
def bar() -> Iterator[Say]:
    """Tells a person at a terminal how many cells are done, how fast, and how long it will take yet."""
    from tqdm import tqdm

    told: Any = None

    def say(done: int, size: int) -> None:
        nonlocal told
        if told is None:
            told = tqdm(
                total=size, initial=done, unit="cell", unit_scale=True, dynamic_ncols=True, leave=False, delay=1.0,
                disable=not sys.stderr.isatty(), file=sys.stderr,
            )  # fmt: skip
        told.update(done - told.n)

    try:
        yield say
    finally:
        if told is not None:
            told.close()


# --- what is told ------------------------------------------------------------------------------------------------


def summary(found: xarray.Dataset, spec: MapSpecification) -> dict[str, Any]:
    """What is found, as JSON has it: m, rad and sr; nothing (null) for what is without bound."""
    import numpy as np

    from cinegen.workspace import How
    from cinegen.workspace.extent import extent

    settled = np.bincount(found["settled"].values.ravel(), minlength=len(How))
    reachable = int(found["reachable"].values.sum())
    told: dict[str, Any] = {
        "robot": spec.mechanism.name,
        "node": spec.node,
        "over": {axis.name: [axis.low, axis.high, axis.count] for axis in spec.region.axes},
        "at": dict(spec.region.at),
        "cells": spec.region.size,
        "reachable": reachable,
        "settled": {how.words: int(count) for how, count in zip(How, settled, strict=True) if count},
        "quantities": {},
    }
    measured = extent(found)
    told["extent"] = {"value": measured.value, "error": measured.error, "unit": measured.unit}
    for name in spec.quantities:
        values = found[name].values[found["reachable"].values].astype(float)
        values = values[~np.isnan(values)]
        if len(values):
            three = {"least": values.min(), "median": np.median(values), "most": values.max()}
            told["quantities"][name] = {
                "unit": found[name].attrs["units"],
                **{key: float(value) if np.isfinite(value) else None for key, value in three.items()},
            }
    return told


def _lines(name: str, spec: MapSpecification, told: dict[str, Any]) -> list[str]:
    from cinegen.workspace.quantities import DIRECTED

    shape = " x ".join(map(str, spec.region.shape))
    what = f"{name}: {shape} cells over {', '.join(spec.region.names)}"
    if spec.region.at:
        what += f", at {', '.join(f'{key} = {value:.4g}' for key, value in spec.region.at.items())}"
    if not spec.of_motors:
        turned = {0: "free", 2: "of its z given", 3: "given"}[spec.rotation]
        what += f"; of {spec.node}, orientation {turned}"
    share = 100.0 * told["reachable"] / told["cells"]
    measured = told["extent"]
    error = f" ± {measured['error']:.2g}" if measured["error"] > _ROUNDING * measured["value"] else ""
    size = f"{measured['value']:.4g}{error} {measured['unit']}"
    lines = [
        *textwrap.wrap(what, _BROAD, subsequent_indent="  "),
        f"  reachable       {size}, {share:.3g} % of the region",
        *textwrap.wrap(f"  settled         {_settled(told)}", _BROAD, subsequent_indent=" " * 18),
    ]
    for quantity, values in told["quantities"].items():
        unit = "" if values["unit"] == "1" else f" {values['unit']}"
        three = ", ".join(f"{key} {_number(values[key])}" for key in ("least", "median", "most"))
        along = f", along {', '.join(f'{x:.3g}' for x in spec.along)}" if quantity in DIRECTED else ""
        lines.append(f"  {quantity:<15} {three}{unit}{along}")
    return lines


def _settled(told: dict[str, Any]) -> str:
    return ", ".join(f"{count:,} {how}" for how, count in told["settled"].items())


def _number(value: float | None) -> str:
    return "without bound" if value is None else f"{value:.3g}"


def _where(spec: MapSpecification) -> str:
    """Where the node is at home: people mistake units, and frames."""
    home = spec.home.translation
    here = ", ".join(f"{name} = {round(value, 6) + 0.0:.4g}" for name, value in zip("xyz", home, strict=True))
    return f"At home {spec.node} is at {here} m; numbers are m and rad unless a unit stands behind (-900mm, 15deg)"


def _refuse(words: str) -> None:
    from cinegen.errors import CinegenError

    raise CinegenError(words)


# --- two maps ----------------------------------------------------------------------------------------------------


def run_compare(options: argparse.Namespace) -> int:
    """Says what differs."""
    from cinegen.workspace import open_map
    from cinegen.workspace.compare import compare

    one, other = (open_map(path) for path in options.maps)
    found = compare(one, other)
    if options.json:
        print(json.dumps(found.as_dict(), indent=1, ensure_ascii=False))
    else:
        print(found)
    if options.plot:
        from cinegen.plotting.comparison import draw_comparison

        write_figure(Path(options.plot), draw_comparison(one, other, options.show))
        if not options.json:
            print(f"picture: {options.plot}")
    return 0
