"""`sweep`: a map and a row for each variant of a robot, in a folder that can be gone on with."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import raff2urdf
from cinegen.workspace.cluster import connected, each
from cinegen.workspace.errors import MapError
from cinegen.workspace.make import BY_POSE, Say
from cinegen.workspace.region import Region
from cinegen.workspace.sweep.box import Box
from cinegen.workspace.sweep.studied import Plan, studied
from cinegen.workspace.sweep.table import Row, Table
from cinegen.workspace.sweep.variant import Variant, variants
from cinegen.workspace.sweep.variation import Variation
from raff2urdf.document import Document, RaffRobot
from raff2urdf.files import write_all
from raff2urdf.reader import parse, read
from raff2urdf.writer import write

_KIND, _VERSION = "cinegen sweep", 1
_LONGEST = 200  # bytes of a folder's name
_WORTH = 4  # pieces for each process, from which on processes are worth starting

_Task = tuple[str, dict[str, float], Path]
"""A variant's name, its values and its folder."""


def sweep(
    path: str | Path,
    variations: Sequence[Variation],
    region: Region,
    out: str | Path,
    *,
    box: Box | None = None,
    robot: str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    say: Say | None = None,
    **settings: Any,
) -> Table:
    """Makes a map of each variant of a robot, or goes on where that was stopped, and tells how they compare.

    In the folder each variant gets one of its own, as `link2.d=1500`, with its `robot.raff` and its `map.zarr`; the
    table is written beside them, `table.csv`. The same maps may be asked for another box.

    Args:
        path: the robot's RAFF file.
        variations: what varies; all combinations are made.
        region: that all maps are made over.
        out: the folder for all of it.
        box: what is wanted of the region; all of it unless said.
        robot: of a file that holds several, the one that varies; the first unless said.
        workers: processes on this machine; as many as it has cores unless given, and this one alone for small maps.
        scheduler: address of a Dask scheduler, whose workers must see the folder too.
        say: is told how many cells of all maps are done, and how many there are.
        settings: others of `MapSpecification`: node, limits, quantities (those of the table are always among them), and
            so on.

    Raises:
        RaffError: the file is wrong.
        MapError: parameters, a box or settings that make no sense; or the folder is of something else, or can't be
            written; or the cluster does not answer.
        UnknownNameError: no such node.
    """
    if workers is not None and workers < 1:
        raise MapError(f"workers: {workers} can't do anything: give 1 or more")
    source, here = Path(path), Path(out).absolute()
    document = parse(read(source), str(source))
    raff2urdf.check(document)
    found = variants(document, variations, robot)
    plan = Plan(region, box or Box(), robot, settings)
    plan.check(source)
    _begin(here, _description(document, variations, plan))
    folders = [here / _name(number, variant) for number, variant in enumerate(found)]
    for variant, at in zip(found, folders, strict=True):
        seen = replace(variant, document=_seen_from(at, source, variant.document))
        _write(at / "robot.raff", seen.raff())
    rows = _rows(plan, found, folders, workers, scheduler, say or (lambda *_: None))
    headings = tuple(variation.heading for variation in variations)
    table = Table(document.robot(robot).name, document.units, headings, plan.box, tuple(rows))
    _write(here / "table.csv", table.csv())
    return table


# --- the work ---------------------------------------------------------------------------------------------------------


