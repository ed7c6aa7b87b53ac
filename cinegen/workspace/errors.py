"""The error of maps."""

from cinegen.errors import CinegenError


class MapError(CinegenError):
    """A map that can't be made, read or resumed: the message names the cause, the file and the remedy."""


DAMAGED = (ArithmeticError, AttributeError, LookupError, OSError, RuntimeError, TypeError, ValueError)
"""Errors of reading a damaged file."""
