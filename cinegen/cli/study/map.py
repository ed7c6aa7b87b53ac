"""`cinegen map`: where a robot reaches, how well, and where it is singular."""

from __future__ import annotations

import math
import os
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cinegen.cli.design.tolerance import ENCODER, PLAY, SIGMA, amounts
from cinegen.cli.files import check_outputs, print_result, write_figure
from cinegen.cli.numbers import UNITS, interval_of, named, point
from cinegen.cli.numbers import quantity as number
from cinegen.cli.options import FILE, JSON, PLOT, SCHEDULER, VIEW, WORKERS, ShownRobotOptions, exclude, output_option
from cinegen.cli.progress import Progress
from cinegen.cli.region import region
from cinegen.cli.served_page import PageOptions
from cinegen.cli.study.map_summary import REACTIONS, counts_of, node_at_home, summary, summary_lines
from cinegen.cli.study.payloads import GRAVITY, PAYLOADS, WRENCHES, carried, gravity_of, wrenches
from cinegen.errors import CinegenError, UnknownNameError
from raff2urdf.command.command_line import UsageError, flag, no_effect, option
from raff2urdf.files import STANDARD, output_path
from raff2urdf.quantities import ANGULAR_STIFFNESS, NUMBER, STIFFNESS

if TYPE_CHECKING:
    from cinegen.model import Mechanism
    from cinegen.workspace import MapSpecification

_LONG = 600.0  # s, or
_LARGE = 2e9  # bytes, that a map may take without a question
_SURELY = 200_000  # cells that take neither
QUANTITIES = (
    "solutions", "sigma_1", "sigma_2", "condition", "manipulability", "margin", "velocity", "force", "torque",
    "payload", "payload_any", "reaction_force", "reaction_moment", "stiffness", "rotational_stiffness", "frequency",
    "accuracy", "solid_angle", "clearance",
)  # fmt: skip
"""Names in `cinegen.workspace.quantities`, whose import takes longer than help may."""

_SLOW = ("solutions", "solid_angle")
_LOADED = ("torque", "payload", "payload_any", *REACTIONS, "stiffness", "rotational_stiffness", "frequency", "accuracy")
"""Quantities that take more than a robot."""


