"""cinegen: drive, study and show any mechanism, serial, tree or closed. SI units and radians everywhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cinegen.errors import CinegenError, CinegenWarning, ClosureError
from cinegen.model import Mechanism, load
from cinegen.solve import Clock, PersistentSolver, Pull, Solver, Step, Verdict, evaluate, reach

if TYPE_CHECKING:
    from cinegen.cockpit import show
    from cinegen.study import assembly_modes, singularity

__all__ = [
    "CinegenError",
    "CinegenWarning",
    "Clock",
    "ClosureError",
    "Mechanism",
    "PersistentSolver",
    "Pull",
    "Solver",
    "Step",
    "Verdict",
    "assembly_modes",
    "evaluate",
    "load",
    "reach",
    "show",
    "singularity",
]


def __getattr__(name: str) -> object:
    """Studies, and the page's server, are loaded when somebody asks for them."""
    if name == "show":
        from cinegen.cockpit import show

        return show
    if name in ("assembly_modes", "singularity"):
        from cinegen import study

        return getattr(study, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
