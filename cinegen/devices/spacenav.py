"""The spacenav daemon (spacenavd), which reads USB and wireless 3D mice."""

from __future__ import annotations

import os
import socket
import struct

from cinegen.devices.threaded_sensor import DeviceLostError, ThreadedSensor
from cinegen.sensor import Twist

SOCKET = "/var/run/spnav.sock"
"""Socket of the daemon unless the environment variable SPNAV_SOCKET names another."""

FULL = 350.0
"""Counts at full deflection of USB devices with the daemon's default settings."""

_EVENT = struct.Struct("=8i")  # type, then seven values: version 0 of the daemon's protocol
_MOTION, _PRESS, _RELEASE = range(3)  # x y z rx ry rz period; number of the button
_POLL = 0.1  # s


class Spacenav(ThreadedSensor):
    """Sensor that reads the daemon's events.

    Args:
        url: `spnav:`, or `spnav:/path/of/its/socket`.
    """

    timeout = 0.5  # the daemon sends nothing while the deflection is constant, but no user is that steady

    def __init__(self, url: str = "spnav:") -> None:
        super().__init__(url)
        self.path = socket_path(url)

    def serve(self) -> None:
        """Read events until the daemon is gone.

        Raises:
            DeviceLostError: the daemon is gone.
            OSError: the daemon can't be reached.
        """
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as daemon:
            daemon.settimeout(_POLL)
            try:
                daemon.connect(self.path)
            except OSError as error:
                raise DeviceLostError(
                    f"no spacenav daemon at {self.path} ({(error.strerror or str(error)).lower()})"
                ) from None
            self.live(f"the spacenav daemon at {self.path}")
            rest, down = b"", frozenset[int]()
            while not self.ending:
                try:
                    data = daemon.recv(1024 * _EVENT.size)
                except TimeoutError:
                    continue
                if not data:
                    raise DeviceLostError("the spacenav daemon has ended")
                rest += data
                whole = len(rest) - len(rest) % _EVENT.size
                twist = None
                for kind, number, *values in _EVENT.iter_unpack(rest[:whole]):
                    if kind == _MOTION:
                        twist = _twist([number, *values])
                        continue
                    if kind not in (_PRESS, _RELEASE) or not 0 <= number < 256:
                        self.damaged += 1
                        continue
                    down = down | {number} if kind == _PRESS else down - {number}
                    self.newest.press(down)
                if twist is not None:  # the last of those that came together
                    self.newest.put(twist=twist)
                rest = rest[whole:]


def socket_path(url: str = "spnav:") -> str:
    """Return the daemon's socket for a sensor's URL."""
    path = url.removeprefix("spnav:")
    if path.startswith("//"):
        path = path[2:]
    return path or os.environ.get("SPNAV_SOCKET") or SOCKET


def _twist(counts: list[int]) -> Twist:
    """Convert the daemon's axes: x to the right, y up, z away from the user (libspnav's `spnav_posrot_moveobj`)."""
    x, y, z, a, b, c = (min(1.0, max(-1.0, count / FULL)) for count in counts[:6])
    return x, z, y, a, c, b
