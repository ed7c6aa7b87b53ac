"""Paths around obstacles: vortex fields for any robot (De Medio and Oriolo, 1991), sampling, and safe dragging."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cinegen.planning.hand import AvoidingSolver
    from cinegen.planning.planner import Plan, PlanStatus, plan, rrt_connect

__all__ = ["AvoidingSolver", "Plan", "PlanStatus", "plan", "rrt_connect"]


def __getattr__(name: str) -> object:
    """Load planners when they are asked for: a field needs none."""
    if name == "AvoidingSolver":
        return import_module("cinegen.planning.hand").AvoidingSolver
    if name in __all__:
        return getattr(import_module("cinegen.planning.planner"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
