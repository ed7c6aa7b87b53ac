"""Work that is shared by processes: of this machine, or of a Dask cluster; results come as they are ready."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from tempfile import TemporaryFile
from typing import IO, TYPE_CHECKING, Any, TypeVar

from cinegen.errors import CinegenError
from cinegen.workspace.errors import MapError

if TYPE_CHECKING:
    from distributed import Client, Future

_AHEAD = 3  # tasks for each process that are handed out and not finished
_COME = 60.0  # s in which processes must come, or a scheduler must answer in a third of that
_LOOK = 0.5  # s between two looks whether processes are alive
_COUNT = 3.0  # s between two times that processes of a cluster are counted: they come and go
_DEATHS = 20  # of processes, from which on something is wrong
_SUSPICIOUS = 10  # of processes that worked on one task, likewise
_SETTINGS = {
    "distributed.admin.tick.interval": "1s",  # it looks at itself; 50 times a second it would disturb those who compute
    "distributed.comm.timeouts.connect": "20s",
    "distributed.scheduler.allowed-failures": _SUSPICIOUS,
    "distributed.scheduler.worker-ttl": None,  # by the wall clock, which may jump: processes are looked after here
    "distributed.worker.memory.terminate": False,
}
_START = "from cinegen.workspace.local_cluster import serve_worker; serve_worker()"
_OPTIONS = ("--no-nanny", "--no-dashboard", "--nthreads", "1", "--nworkers", "1", "--memory-limit", "0",
            "--worker-class", "cinegen.workspace.local_cluster.Worker", "--death-timeout", str(_COME))  # fmt: skip

Task = TypeVar("Task")


@contextmanager
def connected(scheduler: str | None, workers: int) -> Iterator[Client]:
    """A Dask client: of a scheduler at an address, or else of so many processes on this machine.

    These are started as programs of their own, so that this works from any script, notebook or test: nothing of it is
    imported again there. They end with this process, however it ends; one that dies is replaced. Scheduler and workers
    listen on 127.0.0.1 only, serve no HTTP, and accept connections from this process and from each other only.
    A client of a given scheduler listens nowhere.

    Raises:
        MapError: nobody answers there; or processes can't be started.
    """
    import dask
    from distributed import Client, SpecCluster
    from distributed.utils import silence_logging_cmgr

    with ExitStack() as stack:
        stack.enter_context(dask.config.set(_SETTINGS))
        stack.enter_context(silence_logging_cmgr("CRITICAL"))
        if scheduler is None:
            from cinegen.workspace.local_cluster import HOST, SCHEME, Scheduler

            options = {"host": HOST, "port": 0, "protocol": SCHEME, "dashboard": False}
            cluster = SpecCluster(scheduler={"cls": Scheduler, "options": options}, silence_logs=False)
            address = stack.enter_context(cluster).scheduler_address
            processes = stack.enter_context(Processes(address, workers))
            client = stack.enter_context(Client(address))
            processes.wait_for(client)
        else:
            try:
                client = stack.enter_context(Client(scheduler, timeout=_COME / 3.0))
            except (OSError, ValueError) as error:
                raise MapError(f"no Dask scheduler answers at {scheduler}: {error}") from None
        yield client


class Processes:
    """Workers of a scheduler on this machine, one thread each.

    Args:
        address: of the scheduler.
        count: of processes.
    """

    def __init__(self, address: str, count: int) -> None:
        self._address, self._count = address, count
        self._said: IO[bytes] = TemporaryFile()  # noqa: SIM115
        self._running: list[subprocess.Popen[bytes]] = []
        self._deaths, self._ends = 0, threading.Event()
        self._keeper = threading.Thread(target=self._keep, daemon=True)

    def __enter__(self) -> Processes:
        self._running = [self._start() for _ in range(self._count)]
        self._keeper.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._keeper.join()
        for process in self._running:
            process.terminate()
        for process in self._running:
            _end(process)
        self._said.close()

    def wait_for(self, client: Client) -> None:
        """Until all have come.

        Raises:
            MapError: they don't.
        """
        until = time.monotonic() + _COME
        while len(client.scheduler_info(n_workers=-1)["workers"]) < self._count:
            if self._deaths >= _DEATHS or time.monotonic() > until:
                raise MapError(f"processes can't be started here: {self._words()}")
            time.sleep(0.02)

    def _start(self) -> subprocess.Popen[bytes]:
        from cinegen.workspace.local_cluster import HOST, SCHEME, secret_line

        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),  # they find what is found here
            "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
            "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
            "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1",
        }  # fmt: skip
        where = "--host", HOST, "--protocol", SCHEME
        process = subprocess.Popen(
            [sys.executable, "-c", _START, self._address, *where, *_OPTIONS], env=environment, stdin=subprocess.PIPE,
            stdout=self._said, stderr=self._said, start_new_session=True,  # Ctrl-C is for who started them
        )  # fmt: skip
        with suppress(BrokenPipeError):  # it has ended already: `_keep` starts another
            if process.stdin is not None:
                process.stdin.write(secret_line())
                process.stdin.flush()
        return process

    def _keep(self) -> None:
        """Replaces those that die."""
        while not self._ends.wait(_LOOK):
            for k, process in enumerate(self._running):
                if process.poll() is not None:
                    self._deaths += 1
                    _end(process)
                    self._running[k] = self._start()

    def _words(self) -> str:
        """The last thing that was said."""
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else "they say nothing"


def _end(process: subprocess.Popen[bytes]) -> None:
    """Waits until it has ended, if need be not for long."""
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
    with process:  # waits, and closes what leads there
        pass


def each(
    client: Client, function: Callable[..., object], tasks: Iterable[Task], *first: Any
) -> Iterator[tuple[Task, Future[Any]]]:
    """Has a function of this program done for tasks, and hands these back as they are done, in any order, with what
    came of each: it stays where it is until somebody asks for its result. Few are under way at a time, so that nobody
    ever has many to look after.

    Args:
        client: of who computes.
        function: called with `first` and a task; what it raises of cinegen's errors is raised here.
        tasks: one after the other.
        first: what all tasks need.

    Raises:
        CinegenError: what the function raised, or that a task can't be done.
    """
    from distributed import as_completed

    left, under_way = iter(tasks), dict[Any, Task]()
    room, looked = 0, -_COUNT

    def more() -> list[Any]:
        nonlocal room, looked
        if time.monotonic() >= looked + _COUNT:
            room, looked = _AHEAD * max(1, sum(client.ncores().values())), time.monotonic()
        futures = []
        for task in islice(left, max(0, room - len(under_way))):
            futures.append(client.submit(function, *first, task, pure=False))
            under_way[futures[-1].key] = task
        return futures

    ready = as_completed(more(), loop=client.loop)  # not that of a client that others may have
    for batch in ready.batches():
        for future in batch:
            _check(future)
            yield under_way.pop(future.key), future
        ready.update(more())


def _check(future: Any) -> None:
    """Whether a task is done.

    Raises:
        CinegenError: it is not.
    """
    if future.status == "finished":
        return
    if future.status == "error":
        error = future.exception()
        if isinstance(error, CinegenError):
            raise error
        raise MapError(f"a task could not be done: {error}. Complete chunks stay") from error
    raise MapError("the Dask scheduler is gone. Complete chunks stay: give the same command again")