@dataclass(frozen=True)
class MapOptions:
    """A map and what is done with it."""

    over: str = option(
        "AXES", "axes, each NAME, NAME=LOW..HIGH or NAME=LOW..HIGH:CELLS: x, y, z, rx, ry, rz of a node ('xy' is x,y), "
        f"azimuth, elevation, radius about --centre, or actuated joints ({UNITS}; "
        "default: all translations, or the actuated joints where these are fewer)", "", unless="--line",
    )  # fmt: skip
    line: str | None = option("A..B", "instead of axes, a line between two points (m): 0,0,-1..0.5,0,-1:200")
    at: str = option("VALUES", f"values of other coordinates, such as z=-0.9,rx=0 ({UNITS}; default: home)", "")
    orientation: Literal["free", "axis", "fixed", "home"] = option(
        None, "orientation to reach: any, a direction of the node's z axis, a full one, or that at home; free is fixed "
        "if rx, ry or rz is given", "free",
    )  # fmt: skip
    centre: str | None = option("X,Y,Z", "centre of azimuth, elevation and radius, m (default: 0,0,0)", unless="--line")
    node: str | None = option("NAME", "node to reach with (default: the last of the file)")
    grid: int | None = option("N", "cells along each axis without a count (80 for two axes)", min=1)
    quantity: list[str] = option(
        "NAMES", f"quantities of each cell: {', '.join(QUANTITIES)}; or all, without {', '.join(_SLOW)} and "
        f"those of loads, stiffness and tolerances: {', '.join(_LOADED)} "
        "(default: sigma_1,sigma_2)", (), "-q", "--quantity",
    )  # fmt: skip
    along: str | None = option("X,Y,Z", "direction of velocity and force, in the world (default: z, or x, or y)")
    scene: Path | None = option("FILE", "obstacles for the clearance: a scene of `cinegen plan`")
    payload: list[str] = PAYLOADS
    wrench: list[str] = WRENCHES
    gravity: str = GRAVITY
    reaction: str | None = option("NAME", "joint or loop whose reaction is mapped")
    stiffness: list[str] = option(
        "JOINT=K", "stiffness of elastic joints (N/m, Nm/rad), * for all other actuated ones, such as *=1e5,joint1=8e4",
        (),
    )  # fmt: skip
    sigma: list[str] = SIGMA
    play: list[str] = PLAY
    encoder: list[str] = ENCODER
    no_limits: bool = flag("--no-limits", "ignore position limits of joints")
    starts: int | None = option("N", "starts of a search where no neighbour's solution leads (6)")
    vary: list[str] = option(
        "PARAMETER", "map each variant of a RAFF file, such as link2.d=1.5..2.5:11; several parameters together "
        f"(link2.d+link5.d=...), or independently (--vary twice; {UNITS})", (),
    )  # fmt: skip
    box: str = option("RANGES", "box that variants should reach, such as x=-0.3..0.3,y=-300..300mm", "", needs="--vary")
    output: str | None = output_option("FOLDER", "folder to write (ROBOT-map.zarr, or ROBOT-sweep)", ".zarr")
    plot: Path | None = PLOT
    show: str | None = option(
        "NAME",
        "quantity to draw and to show (default: the first of --quantity)",
        needs="--plot, --view",
        unless="--vary",
    )
    view: bool = VIEW
    json: bool = JSON
    workers: int | None = WORKERS
    scheduler: str | None = SCHEDULER
    yes: bool = flag("--yes", "start without a question, however long it takes")


def run(robots: ShownRobotOptions, options: MapOptions, page: PageOptions, file: Path = FILE) -> int:
    """Map where a robot reaches, how well, and where it is singular.

    Divides a region into cells, finds for each whether the robot reaches it, and how well, and writes an xarray Dataset
    as zarr. After an interruption at any moment, the same command continues. With --view, a click on a cell moves the
    robot there.
    """
    from cinegen.workspace import make_map

    exclude(json=options.json, view=options.view)
    if not (options.plot or (options.view and page.writes)):
        no_effect("where no file is written, such as that of --plot", "--force")
    check_outputs(options.plot, force=page.force, json=options.json)
    name, mechanism = robots.load_one(file)
    spec = specification(mechanism, options, robots, file)
    shown = (*spec.quantities, "reachable", "status")
    if options.show not in (None, *shown):
        raise UnknownNameError("quantity", options.show, shown)
    asked = [name.strip() for listed in options.quantity for name in listed.split(",")]
    show = options.show or next((name for name in asked if name in shown), shown[0])
    if options.vary:
        return _sweep(name, spec, file, robots, options)
    path = _folder(options.output, f"{name}-map.zarr")
    if not options.yes and not path.exists():
        _confirm(spec, options)
    try:
        with Progress() as progress:
            dataset = make_map(spec, path, workers=options.workers, scheduler=options.scheduler, report=progress.cells)
    except KeyboardInterrupt:
        print(f"{path}: finished cells are kept; the same command continues", file=sys.stderr)
        raise
    result = summary(dataset, spec)
    if not result["reachable"]:
        dataset.close()
        shutil.rmtree(path, ignore_errors=True)
        raise CinegenError(f"{name}: no cell of this region is reached ({counts_of(result)}). {node_at_home(spec)}")
    text = "\n".join([*summary_lines(name, spec, result), f"map: {path}"])
    print_result({"map": str(path), **result}, text, options.json)
    if options.plot:
        from cinegen.plotting.map import draw_map

        write_figure(options.plot, draw_map(dataset, show, name=name), options.json)
    if options.view:
        from cinegen.session import map_setup

        return page.show(map_setup(path, show if spec.quantities else None, mechanism), name)
    return 0


