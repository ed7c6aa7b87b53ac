"""Write files: all of them or none.

A target that is a regular file, or absent, is replaced: its new content is written to a temporary file in the same
folder, which is then renamed. A symbolic link stays a link: the file that it points to is replaced, or created.
Whatever else a path names (a device, a FIFO, the file that standard output goes to) is written through and stays what
it is.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from raff2urdf.errors import Problem, RaffError

_PREFIX = 50  # characters of a file's name in that of its temporary file; at most 200 bytes, and a name may have 255


def read_bytes(path: str | Path, most: int = -1) -> bytes:
    """Return the content of a file, up to `most` bytes.

    Raises:
        RaffError: it can't be read.
    """
    try:
        with open(path, "rb") as file:
            return file.read(most)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise RaffError(Problem(f"can't be read: {getattr(error, 'strerror', None) or error}", str(path))) from None


def write_all(contents: Mapping[Path, bytes]) -> None:
    """Write all files, in the mapping's order; missing folders are created.

    Devices and FIFOs come first, when all other content is on the disk and only has to be renamed: what was written to
    them can't be taken back.

    Raises:
        OSError: one of them can't be written; `filename` names it. Then no regular file was created or changed
            (unless it is the renaming that fails, as of a file that is a mount point), and no new folder is left.
    """
    targets: dict[Path, Path] = {}  # of the paths that are no streams
    aside: dict[Path, str] = {}
    made: list[Path] = []
    try:
        for path in contents:
            with _naming(path):
                if is_stream(path):
                    continue
                targets[path] = target = Path(os.path.realpath(path))
                for folder in _missing(target.parent):
                    folder.mkdir(exist_ok=True)
                    made.append(folder)
                _check_replaceable(target)
        for path, target in targets.items():
            with _naming(path):
                handle, aside[path] = tempfile.mkstemp(prefix=f".{target.name[:_PREFIX]}.", dir=target.parent)
                with open(handle, "wb") as file:
                    file.write(contents[path])
                _take_over(target, aside[path])
        for path in contents:
            if path not in targets:
                with _naming(path), open(open_stream(path), "wb") as file:
                    file.write(contents[path])
        for path, target in targets.items():
            with _naming(path):
                os.replace(aside[path], target)
    except BaseException:
        for name in aside.values():
            Path(name).unlink(missing_ok=True)
        for folder in reversed(made):
            with suppress(OSError):  # somebody else's file is in it by now
                folder.rmdir()
        raise


def is_stream(path: str | Path) -> bool:
    """Return whether a path is written through, not replaced: neither a regular file nor a folder, or where standard
    output or standard error goes.

    Raises:
        OSError: the path can't be looked up.
    """
    try:
        there = os.stat(path)
    except FileNotFoundError:
        return False
    return not (stat.S_ISREG(there.st_mode) or stat.S_ISDIR(there.st_mode)) or _standard(there) is not None


def open_stream(path: str | Path) -> int:
    """Open what `is_stream` says is one; return its file descriptor. A FIFO waits for its reader.

    Raises:
        OSError: it can't be opened.
    """
    standard = _standard(os.stat(path))
    if standard is None:
        return os.open(path, os.O_WRONLY | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0))
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()  # what was printed before comes before
    return os.dup(standard)


def _standard(there: os.stat_result) -> int | None:
    """The descriptor of standard output or standard error, if that is the same file. It is used as it is: `/dev/stdout`
    opened anew begins at the start of the file, and fails where the stream is a socket."""
    for descriptor in (1, 2):
        with suppress(OSError):  # it is closed
            if os.path.samestat(there, os.fstat(descriptor)):
                return descriptor
    return None


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Have errors name the file that was asked for, not a temporary one."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def _check_replaceable(target: Path) -> None:
    """Refuse what a rename would replace although it could not be opened for writing."""
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def _take_over(target: Path, fresh: str) -> None:
    """Give a fresh file the permissions, and where allowed the owner, of the one that it replaces; else the usual."""
    try:
        there = os.stat(target)
    except FileNotFoundError:
        os.chmod(fresh, 0o666 & ~_umask())
        return
    if hasattr(os, "chown"):
        with suppress(PermissionError):
            os.chown(fresh, there.st_uid, there.st_gid)
    os.chmod(fresh, stat.S_IMODE(there.st_mode))


def _missing(folder: Path) -> list[Path]:
    """The folder and those that it stands in, as far as they don't exist, outermost first."""
    return [one for one in (folder, *folder.parents) if not one.exists()][::-1]


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
