"""Judge what a case did: it succeeds, or raises an error of the package that names the file; all else is a finding."""

import os
import re
import resource
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cinegen.errors import CinegenError, CinegenWarning
from raff2urdf.errors import RaffError, RaffWarning

SLOW = 5.0
"""CPU seconds that no input of a few kilobytes may take."""

_PACKAGES = re.compile(r"/(cinegen|raff2urdf)/")


@dataclass(frozen=True)
class Finding:
    """A broken promise.

    Attributes:
        case: that broke it, such as "raff:123".
        kind: which promise.
        where: what distinguishes findings of one cause from others: the exception and the function that raised it.
        detail: for people.
        files: contents of the case's files by name, if it has any.
    """

    case: str
    kind: str
    where: str
    detail: str = ""
    files: dict[str, bytes] = field(default_factory=dict, repr=False, compare=False)

    @property
    def key(self) -> str:
        """The cause, as far as it is known."""
        return f"{self.case.partition(':')[0]} {self.kind}: {self.where}"


@dataclass
class Outcome:
    """What a case did.

    Attributes:
        status: what is counted: "read", "refused", ...
        value: the result.
        message: of the error that refused it, and of the warnings.
        broken: kind, where and detail of each broken promise.
        seconds: CPU time.
    """

    status: str = "read"
    value: Any = None
    message: str = ""
    broken: list[tuple[str, str, str]] = field(default_factory=list)
    seconds: float = 0.0


def judged(act: Callable[[], Any], names: Iterable[str], checks: Callable[[Any], Iterable[str]]) -> Outcome:
    """Run what a case does.

    Args:
        act: what it does; returns a result.
        names: of files, one of which an error must name.
        checks: yields what is wrong with the result.
    """
    outcome = Outcome()
    began = time.process_time()
    with warnings.catch_warnings(record=True) as warned, leaks(outcome):
        warnings.simplefilter("always")
        try:
            outcome.value = act()
            for wrong in checks(outcome.value):
                outcome.broken.append(("invariant", re.sub(r"[-+]?\d[\d.e+-]*", "N", wrong), wrong))
        except (RaffError, CinegenError) as error:
            outcome.status, outcome.message = "refused", str(error)
            outcome.broken += list(_of_message(error, tuple(names)))
        except Exception as error:
            outcome.status, kind = "raised", "memory" if isinstance(error, MemoryError) else "exception"
            outcome.broken.append((kind, where(error), "".join(traceback.format_exception(error))))
    outcome.seconds = time.process_time() - began
    for warn in warned:
        if issubclass(warn.category, (RaffWarning, CinegenWarning)):
            outcome.message += f"\nwarning: {warn.message}"
        elif warn.category not in (DeprecationWarning, PendingDeprecationWarning, ResourceWarning):
            place = f"{os.path.basename(os.path.dirname(warn.filename))}/{os.path.basename(warn.filename)}"
            outcome.broken.append(("warning", f"{warn.category.__name__} of {place}:{warn.lineno}", str(warn.message)))
    if outcome.seconds > SLOW:
        outcome.broken.append(("slow", "", f"{outcome.seconds:.1f} s of CPU"))
    return outcome


def where(error: BaseException) -> str:
    """Return the type of an error and the innermost function of the package that it passed."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if _PACKAGES.search(frame.filename)]
    if not frames:
        return type(error).__name__
    return f"{type(error).__name__} in {_PACKAGES.split(frames[-1].filename)[-1]}:{frames[-1].name}"


def _of_message(error: Exception, names: tuple[str, ...]) -> Iterator[tuple[str, str, str]]:
    """Yield what is wrong with an error's message."""
    text = str(error)
    if names and not any(name in text for name in names):
        yield "unnamed file", where(error), text
    if len(text) > 20_000:
        yield "endless message", where(error), f"{len(text)} characters: {text[:200]}"
    if re.search(r"Traceback|<[\w.]+ object at 0x|KeyError|IndexError", text):
        yield "riddle", where(error), text[:2000]


@contextmanager
def leaks(outcome: Outcome) -> Iterator[None]:
    """Find what libraries print, past Python, on standard output and standard error."""
    if _Captured.file is None:
        yield
        return
    sys.stderr.flush()
    start = os.fstat(_Captured.file).st_size
    yield
    sys.stderr.flush()
    size = os.fstat(_Captured.file).st_size
    if size > start:
        text = os.pread(_Captured.file, 4000, start).decode(errors="replace")
        first = re.sub(r"\d+|'[^']*'|\"[^\"]*\"|/\S+", "", text.strip().split("\n")[0])
        outcome.broken.append(("printed", first[:60], text))


class _Captured:
    file: int | None = None


def capture() -> None:
    """Send what this process prints to a file of its own from now on, where `leaks` looks."""
    _Captured.file = os.memfd_create("printed")
    os.dup2(_Captured.file, 1)
    os.dup2(_Captured.file, 2)


def limit_memory(memory: int) -> None:
    """Limit the address space of this process to what it has and so many bytes more."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + memory
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
