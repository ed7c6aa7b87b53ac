"""Objects whose memory one thread at a time may use: a second one gets an error.

Kernels run without Python's lock, and read and write memory that Python allocates anew when sizes change. Two threads
in one such memory would get wrong numbers, or end the process.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from threading import get_ident
from typing import Concatenate, ParamSpec, Protocol, TypeVar, cast

from cinegen.errors import CinegenError

_Owner = TypeVar("_Owner", bound="OneThread")
_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


class HasUser(Protocol):
    """An object of this kind, to those that use its memory: 0, or the thread that is in one of its methods."""

    _user: int


class OneThread:
    """Base of classes with methods that are decorated with `in_one_thread`."""

    _user = 0  # the thread that is in one of them


def in_one_thread(
    method: Callable[Concatenate[_Owner, _Parameters], _Result],
) -> Callable[Concatenate[_Owner, _Parameters], _Result]:
    """Have a method raise a `CinegenError` while another thread is in one of the object's methods. It never waits."""

    @wraps(method)
    def guarded(self: _Owner, /, *arguments: _Parameters.args, **named: _Parameters.kwargs) -> _Result:
        caller = get_ident()
        if self._user == caller:
            return method(self, *arguments, **named)
        if self._user:  # Python changes threads only at calls and jumps back: not before the next line
            raise other_thread(self)
        self._user = caller
        try:
            return method(self, *arguments, **named)
        finally:
            self._user = 0

    return cast(Callable[Concatenate[_Owner, _Parameters], _Result], guarded)


def other_thread(used: object, more: str = "") -> CinegenError:
    """Return the error for a thread that calls an object which another one is using.

    Args:
        used: the object.
        more: what else may not use it.
    """
    kind = type(used)
    parameters = inspect.signature(kind).parameters.values()
    needed = ", ".join(p.name for p in parameters if p.default is p.empty and p.kind is not p.VAR_POSITIONAL)
    return CinegenError(
        f"this {kind.__name__} is in use: it may be used by one thread at a time{more}; give each thread its own, "
        f"{kind.__name__}({needed}), or use a lock"
    )
