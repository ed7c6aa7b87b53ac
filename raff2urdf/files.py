"""Writes files: all of them or none."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path


def write_all(contents: Mapping[Path, bytes]) -> None:
    """Writes each file aside, then puts all in place, in the mapping's order; folders are made.

    Raises:
        OSError: one of them can't be written. Then none is, and no folder is left that was not there.
    """
    aside: list[str] = []
    made: list[Path] = []
    try:
        for path in contents:
            for folder in _missing(path.parent):
                folder.mkdir(exist_ok=True)
                made.append(folder)
            if path.is_dir():
                raise IsADirectoryError(0, f"{path.name} is a folder")
        for path, content in contents.items():
            handle, name = tempfile.mkstemp(prefix=f".{path.name[:100]}.", dir=path.parent)
            aside.append(name)
            with open(handle, "wb") as file:
                file.write(content)
            os.chmod(name, 0o666 & ~_umask())
        for path, name in zip(contents, aside, strict=True):
            os.replace(name, path)
    except OSError:
        for name in aside:
            Path(name).unlink(missing_ok=True)
        for folder in reversed(made):
            with suppress(OSError):  # somebody else's file is in it by now
                folder.rmdir()
        raise


def _missing(folder: Path) -> list[Path]:
    """The folder and those that it stands in, as far as they don't exist, outermost first."""
    return [one for one in (folder, *folder.parents) if not one.exists()][::-1]


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
