"""Errors of scenes and of motion planning."""

from __future__ import annotations

from cinegen.errors import CinegenError


class PlanningError(CinegenError):
    """Root of every error of `cinegen.collision` and `cinegen.planning`."""


class SceneError(PlanningError):
    """An invalid scene; the message names the file and the key, what is wrong, and what is valid."""