def specification(mechanism: Mechanism, options: MapOptions, robots: ShownRobotOptions, file: Path) -> MapSpecification:
    """Return the specification of a map.

    Raises:
        CinegenError: an option is wrong.
    """
    from cinegen.workspace import MapSpecification
    from cinegen.workspace.specification import STARTS

    where = region(
        mechanism, options.over, options.at, options.node, options.orientation, options.grid, options.centre,
        options.line,
    )  # fmt: skip
    scene = None if options.scene is None else _obstacles(mechanism, options.scene, robots)
    names = [name.strip() for text in options.quantity or ["sigma_1,sigma_2"] for name in text.split(",") if name]
    if "all" in names:
        left_out = {*_SLOW, *_LOADED, *(() if scene else ("clearance",))}
        names = [name for name in names if name != "all"] + [name for name in QUANTITIES if name not in left_out]
    elif scene:
        names.append("clearance")
    if options.reaction is not None and not set(REACTIONS) & set(names):
        names += REACTIONS
    springs = _springs(mechanism, options.stiffness)
    if springs and not {"stiffness", "rotational_stiffness", "frequency"} & set(names):
        names.append("stiffness")
    errors = tolerances(options, file)
    if errors and "accuracy" not in names:
        names.append("accuracy")
    payloads, pushed = dict[str, float](), dict[str, Any]()
    for load in carried(mechanism, options.payload, options.node):
        payloads[load.node] = payloads.get(load.node, 0.0) + load.mass
    for load in wrenches(options.wrench):
        if load.node in pushed:
            raise UsageError(f"--wrench: two wrenches act on {load.node}: add them up")
        pushed[load.node] = load.wrench
    return MapSpecification(
        mechanism, where, tuple(dict.fromkeys(names)), options.node or "", not options.no_limits,
        STARTS if options.starts is None else options.starts,
        along=() if options.along is None else point(options.along, "--along", NUMBER),
        scene=scene, folder=str(options.scene.absolute().parent) if options.scene else ".",
        payloads=payloads, wrenches=pushed, gravity=gravity_of(options.gravity) or (),
        reaction=options.reaction or "", stiffness=springs, tolerances=errors,
    )  # fmt: skip


def tolerances(options: MapOptions, file: Path) -> dict[str, Any]:
    """Return the tolerances that are given, with the text of the robot's file; nothing without any.

    Raises:
        UsageError: the file is not RAFF, whose parameters tolerances belong to.
    """
    typed = {"sigma": options.sigma, "play": options.play, "encoder": options.encoder}
    errors: dict[str, Any] = {key: amounts(texts, f"--{key}") for key, texts in typed.items() if texts}
    if not errors:
        return {}
    from raff2urdf import readers
    from raff2urdf.raff.reader import read
    from raff2urdf.shipped import find_robot

    path = find_robot(file)
    if readers.holds_xml(path):
        raise UsageError(f"{path}: tolerances are those of RAFF's parameters: convert the file by urdf2raff first")
    return {"raff": read(path), **errors}


def _springs(mechanism: Mechanism, texts: Sequence[str]) -> dict[str, float]:
    """Return the stiffness of joints by name, N m/rad and N/m.

    Raises:
        UsageError: it is no quantity of that dimension.
        UnknownNameError: no such joint.
    """
    typed = named(",".join(texts), "--stiffness", "*=1e5 or joint1=8e4Nm/rad")
    every = typed.pop("*", None)
    if every is not None:
        typed = {name: every for name in mechanism.actuated if name not in typed} | typed
    springs = {}
    for name, text in typed.items():
        dimension = STIFFNESS if mechanism.is_prismatic(name) else ANGULAR_STIFFNESS
        springs[name] = number(text, f"--stiffness: {name}", dimension)
    return springs


