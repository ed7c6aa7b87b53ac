"""Errors of designs."""

from cinegen.errors import CinegenError


class DesignError(CinegenError):
    """Parameters, ties, bounds, tolerances or tasks that do not fit a mechanism; the message names the remedy."""
