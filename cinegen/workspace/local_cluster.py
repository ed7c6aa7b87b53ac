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
import sys
import threading
from secrets import token_bytes
from typing import Any

import distributed
from distributed.comm.core import FatalCommClosedError
from distributed.comm.registry import backends
from distributed.comm.tcp import TCPBackend, TCPConnector, TCPListener
from tornado.iostream import StreamClosedError

SCHEME = "cinegen"
"""Of addresses such as cinegen://127.0.0.1:40123."""

HOST = "127.0.0.1"
"""The only address that is listened on."""

_SIZE = 32  # bytes of the secret, of a random number, and of a proof
_PATIENCE = 20.0  # s in which the other end must prove that it knows the secret

_secret = token_bytes(_SIZE)


def secret_line() -> bytes:
    """Return the line that `serve_worker` expects on a worker's standard input."""
    return _secret.hex().encode() + b"\n"


def serve_worker() -> None:
    """Run `dask worker` with the arguments of this process.

    The secret is the first line of standard input; the process ends when standard input does.
    """
    global _secret
    _secret = bytes.fromhex(sys.stdin.readline())
    if len(_secret) != _SIZE:
        sys.exit("no secret on standard input: cinegen starts this process, nobody else")
    threading.Thread(target=_end_with_parent, daemon=True).start()
    from distributed.cli.dask_worker import main

    main()


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


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
            answer = await asyncio.wait_for(stream.read_bytes(2 * _SIZE), _PATIENCE)
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


class _WithoutHTTP:
    def start_http_server(self, *_: Any, **__: Any) -> None:
        """Start none."""


class Scheduler(_WithoutHTTP, distributed.Scheduler):
    """A scheduler without an HTTP server."""


class Worker(_WithoutHTTP, distributed.Worker):
    """A worker without an HTTP server."""
