"""A Dask scheduler and workers for this machine alone: on the loopback interface, authenticated, without HTTP servers.

Dask runs any function that a connection asks for, and its TCP transport has no authentication: any user of the machine
could run code in these processes. So they use TLS, and both ends of a connection must present a certificate that was
made for this cluster. Workers receive it and its key through their standard input.

Dask's servers also put a working folder in front of `sys.path`, and create it in a folder of a fixed name that all
users of the machine share: who made that one first could replace modules. So they get a private folder.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from tempfile import TemporaryDirectory, TemporaryFile
from typing import IO, Any

import dask
import distributed
from distributed import Client, SpecCluster
from distributed.security import Security

from cinegen.cluster import ClusterError

HOST = "127.0.0.1"
"""The only address on which processes listen."""

_PATIENCE = 60.0  # s, in which all workers must connect
_INTERVAL = 0.5  # s between two checks of the workers
_DEATHS = 20  # of workers, at start, before giving up
_START = "from cinegen.cluster.local import serve_worker; serve_worker()"
_OPTIONS = (
    "--host", HOST, "--protocol", "tls", "--no-nanny", "--no-dashboard", "--nthreads", "1", "--nworkers", "1",
    "--memory-limit", "0", "--worker-class", "cinegen.cluster.local.LocalWorker",
    "--death-timeout", str(_PATIENCE),
)  # fmt: skip
_ENVIRONMENT = {
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
}


class _WithoutHTTP:
    def start_http_server(self, *_: Any, **__: Any) -> None:
        """Start none."""


class LocalScheduler(_WithoutHTTP, distributed.Scheduler):
    """A scheduler without an HTTP server."""


class LocalWorker(_WithoutHTTP, distributed.Worker):
    """A worker without an HTTP server."""


class TidyClient(Client):
    """A Dask client that leaves no thread where it is refused: Dask's own leaves one until it is collected."""

    def start(self, **settings: Any) -> None:
        """Connect.

        Raises:
            OSError: no scheduler answers.
            ValueError: the address is none.
        """
        try:
            super().start(**settings)  # type: ignore[no-untyped-call]
        except BaseException:
            self.close()  # type: ignore[no-untyped-call]
            self._loop_runner.stop()  # `close` leaves it before the first attempt to connect
            raise


@contextmanager
def local_cluster(workers: int) -> Iterator[Client]:
    """Yield a client of a scheduler in this process and of so many workers, each a process of its own.

    Workers are started as programs, so that this works from any script, notebook or test: nothing of it is imported
    again there. They end with this process, however it ends; one that dies is replaced.

    Raises:
        ClusterError: workers can't be started.
    """
    options = {"host": HOST, "port": 0, "protocol": "tls", "dashboard": False}
    with (
        TemporaryDirectory(prefix="cinegen-", ignore_cleanup_errors=True) as folder,
        dask.config.set(settings := _certificate() | {"temporary-directory": folder}),
        SpecCluster(scheduler={"cls": LocalScheduler, "options": options}, silence_logs=False) as cluster,
        _Workers(cluster.scheduler_address, workers, settings) as processes,
        Client(cluster.scheduler_address, set_as_default=False) as client,
    ):
        processes.wait_for(client)
        yield client


@cache
def _certificate() -> dict[str, str]:
    """Return Dask's settings for TLS with a certificate of this process, for all its clusters."""
    tls = Security.temporary().get_tls_config_for_role("worker")
    roles, names = ("client", "scheduler", "worker"), ("key", "cert")
    settings = {f"distributed.comm.tls.{role}.{name}": tls[name] for role in roles for name in names}
    return settings | {"distributed.comm.tls.ca-file": tls["ca_file"]}


class _Workers:
    """Worker processes, one thread each, replaced when they die."""

    def __init__(self, address: str, count: int, settings: dict[str, str]) -> None:
        self._address, self._count, self._settings = address, count, settings
        self._output: IO[bytes] = TemporaryFile()  # noqa: SIM115
        self._running: list[subprocess.Popen[bytes]] = []
        self._deaths, self._ends = 0, threading.Event()
        self._keeper = threading.Thread(target=self._keep, daemon=True)

    def __enter__(self) -> _Workers:
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
        self._output.close()

    def wait_for(self, client: Client) -> None:
        """Wait until all workers have connected.

        Raises:
            ClusterError: they don't.
        """
        until = time.monotonic() + _PATIENCE
        while len(client.scheduler_info(n_workers=-1)["workers"]) < self._count:
            if self._deaths >= _DEATHS or time.monotonic() > until:
                self._output.seek(0)
                lines = self._output.read().decode(errors="replace").strip().splitlines()
                raise ClusterError(
                    f"worker processes can't be started: {lines[-1] if lines else 'they report nothing'}"
                )
            time.sleep(0.02)

    def _start(self) -> subprocess.Popen[bytes]:
        path = os.pathsep.join(filter(None, sys.path))  # workers find the same modules
        process = subprocess.Popen(
            [sys.executable, "-c", _START, self._address, *_OPTIONS],
            env={**os.environ, **_ENVIRONMENT, "PYTHONPATH": path}, stdin=subprocess.PIPE, stdout=self._output,
            stderr=self._output, start_new_session=True,  # Ctrl-C is for this process
        )  # fmt: skip
        with suppress(BrokenPipeError):  # it has ended already, and will be replaced
            if process.stdin is not None:
                process.stdin.write(json.dumps(self._settings).encode() + b"\n")
                process.stdin.flush()
        return process

    def _keep(self) -> None:
        while not self._ends.wait(_INTERVAL):
            for k, process in enumerate(self._running):
                if process.poll() is not None:
                    self._deaths += 1
                    _end(process)
                    self._running[k] = self._start()


def _end(process: subprocess.Popen[bytes]) -> None:
    """Wait for the end of a process, which is killed if it takes long."""
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
    with process:  # waits, and closes its pipe
        pass


def serve_worker() -> None:
    """Run `dask worker` with the arguments of this process, and Dask's settings in the first line of standard input.

    The process ends when standard input does: with the one that started it.
    """
    dask.config.set(json.loads(sys.stdin.readline()) | {"distributed.comm.require-encryption": True})
    threading.Thread(target=_end_with_parent, daemon=True).start()
    from distributed.cli.dask_worker import main

    main()


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)