def _obstacles(mechanism: Mechanism, file: Path, robots: ShownRobotOptions) -> dict[str, Any]:
    """Return the obstacles of a scene, with this robot instead of the scene's."""
    from cinegen.collision import load_scene

    options = robots.options()
    scene = load_scene(file, robots.ignore_loops, robots.ignore, fixed_base=robots.fixed_base, options=options)
    home = mechanism.placement(mechanism.q_home, mechanism.end).translation.tolist()
    values: dict[str, Any] = {"name": scene.name, "goal": {"point": home}}
    if scene.allowed_collisions:
        values["allowed_collisions"] = [list(pair) for pair in scene.allowed_collisions]
    if scene.attached:
        values["attached"] = [body.document() for body in scene.attached]
    values["obstacle"] = [obstacle.document() for obstacle in scene.obstacles]
    return values


def _sweep(name: str, spec: MapSpecification, file: Path, robots: ShownRobotOptions, options: MapOptions) -> int:
    """Map all variants and print their table."""
    from cinegen.workspace.sweep import Variation, WantedBox, sweep
    from raff2urdf.raff.reader import load as load_document
    from raff2urdf.shipped import find_robot

    for other in ("loop", "ignore_loops", "ignore", "fixed_base", "actuated", "view", "sigma", "play", "encoder"):
        exclude(vary=True, **{other: getattr(robots, other, None) or getattr(options, other, None)})
    document = load_document(find_robot(file))
    variations = [Variation.typed(text, document, robots.robot) for text in options.vary]
    if options.plot:
        from cinegen.plotting.sweep import check_drawable, draw_sweep

        check_drawable(variations)
    folder = _folder(options.output, f"{name}-sweep")
    if not options.yes and not folder.exists():
        _confirm(spec, options, math.prod(len(variation.values) for variation in variations))
    wanted = named(options.box, "--box", "x=-0.3..0.3")
    box = {key: interval_of(spec.mechanism, key, ends, "--box") for key, ends in wanted.items()}
    with Progress() as progress:
        table = sweep(
            file, variations, spec.region, folder, box=WantedBox(box), robot=robots.robot, workers=options.workers,
            scheduler=options.scheduler, report=progress.cells, node=spec.node, limits=spec.limits,
            quantities=spec.quantities, starts=spec.starts, along=spec.along, scene=spec.scene, folder=spec.folder,
            payloads=spec.payloads, wrenches=spec.wrenches, gravity=spec.gravity,
            reaction=spec.reaction, stiffness=spec.stiffness,
        )  # fmt: skip
    print_result(table.as_dict(), f"{table.text()}\nvariants, maps and table.csv: {folder}", options.json)
    if options.plot:
        write_figure(options.plot, draw_sweep(table, name=name), options.json)
    return 0


def _folder(output: str | None, name: str) -> Path:
    """Return the folder of a map or of variants, which --output names as it names files."""
    path = Path(output or name)
    if path == STANDARD:
        raise UsageError("-o -: a map is a folder, which can't go to standard output")
    is_map = path.suffix == ".zarr" or any((path / file).exists() for file in ("zarr.json", "sweep.json"))
    return path if is_map else output_path(output, name)


def _confirm(spec: MapSpecification, options: MapOptions, maps: int = 1) -> None:
    """Ask before maps that take long or much of the disk.

    Raises:
        CinegenError: the answer is no, or no one can answer.
    """
    if maps * spec.region.size <= _SURELY:
        return
    from cinegen.workspace.evaluator import estimate

    cost, cores = estimate(spec, maps), options.workers or os.cpu_count() or 1
    if cost.seconds / cores <= _LONG and cost.size <= _LARGE:
        return
    words = cost.text(cores)
    if not sys.stdin.isatty():
        raise CinegenError(f"{words}. Add --yes to start it, or use a coarser --grid")
    print(words, file=sys.stderr)
    try:
        answer = input("Start? [y/N] ")
    except EOFError:
        answer = ""
    if answer.strip().lower() not in ("y", "yes"):
        raise CinegenError("not started; nothing is written")
