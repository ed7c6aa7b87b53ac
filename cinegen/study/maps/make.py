"""`make_map`: all pieces of a map, in this process, on this machine's cores or on a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.study.maps import work
from cinegen.study.maps.errors import MapError
from cinegen.study.maps.store import Lock, Store, create
from cinegen.study.maps.survey import Survey

if TYPE_CHECKING:
    import xarray
    from distributed import Client

BY_POSE, BY_MOTORS = 6_000, 20_000
"""Cells of a piece: 0.1 to 1 s of work."""

_AHEAD = 3  # pieces for each process that are handed out and not finished
_RETRIES = 5  # of a piece whose process has died
_WORTH = 4  # pieces for each process, from which on processes are worth starting

Say = Callable[[int, int], None]


def make_map(
    survey: Survey,
    path: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    most: int | None = None,
    say: Say | None = None,
) -> xarray.Dataset:
    """Makes a map, or goes on with one that was begun; what is finished is never computed again.

    Killed at any moment, the same call goes on where it stopped, and the file is the same in the end, byte for byte.

    Args:
        survey: what is to be shown.
        path: the map's folder, .zarr.
        workers: processes on this machine; as many as it has cores unless given, and this one alone for a small map.
        scheduler: address of a Dask scheduler, such as tcp://node1:8786; its workers must see the path too.
        most: cells of a piece.
        say: is told how many cells are done, and how many there are.

    Returns:
        the map, see `open_map`.

    Raises:
        MapError: there is something else at the path, or it can't be written, or the cluster does not answer.
    """
    where = Path(path).absolute()
    if where.exists():
        store = Store(where)
        if store.text != survey.text:
            raise MapError(f"{where} is a map of something else: {_difference(store.survey, survey)}. Give another -o")
    else:
        store = create(where, survey, survey.region.chunks(most or (BY_MOTORS if survey.of_motors else BY_POSE)))
    with Lock(where):
        _make(store, workers, scheduler, say or (lambda *_: None))
    return open_map(where)


def open_map(path: str | Path) -> xarray.Dataset:
    """A map that is on disk, finished or not: cells that nobody has looked at are `settled` 0. Nothing is read yet.

    Raises:
        MapError: there is no map.
    """
    import xarray

    store = Store(Path(path).absolute())
    dataset: xarray.Dataset = xarray.open_zarr(store.path, consolidated=False, chunks=None)
    dataset.encoding["source"] = str(store.path)
    return dataset


def _make(store: Store, workers: int | None, scheduler: str | None, say: Say) -> None:
    size, path = store.survey.region.size, str(store.path)
    left = list_of(store)
    done = size - sum(cells for _, cells in left)
    say(done, size)
    if not left:
        return
    wanted = workers or min(os.cpu_count() or 1, max(1, len(left) // _WORTH))
    if scheduler is None and wanted == 1:
        for index, cells in left:
            work.do(path, store.text, [index])
            done += cells
            say(done, size)
        return
    with _client(scheduler, wanted) as client:
        for cells in _handed_out(client, store, left):
            done += cells
            say(done, size)


def list_of(store: Store) -> list[tuple[tuple[int, ...], int]]:
    """Pieces that are left, and cells of each."""
    found = []
    for index in store.left():
        cells = 1
        for part in store.cells(index):
            cells *= part.stop - part.start
        found.append((index, cells))
    return found


@contextmanager
def _client(scheduler: str | None, workers: int) -> Iterator[Client]:
    import dask
    from distributed import Client, LocalCluster

    quiet = {"distributed.worker.memory.terminate": False, "distributed.comm.timeouts.connect": "20s"}
    with dask.config.set(quiet):
        if scheduler is None:
            cluster = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None, silence_logs=50)
            with cluster, Client(cluster) as client:
                yield client
            return
        try:
            client = Client(scheduler, timeout=20)
        except (OSError, ValueError) as error:
            raise MapError(f"no Dask scheduler answers at {scheduler}: {error}") from None
        with client:
            yield client


def _handed_out(client: Client, store: Store, left: list[tuple[tuple[int, ...], int]]) -> Iterator[int]:
    """Cells that are done, as they are: a few pieces for each process are under way, so that the scheduler never has
    many to look after."""
    from distributed import as_completed

    path, text = str(store.path), store.text
    ahead = _AHEAD * max(1, sum(client.ncores().values()))
    waiting = iter(left)
    cells_of: dict[Any, int] = {}

    def next_one() -> list[Any]:
        for index, cells in waiting:
            future = client.submit(work.do, path, text, [index], pure=False, retries=_RETRIES)
            cells_of[future.key] = cells
            return [future]
        return []

    futures = as_completed([future for _ in range(ahead) for future in next_one()])
    for future in futures:
        try:
            future.result()
        except MapError:
            raise
        except Exception as error:
            raise MapError(f"{store.path}: a piece could not be made: {error}. What was finished stays") from error
        yield cells_of.pop(future.key)
        futures.update(next_one())


def _difference(there: Survey, asked: Survey) -> str:
    """What differs between two surveys, in words."""
    one, other = there.document(), asked.document()
    if one["robot"] != other["robot"]:
        return f"of another robot, or of another version of it ({there.mechanism.name})"
    return "; ".join(f"{key} is {one[key]}, not {other[key]}" for key in one if one[key] != other[key])
