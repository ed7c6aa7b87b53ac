"""`make_map`: evaluates all chunks of a map in this process, on this machine's cores or on a cluster."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from functools import lru_cache
from pathlib import Path
from socket import gethostname
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from cinegen.arrays import Indices
from cinegen.cluster import check_workers, connected, each, processes
from cinegen.workspace.chunks import chunk_shape
from cinegen.workspace.errors import MapError
from cinegen.workspace.evaluator import ChunkEvaluator
from cinegen.workspace.specification import MapSpecification

if TYPE_CHECKING:
    import xarray

    from cinegen.workspace.zarr_store import MapStore

OVER_POSES, OVER_JOINTS = 6_000, 20_000
"""Default number of cells of a chunk, and of a task: 0.1 to 1 s of work ..."""
_QUICK = 3  # ... but of a task so many times more without loops, as it takes 2 ms to hand it out

_MANY = 100_000  # chunks: maps with more have larger chunks, so that there are fewer files ...
_LARGEST = 200_000  # ... up to so many cells

_READ = 2_000_000  # cells of a task that only reads
_WORTH = 4  # tasks for each process, from which on processes are worth starting

Chunks = list[int]
Report = Callable[[int, int], None]


def make_map(
    spec: MapSpecification,
    path: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    most: int | None = None,
    report: Report | None = None,
) -> xarray.Dataset:
    """Make a map, or resume one that was begun. Complete chunks are never evaluated again.

    Whenever it is stopped, even killed, the same call resumes where it stopped, and the files are the same in the end,
    byte for byte, whichever processes made them. A resumed map is checked first: chunks with damaged files are
    evaluated again.

    Args:
        spec: specification of the map.
        path: folder of the map, .zarr.
        workers: number of processes on this machine; one for each core unless given, and this process alone for a small
            map.
        scheduler: address of a Dask scheduler, such as tcp://node1:8786; its workers must see the path too.
        most: number of cells of a chunk, at most; a resumed map keeps its own. Unless given as many as take about a
            second, and more in maps of more than 10^9 cells.
        report: called with the number of evaluated cells and the number of all cells.

    Returns:
        the map, see `open_map`.

    Raises:
        MapError: there is something else at the path, or it can't be written.
        ClusterError: the cluster does not answer.
    """
    from cinegen.workspace.zarr_store import open_for_writing

    where = Path(path).absolute()
    usual = OVER_JOINTS if spec.over_joints else OVER_POSES
    check_workers(workers, scheduler)
    if most is not None and most < 1:
        raise MapError(f"cells of a chunk ({most}) must be 1 or more")
    chunks = chunk_shape(spec.region.shape, most or chunk_size(spec.region.size, usual), cube=not spec.over_joints)
    with open_for_writing(where, spec, chunks) as store:
        if store.text != spec.text:
            differs = (f"{name} is {stored}, not {asked}" for name, stored, asked in store.spec.differences(spec))
            raise MapError(f"{where} is another map: {'; '.join(differs)}. Give another -o")
        quick = spec.over_joints and not spec.mechanism.is_constrained
        _make(store, _QUICK * usual if quick else usual, workers, scheduler, report or (lambda *_: None))
    return open_map(where)


def open_map(path: str | Path) -> xarray.Dataset:
    """Open a map on disk, complete or not, without loading its values. The status of missing cells is 0.

    Raises:
        MapError: there is no map; or, later, where values are loaded, a file is damaged.
    """
    from cinegen.workspace.zarr_store import open_dataset

    dataset: xarray.Dataset = open_dataset(Path(path).absolute())
    return dataset


def chunk_size(cells: int, usual: int) -> int:
    """Return the number of cells of a chunk, at most, for a map of so many cells."""
    return min(max(usual, cells // _MANY), _LARGEST)


def _make(store: MapStore, usual: int, workers: int | None, scheduler: str | None, report: Report) -> None:
    complete, size = store.complete(), store.spec.region.size
    left = size - store.done
    wanted = processes(workers, scheduler, left // (_WORTH * usual))
    client: AbstractContextManager[Any] = nullcontext()
    if not left or (scheduler is None and wanted == 1):
        usual = 1  # each chunk is reported
    else:
        from cinegen.ik.batch import BatchEvaluator

        BatchEvaluator(store.spec.mechanism, store.spec.node)  # compiles, if necessary, before all processes do at once
        client = connected(scheduler, wanted)
    folder = str(store.path), store.digest
    with client as shared:
        if left < size:
            for _ in each(shared, _discard_damaged, _lists(store, np.flatnonzero(complete), _READ), *folder):
                pass
        done = store.done
        report(done, size)
        for chunks, _ in each(shared, _evaluate, _lists(store, np.flatnonzero(~store.complete()), usual), *folder):
            done += int(store.sizes(np.asarray(chunks)).sum())
            report(done, size)


def _lists(store: MapStore, chunks: Indices, most: int) -> Iterator[Chunks]:
    """Divide chunks (n,) into lists with at most so many cells each, unless a chunk has more."""
    count = max(1, most // math.prod(store.chunk_shape))
    return (chunks[first : first + count].tolist() for first in range(0, len(chunks), count))


# --- tasks, in any process of any machine -----------------------------------------------------------------------


_ONE = Lock()  # an evaluator has memory of its own, and is used by one thread at a time


def _evaluate(path: str, digest: str, chunks: Chunks) -> None:
    """Evaluate and write chunks, unless they are complete.

    Raises:
        MapError: the map can't be read or written.
    """
    with _ONE:
        store = _store(path, digest)
        for chunk in chunks:
            if not store.is_complete(chunk):  # a process that was thought dead may have written it
                store.write(chunk, _evaluator(path, digest).values(store.cells(chunk)))


def _discard_damaged(path: str, digest: str, chunks: Chunks) -> None:
    """Read complete chunks, and mark as incomplete those whose files are damaged.

    Raises:
        MapError: the map can't be read or written.
    """
    store = _store(path, digest)
    for chunk in chunks:
        if not store.is_sound(chunk):
            store.discard(chunk)


@lru_cache(maxsize=2)
def _store(path: str, digest: str) -> MapStore:
    """Return the map at a path, with the digest of its description."""
    from cinegen.workspace.zarr_store import MapStore

    if not Path(path).exists():
        raise MapError(f"{gethostname()} sees no map at {path}: all machines must see it at the same path")
    store = MapStore(path)
    if store.digest != digest:
        raise MapError(f"{gethostname()} sees another map at {path}: all machines must see the same one there")
    return store


@lru_cache(maxsize=2)
def _evaluator(path: str, digest: str) -> ChunkEvaluator:
    return ChunkEvaluator(_store(path, digest).spec)
