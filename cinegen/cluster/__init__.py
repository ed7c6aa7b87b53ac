"""Work that processes share: those of this machine, or of a Dask cluster; results come as they are ready."""

from __future__ import annotations

import concurrent.futures
import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeVar

from cinegen.errors import CinegenError, warn
from raff2urdf.command.extras import install, needs
from raff2urdf.errors import raised_as

if TYPE_CHECKING:
    from distributed import Client, Future

_QUEUED = 3  # unfinished tasks for each process
_PATIENCE = 20.0  # s, in which a scheduler must answer
_COUNT = 3.0  # s between two counts of the processes of a cluster, which come and go
_ALWAYS, _EACH_CORE = 8, 2  # processes on this machine that may be asked for: so many, or so many for each core
_SUSPICIOUS = 10  # deaths of processes that worked on the same task, before it is given up
_SETTINGS = {
    "distributed.admin.tick.interval": "1s",  # the default, 50 times a second, would take time from those who compute
    "distributed.comm.timeouts.connect": "20s",
    "distributed.scheduler.allowed-failures": _SUSPICIOUS,
    "distributed.scheduler.worker-ttl": None,  # it uses the wall clock, which may jump
    "distributed.worker.memory.terminate": False,
}

Task = TypeVar("Task")


class ClusterError(CinegenError):
    """A cluster that does not answer, can't be started, or can't do a task."""


def check_workers(workers: int | None, scheduler: str | None) -> None:
    """Check a number of processes that is asked for, before anything is written or started.

    Args:
        workers: the number, on this machine; None leaves it open.
        scheduler: address of a Dask scheduler, whose workers are not counted here.

    Raises:
        ClusterError: there must be at least one, and no more than this machine can use.
    """
    cores = os.cpu_count() or 1
    most = max(_ALWAYS, _EACH_CORE * cores)
    if workers is not None and not 1 <= workers <= (most if scheduler is None else workers):
        raise ClusterError(f"workers ({workers}) must be 1 to {most} on this machine, which has {cores} cores")


def processes(workers: int | None, scheduler: str | None, worth: int) -> int:
    """Return the number of processes to use on this machine.

    Args:
        workers: the number that is asked for; one for each core unless given, but at most `worth`, and this process
            alone where Dask is not installed.
        scheduler: address of a Dask scheduler, if one is to be used.
        worth: number of processes for which there is enough work.

    Raises:
        MissingExtraError: several processes or a scheduler are asked for, and Dask is not installed.
    """
    if scheduler is not None or (workers or 1) > 1:
        _check_installed()
    wanted = workers or min(os.cpu_count() or 1, max(1, worth))
    if wanted > 1 and find_spec("distributed") is None:
        warn(f"one process alone does this work; for all {os.cpu_count()} cores: {install('cluster')}")
        return 1
    return wanted


def _check_installed() -> None:
    with needs("cluster", "several processes"):
        import cryptography  # noqa: F401 - distributed needs it for certificates, and does not require it
        import dask  # noqa: F401
        import distributed  # noqa: F401


@contextmanager
def connected(scheduler: str | None, workers: int) -> Iterator[Client]:
    """Yield a Dask client: of the scheduler at an address, or else of so many processes on this machine.

    A client of a given scheduler listens on no port.

    Raises:
        ClusterError: no scheduler answers there, or Dask's configuration names no certificate for one with TLS; or
            processes can't be started.
        MissingExtraError: Dask is not installed.
    """
    _check_installed()
    import dask
    from distributed.utils import silence_logging_cmgr

    with dask.config.set(_SETTINGS), silence_logging_cmgr("CRITICAL"):
        from cinegen.cluster.local import TidyClient, local_cluster

        if scheduler is None:
            with local_cluster(workers) as client:
                yield client
            return
        if scheduler.startswith("tls://") and not dask.config.get("distributed.comm.tls.ca-file"):
            raise ClusterError(
                f"{scheduler}: TLS needs certificates: name them in Dask's configuration (distributed.comm.tls), "
                "see docs/cluster.md"
            )
        with raised_as(ClusterError, (OSError, ValueError), f"no Dask scheduler answers at {scheduler}: "):
            client = TidyClient(scheduler, timeout=_PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]
        with client:
            yield client


def each(
    client: Client | None, function: Callable[..., object], tasks: Iterable[Task], *first: Any
) -> Iterator[tuple[Task, Future[Any] | concurrent.futures.Future[Any]]]:
    """Run a function for tasks, and yield these as they are done, in any order, each with its future.

    A result stays on its worker until it is asked for. Few tasks are submitted at a time, however many there are.

    Args:
        client: of the cluster; None for this process alone, which does one task after the other.
        function: called with `first` and a task; its errors that are cinegen's are raised here.
        tasks: one after the other.
        first: arguments for all tasks.

    Raises:
        CinegenError: the function raised it, or a task can't be done.
    """
    if client is None:
        for task in tasks:
            done = concurrent.futures.Future[Any]()
            done.set_result(function(*first, task))
            yield task, done
        return
    from distributed import as_completed

    left, under_way = iter(tasks), dict[Any, Task]()
    room, counted = 0, -_COUNT

    def more() -> list[Any]:
        nonlocal room, counted
        if time.monotonic() >= counted + _COUNT:
            room, counted = _QUEUED * max(1, sum(client.ncores().values())), time.monotonic()
        futures = []
        for task in islice(left, max(0, room - len(under_way))):
            futures.append(client.submit(function, *first, task, pure=False))
            under_way[futures[-1].key] = task
        return futures

    ready = as_completed(more(), loop=client.loop)  # not that of another client
    for batch in ready.batches():
        again = []
        for future in batch:
            if future.status in ("lost", "pending"):  # its worker has died with the result: another one repeats it
                again.append(future)
                continue
            _check(future)
            yield under_way.pop(future.key), future
        ready.update([*again, *more()])


def _check(future: Any) -> None:
    """Check that a task is done.

    Raises:
        CinegenError: it is not.
    """
    if future.status == "finished":
        return
    if future.status == "error":
        error = future.exception()
        if isinstance(error, CinegenError):
            raise error
        raise ClusterError(f"a task could not be done: {error}. Finished tasks stay") from error
    raise ClusterError("the Dask scheduler is gone. Finished tasks stay: repeat the command")
