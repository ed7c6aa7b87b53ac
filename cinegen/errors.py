"""Errors of cinegen, with one root class. The control loop raises none of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import raff2urdf.errors
from raff2urdf.errors import did_you_mean, listed


class CinegenError(Exception):
    """Root of every error of this package. (A RAFF file that is wrong raises `raff2urdf.RaffError`.)

    Attributes:
        lines: problems of a file, of which the message lists the first; empty if there is one.
    """

    lines: Sequence[str] = ()


class LoadError(CinegenError):
    """A file that can't become a mechanism."""


class ClosureError(CinegenError, raff2urdf.errors.RaffClosureError):
    """Loops that can't be closed; the message names them, their residual, and a remedy."""


class UnknownNameError(CinegenError):
    """A node, joint or loop that the mechanism does not have; lists or suggests those it has."""

    def __init__(self, what: str, name: object, known: tuple[str, ...]) -> None:
        self.what, self.name, self.known = what, name, known
        super().__init__(f"no {what} '{name}'{did_you_mean(str(name), known)}")

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[str, object, tuple[str, ...]]]:
        return type(self), (self.what, self.name, self.known)


class LimitError(CinegenError):
    """A motion on which a joint would pass its limit; the message reports where.

    Attributes:
        joint: its name.
    """

    def __init__(self, joint: str, text: str) -> None:
        self.joint = joint
        super().__init__(text)

    def __reduce__(self) -> tuple[type[LimitError], tuple[str, str]]:
        return type(self), (self.joint, str(self))


class ConfigurationError(CinegenError):
    """A configuration of the wrong shape, or with numbers that are not finite."""


def read_all(
    reads: Mapping[str, Callable[[], Any]] | Iterable[tuple[str, Callable[[], Any]]],
    failure: type[CinegenError],
    values: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Return what functions that don't need each other return, by their names.

    Args:
        reads: functions by the names of their values, or pairs of both.
        failure: class of the errors that are collected and raised.
        values: to which each value is added as soon as it was read: for functions that need an earlier one, which keep
            the value that stands there if that one fails.

    Raises:
        failure: with the messages of all that fail, a line each.
    """
    values, problems = {} if values is None else values, list[str]()
    for name, read in reads.items() if isinstance(reads, Mapping) else reads:
        try:
            values[name] = read()
        except failure as error:
            problems += error.lines or str(error).split("\n")
    if problems:
        every = failure(listed(problems))
        every.lines = problems
        raise every
    return values


class CinegenWarning(UserWarning):
    """Something that works, but probably not as its author wants."""


def warn(message: str) -> None:
    """Warn the program that calls this package: the warning is of its line, however deep in the package it arose."""
    raff2urdf.errors.warn(message, CinegenWarning)