def _rows(
    plan: Plan, found: list[Variant], folders: list[Path], workers: int | None, scheduler: str | None, say: Say
) -> list[Row]:
    """Of each variant. With several processes variants are studied side by side, or, if there are fewer variants than
    processes, one after the other by all of them."""
    size = plan.region.size
    wanted = workers or min(os.cpu_count() or 1, max(1, len(found) * size // BY_POSE // _WORTH))
    tasks = [(variant.name, dict(variant.values), at) for variant, at in zip(found, folders, strict=True)]
    say(0, len(tasks) * size)
    if scheduler is None and wanted == 1:
        return list(_in_turn(plan, tasks, size, say))
    with connected(scheduler, wanted) as client:
        if len(tasks) < len(client.ncores()):
            address = client.scheduler.address  # type: ignore[union-attr]
            return list(_in_turn(plan, tasks, size, say, str(address)))
        rows = dict[str, Row]()
        for (name, *_), future in each(client, _studied, tasks, plan):
            rows[name] = future.result()
            say(len(rows) * size, len(tasks) * size)
    return [rows[name] for name, *_ in tasks]


def _studied(plan: Plan, task: _Task) -> Row:
    return studied(plan, *task)


def _in_turn(plan: Plan, tasks: list[_Task], size: int, say: Say, scheduler: str | None = None) -> Iterator[Row]:
    for number, task in enumerate(tasks):

        def told(done: int, _: int, before: int = number * size) -> None:
            say(before + done, len(tasks) * size)

        row = studied(plan, *task, scheduler, told)
        if row.dexterity is None:
            told(size, size)
        yield row


# --- the folder -------------------------------------------------------------------------------------------------------


def _description(document: Document, variations: Sequence[Variation], plan: Plan) -> dict[str, Any]:
    """All that determines the maps, as JSON has it."""
    described = {
        "kind": _KIND,
        "version": _VERSION,
        "raff": write(document),
        "robot": plan.robot,
        "varied": [str(variation) for variation in variations],
        "region": plan.region.document(),
        "settings": plan.settings,
    }
    return dict(json.loads(json.dumps(described)))


def _begin(out: Path, asked: dict[str, Any]) -> None:
    """A new folder, or the one where this sweep was begun.

    Raises:
        MapError: it is of something else, or can't be written.
    """
    at = out / "sweep.json"
    try:
        if at.exists():
            there = json.loads(at.read_text(encoding="utf-8"))
        elif out.exists() and any(out.iterdir()):
            raise MapError(f"{out} holds something else than a sweep: give an empty folder, or a new one")
        else:
            there = None
    except (OSError, ValueError) as error:
        raise MapError(f"{out} can't be gone on with: {error}. Give another folder") from None
    if there is None:
        _write(at, json.dumps(asked, indent=1, sort_keys=True) + "\n")
        return
    if not isinstance(there, dict) or there.get("kind") != _KIND:
        raise MapError(f"{at} is no description of a sweep: give another folder")
    differs = [key for key in sorted({*asked, *there}) if asked.get(key) != there.get(key)]
    if differs:
        words = ["the RAFF file" if key == "raff" else f"{key} ({there.get(key)}, not {asked.get(key)})"
                 for key in differs]  # fmt: skip
        raise MapError(f"{out} holds another sweep, which differs in {', '.join(words)}. Give another folder")


def _name(number: int, variant: Variant) -> str:
    """Of a variant's folder: its own, unless no file system would take that."""
    return variant.name if len(variant.name.encode()) <= _LONGEST else f"variant {number}"


def _seen_from(folder: Path, source: Path, document: Document) -> Document:
    """The document as it stands in another folder: its graphics are where they were."""

    def moved(robot: RaffRobot) -> RaffRobot:
        there = source.parent.absolute() / Path(robot.path or "").expanduser()
        return replace(robot, path=Path(os.path.relpath(there, folder)).as_posix())

    drawn = [any(part.filenames for part in (robot.base, *robot.parts)) for robot in document.robots]
    robots = (moved(robot) if has else robot for robot, has in zip(document.robots, drawn, strict=True))
    return replace(document, robots=tuple(robots))


def _write(path: Path, text: str) -> None:
    """Writes a file as a whole, unless that is what it says already."""
    try:
        if path.is_file() and path.read_text(encoding="utf-8") == text:
            return
        write_all({path: text.encode()})
    except (OSError, ValueError) as error:
        raise MapError(f"{path} can't be written: {error}") from None
