"""What a test leaves behind in this process, for the next to meet: threads, child processes, changed settings."""

from __future__ import annotations

import contextlib
import os
import select
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

GRACE = 10.0
"""Time that threads and processes have to end, s: those that were told to end."""

SHARED = "shared by tests"
"""Names of threads that serve all tests begin with this."""

_KEPT = (SHARED, "zarr_io", "asyncio_", "Dask-Offload")  # and those that libraries keep until the process ends


@dataclass(frozen=True)
class Snapshot:
    """Threads, child processes (by number) and settings at one moment."""

    threads: frozenset[threading.Thread]
    children: frozenset[int]
    switch_interval: float

    @classmethod
    def take(cls) -> Snapshot:
        return cls(
            frozenset(thread for thread in threading.enumerate() if not thread.name.startswith(_KEPT)),
            frozenset(_children()),
            sys.getswitchinterval(),
        )


def left_since(before: Snapshot, grace: float = GRACE) -> list[str]:
    """Return a line for each thing that is left since a snapshot, and put settings back."""
    end = time.monotonic() + grace
    left = []
    for thread in Snapshot.take().threads - before.threads:
        thread.join(max(0.0, end - time.monotonic()))
        if thread.is_alive():
            left.append(f"thread '{thread.name}'")
    for child in frozenset(_children()) - before.children:
        command = _command(child)
        if not _ends(child, max(0.0, end - time.monotonic())):
            left.append(f"process {child}: {command}")
    now = Snapshot.take()
    if now.switch_interval != before.switch_interval:
        left.append(f"a switch interval of {now.switch_interval} s instead of {before.switch_interval} s")
        sys.setswitchinterval(before.switch_interval)
    return sorted(left)


def _children() -> list[int]:
    """The child processes, without the one that Python itself keeps (`multiprocessing.resource_tracker`)."""
    children: list[int] = []
    for tasks in Path("/proc/self/task").glob("*/children"):
        with contextlib.suppress(OSError):  # the thread has ended
            children += map(int, tasks.read_text().split())
    return [child for child in children if "resource_tracker" not in _command(child)]


def _command(child: int) -> str:
    try:
        return Path(f"/proc/{child}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
    except OSError:
        return ""


def _ends(child: int, seconds: float) -> bool:
    try:
        handle = os.pidfd_open(child)
    except OSError:
        return True
    try:
        return bool(select.select([handle], [], [], seconds)[0])
    finally:
        os.close(handle)
