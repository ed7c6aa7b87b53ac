"""A clock of CPU time that may be read at each step of a search."""

from __future__ import annotations

import time

_RESOLUTION = 1e-2  # s


class CpuClock:
    """CPU seconds of this process. Where the system's clock takes as long as a test of a motion (0.2 ms in some
    sandboxes), most of a search would be spent on reading it: it is read every 10 ms at most."""

    def __init__(self) -> None:
        self._real = time.perf_counter  # not what is replaced by this clock
        self._read, self._seconds = -1.0, 0.0

    def __call__(self) -> float:
        """Return the seconds so far."""
        now = self._real()
        if now - self._read >= _RESOLUTION:
            self._seconds, self._read = time.process_time(), now
        return self._seconds
