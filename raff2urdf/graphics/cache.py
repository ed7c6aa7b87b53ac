"""A cache of converted graphics that belong to no written URDF, in a folder of the user, named by their content."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from raff2urdf.files import write_all


def keep(content: bytes, ending: str) -> Path:
    """Return a file with the content: the existing one, or a new one.

    It is in `$XDG_CACHE_HOME/raff2urdf`, by default `~/.cache/raff2urdf`; if that can't be written, in a temporary
    folder that is removed when Python ends.

    Args:
        content: of the file, whose hash is its name.
        ending: of its name, such as ".stl".

    Raises:
        OSError: no folder can be written.
    """
    name = hashlib.sha256(content).hexdigest()[:32] + ending
    reason = OSError("no folder for temporary files")
    for folder in _folders():
        path = folder / name
        try:
            if not _holds(path, content):
                write_all({path: content})
        except OSError as error:
            reason = error
        else:
            return path
    raise reason


def _folders() -> Iterator[Path]:
    try:
        configured = os.environ.get("XDG_CACHE_HOME", "")
        # The XDG base directory specification: a relative one is invalid, to be ignored.
        home = Path(configured) if os.path.isabs(configured) else Path.home() / ".cache"
        yield home / "raff2urdf"
    except RuntimeError:  # there is no home folder
        pass
    yield Path(_temporary().name)


def _holds(path: Path, content: bytes) -> bool:
    """Return whether a file exists and is complete: a disk may have been full."""
    try:
        return path.stat().st_size == len(content) and path.read_bytes() == content
    except FileNotFoundError:
        return False


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="raff2urdf-")
