"""The spacenav daemon (spacenavd), which has the 3D mice of today: USB and wireless ones."""

from __future__ import annotations

import os
import socket
import struct

from cinegen.devices.feed import Feed, LostError
from cinegen.sensor import Twist

SOCKET = "/var/run/spnav.sock"
"""Where the daemon listens unless the environment's SPNAV_SOCKET says otherwise."""

FULL = 350.0
"""Counts at full deflection of the USB devices, with the daemon's own settings left as they are."""

_EVENT = struct.Struct("=8i")  # type, then seven values: version 0 of the daemon's protocol
_MOTION, _PRESS, _RELEASE = range(3)  # x y z rx ry rz period; number of the button
_POLL = 0.1  # s


class Spacenav(Feed):
    """Reads the daemon's events.

    Args:
        url: `spnav:`, or `spnav:/path/of/its/socket`.
    """

    timeout = 0.5  # the daemon says nothing while the device stands as it stood, but no hand is that steady

    def __init__(self, url: str = "spnav:") -> None:
        super().__init__(url)
        self.path = socket_path(url)

    def serve(self) -> None:
        """Reads events until the daemon is gone.

        Raises:
            LostError: the daemon is gone.
            OSError: it can't be reached.
        """
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as daemon:
            daemon.settimeout(_POLL)
            try:
                daemon.connect(self.path)
            except OSError as error:
                raise LostError(
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
                    raise LostError("the spacenav daemon has ended")
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
                if twist is not None:  # of those that came together, the last
                    self.newest.put(twist=twist)
                rest = rest[whole:]


def socket_path(url: str = "spnav:") -> str:
    """Where the daemon listens, by a sensor's URL."""
    path = url.removeprefix("spnav:")
    if path.startswith("//"):
        path = path[2:]
    return path or os.environ.get("SPNAV_SOCKET") or SOCKET


def _twist(counts: list[int]) -> Twist:
    """The daemon's x is to the right, y up, z away from the user (libspnav's `spnav_posrot_moveobj`)."""
    x, y, z, a, b, c = (min(1.0, max(-1.0, count / FULL)) for count in counts[:6])
    return x, z, y, a, c, b
