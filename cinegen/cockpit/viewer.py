"""`cinegen.Viewer`: configurations of a mechanism in meshcat's own viewer."""

from __future__ import annotations

import asyncio
import tempfile
import threading
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import tornado.web
from meshcat import Visualizer
from meshcat.servers.zmqserver import ZMQWebSocketBridge
from numpy.typing import ArrayLike

from cinegen.cockpit.scene import RobotScene
from cinegen.errors import CinegenError
from cinegen.model import Mechanism


class Viewer:
    """Shows configurations of a mechanism in meshcat's viewer, in true size: 1 is 1 m.

    Its server runs in a thread of this process until `stop`, or until the process ends, and listens on 127.0.0.1 only.
    For a page in which the robot is dragged, see `cinegen.show`.

    Args:
        mechanism: mechanism to show, at home first.

    Attributes:
        meshcat: the `meshcat.Visualizer`, for objects of your own; its `url()` is the address of the page. The robot is
            below the path /meshcat/cinegen.

    Raises:
        CinegenError: the server can't be started.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._folder = tempfile.TemporaryDirectory(prefix="cinegen-viewer-")  # mode 700: others can't send commands
        started = Future[_Bridge]()
        socket = f"ipc://{Path(self._folder.name, 'commands')}"
        self._thread = threading.Thread(target=_serve, args=(socket, started), name="cinegen viewer", daemon=True)
        self._thread.start()
        try:
            self._bridge = started.result()
        except Exception as error:
            self._folder.cleanup()
            raise CinegenError(f"meshcat's server can't be started: {error}") from error
        self.meshcat = Visualizer(zmq_url=socket)
        self._scene = RobotScene(self.meshcat.window, {mechanism.name: mechanism}, scaled=False)

    def display(self, q: ArrayLike) -> None:
        """Show the mechanism at q (nq,), whether its loops are closed there or not.

        Raises:
            ConfigurationError: q has a wrong shape or is not finite.
        """
        self._scene.show(self.mechanism.name, q)

    def stop(self) -> None:
        """End the server. Pages that are open keep what they show."""
        if self._thread.is_alive():
            self._bridge.ioloop.add_callback(self._bridge.ioloop.stop)
            self._thread.join()
            self.meshcat.window.zmq_socket.close(0)
            self._folder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _repr_html_(self) -> str:
        """Return the page as a notebook's cell."""
        return str(self.meshcat.jupyter_cell()._repr_html_())


class _Bridge(ZMQWebSocketBridge):  # type: ignore[misc] # meshcat has no types
    """meshcat's server, on one address: by itself it listens on all."""

    def make_app(self) -> tornado.web.Application:
        app: Any = super().make_app()
        app.listen = partial(app.listen, address=self.host)
        return app  # type: ignore[no-any-return]


def _serve(socket: str, started: Future[_Bridge]) -> None:
    asyncio.set_event_loop(loop := asyncio.new_event_loop())
    try:
        bridge = _Bridge(zmq_url=socket)
    except Exception as error:
        started.set_exception(error)
        return
    started.set_result(bridge)
    bridge.run()
    bridge.zmq_stream.close()
    loop.close()
