"""`locked`: a file or folder that one process holds at a time; let go by the system, however the process ends."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cinegen.workspace.errors import MapError


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
