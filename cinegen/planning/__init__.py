"""Paths around obstacles: vortex fields for any robot (De Medio and Oriolo, 1991), sampling, and safe dragging."""

from __future__ import annotations

from typing import TYPE_CHECKING

from raff2urdf.lazy import lazy_names

if TYPE_CHECKING:
    from cinegen.planning.attempt import PlanStatus as PlanStatus
    from cinegen.planning.mode_changes import ModeChange as ModeChange
    from cinegen.planning.mode_changes import SingularPaths as SingularPaths
    from cinegen.planning.mode_changes import change_mode as change_mode
    from cinegen.planning.mode_search import CrossedSingularity as CrossedSingularity
    from cinegen.planning.planner import Plan as Plan
    from cinegen.planning.planner import Planner as Planner
    from cinegen.planning.planner import plan as plan
    from cinegen.planning.safe_drag import AvoidingSolver as AvoidingSolver

__all__, __getattr__, __dir__ = lazy_names(__name__)
