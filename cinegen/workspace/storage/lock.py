"""`locked`: a file or folder that one process holds at a time; let go by the system, however the process ends."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cinegen.workspace.errors import MapError

try:
    import fcntl
except ImportError:  # on Windows
    SYSTEM_LOCKS = False
else:
    SYSTEM_LOCKS = True

_PAUSE = 0.02  # s between two attempts, where the system can't wait


@contextmanager
def locked(path: Path, wait: bool = False) -> Iterator[None]:
    """Holds a file or folder meanwhile. Where the file system knows no locks nothing is held.

    Args:
        path: of a file, which must be writable (network file systems want that), or of a folder.
        wait: until another process lets go.

    Raises:
        MapError: another process holds it, and nobody waits.
        OSError: it can't be opened.
    """
    if not SYSTEM_LOCKS:
        with _lock_file(path.resolve(), wait):
            yield
        return
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            raise MapError(f"{path.parent} is being made by another process: wait for it") from None
        except OSError:
            pass
        yield
    finally:
        os.close(descriptor)


@contextmanager
def _lock_file(path: Path, wait: bool) -> Iterator[None]:
    """Hold a file or folder by a file that only one process can create. Windows removes it when that process ends.

    It lies in the folder, or next to the folder of the file: readers of a map don't see it.
    """
    lock = path / ".cinegen.lock" if path.is_dir() else path.parent.with_name(f".{path.parent.name}.lock")
    flags = os.O_CREAT | os.O_EXCL | os.O_RDWR | getattr(os, "O_TEMPORARY", 0)
    while True:
        try:
            descriptor = os.open(lock, flags)
            break
        except FileExistsError:
            if not wait:
                raise MapError(
                    f"{path.parent} is being made by another process: wait for it. If there is none, remove {lock}"
                ) from None
            time.sleep(_PAUSE)
    try:
        yield
    finally:
        os.close(descriptor)
        lock.unlink(missing_ok=True)
