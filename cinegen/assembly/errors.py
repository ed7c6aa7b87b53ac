"""Errors of assembly modes."""

from __future__ import annotations

from cinegen.errors import CinegenError


class ModesError(CinegenError):
    """Assembly modes that can't be computed; the message names the joints, and what to do."""


class FreeMotionError(ModesError):
    """Assembly modes that can't be computed as the locked joints don't determine the mechanism.

    Attributes:
        dof: number of DoF that remain.
    """

    def __init__(self, message: str, dof: int) -> None:
        super().__init__(message)
        self.dof = dof
