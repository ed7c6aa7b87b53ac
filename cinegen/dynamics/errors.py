"""Errors of dynamics."""

from __future__ import annotations

from cinegen.errors import CinegenError


class PayloadError(CinegenError):
    """A payload or a wrench that no body can have."""


class MassError(CinegenError):
    """Links without mass where their masses are needed; the message names them."""


class MotionError(CinegenError):
    """Velocities or accelerations that would open loops."""
