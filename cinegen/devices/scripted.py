"""A scripted path as a sensor: it says where the node should be now."""

from __future__ import annotations

import math
import time

from cinegen.devices.path import Path
from cinegen.sensor import Reading, SensorState, SensorStatus


class Scripted:
    """Runs along a path from the moment it is started.

    Args:
        path: as `fitted` makes it.
    """

    timeout = math.inf

    def __init__(self, path: Path) -> None:
        self.url = f"path:{path.shape}"
        self.path = path
        self._begin: float | None = None
        self._count = 0

    def start(self) -> None:
        """Begins to count the time, once."""
        if self._begin is None:
            self._begin = time.monotonic()

    def read(self) -> Reading | None:
        """Where the node should be at this moment: always new."""
        if self._begin is None:
            return None
        now = time.monotonic()
        self._count += 1
        return Reading(now, target=self.path.target(now - self._begin))

    @property
    def status(self) -> SensorStatus:
        """Live while it is started."""
        if self._begin is None:
            return SensorStatus(SensorState.CLOSED, f"{self.url} is not started")
        return SensorStatus(
            SensorState.LIVE, f"{self.path.node} follows a {self.path.shape} of {self.path.size:.3g} m", self._count
        )

    def close(self) -> None:
        """Ends; when it is started again, it begins at its beginning."""
        self._begin = None
