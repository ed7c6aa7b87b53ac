"""What can be wrong with a scene, or with planning in it."""

from __future__ import annotations

from cinegen.errors import CinegenError


class AvoidError(CinegenError):
    """Root of every error of `cinegen.planning`."""


class SceneError(AvoidError):
    """A scene that can't be used: says which file and which key, what is wrong, and what would be right."""
