"""`sweep`: a map and a result for each variant of a robot, in a folder from which it can be resumed."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import raff2urdf
from cinegen.cluster import check_workers, connected, each, processes
from cinegen.errors import ClosureError
from cinegen.model.load import load
from cinegen.workspace.errors import MapError
from cinegen.workspace.extent import extent
from cinegen.workspace.maps import OVER_POSES, Report, make_map
from cinegen.workspace.region import Region
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.sweep.box import BoxConfigurations, WantedBox, dexterity, regularity
from cinegen.workspace.sweep.result import SweepResult, VariantResult
from cinegen.workspace.sweep.variants import Variation, variants
from raff2urdf.errors import raised_as
from raff2urdf.files import digest_of, write_all
from raff2urdf.graphics.names import may_read
from raff2urdf.raff.document import Document, RaffRobot
from raff2urdf.raff.reader import parse, read
from raff2urdf.raff.writer import dumps
from raff2urdf.shipped import find_robot

_KIND, _VERSION = "cinegen sweep", 2
_NAME, _TABLE = "sweep.json", "table"  # the description, and in it the digest of the table
_LONGEST = 200  # bytes of a folder's name
_WORTH = 4  # chunks for each process, from which on processes are worth starting
_NEEDED = ("sigma_1", "sigma_2", "condition")

_Task = tuple[str, dict[str, float], Path]
"""A variant's name, its values and its folder."""


def sweep(
    path: str | Path,
    variations: Sequence[Variation],
    region: Region,
    out: str | Path,
    *,
    box: WantedBox | None = None,
    robot: str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    report: Report | None = None,
    **settings: Any,
) -> SweepResult:
    """Make a map of each variant of a robot, or resume where that was stopped, and compare them.

    Each variant gets a folder in `out`, such as `link2.d=1500`, with its `robot.raff` and its `map.zarr`; `table.csv`
    next to them has all results. The same maps can be judged again for another box.

    Args:
        path: the robot's RAFF file.
        variations: what varies; all combinations are made.
        region: the grid of all maps.
        out: the folder of the sweep.
        box: the wanted part of the region; all of it unless given.
        robot: the robot that varies, of a file that holds several; the first unless given.
        workers: number of processes on this machine; one for each core unless given, and this process alone for small
            maps.
        scheduler: address of a Dask scheduler, whose workers must see the folder too.
        report: called with the number of evaluated cells of all maps, and the number of all their cells.
        settings: other arguments of `MapSpecification`: node, limits, quantities (those of the result are always among
            them) and so on.

    Raises:
        RaffError: the file is wrong.
        MapError: invalid parameters, box or settings; or the folder is of something else, or can't be written.
        ClusterError: the cluster does not answer.
        UnknownNameError: no such node.
    """
    check_workers(workers, scheduler)
    source, root = find_robot(path), Path(out).absolute()
    document = parse(read(source), str(source))
    raff2urdf.check(document)
    combinations = variants(document, variations, robot)
    plan = _Plan(region, box or WantedBox(), robot, settings)
    plan.box.grid(region)
    with warnings.catch_warnings(), suppress(ClosureError):  # each variant reports its own
        warnings.simplefilter("ignore")
        plan.spec(source)
    asked = _description(document, variations, plan)
    _begin(root, asked)
    tasks: list[_Task] = []
    for k, variant in enumerate(combinations):
        folder = root / (variant.name if len(variant.name.encode()) <= _LONGEST else f"variant {k}")
        moved = replace(variant, document=_in_folder(folder, source, variant.document))
        _write_robot(folder / "robot.raff", moved.raff())
        tasks.append((variant.name, dict(variant.values), folder))
    rows = _rows(plan, tasks, workers, scheduler, report or (lambda *_: None))
    headings = tuple(variation.heading for variation in variations)
    chosen = document.robot(robot)
    si = {variation.heading: variation.parameters[0].si(document, chosen) for variation in variations}
    result = SweepResult(chosen.name, document.units, headings, plan.box, tuple(rows), si)
    _write_table(root, asked, result.csv())
    return result


