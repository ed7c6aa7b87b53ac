"""Errors of cinegen, with one root class. The control loop raises none of them."""

from __future__ import annotations

import raff2urdf.errors
from raff2urdf.errors import did_you_mean


class CinegenError(Exception):
    """Root of every error of this package. (A RAFF file that is wrong raises `raff2urdf.RaffError`.)"""


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


class ConfigurationError(CinegenError):
    """A configuration of the wrong shape, or with numbers that are not finite."""


class CinegenWarning(UserWarning):
    """Something that works, but probably not as its author wants."""


def warn(message: str) -> None:
    """Warn the program that calls this package: the warning is of its line, however deep in the package it arose."""
    raff2urdf.errors.warn(message, CinegenWarning)
