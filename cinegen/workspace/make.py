"""`make_map`: all pieces of a map, in this process, on this machine's cores or on a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.workspace import work
from cinegen.workspace.cluster import connected, each
from cinegen.workspace.errors import MapError
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.storage.lock import locked
from cinegen.workspace.storage.store import Index, Store, begin, sweep, unwritten

if TYPE_CHECKING:
    import xarray

BY_POSE, BY_MOTORS = 6_000, 20_000
"""Cells of a piece, and of a task: 0.1 to 1 s of work ..."""
_QUICK = 3  # ... but of a task so many times more where no loops are to be closed: it takes 2 ms to hand it out

_MANY = 100_000  # pieces: of more than that each is larger, so that there are fewer files ...
_LARGEST = 200_000  # ... up to so many cells

_READ = 2_000_000  # cells of a task that only reads
_WORTH = 4  # tasks for each process, from which on processes are worth starting

Say = Callable[[int, int], None]
Task = Callable[[work.Job, list[Index]], None]
Do = Callable[[Task, Iterable[list[Index]]], Iterator[list[Index]]]
"""Has a function of `work` done for many lists of pieces, and hands them back as they are done."""


def make_map(
    spec: MapSpecification,
    path: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    most: int | None = None,
    say: Say | None = None,
) -> xarray.Dataset:
    """Makes a map, or goes on with one that was begun; what is finished is never computed again.

    Killed at any moment, the same call goes on where it stopped, and the file is the same in the end, byte for byte,
    whoever made it. What is finished is read first: a piece whose files are damaged is made again.

    Args:
        specification: what is to be shown.
        path: the map's folder, .zarr.
        workers: processes on this machine; as many as it has cores unless given, and this one alone for a small map.
        scheduler: address of a Dask scheduler, such as tcp://node1:8786; its workers must see the path too.
        most: cells of a piece; a map that is there keeps its own. Unless given as many as take about a second, and of
            a map of more than 10^9 cells more.
        say: is told how many cells are done, and how many there are.

    Returns:
        the map, see `open_map`.

    Raises:
        MapError: there is something else at the path, or it can't be written, or the cluster does not answer.
    """
    where = Path(path).absolute()
    usual = BY_MOTORS if spec.of_motors else BY_POSE
    if min(workers or 1, most or 1) < 1 or 0 in (workers, most):
        raise MapError(f"workers ({workers}) and cells of a piece ({most}) must be 1 or more")
    cut = spec.region.lines if spec.of_motors else spec.region.blocks
    store = begin(where, spec, cut(most or piece_size(spec.region.size, usual)))
    if store.text != spec.text:
        raise MapError(f"{where} is a map of something else: {_difference(store.spec, spec)}. Give another -o")
    with _held(where):
        quick = spec.of_motors and not spec.mechanism.loops
        _make(store, _QUICK * usual if quick else usual, workers, scheduler, say or (lambda *_: None))
    return open_map(where)


def open_map(path: str | Path) -> xarray.Dataset:
    """A map that is on disk, finished or not: cells that nobody has looked at are `settled` 0. Nothing is read yet.

    Raises:
        MapError: there is no map; later, where values are read, that files are damaged.
    """
    import xarray

    from cinegen.workspace.storage.checked import CheckedStore

    store = Store(Path(path).absolute())
    try:
        dataset: xarray.Dataset = xarray.open_zarr(
            CheckedStore(store.path, read_only=True), consolidated=False, chunks=None
        )
    except (ValueError, TypeError, KeyError, AttributeError, OSError) as error:
        why = f"{store.path} is damaged: zarr can't read it ({error})"
        raise MapError(f"{why}. Give another path, or delete it") from None
    dataset.encoding["source"] = str(store.path)
    return dataset


def piece_size(cells: int, usual: int) -> int:
    """Cells of a piece, at most, of a map of so many cells."""
    return min(max(usual, cells // _MANY), _LARGEST)


@contextmanager
def _held(path: Path) -> Iterator[None]:
    """Nobody else makes the map meanwhile; nothing is left beside it."""
    try:
        with locked(path / "zarr.json"):
            sweep(path)
            try:
                yield
            finally:
                sweep(path)
    except OSError as error:
        raise unwritten(path, error) from None


def _make(store: Store, usual: int, workers: int | None, scheduler: str | None, say: Say) -> None:
    there = left = 0  # cells
    for index, written in store.look():
        there, left = there + written * store.size(index), left + (not written) * store.size(index)
    wanted = workers or min(os.cpu_count() or 1, max(1, left // (_WORTH * usual)))
    if not left or (scheduler is None and wanted == 1):
        scheduler, wanted, usual = None, 1, 1  # then it is told of each piece
    with _doing(store, scheduler, wanted) as do:
        if there:
            for _ in do(work.look_after, _lists(store, True, _READ)):
                pass
        done, size = store.done, store.spec.region.size
        say(done, size)
        for indices in do(work.make, _lists(store, False, usual)):
            done += sum(map(store.size, indices))
            say(done, size)


def _lists(store: Store, written: bool, most: int) -> Iterator[list[Index]]:
    """All pieces that are written, or are not, some at a time: of at most so many cells, unless one has more."""
    some, cells = list[Index](), 0
    for index, there in store.look():
        if there != written:
            continue
        size = store.size(index)
        if some and cells + size > most:
            yield some
            some, cells = [], 0
        some.append(index)
        cells += size
    if some:
        yield some


@contextmanager
def _doing(store: Store, scheduler: str | None, workers: int) -> Iterator[Do]:
    """Who does it: this process alone, others on this machine, or a cluster."""
    job = work.Job.of(store)
    if scheduler is None and workers == 1:
        yield partial(_in_turn, job)
        return
    from cinegen.ik.batch import Sampler

    Sampler(store.spec.mechanism, store.spec.node)  # compiles, where that must be done, before all do it at once
    with connected(scheduler, workers) as client:
        yield lambda function, lists: (indices for indices, _ in each(client, function, lists, job))


def _in_turn(job: work.Job, function: Task, lists: Iterable[list[Index]]) -> Iterator[list[Index]]:
    for indices in lists:
        function(job, indices)
        yield indices


def _difference(there: MapSpecification, asked: MapSpecification) -> str:
    """What differs between two specifications, in words."""
    one, other = there.document(), asked.document()
    if one["robot"] != other["robot"]:
        return f"of another robot, or of another version of it ({there.mechanism.name})"
    one, other = _flat(one), _flat(other)
    return "; ".join(
        f"{name} is {one.get(name, 'left out')}, not {other.get(name, 'left out')}"
        for name in sorted({*one, *other})
        if one.get(name) != other.get(name)
    )


def _flat(document: Mapping[str, Any]) -> dict[str, str]:
    """The specification's words by name, those of its region among them."""
    region = document["region"]
    words = {axis["name"]: f"{axis['low']:g}..{axis['high']:g}:{axis['count']}" for axis in region["axes"]}
    words |= {name: f"{value:g}" for name, value in region["at"].items()}
    own = {name: value for name, value in region.items() if name not in ("axes", "at")}
    others = {name: value for name, value in document.items() if name not in ("region", "robot")}
    return words | {name: _words(value) for name, value in (own | others).items()}


def _words(value: Any) -> str:
    return ", ".join(map(_words, value)) if isinstance(value, (list, tuple)) else str(value)