class _Plan(NamedTuple):
    """The settings of a sweep.

    Attributes:
        region: the grid of all maps.
        box: the wanted box.
        robot: of a file that holds several.
        settings: others of `MapSpecification`.
    """

    region: Region
    box: WantedBox
    robot: str | None
    settings: dict[str, Any]

    def spec(self, path: Path) -> MapSpecification:
        """Return the specification of the map of a variant's RAFF file.

        Raises:
            ClosureError: its loops can't be closed.
            MapError: settings that are invalid for it.
            UnknownNameError: no such node.
        """
        settings = {**self.settings, "quantities": (*_NEEDED, *self.settings.get("quantities", ()))}
        return MapSpecification(load(path, self.robot), self.region, **settings)


def _rows(
    plan: _Plan, tasks: list[_Task], workers: int | None, scheduler: str | None, report: Report
) -> list[VariantResult]:
    """Return the result of each variant. Several processes work on different variants or, if there are fewer variants
    than processes, together on one after the other."""
    size = plan.region.size
    wanted = processes(workers, scheduler, len(tasks) * size // OVER_POSES // _WORTH)
    report(0, len(tasks) * size)
    if scheduler is None and wanted == 1:
        return list(_in_turn(plan, tasks, size, report))
    with connected(scheduler, wanted) as client:
        if len(tasks) < len(client.ncores()):
            address = client.scheduler.address  # type: ignore[union-attr]
            return list(_in_turn(plan, tasks, size, report, str(address)))
        rows = dict[str, VariantResult]()
        for (name, *_), future in each(client, _judged, tasks, plan):
            rows[name] = future.result()
            report(len(rows) * size, len(tasks) * size)
    return [rows[name] for name, *_ in tasks]


def _in_turn(
    plan: _Plan, tasks: list[_Task], size: int, report: Report, scheduler: str | None = None
) -> Iterator[VariantResult]:
    for number, task in enumerate(tasks):

        def report_all(done: int, _: int, before: int = number * size) -> None:
            report(before + done, len(tasks) * size)

        row = _judged(plan, task, scheduler, report_all)
        if row.dexterity is None:
            report_all(size, size)
        yield row


def _judged(plan: _Plan, task: _Task, scheduler: str | None = None, report: Report | None = None) -> VariantResult:
    """Make the map of a variant, by a cluster or by this process alone, and judge it in the wanted box.

    Raises:
        MapError: the map can't be made.
    """
    name, values, folder = task
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            spec = plan.spec(folder / "robot.raff")
        except ClosureError as error:
            return VariantResult(name, values, remark=_one_line(*(problem.message for problem in error.problems)))
        except MapError as error:
            return VariantResult(name, values, remark=_one_line(str(error)))
    dataset = make_map(spec, folder / "map.zarr", workers=1, scheduler=scheduler, report=report)
    grid = plan.box.grid(plan.region)
    touched = dataset["configuration"].isel(dict(zip(plan.region.names, grid.cells, strict=True)))
    box = BoxConfigurations(spec, grid, touched.values)
    regular = regularity(box) if box.parts else None
    remark = _one_line(*(str(warning.message) for warning in warned))
    return VariantResult(name, values, extent(dataset), spec.mechanism.length, dexterity(box), regular, remark)


def _one_line(*texts: str) -> str:
    lines = (line for text in texts for line in text.splitlines())
    return "; ".join(" ".join(line.split()) for line in lines if line.strip())


# --- the folder -------------------------------------------------------------------------------------------------------


def _description(document: Document, variations: Sequence[Variation], plan: _Plan) -> dict[str, Any]:
    """Return everything that determines the maps, as JSON values."""
    described = {
        "kind": _KIND, "version": _VERSION, "raff": dumps(document), "robot": plan.robot,
        "varied": list(map(str, variations)), "region": plan.region.document(), "settings": plan.settings,
    }  # fmt: skip
    return dict(json.loads(json.dumps(described)))


def _begin(out: Path, asked: dict[str, Any]) -> None:
    """Create the folder, or check that this sweep was begun there.

    Raises:
        MapError: it is of something else, or can't be written.
    """
    at, begun = out / _NAME, None
    with raised_as(MapError, (OSError, ValueError), f"{out} can't be resumed: ", ". Give another folder"):
        if at.exists():
            begun = _begun(out)
        elif out.exists() and any(out.iterdir()):
            raise MapError(f"{out} holds something other than a sweep: give an empty folder, or a new one")
    if begun is None:
        _write({at: _json(asked)})
        return
    if not isinstance(begun, dict) or begun.get("kind") != _KIND:
        raise MapError(f"{at} is not the description of a sweep: give another folder")
    if differs := [key for key in sorted({*asked, *begun} - {_TABLE}) if asked.get(key) != begun.get(key)]:
        texts = ["the RAFF file" if key == "raff" else f"{key} ({begun.get(key)}, not {asked.get(key)})"
                 for key in differs]  # fmt: skip
        raise MapError(f"{out} holds another sweep, which differs in {', '.join(texts)}. Give another folder")


def _in_folder(folder: Path, source: Path, document: Document) -> Document:
    """Return a document for another folder, next to which its graphics are copied: a file may name none elsewhere."""

    def moved(robot: RaffRobot) -> RaffRobot:
        named = {Path(name) for part in (robot.base, *robot.parts) for name in part.filenames or ()}
        names = {path for path in named if not path.is_absolute() and ".." not in path.parts}
        if not named:
            return robot
        origin = source.parent / Path(robot.path or "").expanduser()
        target = folder.parent / "graphics" / robot.name
        for name in names:
            for file in {name, name.with_suffix(".mtl")}:  # the colours of an OBJ
                if may_read(origin / file, source.parent) and (origin / file).is_file():
                    _write({target / file: (origin / file).read_bytes()})
        return replace(robot, path=f"../graphics/{robot.name}")

    return replace(document, robots=tuple(map(moved, document.robots)))


def _write_robot(path: Path, text: str) -> None:
    """Write the RAFF file of a variant, unless it is there.

    Raises:
        MapError: it has another text, or can't be written.
    """
    if not path.exists():
        _write({path: text})
    elif _digest(path) != digest_of(text.encode()):
        raise MapError(
            f"{path}: was changed by hand, or made by another version of cinegen: remove it, or give another folder"
        )


def _write_table(out: Path, asked: dict[str, Any], text: str) -> None:
    """Write the table, and its digest into the sweep's description.

    Raises:
        MapError: it was changed by hand, or can't be written.
    """
    path, known = out / "table.csv", _begun(out).get(_TABLE)
    if known is not None and path.exists() and _digest(path) != known:
        raise MapError(f"{path}: was changed by hand since the sweep made it: rename it, or give another folder")
    _write({path: text, out / _NAME: _json(asked | {_TABLE: digest_of(text.encode())})})


def _digest(path: Path) -> str:
    with raised_as(MapError, OSError, f"{path} can't be read: "):
        return digest_of(path.read_bytes())


def _begun(out: Path) -> Any:
    return json.loads((out / _NAME).read_text(encoding="utf-8"))


def _json(asked: dict[str, Any]) -> str:
    return json.dumps(asked, indent=1, sort_keys=True) + "\n"


def _write(texts: Mapping[Path, str | bytes]) -> None:
    """Write files as a whole.

    Raises:
        MapError: one can't be written.
    """
    try:
        write_all({path: text.encode() if isinstance(text, str) else text for path, text in texts.items()})
    except (OSError, ValueError) as error:
        raise MapError(f"{getattr(error, 'filename', None) or next(iter(texts))} can't be written: {error}") from None
