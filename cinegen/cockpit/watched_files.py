"""`WatchedFiles`: notices that the files of a session's robots were saved, and reads them again."""

from __future__ import annotations

import hashlib
import threading
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

from cinegen.errors import CinegenError
from cinegen.session import Setup
from raff2urdf.errors import RaffError
from raff2urdf.files import Signature, noting, read_bytes, signature

_LOOK = 0.2  # s between two looks at the files; one that has changed is read when it is the same at the next look

T = TypeVar("T")


@dataclass(frozen=True)
class FileReading(Generic[T]):
    """Result of reading files that were saved.

    Attributes:
        made: what was made of them; None if they are wrong, or as they were when they were read without errors.
        problem: what is wrong with them, and where; empty if nothing is.
        warnings: what is probably not intended in them, unless an earlier reading had it.
    """

    made: T | None
    problem: str = ""
    warnings: tuple[str, ...] = field(default=())


@dataclass(frozen=True)
class SetupFiles:
    """The files that describe a setup.

    Attributes:
        read: returns the setup, as they describe it now.
        noted: those that were read for it, or looked for in vain, with their signatures before that.
    """

    read: Callable[[], Setup]
    noted: Mapping[Path, Signature]

    @classmethod
    def of(cls, read: Callable[[], Setup]) -> tuple[Setup, SetupFiles]:
        """Return the setup that a function reads, and its files.

        Raises:
            RaffError, CinegenError: as the function.
        """
        with noting() as noted:
            setup = read()
        return setup, cls(read, noted)


class WatchedFiles(Generic[T]):
    """Waits until files are saved, and reads them again. For one thread at a time.

    Editors save by writing a file or by renaming another one; either changes its signature.

    Args:
        files: files that describe a setup.
        make: returns what is made of a setup, and draws it: further files, such as meshes, may be read for it.
        noted: such files of the present setup.
    """

    def __init__(self, files: SetupFiles, make: Callable[[Setup], T], noted: Mapping[Path, Signature]) -> None:
        self._read, self._make = files.read, make
        self._known: dict[Path, Signature] = {**noted, **files.noted}
        self._digest = _digest(self._known)
        self._warned: set[str] = set()

    def __repr__(self) -> str:
        return f"<WatchedFiles: {len(self._known)}>"

    def wait(self, over: threading.Event) -> FileReading[T] | None:
        """Wait until files were saved, and read them; None if the event comes before."""
        seen = self._known
        while not over.wait(_LOOK):
            now = {path: signature(path) for path in self._known}
            if now != self._known and now == seen:
                return self._read_again(now)
            seen = now
        return None

    def _read_again(self, now: dict[Path, Signature]) -> FileReading[T]:
        if _digest(now) == self._digest:
            self._known = now
            return FileReading(None)
        noted: dict[Path, Signature] = {}
        try:
            with warnings.catch_warnings(record=True) as caught, noting() as noted:
                warnings.simplefilter("always")
                made = self._make(self._read())
        except Exception as error:  # a file that is being written may hold anything; the session goes on
            self._known = now | noted
            known = isinstance(error, RaffError | CinegenError)
            return FileReading(None, str(error) if known else f"{type(error).__name__}: {error}")
        self._known, self._digest = noted, _digest(noted)
        texts = [text for text in dict.fromkeys(str(warning.message) for warning in caught) if text not in self._warned]
        self._warned |= set(texts)
        return FileReading(made, warnings=tuple(texts))


def _digest(paths: Iterable[Path]) -> bytes:
    """Return a digest of the contents of files."""
    digest = hashlib.blake2b()
    for path in sorted(paths):
        try:
            content = read_bytes(path)
        except RaffError:
            content = b""
        digest.update(f"{path}\0{len(content)}\0".encode(errors="surrogateescape") + content)
    return digest.digest()
