"""What a session says when something is wrong."""

from __future__ import annotations

from cinegen.errors import CinegenError


class SessionError(CinegenError):
    """Something went wrong in a session that has ended."""


class CommandError(CinegenError):
    """A command that makes no sense; says why. Whoever sends such is not listened to any more."""
