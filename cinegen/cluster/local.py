"""A Dask scheduler and workers for this machine alone: on the loopback interface, authenticated, without HTTP servers.

Dask runs any function that a connection asks for. Its own TCP transport asks nobody who they are, so any user of the
machine could run code in these processes. The transport here, scheme `cinegen://`, first has both ends prove that they
know a secret (HMAC-SHA256 of fresh random numbers and of the port, so that neither a replayed nor a relayed proof is
accepted). Workers receive it through their standard input. Nothing is encrypted: loopback traffic can be read only by
who may read these processes' memory as well.
"""

from __future__ import annotations

import asyncio
import hmac
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from secrets import token_bytes
from tempfile import TemporaryFile
from typing import IO, Any

import distributed
from distributed import Client, SpecCluster
from distributed.comm.core import FatalCommClosedError
from distributed.comm.registry import backends
from distributed.comm.tcp import TCPBackend, TCPConnector, TCPListener
from tornado.iostream import StreamClosedError

from cinegen.cluster import ClusterError

SCHEME = "cinegen"
"""Of addresses such as cinegen://127.0.0.1:40123."""

HOST = "127.0.0.1"
"""The only address that is listened on."""

_PATIENCE = 60.0  # s, in which all workers must connect
_INTERVAL = 0.5  # s between two checks of the workers
_DEATHS = 20  # of workers, at start, before giving up
_START = "from cinegen.cluster.local import serve_worker; serve_worker()"
_OPTIONS = (
    "--host", HOST, "--protocol", SCHEME, "--no-nanny", "--no-dashboard", "--nthreads", "1", "--nworkers", "1",
    "--memory-limit", "0", "--worker-class", "cinegen.cluster.local.LocalWorker",
    "--death-timeout", str(_PATIENCE),
)  # fmt: skip
_ENVIRONMENT = {
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
}


# --- authentication ----------------------------------------------------------------------------------------------

_SIZE = 32  # bytes of the secret, of a random number, and of a proof
_PROOF_PATIENCE = 20.0  # s, in which the other end must prove that it knows the secret

_secret = token_bytes(_SIZE)


def _proof(role: bytes, port: int, listener: bytes, connector: bytes) -> bytes:
    """Return what only an end that knows the secret can compute from both ends' random numbers."""
    return hmac.digest(_secret, b"%s %d " % (role, port) + listener + connector, "sha256")


class _Connector(TCPConnector):
    prefix = f"{SCHEME}://"

    async def connect(self, address: str, deserialize: bool = True, **connection_args: Any) -> Any:
        """Connect, and exchange proofs with the listener."""
        comm = await super().connect(address, deserialize, **connection_args)  # type: ignore[no-untyped-call]
        port, own = int(address.rpartition(":")[2]), token_bytes(_SIZE)
        try:
            other = await comm.stream.read_bytes(_SIZE)
            await comm.stream.write(own + _proof(b"connector", port, other, own))
            proof = await comm.stream.read_bytes(_SIZE)
        except StreamClosedError as error:
            raise FatalCommClosedError(f"{address} refuses this process: it belongs to another run") from error
        except asyncio.CancelledError:
            comm.abort()
            raise
        if not hmac.compare_digest(proof, _proof(b"listener", port, other, own)):
            comm.abort()
            raise FatalCommClosedError(f"{address} belongs to another run")
        return comm


class _Listener(TCPListener):
    prefix = f"{SCHEME}://"

    async def _prepare_stream(self, stream: Any, address: str) -> Any:
        """Return the stream once the other end has proved itself; close it and return None where it does not."""
        try:
            port, own = stream.socket.getsockname()[1], token_bytes(_SIZE)
            await stream.write(own)
            answer = await asyncio.wait_for(stream.read_bytes(2 * _SIZE), _PROOF_PATIENCE)
            other, proof = answer[:_SIZE], answer[_SIZE:]
            if hmac.compare_digest(proof, _proof(b"connector", port, own, other)):
                await stream.write(_proof(b"listener", port, own, other))
                return stream
        except (StreamClosedError, TimeoutError):
            pass
        stream.close()
        return None


class _Backend(TCPBackend):
    _connector_class = _Connector
    _listener_class = _Listener


backends[SCHEME] = _Backend()


# --- processes ---------------------------------------------------------------------------------------------------


class _WithoutHTTP:
    def start_http_server(self, *_: Any, **__: Any) -> None:
        """Start none."""


class LocalScheduler(_WithoutHTTP, distributed.Scheduler):
    """A scheduler without an HTTP server."""


class LocalWorker(_WithoutHTTP, distributed.Worker):
    """A worker without an HTTP server."""


@contextmanager
def local_cluster(workers: int) -> Iterator[Client]:
    """Yield a client of a scheduler in this process and of so many workers, each a process of its own.

    Workers are started as programs, so that this works from any script, notebook or test: nothing of it is imported
    again there. They end with this process, however it ends; one that dies is replaced.

    Raises:
        ClusterError: workers can't be started.
    """
    options = {"host": HOST, "port": 0, "protocol": SCHEME, "dashboard": False}
    with (
        SpecCluster(scheduler={"cls": LocalScheduler, "options": options}, silence_logs=False) as cluster,
        _Workers(cluster.scheduler_address, workers) as processes,
        Client(cluster.scheduler_address) as client,
    ):
        processes.wait_for(client)
        yield client


class _Workers:
    """Worker processes, one thread each, replaced when they die."""

    def __init__(self, address: str, count: int) -> None:
        self._address, self._count = address, count
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
                process.stdin.write(_secret.hex().encode() + b"\n")
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
    """Run `dask worker` with the arguments of this process, and the secret in the first line of standard input.

    The process ends when standard input does: with the one that started it.
    """
    global _secret
    _secret = bytes.fromhex(sys.stdin.readline())
    if len(_secret) != _SIZE:
        sys.exit("no secret on standard input: only cinegen starts this process")
    threading.Thread(target=_end_with_parent, daemon=True).start()
    from distributed.cli.dask_worker import main

    main()


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)
