"""The error of maps."""

from cinegen.errors import CinegenError


class MapError(CinegenError):
    """A map that can't be made, read or gone on with: says what is wrong, where, and what to do."""
