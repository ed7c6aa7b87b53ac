"""Where converted graphics are kept that stand beside no URDF: a folder of the user's, named by their content."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from raff2urdf.files import write_all


def keep(content: bytes, ending: str) -> Path:
    """A file that holds the content: the one that is there, or a new one.

    It stands in `$XDG_CACHE_HOME/raff2urdf`, by default `~/.cache/raff2urdf`; where that can't be written, in a
    temporary folder that is removed when Python ends.

    Args:
        content: of the file, whose hash is its name.
        ending: of its name, such as ".stl".

    Raises:
        OSError: there is no folder that can be written.
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
        said = os.environ.get("XDG_CACHE_HOME", "")
        # The XDG base directory specification: a relative one is invalid, to be ignored.
        home = Path(said) if os.path.isabs(said) else Path.home() / ".cache"
        yield home / "raff2urdf"
    except RuntimeError:  # nobody knows the home folder
        pass
    yield Path(_temporary().name)


def _holds(path: Path, content: bytes) -> bool:
    """Whether a file is there and whole: a disk may have been full."""
    try:
        return path.stat().st_size == len(content) and path.read_bytes() == content
    except FileNotFoundError:
        return False


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="raff2urdf-")
